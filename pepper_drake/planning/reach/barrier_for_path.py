"""A barrier that lets a planned path pass."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance

Vector = npt.NDArray[np.float64]

_TRIED = np.arange(0.12, -0.081, -0.005)
"""Distances kept by the barrier, the greatest first [m]."""


def fit_barrier_to_path(
    coupling: BarrierCoupling,
    field: PointCloudDistance,
    positions: Vector,
    velocities: Vector,
    accelerations: Vector,
    *,
    margin: float = 0.003,
) -> BarrierCoupling:
    """The barrier that keeps the greatest distance at which it is silent all along a path.

    A planned path may pass an obstacle more closely than a hand whose orientation does not count
    would. There the barrier must not push, as it would push the hand off the plan; but it has to
    act as soon as something is nearer than the plan knew. It is silent, as `BarrierCoupling` is,
    where

        n·a + k1 n·v + k (d - rho) >= 0,  k = k0 k1² / 4,  that is  rho <= d + (n·a + k1 n·v) / k.

    Args:
        coupling: The barrier otherwise used; its hand never becomes larger.
        field: What it knows of obstacles, in the frame of the path.
        positions: (N, 3) of the hand, the last one its goal [m].
        velocities: (N, 3) m/s.
        accelerations: (N, 3) m/s².
        margin: To the radius that the path allows [m].

    Returns:
        The same barrier with another hand radius; a negative one means that obstacles are passed
        so fast and closely that only a nearer one makes it act.
    """
    distance, normal = field.distance_and_normal(positions)
    if not np.isfinite(distance).any():
        return coupling
    stiffness = coupling.stiffness * coupling.damping**2 / 4.0
    inward = np.einsum("ni,ni->n", normal, accelerations + coupling.damping * velocities)
    allowed = distance + inward / stiffness - margin
    to_goal = np.sum((positions - positions[-1]) ** 2, axis=1)
    near_goal = np.exp(-0.5 / coupling.goal_distance**2 * to_goal)
    at_goal = distance[-1] - coupling.goal_margin
    largest = coupling.hand_radius + coupling.margin
    for rho0 in (largest, *_TRIED[largest > _TRIED]):
        rho = rho0 + (min(rho0, at_goal) - rho0) * near_goal
        if np.all(rho <= allowed):
            break
    return replace(coupling, hand_radius=float(rho0) - coupling.margin)
