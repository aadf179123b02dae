"""The arm controller against the planner's simulation of it, and what it does with its inputs."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.arm_controller import ArmController
from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.errors import InputError
from pepper_drake.learning import PointCloudDistance
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import POSTURES
from pepper_drake.perception.mapping.cloud_points import make_cloud
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.kinematic_simulation import ArmState, KinematicSimulator
from pepper_drake.planning.reach.movement import Movement
from tests.systems.motion_example import moving

X_WT = RigidTransform(RollPitchYaw(0.0, 0.02, 0.3), [0.5, 0.1, 0.82])
MODEL = shared_control_model()


class Rig:
    """A controller whose arm is perfect: it is where the last command has it."""

    def __init__(self, arm, primitive=None):
        self.arm, self.primitive = arm, primitive or make_primitive(None, arm)
        self.kinematics = arm_kinematics(MODEL, arm)
        self.start = np.array([POSTURES["stand"][name] for name in arm_joints(arm)])
        self.controller = ArmController(MODEL, arm, self.primitive, self.start)
        self.simulator = Simulator(self.controller)
        self.context = self.simulator.get_mutable_context()
        self.fix("torso_pose", X_WT)
        self.fix("hand_pose", self.kinematics.hand_pose(self.start))
        self.fix("arm_position", self.start)
        self.time_step = DifferentialIkParams().time_step

    def fix(self, port, value):
        self.controller.GetInputPort(port).FixValue(self.context, value)

    def perform(self, movement, X_TG, points=None, predicted=None):
        self.fix("movement", Value[object](movement))
        self.fix("object_pose", X_WT @ X_TG @ movement.X_OG.inverse())
        for port, cloud in (("cloud", points), ("predicted_cloud", predicted)):
            if cloud is not None:
                self.fix(port, Value(make_cloud(cloud)))

    def value(self, port):
        return self.controller.GetOutputPort(port).Eval(self.context)

    def commands(self, count):
        """The commands (count, 5) from now on, one for each tick."""
        taken = [self.value("position_command")]
        first = round(self.context.get_time() / self.time_step)
        for k in range(first, first + count - 1):
            self.simulator.AdvanceTo((k + 0.5) * self.time_step)
            taken.append(self.value("position_command"))
            self.fix("arm_position", taken[-1])
            self.fix("hand_pose", self.kinematics.hand_pose(taken[-1]))
        return np.array(taken)


def goal_of(primitive, offset=(0.0, 0.0, 0.0)):
    return RigidTransform(Quaternion(primitive.orientation.goal), primitive.goal + offset)


def points_near(primitive):
    path = primitive.rollout().positions
    return path[len(path) // 2] + np.array([[0.02, 0.05, -0.06], [0.04, 0.06, -0.05]])


CASES = {
    "alone": {},
    "to another goal": {"offset": (0.03, -0.02, 0.04)},
    "among obstacles": {"coupling": "barrier", "obstacles": True},
    "by the report's coupling": {"coupling": "report", "obstacles": True},
}


@pytest.mark.parametrize("arm", ["right", "left"])
@pytest.mark.parametrize("case", CASES)
def test_the_kinematic_simulation_gives_the_controllers_commands(arm, case):
    case = CASES[case]
    rig = Rig(arm)
    X_TG = goal_of(rig.primitive, case.get("offset", (0.0, 0.0, 0.0)))
    X_OG = RigidTransform(RollPitchYaw(-1.5, -0.26, 0.1), [-0.015, -0.085, 0.11])
    movement = Movement(rig.primitive, make_coupling(case.get("coupling", "none")), X_OG, id=1)
    points = points_near(rig.primitive) if case.get("obstacles") else np.zeros((0, 3))
    # The cloud is in single precision.
    points = points.astype(np.float32).astype(float)
    simulator = KinematicSimulator(MODEL, rig.kinematics, DifferentialIkParams(), 0.5, 0.02)
    start = ArmState(rig.start, np.zeros(5))
    path = simulator.roll_out(movement, start, X_TG, PointCloudDistance(points))
    expected = simulator.track(start, path, 1e-9)
    rig.perform(movement, X_TG, points)
    rig.simulator.Initialize()
    found = rig.commands(len(expected))
    assert len(expected) > 1.2 * rig.primitive.duration / rig.time_step
    assert np.abs(found[-1] - found[0]).max() > 0.5
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)
    if case.get("obstacles"):
        alone = simulator.roll_out(replace(movement, coupling=None), start, X_TG, None)
        count = min(len(alone.positions), len(path.positions))
        bent = np.linalg.norm(alone.positions[:count] - path.positions[:count], axis=1).max()
        assert bent > 0.002


def test_predicted_points_bend_the_movement_like_seen_ones():
    taken = []
    for port in ("points", "predicted"):
        rig = Rig("right")
        movement = Movement(rig.primitive, make_coupling("barrier"), id=1)
        rig.perform(movement, goal_of(rig.primitive), **{port: points_near(rig.primitive)})
        taken.append(rig.commands(120))
    np.testing.assert_array_equal(*taken)


def test_a_movement_that_ends_brakes_and_an_external_slowdown_makes_it_wait():
    rig = Rig("right")
    rig.perform(Movement(rig.primitive, id=1), goal_of(rig.primitive))
    rig.fix("slowdown", [1e6])
    rig.commands(30)
    assert rig.value("phase")[0] == pytest.approx(1.0, abs=1e-4)
    rig.fix("slowdown", [0.0])
    assert np.abs(rig.commands(60)[-1] - rig.start).max() > 0.2
    rig.fix("movement", moving(rig.primitive, 0))
    assert rig.value("active")[0] == 0.0
    rig.commands(30)
    np.testing.assert_array_equal(rig.value("velocity_command"), np.zeros(5))
    np.testing.assert_array_equal(rig.value("phase"), [1.0])


def test_a_movement_that_takes_anothers_place_begins_with_its_velocity():
    rig = Rig("right")
    rig.perform(Movement(rig.primitive, id=1), goal_of(rig.primitive))
    rig.commands(70)
    before = rig.value("velocity_command")
    X_TG = goal_of(rig.primitive, [0.0, 0.1, -0.05])
    rig.perform(Movement(rig.primitive, id=2), X_TG)
    assert rig.value("phase")[0] == 1.0
    rig.commands(2)
    step = np.abs(rig.value("velocity_command") - before).max()
    assert step < 0.3 < np.abs(before).max()
    rig.commands(220)
    hand = rig.kinematics.hand_pose(rig.value("position_command"))
    assert np.linalg.norm(hand.translation() - X_TG.translation()) < 2e-3


def test_a_movement_that_is_slowed_down_keeps_to_its_path():
    speeds = np.repeat([1.0, 0.3, 0.02, 0.7, 1.0], 40)
    paths = []
    for wanted in (np.ones(200), speeds):
        rig = Rig("right")
        rig.perform(Movement(rig.primitive, id=1), goal_of(rig.primitive))
        hands = []
        for k, speed in enumerate(wanted):
            rig.fix("speed", [speed])
            rig.simulator.AdvanceTo((k + 0.5) * rig.time_step)
            hands.append(np.concatenate((rig.value("desired_position"), rig.value("phase"))))
        paths.append(np.array(hands))
    full, slowed = paths
    # The phase tells what of the full movement is over.
    share = np.interp(-slowed[:, 3], -full[:, 3], np.arange(len(full)))
    assert share[-1] == pytest.approx(speeds.sum() - 1.0, abs=0.5)
    there = np.array([np.interp(share, np.arange(len(full)), full[:, k]) for k in range(3)]).T
    np.testing.assert_allclose(slowed[:, :3], there, atol=2e-4)
    assert np.ptp(slowed[:, :3], axis=0).max() > 0.1


def test_a_movement_that_takes_a_slowed_ones_place_begins_with_the_arms_velocity():
    rig = Rig("right")
    rig.perform(Movement(rig.primitive, id=1), goal_of(rig.primitive))
    rig.commands(60)
    rig.fix("speed", [0.25])
    rig.commands(20)
    before = rig.value("velocity_command")
    rig.fix("speed", [1.0])
    rig.perform(Movement(rig.primitive, id=2), goal_of(rig.primitive, [0.0, 0.1, -0.05]))
    rig.commands(2)
    assert np.abs(rig.value("velocity_command") - before).max() < 0.2


def test_a_primitive_without_joints_is_refused():
    primitive = make_primitive(None, "right")
    with pytest.raises(InputError, match="no orientation or no posture"):
        Rig("right", replace(primitive, posture=None))
