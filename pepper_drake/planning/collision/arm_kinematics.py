"""Forward kinematics of one arm for many joint positions at once.

The chain is read once off the control model's plant; from then on it is compiled arithmetic, a
thousand times faster than a loop over contexts.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import RevoluteJoint

from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.models.pepper import hand_frame
from pepper_drake.planning.collision.compiled_arm import ArmChain, link_poses, placed_points
from pepper_drake.planning.collision.sphere_model import (
    SphereModel,
    arm_link_names,
    make_link_spheres,
)

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ArmPoses:
    """Link poses of an arm at M joint positions, in T or another frame that was asked for.

    Attributes:
        rotations: (M, L + 1, 3, 3) of each link with spheres, and of the hand.
        positions: (M, L + 1, 3) likewise [m].
        axes: (M, 5, 3) the joints' axes.
        origins: (M, 5, 3) a point on each axis [m].
    """

    rotations: Vector
    positions: Vector
    axes: Vector
    origins: Vector

    @property
    def hand_position(self) -> Vector:
        """(M, 3) p_TH [m]."""
        return self.positions[:, -1]

    @property
    def hand_rotation(self) -> Vector:
        """(M, 3, 3) R_TH."""
        return self.rotations[:, -1]

    def hand_jacobian(self) -> Vector:
        """(M, 6, 5): the hand's angular (first) and linear velocity in T per joint velocity."""
        arm = self.hand_position[:, None] - self.origins
        (u, v, w), (x, y, z) = np.moveaxis(self.axes, 2, 0), np.moveaxis(arm, 2, 0)
        return np.stack((u, v, w, v * z - w * y, w * x - u * z, u * y - v * x), axis=1)


class ArmKinematics:
    """The forward kinematics of one arm in the torso frame T.

    Immutable. The arm hangs on the torso by five joints, so nothing else moves it there.

    Args:
        model: Pepper.
        arm: "left" or "right".

    Attributes:
        arm: "left" or "right".
        spheres: The arm's spheres, upper arm to hand.
        chain: The same kinematics as arrays.
    """

    def __init__(self, model: ControlModel, arm: str) -> None:
        self.arm = arm
        self._X_TT = np.eye(3), np.zeros(3)
        self.spheres: SphereModel = make_link_spheres(model, arm_link_names(arm))
        plant = model.plant
        link_after: list[int] = []
        axes: list[Vector] = []
        names = arm_link_names(arm)
        poses: list[RigidTransform] = []
        for name in arm_joints(arm):
            joint: RevoluteJoint = plant.GetJointByName(name)
            X_PF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
            X_CM = joint.frame_on_child().GetFixedPoseInBodyFrame()
            if not X_CM.IsNearlyIdentity(1e-12):
                raise ValueError(f"{name}: its link's frame is not that of the joint")
            poses.append(X_PF)
            axes.append(joint.revolute_axis())
            child = joint.child_body().name()
            link_after.append(names.index(child) if child in names else -1)
        X_LH = plant.GetFrameByName(hand_frame(arm)).GetFixedPoseInBodyFrame()
        poses.append(X_LH)
        numbers = np.argmax(np.abs(axes), axis=1)
        self.chain = ArmChain(
            np.array([X.rotation().matrix() for X in poses]),
            np.array([X.translation() for X in poses]),
            numbers,
            np.array([axis[number] for axis, number in zip(axes, numbers, strict=True)]),
            np.array([not X.rotation().IsExactlyIdentity() for X in poses]),
            np.array([*link_after, len(names)]),
        )
        if any(np.count_nonzero(axis) != 1 for axis in axes):
            raise ValueError("a joint of the arm does not turn about a coordinate axis")

    def poses(self, joints: Vector, X_FT: RigidTransform | None = None) -> ArmPoses:
        """Link poses of the arm at joints (M, 5) [rad], in a frame F; left out, F is T."""
        R, p = self._X_TT
        if X_FT is not None:
            R, p = np.array(X_FT.rotation().matrix(), order="C"), np.array(X_FT.translation())
        # A copy: compiled anew it would be for arrays that may not be written or have gaps.
        q = np.array(joints, dtype=float, order="C")
        return ArmPoses(*link_poses(q, R, p, self.chain))

    def hand_pose(self, joints: Vector) -> RigidTransform:
        """Returns X_TH at joints (5,) [rad]."""
        poses = self.poses(joints[None])
        R_TH = RotationMatrix.ProjectToRotationMatrix(poses.hand_rotation[0])
        return RigidTransform(R_TH, poses.hand_position[0])

    def sphere_centers_at(self, joints: Vector) -> Vector:
        """Returns centres (M, S, 3) of the arm's spheres in T [m] at joints (M, 5) [rad]."""
        return self.sphere_centers(self.poses(joints))

    def sphere_centers(self, poses: ArmPoses, spheres: SphereModel | None = None) -> Vector:
        """Centres (M, S, 3) of spheres on the arm's links [m]; the arm's own if left out."""
        spheres = self.spheres if spheres is None else spheres
        centers: Vector = placed_points(
            poses.rotations, poses.positions, spheres.link, spheres.centers
        )
        return centers


@lru_cache(maxsize=4)
def arm_kinematics(model: ControlModel, arm: str) -> ArmKinematics:
    """The kinematics of a model's arm, made once."""
    return ArmKinematics(model, arm)
