"""The model against numbers that are written here, and against geometry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Box, Capsule, Cylinder, Role, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.errors import InputError
from pepper_drake.models import pepper

# NAOqi's tree hangs from the torso: joint -> (parent, child, axis, xyz, rpy).
ROS_TREE = {
    "HeadYaw": ("torso", "Neck", "z", (-0.038, 0, 0.1699), (0, 0, 0)),
    "HeadPitch": ("Neck", "Head", "y", (0, 0, 0), (0, 0, 0)),
    "RShoulderPitch": ("torso", "RShoulder", "y", (-0.057, -0.14974, 0.08682), (0, 0, 0)),
    "RShoulderRoll": ("RShoulder", "RBicep", "z", (0, 0, 0), (0, 0, 0)),
    "RElbowYaw": ("RBicep", "RElbow", "x", (0.1812, -0.015, 0.00013), (0, -0.157079, 0)),
    "RElbowRoll": ("RElbow", "RForeArm", "z", (0, 0, 0), (0, 0, 0)),
    "RWristYaw": ("RForeArm", "r_wrist", "x", (0.15, 0, 0), (0, 0, 0)),
    "LShoulderPitch": ("torso", "LShoulder", "y", (-0.057, 0.14974, 0.08682), (0, 0, 0)),
    "LShoulderRoll": ("LShoulder", "LBicep", "z", (0, 0, 0), (0, 0, 0)),
    "LElbowYaw": ("LBicep", "LElbow", "x", (0.1812, 0.015, 0.00013), (0, -0.157079, 0)),
    "LElbowRoll": ("LElbow", "LForeArm", "z", (0, 0, 0), (0, 0, 0)),
    "LWristYaw": ("LForeArm", "l_wrist", "x", (0.15, 0, 0), (0, 0, 0)),
    "HipRoll": ("torso", "Hip", "x", (2e-05, 0, -0.139), (0, 0, 0)),
    "HipPitch": ("Hip", "Pelvis", "y", (0, 0, -0.079), (0, 0, 0)),
    "KneePitch": ("Pelvis", "Tibia", "y", (0, 0, -0.268), (0, 0, 0)),
    "foot": ("Tibia", "base_footprint", None, (0, 0, -0.334), (0, 0, 0)),
    "top": ("Head", "CameraTop_frame", None, (0.08601, 0, 0.16284), (0, 0, 0)),
    "bottom": ("Head", "CameraBottom_frame", None, (0.09262, 0, 0.06177), (0, 0.698132, 0)),
    "depth": ("Head", "CameraDepth_frame", None, (0.05138, 0.039, 0.1194), (0, 0, 0)),
    "r_hand": ("r_wrist", "r_hand_effector", None, (0.0695, 0, -0.0303), (0, 0, 0)),
    "l_hand": ("l_wrist", "l_hand_effector", None, (0.0695, 0, -0.0303), (0, 0, 0)),
} | {
    f"{camera}_optical": (
        f"{camera}_frame",
        f"{camera}_optical_frame",
        None,
        (0, 0, 0),
        (-1.570796326794897, 0, -1.570796326794897),
    )
    for camera in ("CameraTop", "CameraBottom", "CameraDepth")
}

FRAMES = (
    "torso",
    "r_wrist",
    "l_wrist",
    "r_hand_effector",
    "l_hand_effector",
    "CameraTop_optical_frame",
    "CameraBottom_optical_frame",
    "CameraDepth_optical_frame",
)


def rotation(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    X = np.eye(4)
    X[:3, :3] = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]
    return X


def translation(xyz):
    X = np.eye(4)
    X[:3, 3] = xyz
    return X


def ros_poses(q):
    """Poses in the world of all links of NAOqi's tree, its floor frame moved by the base joints."""
    poses = {"torso": np.eye(4)}
    for joint, (parent, child, axis, xyz, (roll, pitch, yaw)) in ROS_TREE.items():
        X = translation(xyz) @ rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
        if axis is not None:
            X = X @ rotation(axis, q[joint])
        poses[child] = poses[parent] @ X
    base = translation((q["BaseX"], q["BaseY"], 0)) @ rotation("z", q["BaseYaw"])
    X_WT = base @ np.linalg.inv(poses["base_footprint"])
    return {name: X_WT @ X for name, X in poses.items()}


@pytest.fixture(scope="module")
def robot():
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=0.002, discrete_contact_approximation="sap")
    plant, scene_graph = AddMultibodyPlant(config, builder)
    model = pepper.add_pepper(plant)
    plant.Finalize()
    diagram = builder.Build()
    return diagram, plant, scene_graph, model


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_kinematics_agree_with_the_table(robot, seed):
    _, plant, _, model = robot
    rng = np.random.default_rng(seed)
    q = {}
    for name in pepper.joint_names():
        joint = plant.GetJointByName(name)
        lower, upper = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
        q[name] = rng.uniform(max(lower, -3), min(upper, 3))
    context = plant.CreateDefaultContext()
    pepper.set_joint_positions(plant, context, model, q)
    expected = ros_poses(q)
    for frame in FRAMES:
        X_WF = plant.GetFrameByName(frame).CalcPoseInWorld(context).GetAsMatrix4()
        np.testing.assert_allclose(X_WF, expected[frame], atol=1e-6, err_msg=frame)


def test_heights_of_the_zero_posture(robot):
    _, plant, _, model = robot
    context = plant.CreateDefaultContext()
    pepper.set_joint_positions(plant, context, model, dict.fromkeys(pepper.joint_names(), 0.0))
    heights = {
        "torso": 0.820,
        "RShoulder": 0.907,
        "Head": 0.990,
        "CameraBottom_optical_frame": 1.052,
        "CameraDepth_optical_frame": 1.109,
        "CameraTop_optical_frame": 1.153,
        "base_footprint": 0.0,
    }
    for frame, height in heights.items():
        z = plant.GetFrameByName(frame).CalcPoseInWorld(context).translation()[2]
        assert z == pytest.approx(height, abs=6e-4), frame


def test_signs_are_naoqis(robot):
    _, plant, _, model = robot

    def height_and_place(frame, **q):
        context = plant.CreateDefaultContext()
        pepper.set_joint_positions(
            plant, context, model, dict.fromkeys(pepper.joint_names(), 0.0) | q
        )
        return plant.GetFrameByName(frame).CalcPoseInWorld(context)

    still = height_and_place("torso").translation()
    assert height_and_place("torso", HipPitch=-0.3).translation()[0] > still[0] + 0.05
    assert height_and_place("r_wrist", RShoulderPitch=1.5).translation()[2] < 0.65
    assert height_and_place("r_wrist", RShoulderRoll=-0.5).translation()[1] < -0.25
    assert height_and_place("l_wrist", LShoulderRoll=0.5).translation()[1] > 0.25
    view = height_and_place("CameraTop_optical_frame", HeadPitch=0.3).rotation().matrix()[:, 2]
    assert view[2] < -0.25  # looks down


def test_every_joint_has_a_motor_with_limits_and_belongs_to_one_group(robot):
    _, plant, _, _ = robot
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    names = [actuator.joint().name() for actuator in actuators]
    assert sorted(names) == sorted(pepper.joint_names())
    assert len(set(names)) == 18 == plant.num_positions()
    effort = {a.joint().name(): a.effort_limit() for a in actuators}
    assert effort["RShoulderPitch"] == 5.428
    assert effort["RShoulderRoll"] == 2.666
    assert effort["RWristYaw"] == 0.2014
    assert effort["KneePitch"] == 27.702
    assert all(np.isfinite(a.effort_limit()) for a in actuators)
    assert all(a.default_reflected_inertia() > 0 for a in actuators if "Base" not in a.name())
    for name in names:
        assert np.isfinite(plant.GetJointByName(name).velocity_upper_limits()[0])
    assert plant.GetJointByName("HeadPitch").position_upper_limits()[0] == 0.4451


def test_the_whole_robot_weighs_what_it_should(robot):
    _, plant, _, model = robot
    # ROS's 28.681 kg without the 2e-6 kg of each finger and gripper.
    mass = sum(plant.get_body(i).default_mass() for i in plant.GetBodyIndices(model))
    assert mass == pytest.approx(28.6811, abs=2e-4)
    for i in plant.GetBodyIndices(model):
        body = plant.get_body(i)
        if body.default_mass() > 0:
            assert body.default_spatial_inertia().IsPhysicallyValid(), body.name()


def test_arms_are_mirror_images(robot):
    _, plant, _, model = robot
    q = pepper.posture_positions("stand", {"RShoulderPitch": 0.3, "RElbowYaw": 0.7, "BaseY": 0.2})
    poses = []
    for positions in (q, pepper.mirror_joint_positions(q)):
        context = plant.CreateDefaultContext()
        pepper.set_joint_positions(plant, context, model, positions)
        poses.append(context)
    flip = np.diag([1, -1, 1])
    right = plant.GetFrameByName("r_hand_effector").CalcPoseInWorld(poses[0])
    left = plant.GetFrameByName("l_hand_effector").CalcPoseInWorld(poses[1])
    np.testing.assert_allclose(left.translation(), flip @ right.translation(), atol=1e-12)
    np.testing.assert_allclose(
        left.rotation().matrix(), flip @ right.rotation().matrix() @ flip, atol=1e-12
    )


@pytest.mark.parametrize("posture", pepper.POSTURES)
def test_postures_are_inside_the_limits_and_touch_nothing(robot, posture):
    diagram, plant, scene_graph, model = robot
    positions = pepper.posture_positions(posture)
    assert pepper.clamp_coupled_limits(positions) == positions
    for name, value in positions.items():
        joint = plant.GetJointByName(name)
        assert joint.position_lower_limits()[0] <= value <= joint.position_upper_limits()[0], name
    context = diagram.CreateDefaultContext()
    pepper.set_joint_positions(plant, plant.GetMyContextFromRoot(context), model, positions)
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    distances = [
        pair.distance for pair in query.ComputeSignedDistancePairwiseClosestPoints(max_distance=0.1)
    ]
    assert distances  # the filters leave something to check
    assert min(distances) > 0.003


def sample_surface(shape):
    """Corners and rims of a shape: where its convex hull is farthest out."""
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    if isinstance(shape, Box):
        half = shape.size() / 2
        return np.array(np.meshgrid(*[(-h, h) for h in half])).reshape(3, -1).T
    if isinstance(shape, Cylinder):
        rims = [
            np.column_stack([circle * shape.radius(), np.full(24, z)])
            for z in (-shape.length() / 2, shape.length() / 2)
        ]
        return np.vstack(rims)
    raise AssertionError(f"cameras see a {type(shape).__name__}, which is slow to draw")


def distance_outside(shape, p):
    """Distance of points p outside a convex shape, in its own frame; negative or zero inside."""
    if isinstance(shape, Sphere):
        return np.linalg.norm(p, axis=1) - shape.radius()
    if isinstance(shape, Box):
        return np.linalg.norm(np.maximum(np.abs(p) - shape.size() / 2, 0), axis=1)
    radial = np.linalg.norm(p[:, :2], axis=1)
    axial = np.abs(p[:, 2]) - shape.length() / 2
    if isinstance(shape, Cylinder):
        return np.hypot(np.maximum(radial - shape.radius(), 0), np.maximum(axial, 0))
    assert isinstance(shape, Capsule)
    return np.hypot(radial, np.maximum(axial, 0)) - shape.radius()


def test_what_cameras_see_lies_within_a_centimetre_of_the_collision_shapes(robot):
    _, plant, scene_graph, model = robot
    inspector = scene_graph.model_inspector()
    for index in plant.GetBodyIndices(model):
        body = plant.get_body(index)
        seen = inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(index), Role.kPerception)
        solid = inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(index), Role.kProximity)
        for visual in seen:
            p_BP = np.array(
                [
                    inspector.GetPoseInFrame(visual) @ p
                    for p in sample_surface(inspector.GetShape(visual))
                ]
            )
            outside = [
                distance_outside(
                    inspector.GetShape(c),
                    np.array([inspector.GetPoseInFrame(c).inverse() @ p for p in p_BP]),
                )
                for c in solid
            ]
            worst = np.min(outside, axis=0).max()
            assert worst < 0.0105, f"{body.name()} {inspector.GetName(visual)} {worst:.4f}"


def test_the_head_does_not_hide_the_view_of_its_own_cameras(robot):
    _, plant, scene_graph, _ = robot
    inspector = scene_graph.model_inspector()
    head = plant.GetBodyByName("Head")
    front = max(
        (inspector.GetPoseInFrame(g) @ p)[0]
        for g in inspector.GetGeometries(
            plant.GetBodyFrameIdOrThrow(head.index()), Role.kPerception
        )
        for p in sample_surface(inspector.GetShape(g))
    )
    assert front < 0.0514  # the rearmost camera's lens


@pytest.mark.parametrize("welded", [None, "odom", "base_footprint", "torso"])
def test_the_file_loads_and_moves_by_itself_whatever_is_welded(welded):
    plant = MultibodyPlant(0.002)
    (model,) = Parser(plant).AddModels(pepper.PEPPER_URDF)
    if welded:
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(welded))
    plant.Finalize()
    assert plant.GetModelInstanceName(model) == "pepper"
    assert plant.num_positions() == (18 if welded else 25)
    simulator = Simulator(plant)
    simulator.AdvanceTo(0.02)
    assert np.isfinite(plant.GetPositions(simulator.get_context())).all()


def test_added_pepper_starts_in_its_posture_and_has_weight():
    plant = MultibodyPlant(0.002)
    model = pepper.add_pepper(plant, posture="crouch")
    plant.Finalize()
    assert plant.is_gravity_enabled(model)
    context = plant.CreateDefaultContext()
    assert plant.GetJointByName("KneePitch").get_angle(context) == 0.51
    X_WB = plant.GetFrameByName("base_footprint").CalcPoseInWorld(context)
    assert X_WB.IsExactlyEqualTo(RigidTransform())


def test_elbow_roll_limits_by_elbow_yaw():
    degrees = np.radians
    assert pepper.elbow_roll_limits(degrees(-80), "left")[0] == pytest.approx(degrees(-78))
    assert pepper.elbow_roll_limits(degrees(-30), "left")[0] == pytest.approx(degrees(-83.75))
    assert pepper.elbow_roll_limits(degrees(50), "left")[0] == pytest.approx(degrees(-89.5))
    assert pepper.elbow_roll_limits(degrees(30), "right")[1] == pytest.approx(degrees(83.75))
    for arm in pepper.ARMS:
        assert min(np.abs(pepper.elbow_roll_limits(0.0, arm))) == 0.00872665


@given(st.floats(-2.08567, 2.08567))
def test_coupled_limits_mirror(yaw):
    lower, upper = pepper.elbow_roll_limits(yaw, "left")
    assert pepper.elbow_roll_limits(-yaw, "right") == (-upper, -lower)
    assert pepper.head_pitch_limits(yaw) == pepper.head_pitch_limits(-yaw)


def test_head_pitch_limits_by_head_yaw():
    assert pepper.head_pitch_limits(0.0) == pytest.approx(np.radians([-40.5, 25.5]))
    assert pepper.head_pitch_limits(np.radians(-61.6)) == pytest.approx(np.radians([-35.2, 20.9]))
    # Half-way between the rows at 61.6 and 91.4 degrees.
    assert pepper.head_pitch_limits(np.radians(76.5)) == pytest.approx(np.radians([-35.15, 17.2]))
    assert pepper.head_pitch_limits(2.0) == pytest.approx(np.radians([-35.03, 13.5]), abs=1e-3)


def test_clamping_moves_only_the_coupled_joints():
    q = {"HeadYaw": 1.6, "HeadPitch": 0.44, "RElbowYaw": 1.2, "RElbowRoll": 1.5, "KneePitch": 9.0}
    clamped = pepper.clamp_coupled_limits(q)
    assert clamped["HeadPitch"] == pytest.approx(np.radians(13.5))
    assert clamped["RElbowRoll"] == pytest.approx(np.radians(78))
    assert clamped["KneePitch"] == 9.0
    assert pepper.clamp_coupled_limits({"RElbowRoll": 1.5}) == {"RElbowRoll": 1.5}


def test_unknown_names_are_told():
    with pytest.raises(InputError, match="stand, upright, crouch"):
        pepper.posture_positions("sit")
    with pytest.raises(InputError, match="RShoulder"):
        pepper.posture_positions("stand", {"RShoulder": 0.0})
    with pytest.raises(InputError, match='"left" or "right"'):
        pepper.hand_frame("both")
