"""Feed-forward of the hand's path in its desired pose: compiled, for one tick or many."""

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
    """Returns the desired pose with which the hand follows its path without lag.

    Drake's system commands the velocity gain (X_desired - X) / dt. With

        X_desired = X_next + (1 - gain) / gain (X_next - X_now)

    that is the path's velocity (X_next - X_now) / dt plus gain times the present error / dt.

    Args:
        position: Present reference position of the hand (3,) in T [m].
        next_position: The same one tick later.
        rotation: Present reference orientation (4,), unit quaternion w, x, y, z.
        next_rotation: The same one tick later.
        gain: In (0, 1].
    """
    p, R = feedforward_poses(position, next_position, rotation[None], next_rotation[None], gain)
    return RigidTransform(Quaternion(R[0]), p)


def feedforward_poses(
    position: Vector, next_position: Vector, rotation: Vector, next_rotation: Vector, gain: float
) -> tuple[Vector, Vector]:
    """Returns the desired poses of N ticks: positions (N, 3) [m], or (3,), rotations (N, 4)."""
    lead = (1.0 - gain) / gain
    # Copies: read-only or non-contiguous arrays would trigger another compilation.
    turned: Vector = _extrapolated(
        np.array(rotation, order="C"), np.array(next_rotation, order="C"), lead
    )
    return next_position + lead * (next_position - position), turned


@compiled
def _product(p: Vector, q: Vector) -> Vector:
    """Returns the quaternion product p q (4,)."""
    return np.array(
        [
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ]
    )


@compiled
def _extrapolated(rotation: Vector, following: Vector, lead: float) -> Vector:
    """Extrapolates unit quaternions (N, 4) beyond the next ones by `lead` times the turn."""
    turned = np.empty_like(following)
    back, ahead = np.empty(4), np.empty(4)
    for n in range(len(rotation)):
        back[0], back[1:] = rotation[n, 0], -rotation[n, 1:]
        turn = _product(following[n], back)
        w, length = turn[0], math.sqrt(np.sum(turn[1:] * turn[1:]))
        # Half the extrapolated angle over the length; its limit for small angles is `lead`.
        share = lead * (math.atan2(length, abs(w)) / length if length > 1e-9 else 1.0)
        half = share * length
        factor = share * (math.sin(half) / half if half > 1e-9 else 1.0)
        ahead[0], ahead[1:] = math.cos(half), (factor if w >= 0.0 else -factor) * turn[1:]
        asked = _product(ahead, following[n])
        turned[n] = asked / math.sqrt(np.sum(asked * asked))
    return turned
