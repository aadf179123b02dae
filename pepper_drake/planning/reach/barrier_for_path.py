"""Fits the obstacle barrier to a planned path, so that it does not push the hand off it."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance

Vector = npt.NDArray[np.float64]

_CANDIDATE_DISTANCES = np.arange(0.12, -0.081, -0.005)
"""Distances that the barrier may keep, the greatest first [m]."""


def fit_barrier_to_path(
    coupling: BarrierCoupling,
    field: PointCloudDistance,
    positions: Vector,
    velocities: Vector,
    accelerations: Vector,
    *,
    margin: float = 0.003,
) -> BarrierCoupling:
    """Returns the barrier with the greatest hand radius at which it is inactive all along a path.

    A planned path may pass an obstacle more closely than the barrier would let the hand. There the
    barrier must not push the hand off the plan, but must act as soon as an obstacle is nearer than
    the plan assumed. `BarrierCoupling` is inactive where

        n·a + k1 n·v + k (d - rho) >= 0,  k = k0 k1² / 4,  that is  rho <= d + (n·a + k1 n·v) / k.

    Args:
        coupling: The barrier to fit; its hand radius never increases.
        field: Distances to the obstacles, in the frame of the path.
        positions: Hand positions (N, 3), the last one the goal [m].
        velocities: (N, 3) m/s.
        accelerations: (N, 3) m/s².
        margin: Subtracted from the distance that the path allows [m].

    Returns:
        The same barrier with another hand radius. A negative one means that the path passes
        obstacles so fast and closely that only a nearer obstacle activates the barrier.
    """
    if not len(field.points):
        return coupling
    stiffness = coupling.stiffness * coupling.damping**2 / 4.0
    drive = accelerations + coupling.damping * velocities
    largest = coupling.hand_radius + coupling.margin
    # Farther than this any distance may be kept, whatever the normal; the goal's is needed.
    far = largest + margin + np.linalg.norm(drive, axis=1) / stiffness
    near = field.distance(positions, within=float(far.max())) <= far
    near[-1] = True
    positions = positions[near]
    distance, normal = field.distance_and_normal(positions)
    allowed = distance + np.einsum("ni,ni->n", normal, drive[near]) / stiffness - margin
    to_goal = np.sum((positions - positions[-1]) ** 2, axis=1)
    near_goal = np.exp(-0.5 / coupling.goal_distance**2 * to_goal)
    at_goal = distance[-1] - coupling.goal_margin
    rho0 = np.append(largest, _CANDIDATE_DISTANCES[largest > _CANDIDATE_DISTANCES])
    rho = rho0[:, None] + np.outer(np.minimum(rho0, at_goal) - rho0, near_goal)
    fits = np.append(np.flatnonzero((rho <= allowed).all(axis=1)), len(rho0) - 1)
    return replace(coupling, hand_radius=float(rho0[fits[0]]) - coupling.margin)
