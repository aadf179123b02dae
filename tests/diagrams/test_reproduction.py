from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.diagrams.reproduction import Reproduction, ReproductionParams
from pepper_drake.diagrams.reproduction_simulation import (
    ReproductionOptions,
    reproduce,
    start_positions,
)
from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.correction import learn_correction
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems.guiding.external_force import ForcePulse


@pytest.fixture(scope="module")
def primitive():
    return make_primitive(None, "right")


@pytest.fixture(scope="module")
def undisturbed(primitive):
    return reproduce(primitive, "right")


def distances(positions, path):
    return np.array([np.linalg.norm(path - p, axis=1).min() for p in positions])


def push(force, start=1.5, duration=0.5, **options):
    return ReproductionOptions(pushes=(ForcePulse(force, start, duration),), **options)


def test_unpushed_the_hand_follows_the_primitive_and_nothing_waits(primitive, undisturbed):
    path = primitive.rollout(
        0.005, start=undisturbed.motion.positions[0], start_velocity=np.zeros(3)
    )
    assert distances(undisturbed.motion.positions, path.positions).max() < 4e-3
    assert undisturbed.final_position_error < 5e-3
    assert undisturbed.slowdowns.max() == 0.0
    assert undisturbed.keeps_limits


@pytest.fixture(scope="module")
def pushed(primitive):
    return reproduce(primitive, "right", push((0.0, 0.0, 5.0)))


def assert_harmless(result, undisturbed):
    assert result.keeps_limits
    assert result.limit_overrun < 0.0
    assert result.worst_joint_speed < 0.5
    assert result.final_position_error < 0.01
    assert result.slowdowns.max() > 0.5
    bent = distances(result.motion.positions, undisturbed.motion.positions).max()
    assert 0.02 < bent < 0.15
    # What is commanded is as smooth as without the push; the hand's own velocity changes by what
    # 5 N do to the half kilogramme that hand and forearm weigh to them: F dt / m = 0.1 m/s.
    assert result.desired_velocity_step < 1.2 * undisturbed.desired_velocity_step
    assert result.hand_velocity_step < 0.12


def test_a_push_of_5_n_for_half_a_second_does_no_harm(primitive, undisturbed, pushed):
    """The figure: no limit passed, goal within 10 mm, no velocity jump."""
    assert_harmless(pushed, undisturbed)
    assert_harmless(reproduce(primitive, "right", push((0.0, -5.0, 0.0), 2.4)), undisturbed)


def test_the_movement_waits_for_a_hand_that_is_pushed_unless_told_not_to(
    primitive, undisturbed, pushed
):
    params = ReproductionParams(tracking=None)
    stubborn = reproduce(primitive, "right", push((0.0, 0.0, 5.0), params=params))
    at = np.searchsorted(undisturbed.motion.times, 2.2)
    assert stubborn.motion.phases[at] == pytest.approx(undisturbed.motion.phases[at])
    assert pushed.motion.phases[at] > 2.0 * stubborn.motion.phases[at]
    assert stubborn.slowdowns.max() == 0.0
    assert stubborn.final_position_error < 0.01


def test_what_was_pushed_is_learned(primitive, undisturbed, pushed):
    corrected = learn_correction(primitive, pushed.motion).primitive
    again = reproduce(corrected, "right", ReproductionOptions(goal=primitive.goal))
    path = pushed.motion.positions
    assert distances(path, undisturbed.motion.positions).max() > 0.03
    assert distances(path, again.motion.positions).max() < 0.01
    assert again.final_position_error < 5e-3


def test_the_left_arm_goes_to_another_goal():
    left = make_primitive(None, "left")
    goal = left.goal + [0.0, 0.03, -0.03]
    result = reproduce(left, "left", ReproductionOptions(goal=goal))
    assert result.final_position_error < 5e-3


def test_a_reproduction_ends_when_it_is_asked_to(primitive):
    asked = iter(range(100))
    options = ReproductionOptions(should_stop=lambda: next(asked) >= 3)
    assert reproduce(primitive, "right", options).motion.times[-1] == pytest.approx(0.3)


def test_a_reproduction_that_is_ended_before_it_begins_has_no_result(primitive):
    assert reproduce(primitive, "right", ReproductionOptions(should_stop=lambda: True)) is None


def test_obstacles_bend_the_path_and_slow_it(primitive, undisturbed):
    path = undisturbed.motion.positions
    spot = path[np.searchsorted(undisturbed.motion.times, 1.8)]
    diagram = Reproduction(
        primitive,
        arm="right",
        positions=start_positions(primitive, "right"),
    )
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    cloud = PointCloud(1)
    cloud.mutable_xyzs()[:] = spot[:, None]
    movement = Movement(primitive, make_coupling("barrier"), id=1)
    diagram.GetInputPort("movement").FixValue(context, Value[object](movement))
    X_TG = RigidTransform(Quaternion(primitive.orientation.goal), primitive.goal)
    diagram.GetInputPort("goal_pose").FixValue(context, X_TG)
    diagram.GetInputPort("cloud").FixValue(context, Value(cloud))
    simulator.AdvanceTo(4.5)
    hand = diagram.logs["hand_position"].FindLog(context).data().T
    assert np.linalg.norm(hand - spot, axis=1).min() > 0.06
    assert diagram.logs["slowdown"].FindLog(context).data().max() > 0.1
    assert np.linalg.norm(hand[-1] - primitive.goal) < 0.01


def test_a_primitive_without_joints_is_refused(primitive):
    with pytest.raises(InputError, match="no orientation or no posture"):
        reproduce(replace(primitive, posture=None), "right")
