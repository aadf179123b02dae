"""From a path of the arm's joints to a movement that performs it."""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.dmp.num_basis import DEFAULT_NUM_BASIS
from pepper_drake.models.control_model import arm_joints
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams

Vector = npt.NDArray[np.float64]

_SAMPLES = 101
_APPROXIMATOR = "trajectory"
"""Approximator that is most at rest after the end, and exact to a tenth of a millimetre."""


def fit_primitive_to_joint_path(
    kinematics: ArmKinematics,
    joints: Vector,
    duration: float,
    name: str,
    rest_share: float = ReachPlannerParams.rest_share,
) -> MovementPrimitive:
    """Learns the primitive of a joint path as if it had been shown.

    The hand's positions and orientations along the path become the translation and the
    orientation, the joints the nominal posture: all of a demonstration, so that its attractor,
    its phase and its answer to a goal that moves are those of any other.

    Args:
        kinematics: Of the arm.
        joints: (N, 5) at even times [rad].
        duration: Of the path [s]; the primitive's is a little longer, as it rests at its end.
        name: Of the primitive.
        rest_share: Share of the movement during which it rests at its end.
    """
    s = np.linspace(0.0, 1.0, len(joints))
    fine = np.linspace(0.0, 1.0, _SAMPLES)
    q = make_interp_spline(s, joints, k=3)(np.minimum(fine / (1.0 - rest_share), 1.0))
    poses = kinematics.poses(q)
    rotations = Rotation.from_matrix(poses.hand_rotation).as_quat(scalar_first=True)
    return MovementPrimitive.fit(
        Demonstration.from_positions(
            duration / (1.0 - rest_share) * fine,
            poses.hand_position,
            rotations=rotations,
            joints=q,
            joint_names=arm_joints(kinematics.arm),
            name=name,
        ),
        approximator=_APPROXIMATOR,
        num_basis=DEFAULT_NUM_BASIS,
        check=False,
    )


def reachable_pre_grasp(
    X_OG: RigidTransform, X_TO: RigidTransform, kinematics: ArmKinematics, joints: Vector
) -> RigidTransform:
    """The pre-grasp pose X_OG with its position, and the orientation that a posture gives the hand.

    Args:
        X_OG: The pre-grasp pose as it was.
        X_TO: The goal object's pose.
        kinematics: Of the arm.
        joints: (5,) at the goal [rad].
    """
    R_TH = kinematics.poses(joints[None]).hand_rotation[0]
    R_OH = X_TO.rotation().matrix().T @ R_TH
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_OH), X_OG.translation())
