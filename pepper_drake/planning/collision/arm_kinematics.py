"""Forward kinematics of one arm for many joint positions at once.

The chain is read once off the control model's plant; from then on it is arithmetic on whole arrays,
a hundred times faster than a loop over contexts. Vectors come with their three components first,
(3, M), inside: each operation then runs over a contiguous row.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import RevoluteJoint

from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.models.pepper import hand_frame
from pepper_drake.planning.collision.sphere_model import (
    SphereModel,
    arm_link_names,
    make_link_spheres,
)

Vector = npt.NDArray[np.float64]


_Terms = tuple[tuple[int, float], ...]
"""A constant vector: the places of its components that are not zero, and these."""


@dataclass(frozen=True)
class _Joint:
    """A revolute joint about a coordinate axis.

    Attributes:
        R: Columns of the rotation of its frame in its parent link; None for no rotation.
        p: The origin of its frame there [m].
        axis: Which coordinate axis it turns about, and the sense, 1 or -1.
    """

    R: tuple[_Terms, ...] | None
    p: _Terms
    axis: tuple[int, float]


class ArmChain(NamedTuple):
    """An arm's five joints and its hand as plain arrays, for compiled code.

    Attributes:
        rotations: (6, 3, 3) of each joint's frame in its parent link, then of the hand in its link.
        positions: (6, 3) their origins there [m].
        axis_numbers: (5,) which coordinate axis each joint turns about.
        senses: (5,) 1 or -1.
    """

    rotations: Vector
    positions: Vector
    axis_numbers: npt.NDArray[np.int64]
    senses: Vector


class ArmPoses:
    """Link poses of an arm at M joint positions.

    Attributes:
        hand_position: (M, 3) p_TH [m].
        hand_rotation: (M, 3, 3) R_TH.
        links: Rotation (3, 3, M) and position (3, M) in T of each link with spheres.
        axes: (5, 3, M) the joints' axes in T.
        origins: (5, 3, M) a point on each axis in T [m].
    """

    def __init__(
        self,
        links: list[tuple[Vector, Vector]],
        axes: Vector,
        origins: Vector,
        hand: tuple[Vector, Vector],
    ) -> None:
        self.links, self.axes, self.origins = links, axes, origins
        self._hand_R, self._hand_p = hand

    @property
    def hand_position(self) -> Vector:
        """(M, 3) p_TH [m]."""
        return self._hand_p.T

    @property
    def hand_rotation(self) -> Vector:
        """(M, 3, 3) R_TH."""
        return np.moveaxis(self._hand_R, -1, 0)

    def hand_jacobian(self) -> Vector:
        """(M, 6, 5): the hand's angular (first) and linear velocity in T per joint velocity."""
        arm = self._hand_p - self.origins
        linear = np.stack(
            (
                self.axes[:, 1] * arm[:, 2] - self.axes[:, 2] * arm[:, 1],
                self.axes[:, 2] * arm[:, 0] - self.axes[:, 0] * arm[:, 2],
                self.axes[:, 0] * arm[:, 1] - self.axes[:, 1] * arm[:, 0],
            ),
            axis=1,
        )
        return np.concatenate((self.axes, linear), axis=1).transpose(2, 1, 0)


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
        self.spheres: SphereModel = make_link_spheres(model, arm_link_names(arm))
        plant = model.plant
        self._joints: list[_Joint] = []
        self._link_after: list[int | None] = []
        names = arm_link_names(arm)
        poses: list[RigidTransform] = []
        for name in arm_joints(arm):
            joint: RevoluteJoint = plant.GetJointByName(name)
            X_PF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
            X_CM = joint.frame_on_child().GetFixedPoseInBodyFrame()
            if not X_CM.IsNearlyIdentity(1e-12):
                raise ValueError(f"{name}: its link's frame is not that of the joint")
            poses.append(X_PF)
            ((number, sense),) = _terms(joint.revolute_axis())
            self._joints.append(
                _Joint(
                    _columns(X_PF.rotation().matrix()), _terms(X_PF.translation()), (number, sense)
                )
            )
            child = joint.child_body().name()
            self._link_after.append(names.index(child) if child in names else None)
        X_LH = plant.GetFrameByName(hand_frame(arm)).GetFixedPoseInBodyFrame()
        self._hand = _columns(X_LH.rotation().matrix()), _terms(X_LH.translation())
        poses.append(X_LH)
        self.chain = ArmChain(
            np.array([X.rotation().matrix() for X in poses]),
            np.array([X.translation() for X in poses]),
            np.array([joint.axis[0] for joint in self._joints]),
            np.array([joint.axis[1] for joint in self._joints]),
        )

    def poses(self, joints: Vector) -> ArmPoses:
        """Link poses of the arm at joints (M, 5) [rad]."""
        q = np.asarray(joints)
        count = len(q)
        cos, sin = np.cos(q.T), np.sin(q.T)
        R = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, count))
        p = np.zeros((3, count))
        links: list[tuple[Vector, Vector]] = [(R, p)] * len(self.spheres.link_names)
        axes, origins = np.empty((5, 3, count)), np.empty((5, 3, count))
        for k, joint in enumerate(self._joints):
            if joint.p:
                p = p + _rotate(R, joint.p)
            R = _times(R, joint.R)
            number, sense = joint.axis
            axes[k], origins[k] = sense * R[:, number], p
            R = _turned(R, number, cos[k], sense * sin[k])
            link = self._link_after[k]
            if link is not None:
                links[link] = (R, p)
        R_LH, p_LH = self._hand
        return ArmPoses(links, axes, origins, (_times(R, R_LH), p + _rotate(R, p_LH)))

    def hand_pose(self, joints: Vector) -> RigidTransform:
        """Returns X_TH at joints (5,) [rad]."""
        poses = self.poses(joints[None])
        R_TH = RotationMatrix.ProjectToRotationMatrix(poses.hand_rotation[0])
        return RigidTransform(R_TH, poses.hand_position[0])

    def sphere_centers_at(self, joints: Vector) -> Vector:
        """Returns centres (M, S, 3) of the arm's spheres in T [m] at joints (M, 5) [rad]."""
        return self.sphere_centers(self.poses(joints)).transpose(2, 1, 0)

    def sphere_centers(self, poses: ArmPoses, spheres: SphereModel | None = None) -> Vector:
        """Centres (3, S, M) of spheres on the arm's links in T [m]; the arm's own if left out."""
        spheres = self.spheres if spheres is None else spheres
        count = poses.axes.shape[-1]
        centers = np.empty((3, len(spheres.radii), count))
        ends = np.searchsorted(spheres.link, range(len(poses.links) + 1)).tolist()
        for number, (R, p) in enumerate(poses.links):
            block = slice(ends[number], ends[number + 1])
            for i in range(3):
                np.matmul(spheres.centers[block], R[i], out=centers[i, block])
                centers[i, block] += p[i]
        return centers


def _terms(v: Vector) -> _Terms:
    return tuple((k, float(x)) for k, x in enumerate(v) if x != 0.0)


def _columns(R: Vector) -> tuple[_Terms, ...] | None:
    return None if np.array_equal(R, np.eye(3)) else tuple(_terms(column) for column in R.T)


def _rotate(R: Vector, v: _Terms) -> Vector:
    """R v (3, M) for rotations (3, 3, M) and one vector, whose zeros cost nothing."""
    total: Vector | None = None
    for k, x in v:
        term = R[:, k] if x == 1.0 else R[:, k] * x
        total = term if total is None else total + term
    return np.zeros((3, R.shape[-1])) if total is None else total


def _times(R: Vector, C: tuple[_Terms, ...] | None) -> Vector:
    """R C for rotations (3, 3, M) and the columns of one rotation."""
    return R if C is None else np.stack([_rotate(R, column) for column in C], axis=1)


def _turned(R: Vector, k: int, cos: Vector, sin: Vector) -> Vector:
    """R times the rotations about the k-th coordinate axis, (3, 3, M)."""
    a, b = (k + 1) % 3, (k + 2) % 3
    turned = np.empty_like(R, subok=False)
    turned[:, k] = R[:, k]
    turned[:, a] = R[:, a] * cos + R[:, b] * sin
    turned[:, b] = R[:, b] * cos - R[:, a] * sin
    return turned


@lru_cache(maxsize=4)
def arm_kinematics(model: ControlModel, arm: str) -> ArmKinematics:
    """The kinematics of a model's arm, made once."""
    return ArmKinematics(model, arm)
