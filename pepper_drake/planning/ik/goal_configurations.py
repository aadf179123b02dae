"""Goal configurations: many postures of an arm with its hand at a point.

Five joints reach a point with two redundant degrees of freedom, which turn the hand and move the
elbow. A library of random postures, made once, is searched for those whose hand is near; a few
damped least-squares steps bring each to the point. As they are random, they spread over the two
redundant degrees of freedom.
"""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.collision.compiled_arm import reach_point

Vector = npt.NDArray[np.float64]

_LIBRARY_SIZE = 20000
_SEED = 1
_STEPS, _DAMPING = 8, 0.01
"""Number of damped least-squares steps, and their damping [m/rad]."""
_TOLERANCE = 2e-4
"""Distance from the point within which a hand has arrived [m]."""
_LARGEST_STEP = 0.3
"""Largest motion of a joint in one step [rad]."""


class GoalConfigurations:
    """Finds postures for hand positions.

    Args:
        kinematics: Of the arm.
        lower: (5,) limits of its joints [rad].
        upper: (5,) rad.
    """

    def __init__(self, kinematics: ArmKinematics, lower: Vector, upper: Vector) -> None:
        self._kinematics, self._lower, self._upper = kinematics, lower, upper
        rng = np.random.default_rng(_SEED)
        self._joints = rng.uniform(lower, upper, (_LIBRARY_SIZE, 5))
        poses = kinematics.poses(self._joints)
        self._hands, self._rotations = cKDTree(poses.hand_position), poses.hand_rotation

    def near(
        self,
        p_TH: Vector,
        count: int,
        R_TG: Vector,
        axis: npt.ArrayLike,
        tolerance: float,
        among: int,
    ) -> Vector:
        """Returns the library's postures (count, 5) [rad] with hands nearest to a point.

        Those whose hand axis is close to the goal's come first: where few are, hardly any of the
        very nearest is of use.

        Args:
            p_TH: The point (3,) in T [m].
            count: Number of postures.
            R_TG: Orientation of the goal (3, 3).
            axis: Axis (3,) in H.
            tolerance: Largest angle between the axes [rad].
            among: Number of the nearest postures from which they are chosen.
        """
        nearest = np.asarray(self._hands.query(p_TH, k=max(count, among))[1])
        turned = axis_error(self._rotations[nearest], R_TG, axis) <= tolerance
        return self._joints[nearest[np.argsort(~turned, kind="stable")[:count]]]

    def solve(self, target: Vector, starts: Vector) -> tuple[Vector, npt.NDArray[np.bool_]]:
        """Moves postures as little as needed to bring their hands to a point.

        Args:
            target: The point (3,) in T [m].
            starts: Initial postures (M, 5) [rad].

        Returns:
            Postures (M, 5) [rad], and a mask of those that arrived.
        """
        q = np.clip(starts, self._lower, self._upper)
        limits = np.stack((self._lower, self._upper))
        left = reach_point(
            np.array(target), q, limits, self._kinematics.chain, _STEPS, _DAMPING, _LARGEST_STEP
        )
        return q, left <= _TOLERANCE

    def well_turned(self, q: Vector, R_TG: Vector, axis: npt.ArrayLike, tolerance: float) -> Vector:
        """Returns the postures (M, 5) whose hand axis (3,) is close to the goal's, or all if none.

        Args:
            q: The postures [rad].
            R_TG: Orientation of the goal (3, 3).
            axis: Axis in H.
            tolerance: Largest angle between the axes [rad].
        """
        kept = axis_error(self._kinematics.poses(q).hand_rotation, R_TG, axis) <= tolerance
        return q[kept] if kept.any() else q


def orientation_error(R_TH: Vector, R_TG: Vector) -> Vector:
    """Returns angles (M,) [rad] between hand orientations (M, 3, 3) and a desired one (3, 3)."""
    trace = np.einsum("mij,ij->m", R_TH, R_TG)
    return np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))


def axis_error(R_TH: Vector, R_TG: Vector, axis: npt.ArrayLike) -> Vector:
    """Returns angles (M,) [rad] between an axis of hands and of a goal.

    Args:
        R_TH: Orientations of the hands (M, 3, 3).
        R_TG: Orientation of the goal (3, 3).
        axis: Axis (3,) in H, of any length.
    """
    direction = np.asarray(axis, dtype=float)
    cosine = R_TH @ direction @ (R_TG @ direction) / (direction @ direction)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
