import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator

from pepper_drake.systems.primitive.hand_goal_pose import HandGoalPose
from tests.systems.motion_example import moving


def pose(rpy, p):
    return RigidTransform(RollPitchYaw(*rpy), p)


X_OG = pose([-1.5, -0.26, 0.1], [-0.015, -0.085, 0.11])
X_WO, X_WO_2 = pose([0, 0, 0.4], [0.98, -0.11, 0.74]), pose([0.1, 0, 0.4], [0.9, -0.1, 0.8])
X_WT, X_WT_2 = pose([0, 0.02, -0.3], [0.5, 0.1, 0.82]), pose([0, 0, -0.4], [0.6, 0.1, 0.82])


def outputs(system, context):
    names = ("goal_position", "goal_orientation")
    return [system.GetOutputPort(name).Eval(context) for name in names]


def start():
    system = HandGoalPose(time_step=0.01)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.object_pose_input.FixValue(context, X_WO)
    system.torso_pose_input.FixValue(context, X_WT)
    system.movement_input.FixValue(context, moving(None, 0, X_OG=X_OG))
    simulator.Initialize()
    return system, simulator, context


def test_the_goal_is_the_product_of_the_three_poses_from_the_start():
    system, _, context = start()
    expected = np.linalg.solve(X_WT.GetAsMatrix4(), X_WO.GetAsMatrix4() @ X_OG.GetAsMatrix4())
    position, (w, x, y, z) = outputs(system, context)
    np.testing.assert_allclose(position, expected[:3, 3], atol=1e-12)
    # The first column of the rotation matrix of a unit quaternion, written out.
    first_column = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
    np.testing.assert_allclose(first_column, expected[:3, 0], atol=1e-12)


@pytest.mark.parametrize("name", ["object_pose", "torso_pose"])
def test_it_is_held_over_a_tick_and_follows_at_the_next(name):
    system, simulator, context = start()
    simulator.AdvanceTo(0.005)
    before = outputs(system, context)
    port, value = {
        "object_pose": (system.object_pose_input, X_WO_2),
        "torso_pose": (system.torso_pose_input, X_WT_2),
    }[name]
    port.FixValue(context, value)
    np.testing.assert_array_equal(outputs(system, context)[0], before[0])
    simulator.AdvanceTo(0.015)
    assert np.linalg.norm(outputs(system, context)[0] - before[0]) > 0.01


def test_another_pre_grasp_pose_counts_at_once():
    system, _, context = start()
    X_OG_2 = pose([0.3, 0.2, -0.1], [-0.1, 0.0, 0.2])
    system.movement_input.FixValue(context, moving(None, X_OG=X_OG_2))
    expected = X_WT.inverse() @ X_WO @ X_OG_2
    position, orientation = outputs(system, context)
    np.testing.assert_allclose(position, expected.translation(), atol=1e-12)
    np.testing.assert_allclose(orientation, expected.rotation().ToQuaternion().wxyz(), atol=1e-12)


@pytest.mark.parametrize("name", ["goal_position", "goal_orientation"])
def test_nothing_but_the_pre_grasp_pose_is_fed_through(name):
    system = HandGoalPose()
    goal = system.GetOutputPort(name).get_index()
    ports = [system.get_input_port(k) for k in range(system.num_input_ports())]
    fed = [p for p in ports if system.HasDirectFeedthrough(p.get_index(), goal)]
    assert fed == [system.movement_input]


def test_before_initialization_the_object_is_at_the_torso():
    system = HandGoalPose()
    context = system.CreateDefaultContext()
    system.movement_input.FixValue(context, moving(None, 0, X_OG=X_OG))
    position, orientation = outputs(system, context)
    np.testing.assert_allclose(position, X_OG.translation(), atol=1e-15)
    np.testing.assert_allclose(orientation, X_OG.rotation().ToQuaternion().wxyz(), atol=1e-15)


def test_a_goal_in_the_torso_frame_does_not_follow_the_object():
    system, simulator, context = start()
    X_TG = pose([0.2, 0.1, -0.3], [0.3, -0.2, 0.05])
    system.movement_input.FixValue(context, moving(None, 1, X_TG=X_TG))
    for X in (X_WO, X_WO_2):
        system.object_pose_input.FixValue(context, X)
        simulator.AdvanceTo(context.get_time() + 0.02)
        np.testing.assert_allclose(outputs(system, context)[0], X_TG.translation(), atol=1e-12)
