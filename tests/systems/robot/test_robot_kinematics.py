import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.pepper import JOINT_GROUPS, MODELS_DIR
from pepper_drake.systems.robot.robot_kinematics import CAMERA_FRAMES, RobotKinematics

BASE = np.array([0.7, -0.3, 0.5])


def some_joints(seed):
    return np.random.default_rng(seed).uniform(-0.4, 0.4, len(BODY_JOINTS))


@pytest.fixture(scope="module")
def independent():
    """Pepper from its URDF alone, posed joint by joint."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(MODELS_DIR / "pepper" / "pepper.urdf"))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("odom"))
    plant.Finalize()
    return plant


def posed(plant, joints, base):
    context = plant.CreateDefaultContext()
    positions = np.zeros(plant.num_positions())
    names = (*BODY_JOINTS, *JOINT_GROUPS["base"])
    for name, value in zip(names, [*joints, *base], strict=True):
        positions[plant.GetJointByName(name).position_start()] = value
    plant.SetPositions(context, positions)
    return context


def poses(plant, context):
    torso = plant.GetFrameByName("torso")
    yield "torso_pose", torso.CalcPoseInWorld(context)
    for name, frame in CAMERA_FRAMES.items():
        yield f"{name}_pose", plant.GetFrameByName(frame).CalcPoseInWorld(context)
    for arm in ("left", "right"):
        frame = plant.GetFrameByName(f"{arm[0]}_hand_effector")
        yield f"{arm}_hand_pose", frame.CalcPose(context, torso)


@pytest.mark.parametrize("seed", range(3))
def test_every_pose_is_that_of_an_independent_plant(independent, seed):
    system = RobotKinematics(shared_control_model())
    context = system.CreateDefaultContext()
    joints = some_joints(seed)
    system.joint_position_input.FixValue(context, joints)
    system.base_pose_input.FixValue(context, BASE)
    for name, X in poses(independent, posed(independent, joints, BASE)):
        given = system.GetOutputPort(name).Eval(context)
        np.testing.assert_allclose(given.GetAsMatrix34(), X.GetAsMatrix34(), atol=1e-12)
    for arm in ("left", "right"):
        X_TH = system.GetOutputPort(f"{arm}_hand_pose").Eval(context)
        np.testing.assert_array_equal(
            system.GetOutputPort(f"{arm}_hand_position").Eval(context), X_TH.translation()
        )
        quaternion = system.GetOutputPort(f"{arm}_hand_orientation").Eval(context)
        np.testing.assert_allclose(quaternion, X_TH.rotation().ToQuaternion().wxyz())


def test_robot_position_is_the_control_models_own_order():
    model = shared_control_model()
    system = RobotKinematics(model)
    context = system.CreateDefaultContext()
    joints = some_joints(0)
    system.joint_position_input.FixValue(context, joints)
    system.base_pose_input.FixValue(context, BASE)
    q = system.GetOutputPort("robot_position").Eval(context)
    for name, value in zip(BODY_JOINTS, joints, strict=True):
        assert q[model.plant.GetJointByName(name).position_start()] == value
    assert q[model.plant.GetJointByName("BaseYaw").position_start()] == BASE[2]


def test_all_outputs_follow_the_joints_and_what_is_in_the_world_the_base(ports):
    rig = ports(RobotKinematics(shared_control_model()))
    first = {"joint_position": some_joints(0), "base_pose": BASE}
    second = {"joint_position": some_joints(1), "base_pose": BASE + 0.1}
    changed = rig.changes(first, second)
    outputs = {output for _, output in rig.feedthrough()}
    assert {output for source, output in changed if source == "joint_position"} == outputs
    in_world = {"robot_position", "torso_pose", *(f"{name}_pose" for name in CAMERA_FRAMES)}
    moved = {output for source, output in changed if source == "base_pose"}
    # In the torso frame rounding alone may differ.
    assert moved >= in_world
    assert changed <= rig.feedthrough()


def test_two_contexts_of_one_system_do_not_disturb_each_other():
    system = RobotKinematics(shared_control_model())
    contexts = [system.CreateDefaultContext() for _ in range(2)]
    contexts.append(contexts[0].Clone())
    port = system.GetOutputPort("right_hand_position")
    expected = []
    for seed, context in enumerate(contexts):
        system.joint_position_input.FixValue(context, some_joints(seed))
        system.base_pose_input.FixValue(context, BASE)
        expected.append(port.Eval(context).copy())
    for context, position in zip(contexts, expected, strict=True):
        np.testing.assert_array_equal(port.Eval(context), position)
        np.testing.assert_array_equal(
            system.GetOutputPort("right_hand_pose").Eval(context).translation(), position
        )
    clone = contexts[0].Clone()
    port.Eval(clone)
    system.joint_position_input.FixValue(clone, some_joints(7))
    assert not np.array_equal(port.Eval(clone), expected[0])
    system.base_pose_input.FixValue(contexts[0], BASE)  # Forces a new computation.
    np.testing.assert_array_equal(port.Eval(contexts[0]), expected[0])
