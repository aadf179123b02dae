from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.diagrams.live_teaching import LiveTeaching, with_movable_objects
from pepper_drake.diagrams.station import StationConfig
from pepper_drake.errors import InputError
from pepper_drake.models.scene import SCENES_DIR, load_scene
from pepper_drake.systems.robot.arm_command import ArmMode
from tests.systems.motion_example import moving

SCENE = SCENES_DIR / "teach.yaml"


class Pepper:
    """The diagram, simulated, its inputs fixed."""

    def __init__(self, scene):
        self.diagram = LiveTeaching(
            scene, make_primitive(None, scene.arm), station=StationConfig(cameras=False)
        )
        self.simulator = Simulator(self.diagram)
        self.fix("arm_mode", [float(ArmMode.LIMP)])
        self.fix("movement", moving(make_primitive(None, scene.arm), 0))
        self.fix("guide_velocity", np.zeros(6))
        self.fix("joint_target", np.zeros(5))
        self.fix("guide_target", self.hand_pose())
        for name in self.diagram.movables:
            self.fix(f"{name}.target", np.zeros(3))

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
        port = self.diagram.arm_position
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
    pepper.fix("arm_mode", [float(ArmMode.HELD)])
    held = pepper.joints()
    pepper.fix("guide_target", start)
    pepper.advance(1.0)
    np.testing.assert_allclose(pepper.joints(), held, atol=0.15)
    rest = pepper.joints()
    pepper.advance(0.5)
    np.testing.assert_allclose(pepper.joints(), rest, atol=1e-3)

    goal = rest + np.array([0.2, 0.1 * side, 0.0, 0.0, 0.1 * side])
    pepper.fix("joint_target", goal)
    pepper.fix("arm_mode", [float(ArmMode.JOINTS)])
    pepper.advance(1.5)
    np.testing.assert_allclose(pepper.joints(), goal, atol=0.005)


def test_the_primitive_at_the_port_is_performed():
    scene = load_scene(SCENE)
    pepper = Pepper(scene)
    pepper.diagram.station.set_stiffness("right_arm", 1.0)
    pepper.advance(0.3)
    slow = make_primitive(None, "right")
    times = []
    pepper.fix("arm_mode", [float(ArmMode.HAND)])
    for number, primitive in enumerate((slow, replace(slow, duration=2 * slow.duration)), 1):
        pepper.fix("movement", moving(primitive, number))
        pepper.advance(0.2)
        controller = pepper.diagram.controller
        context = controller.GetMyContextFromRoot(pepper.simulator.get_context())
        times.append(controller.GetOutputPort("tau").Eval(context)[0])
    assert times[1] == pytest.approx(2 * times[0])
