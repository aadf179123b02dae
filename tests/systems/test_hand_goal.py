import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.systems.hand_goal import HandGoal


def pose(rpy, p):
    return RigidTransform(RollPitchYaw(*rpy), p)


X_OG = pose([-1.5, -0.26, 0.1], [-0.015, -0.085, 0.11])
X_WO, X_WO_2 = pose([0, 0, 0.4], [0.98, -0.11, 0.74]), pose([0.1, 0, 0.4], [0.9, -0.1, 0.8])
X_WT, X_WT_2 = pose([0, 0.02, -0.3], [0.5, 0.1, 0.82]), pose([0, 0, -0.4], [0.6, 0.1, 0.82])


def test_the_goal_is_the_product_of_the_three_poses():
    system = HandGoal(X_OG)
    context = system.CreateDefaultContext()
    system.object_pose_input.FixValue(context, X_WO)
    system.torso_pose_input.FixValue(context, X_WT)
    expected = np.linalg.solve(X_WT.GetAsMatrix4(), X_WO.GetAsMatrix4() @ X_OG.GetAsMatrix4())
    position = system.GetOutputPort("goal_position").Eval(context)
    np.testing.assert_allclose(position, expected[:3, 3], atol=1e-12)
    w, x, y, z = system.GetOutputPort("goal_orientation").Eval(context)
    # The first column of the rotation matrix of a unit quaternion, written out.
    first_column = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
    np.testing.assert_allclose(first_column, expected[:3, 0], atol=1e-12)


def test_both_outputs_follow_both_inputs(ports):
    rig = ports(HandGoal(X_OG))
    changed = rig.changes(
        {"object_pose": X_WO, "torso_pose": X_WT},
        {"object_pose": X_WO_2, "torso_pose": X_WT_2},
    )
    assert changed == {
        (source, output)
        for source in ("object_pose", "torso_pose")
        for output in ("goal_position", "goal_orientation")
    }
    assert rig.feedthrough() == changed
