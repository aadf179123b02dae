import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import BODY_JOINTS, body_indices, shared_control_model
from pepper_drake.models.movable_objects import with_movable_objects
from pepper_drake.models.pepper import JOINT_GROUPS, add_pepper
from pepper_drake.models.scene import SCENES_DIR, load_scene


def make_scene():
    """A scene in which the arms are far enough from the body to move alone."""
    scene = load_scene("free")
    scene.robot.joints = {"LShoulderRoll": 0.4, "RShoulderRoll": -0.4}
    return scene


def make_station(scene=None, **options):
    return PepperStation(
        scene or make_scene(), StationConfig(cameras=False, **options), shared_control_model()
    )


# Head and arms follow; the trunk, which carries them, sways a little when it is moved.
TOLERANCE = np.array([0.015 if name in JOINT_GROUPS["body"] else 0.002 for name in BODY_JOINTS])

RESTING = np.array([make_scene().robot.positions()[name] for name in BODY_JOINTS])


class Rig:
    """A station that is commanded by hand."""

    def __init__(self, station):
        self.station = station
        self.simulator = Simulator(station)
        self.context = self.simulator.get_mutable_context()
        self.command(RESTING)
        self.drive([0, 0, 0])

    def command(self, joints):
        self.station.GetInputPort("joint_position_command").FixValue(self.context, joints)

    def drive(self, velocity):
        self.station.GetInputPort("base_velocity_command").FixValue(self.context, velocity)

    def value(self, name):
        return self.station.GetOutputPort(name).Eval(self.context)

    def advance(self, duration):
        self.simulator.AdvanceTo(self.context.get_time() + duration)


@pytest.fixture(scope="module")
def station():
    return make_station()


def test_it_starts_where_the_scene_says(station):
    rig = Rig(station)
    np.testing.assert_array_equal(rig.value("joint_position"), RESTING)
    np.testing.assert_array_equal(rig.value("base_pose"), np.zeros(3))


def test_it_stands_still_when_told_to(station):
    rig = Rig(station)
    rig.advance(1.0)
    np.testing.assert_allclose(rig.value("joint_position"), RESTING, atol=1e-4)
    np.testing.assert_allclose(rig.value("base_pose"), np.zeros(3), atol=1e-4)


@pytest.mark.parametrize("name", BODY_JOINTS)
def test_a_joint_commanded_alone_moves_alone(station, name):
    rig = Rig(station)
    limits = shared_control_model().command_limits([name])
    k = BODY_JOINTS.index(name)
    middle = (limits.position_lower[0] + limits.position_upper[0]) / 2
    step = 0.05 if RESTING[k] < middle else -0.05
    target = RESTING.copy()
    target[k] += step
    rig.command(target)
    rig.advance(0.4)
    assert np.all(np.abs(rig.value("joint_position") - target) < TOLERANCE)
    plant = station.plant
    q = plant.GetPositions(plant.GetMyContextFromRoot(rig.context))
    moved = q[plant.GetJointByName(name).position_start()]
    assert moved == pytest.approx(target[k], abs=TOLERANCE[k])


def test_head_and_arms_follow_within_2_mrad_at_the_stated_lag(station):
    # Commands are reached at the end of their period, and one or two of the plant's steps later.
    period = station.config.command_period
    lag, amplitude, omega = period, 0.1, 2 * np.pi * 0.5
    inward = np.sign(
        sum(
            getattr(shared_control_model().command_limits(BODY_JOINTS), side)
            for side in ("position_lower", "position_upper")
        )
        - 2 * RESTING
    )
    inward[inward == 0] = 1

    def wish(time):
        return RESTING + amplitude * inward * (1 - np.cos(omega * max(time, 0.0))) / 2

    rig = Rig(station)
    errors = []
    for k in range(100):
        time = period * k
        rig.command(wish(time))
        rig.simulator.AdvanceTo(time + period)
        errors.append(rig.value("joint_position") - wish(rig.context.get_time() - lag))
    assert np.all(np.abs(errors).max(axis=0) < TOLERANCE)


def test_the_base_goes_as_commanded_in_its_own_frame():
    scene = make_scene()
    scene.robot.yaw = np.pi / 2
    rig = Rig(make_station(scene))
    rig.drive([0.1, 0.05, 0.0])
    rig.advance(1.0)
    # Facing y: ahead is y, to the left is -x. The base starts and stops within 0.1 s.
    np.testing.assert_allclose(rig.value("base_pose"), [-0.05, 0.1, np.pi / 2], atol=0.01)
    before = rig.value("base_pose")
    rig.drive([0, 0, 0.2])
    rig.advance(1.0)
    turned = rig.value("base_pose") - before
    assert turned[2] == pytest.approx(0.2, abs=0.02)
    rig.drive([0, 0, 0])
    rig.advance(0.3)
    standing = rig.value("base_pose")
    rig.advance(0.5)
    np.testing.assert_allclose(rig.value("base_pose"), standing, atol=1e-3)
    # The trunk sways by some milliradians as the base starts and stops.
    np.testing.assert_allclose(rig.value("joint_position"), RESTING, atol=5e-3)


@pytest.mark.parametrize("yaw", [0.5, np.pi / 2, 2.6])
def test_a_robot_that_stands_for_long_goes_on_standing(yaw):
    # When all is at rest the contact solver has nothing but rounding left to solve for.
    scene = make_scene()
    scene.robot.yaw = yaw
    rig = Rig(make_station(scene))
    rig.drive([0.1, 0.05, 0.2])
    rig.advance(1.0)
    rig.drive([0, 0, 0])
    rig.advance(1.0)
    standing = rig.value("base_pose")
    rig.advance(7.0)
    np.testing.assert_allclose(rig.value("base_pose"), standing, atol=1e-3)
    np.testing.assert_allclose(rig.value("joint_position"), RESTING, atol=1e-4)


def test_an_arm_without_stiffness_does_not_follow_and_all_else_does():
    stiffness = dict.fromkeys(JOINT_GROUPS, 1.0) | {"right_arm": 0.0}
    rig = Rig(make_station(stiffness=stiffness))
    limits = shared_control_model().command_limits(BODY_JOINTS)
    middle = (limits.position_lower + limits.position_upper) / 2
    target = RESTING + 0.05 * np.where(middle > RESTING, 1, -1)
    rig.command(target)
    rig.advance(0.5)
    limp = body_indices(JOINT_GROUPS["right_arm"])
    stiff = [k for k in range(15) if k not in limp]
    moved = rig.value("joint_position")
    assert np.all(np.abs(moved - target)[stiff] < TOLERANCE[stiff])
    assert np.all(np.abs(moved[limp] - target[limp]) > 0.03)


def test_poses_agree_with_an_independent_plant(station):
    rig = Rig(station)
    rig.drive([0.1, 0, 0.1])
    rig.advance(0.5)
    plant = MultibodyPlant(0.0)
    add_pepper(plant)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for names, values in (
        (BODY_JOINTS, rig.value("joint_position")),
        (JOINT_GROUPS["base"], rig.value("base_pose")),
    ):
        for name, value in zip(names, values, strict=True):
            q = plant.GetPositions(context)
            q[plant.GetJointByName(name).position_start()] = value
            plant.SetPositions(context, q)
    torso = plant.GetFrameByName("torso")
    assert rig.value("torso_pose").IsNearlyEqualTo(torso.CalcPoseInWorld(context), 1e-12)
    hand = plant.GetFrameByName("r_hand_effector").CalcPose(context, torso)
    assert rig.value("right_hand_pose").IsNearlyEqualTo(hand, 1e-12)


def test_the_goal_object_moves_by_its_port():
    scene = make_scene()
    scene.goal.path = [[0.0, 0, 0, 0], [1.0, 0, 0, 0.08]]
    station = make_station(scene, goal_motion_port=True)
    rig = Rig(station)
    port = station.GetInputPort("goal_object.desired_state")
    port.FixValue(rig.context, [0.0, 0.0, 0.05, 0, 0, 0])
    rig.advance(0.5)
    goal = station.plant.GetBodyByName(station.scene_models.goal_object)
    p_WO = station.plant.EvalBodyPoseInWorld(
        station.plant.GetMyContextFromRoot(rig.context), goal
    ).translation()
    np.testing.assert_allclose(p_WO, np.add(scene.goal.position, [0, 0, 0.05]), atol=2e-3)


def test_two_contexts_share_nothing(station):
    rig = Rig(station)
    rig.command(RESTING + 0.01)
    rig.advance(0.05)
    clone = rig.context.Clone()
    names = ("joint_position", "joint_velocity", "base_pose", "robot_position")
    before = [station.GetOutputPort(name).Eval(clone).copy() for name in names]
    state = station.GetOutputPort("ground_truth.state").Eval(clone).copy()
    rig.command(RESTING - 0.05)
    rig.drive([0.1, 0, 0])
    rig.advance(0.3)
    assert np.abs(rig.value("joint_position") - before[0]).max() > 0.03
    clone.SetTime(clone.get_time())  # Whatever was cached is computed again.
    for name, value in zip(names, before, strict=True):
        np.testing.assert_array_equal(station.GetOutputPort(name).Eval(clone), value)
    np.testing.assert_array_equal(station.GetOutputPort("ground_truth.state").Eval(clone), state)

    # The clone goes on as the original would have.
    other = Simulator(station, clone)
    other.AdvanceTo(clone.get_time() + 0.3)
    held = station.GetOutputPort("joint_position").Eval(clone)
    assert np.all(np.abs(held - RESTING - 0.01) < TOLERANCE)


@pytest.mark.parametrize("gravity", [True, False])
def test_at_rest_the_solver_has_a_scale(gravity):
    """With 30 times the gains, rounding is small beside weights, but not beside nothing."""
    scene = with_movable_objects(load_scene(SCENES_DIR / "teach.yaml"))
    station = make_station(
        scene,
        goal_motion_port=True,
        obstacle_motion_ports=True,
        proportional_gain=12000.0,
        derivative_gain=300.0,
    )
    if not gravity:
        station.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    rig = Rig(station)
    target = np.array([scene.robot.positions()[name] for name in BODY_JOINTS])
    target[body_indices(JOINT_GROUPS["right_arm"])] += [-0.15, -0.07, 0.08, 0.06, 0.09]
    rig.command(target)
    for moving in station.scene_models.moving:
        port = station.GetInputPort(f"{moving.name}.desired_state")
        port.FixValue(rig.context, [0.03, -0.07, 0.1, 0, 0, 0])
    if gravity:
        rig.advance(20.0)
        np.testing.assert_allclose(rig.value("joint_position"), target, atol=1e-4)
    else:
        with pytest.raises(RuntimeError, match="SAP solver failed to converge"):
            rig.advance(20.0)


def test_thirty_minutes_at_rest(station):
    rig = Rig(station)
    target = RESTING.copy()
    target[body_indices(JOINT_GROUPS["right_arm"])] += [-0.15, -0.07, 0.08, 0.06, 0.09]
    rig.command(target)
    rig.advance(1800.0)
    np.testing.assert_allclose(rig.value("joint_position"), target, atol=1e-4)
