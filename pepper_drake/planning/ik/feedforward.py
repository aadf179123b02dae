"""The hand's pose to ask for so that it moves with its path: compiled, for one tick or many."""

import math

import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform

from pepper_drake.compiled import compiled

Vector = npt.NDArray[np.float64]


def feedforward_pose(
    position: Vector, next_position: Vector, rotation: Vector, next_rotation: Vector, gain: float
) -> RigidTransform:
    """The pose to ask for so that the hand moves with its path and makes up for its error.

    Drake's system asks for the velocity gain (X_asked - X) / dt. With

        X_asked = X_next + (1 - gain) / gain (X_next - X_now)

    that is the path's own velocity (X_next - X_now) / dt, and gain times the present error.

    Args:
        position: (3,) where the hand should be now [m], in T.
        next_position: (3,) where it should be one tick later.
        rotation: (4,) its orientation now, unit quaternion w, x, y, z.
        next_rotation: (4,) the same one tick later.
        gain: In (0, 1].
    """
    p, R = feedforward_poses(
        position[None], next_position[None], rotation[None], next_rotation[None], gain
    )
    return RigidTransform(Quaternion(R[0]), p[0])


def feedforward_poses(
    position: Vector, next_position: Vector, rotation: Vector, next_rotation: Vector, gain: float
) -> tuple[Vector, Vector]:
    """Feed-forward poses of N ticks at once: positions (N, 3) [m], rotations (N, 4)."""
    lead = (1.0 - gain) / gain
    # Copies: compiled anew it would be for arrays that may not be written or have gaps.
    turned: Vector = _turned_on(
        np.array(rotation, order="C"), np.array(next_rotation, order="C"), lead
    )
    return next_position + lead * (next_position - position), turned


@compiled
def _product(p: Vector, q: Vector) -> Vector:
    """Quaternion product p q (4,)."""
    return np.array(
        [
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ]
    )


@compiled
def _turned_on(rotation: Vector, following: Vector, lead: float) -> Vector:
    """Unit quaternions (N, 4) that lead beyond the following ones by a share of the turn."""
    turned = np.empty_like(following)
    back, ahead = np.empty(4), np.empty(4)
    for n in range(len(rotation)):
        back[0], back[1:] = rotation[n, 0], -rotation[n, 1:]
        turn = _product(following[n], back)
        w, length = turn[0], math.sqrt(np.sum(turn[1:] * turn[1:]))
        # Half the angle led by, over the length; for small angles both are nearly the same.
        share = lead * (math.atan2(length, abs(w)) / length if length > 1e-9 else 1.0)
        half = share * length
        factor = share * (math.sin(half) / half if half > 1e-9 else 1.0)
        ahead[0], ahead[1:] = math.cos(half), (factor if w >= 0.0 else -factor) * turn[1:]
        asked = _product(ahead, following[n])
        turned[n] = asked / math.sqrt(np.sum(asked * asked))
    return turned
