"""Python computes at the control period at the most, never at the rate of the physics."""

import pytest
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import CONTROL_PERIOD
from pepper_drake.models.scene import load_scene
from pepper_drake.systems.primitive.obstacle_field_cache import ObstacleFieldCache
from pepper_drake.systems.robot.joint_command_interpolator import JointCommandInterpolator
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor


def counting(calls, system, original):
    """A method that counts its calls."""

    def calc(self, *args):
        calls[system] += 1
        return original(self, *args)

    return calc


@pytest.fixture(scope="module")
def counted():
    """The whole loop without cameras after 20 control periods, and what was computed in them."""
    calls = dict.fromkeys((SafetyMonitor, JointCommandInterpolator, ObstacleFieldCache), 0)
    with pytest.MonkeyPatch.context() as patch:
        for system, name in (
            (SafetyMonitor, "_calc_next"),
            (JointCommandInterpolator, "_calc_desired_state"),
            (ObstacleFieldCache, "_calc"),
        ):
            patch.setattr(system, name, counting(calls, system, getattr(system, name)))
        scene = load_scene("free")
        config = ReachingConfig(station=StationConfig(cameras=False))
        reaching = Reaching(
            scene, make_primitive(None, scene.arm), make_coupling("barrier"), config
        )
        simulator = Simulator(reaching)
        simulator.AdvanceTo(5.5 * CONTROL_PERIOD)
        calls.update(dict.fromkeys(calls, 0))
        simulator.AdvanceTo(25.5 * CONTROL_PERIOD)
    return reaching, calls


def test_a_safe_command_is_computed_once_for_each_tick_and_when_something_new_is_seen(counted):
    _, calls = counted
    assert 20 <= calls[SafetyMonitor] <= 30


def test_the_servos_go_on_evenly_without_being_asked_at_each_step_of_the_physics(counted):
    reaching, calls = counted
    steps = round(20 * CONTROL_PERIOD / reaching.station.plant.time_step())
    assert calls[JointCommandInterpolator] < 0.8 * steps


def test_obstacles_are_not_sorted_again_where_nothing_is_seen(counted):
    _, calls = counted
    assert calls[ObstacleFieldCache] == 0
