from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.diagrams.live_teaching import LiveTeaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.errors import InputError
from pepper_drake.models.movable_objects import with_movable_objects
from pepper_drake.models.scene import SCENES_DIR, load_scene
from pepper_drake.planning.reach.reach_mode import ReachCommand, ReachMode
from pepper_drake.systems.robot.arm_command import ArmMode

SCENE = SCENES_DIR / "teach.yaml"


class Pepper:
    """The diagram, simulated, its inputs fixed."""

    def __init__(self, scene):
        self.diagram = LiveTeaching(
            scene,
            make_primitive(None, scene.arm),
            None,
            config=ReachingConfig(station=StationConfig(cameras=False)),
        )
        self.simulator = Simulator(self.diagram)
        self.fix("arm_mode", [float(ArmMode.LIMP)])
        self.resets = 0
        self.fix("reset", [0.0])
        self.fix("command", [float(ReachCommand.IDLE)])
        self.fix("guide_velocity", np.zeros(6))
        self.fix("joint_target", np.zeros(5))
        self.fix("guide_target", self.hand_pose())
        for name in self.diagram.movables:
            self.fix(f"{name}.target", np.zeros(3))

    def change(self, arm_mode):
        """As a live session does."""
        self.resets += 1
        self.fix("reset", [float(self.resets)])
        self.fix("arm_mode", [float(arm_mode)])

    def fix(self, port, value):
        context = self.simulator.get_mutable_context()
        self.diagram.GetInputPort(port).FixValue(context, value)

    def advance(self, seconds):
        self.simulator.AdvanceTo(self.simulator.get_context().get_time() + seconds)

    def hand_pose(self):
        station = self.diagram.station
        context = station.GetMyContextFromRoot(self.simulator.get_context())
        return station.GetOutputPort(f"{self.diagram.arm}_hand_pose").Eval(context)

    def joints(self):
        port = self.diagram.reaching.arm_position
        context = port.get_system().GetMyContextFromRoot(self.simulator.get_context())
        return port.Eval(context)


def test_what_has_a_path_or_is_named_can_be_moved():
    scene = load_scene("table")
    assert scene.goal.path == []
    moved = with_movable_objects(scene, ["mug"])
    assert [o.name for o in moved.obstacles if o.path] == ["mug"]
    assert moved.goal.path
    assert scene.goal.path == []
    with pytest.raises(InputError, match=r'no obstacle "spoon".*mug'):
        with_movable_objects(scene, ["spoon"])
    assert [o.name for o in with_movable_objects(load_scene(SCENE)).obstacles if o.path] == ["ball"]


@pytest.mark.parametrize("arm", ["right", "left"])
def test_the_arm_is_led_then_held_then_goes_to_joint_angles(arm):
    scene = load_scene(SCENE)
    pepper = Pepper(scene if scene.arm == arm else scene.mirrored())
    side = 1.0 if arm == "left" else -1.0
    start = pepper.hand_pose()
    target = start.translation() + [0.08, 0.05 * side, 0.06]
    pepper.fix("guide_target", RigidTransform(start.rotation(), target))
    pepper.advance(1.5)
    np.testing.assert_allclose(pepper.hand_pose().translation(), target, atol=0.006)

    pepper.diagram.station.set_stiffness(f"{arm}_arm", 1.0)
    pepper.change(ArmMode.HELD)
    held = pepper.joints()
    pepper.fix("guide_target", start)
    pepper.advance(1.0)
    np.testing.assert_allclose(pepper.joints(), held, atol=0.15)
    rest = pepper.joints()
    pepper.advance(0.5)
    np.testing.assert_allclose(pepper.joints(), rest, atol=1e-3)

    goal = rest + np.array([0.2, 0.1 * side, 0.0, 0.0, 0.1 * side])
    pepper.fix("joint_target", goal)
    pepper.change(ArmMode.JOINTS)
    pepper.advance(1.5)
    np.testing.assert_allclose(pepper.joints(), goal, atol=0.005)


def test_a_command_begins_and_ends_a_reach_with_the_primitive_at_the_port():
    pepper = Pepper(load_scene(SCENE))
    pepper.diagram.station.set_stiffness("right_arm", 1.0)
    own = make_primitive(None, "right")
    slow = replace(own, duration=2 * own.duration)
    pepper.fix("arm_mode", [float(ArmMode.HAND)])
    reaching = pepper.diagram.reaching
    context = reaching.supervisor.GetMyContextFromRoot(pepper.simulator.get_context())

    def supervised(port):
        return reaching.supervisor.GetOutputPort(port).Eval(context)

    pepper.advance(1.0)
    assert supervised("mode")[0] == ReachMode.IDLE
    assert supervised("movement").primitive is reaching.planner.demonstrated.primitive
    pepper.fix("primitive", Value[object](slow))
    assert supervised("movement").primitive.duration == slow.duration
    pepper.fix("command", [float(ReachCommand.REACH)])
    before = pepper.joints()
    while supervised("mode")[0] in (ReachMode.IDLE, ReachMode.LOOKING, ReachMode.SETTLING):
        pepper.advance(0.1)
        assert pepper.simulator.get_context().get_time() < 8.0
    assert supervised("mode")[0] == ReachMode.REACHING
    assert np.isnan(supervised("base_goal")).all()
    pepper.advance(1.0)
    assert supervised("movement").id == 1
    assert np.abs(pepper.joints() - before).max() > 0.02
    pepper.fix("command", [float(ReachCommand.STOP)])
    pepper.advance(0.5)
    assert reaching.supervisor.progress(context).reason == "stopped"
    assert supervised("movement").id == 0
    pepper.fix("command", [float(ReachCommand.IDLE)])
    pepper.advance(0.1)
    assert supervised("mode")[0] == ReachMode.IDLE
