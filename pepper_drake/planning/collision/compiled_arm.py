"""Compiled forward kinematics of an arm, and postures that reach a point."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled

Vector = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


class ArmChain(NamedTuple):
    """An arm's five joints and its hand as plain arrays.

    Attributes:
        rotations: (6, 3, 3) of each joint's frame in its parent link, then of the hand in its link.
        positions: (6, 3) of their origins in the same frames [m].
        axis_numbers: (5,) index of the coordinate axis that each joint turns about.
        senses: (5,) sign of the rotation about that axis, 1 or -1.
        turned: (6,) whether the rotation is not the identity.
        rows: (6,) output row of the link after each joint, then of the hand; -1 for no output.
    """

    rotations: Vector
    positions: Vector
    axis_numbers: Numbers
    senses: Vector
    turned: npt.NDArray[np.bool_]
    rows: Numbers


@compiled
def pose_links(
    q: Vector,
    chain: ArmChain,
    R: Vector,
    p: Vector,
    rotations: Vector,
    positions: Vector,
    axes: Vector,
    origins: Vector,
) -> None:
    """Advances R, p from the torso's pose to the hand's, and stores the poses of all links."""
    for k in range(6):
        C, (x, y, z) = chain.rotations, chain.positions[k]
        for i in range(3):
            a, b, c = R[i, 0], R[i, 1], R[i, 2]
            p[i] += a * x + b * y + c * z
            if chain.turned[k]:
                for j in range(3):
                    R[i, j] = a * C[k, 0, j] + b * C[k, 1, j] + c * C[k, 2, j]
        if k < 5:
            number, sense = chain.axis_numbers[k], chain.senses[k]
            first, second = (number + 1) % 3, (number + 2) % 3
            cos, sin = math.cos(q[k]), sense * math.sin(q[k])
            for i in range(3):
                axes[k, i], origins[k, i] = sense * R[i, number], p[i]
                a, b = R[i, first], R[i, second]
                R[i, first], R[i, second] = a * cos + b * sin, b * cos - a * sin
        row = chain.rows[k]
        if row >= 0:
            for i in range(3):
                positions[row, i] = p[i]
                for j in range(3):
                    rotations[row, i, j] = R[i, j]


@compiled
def link_poses(
    joints: Vector, R_FT: Vector, p_FT: Vector, chain: ArmChain
) -> tuple[Vector, Vector, Vector, Vector]:
    """Returns the arrays of `ArmPoses` in a frame F, at joints (M, 5) [rad]."""
    count, rows = len(joints), chain.rows[5] + 1
    rotations, positions = np.empty((count, rows, 3, 3)), np.empty((count, rows, 3))
    axes, origins = np.empty((count, 5, 3)), np.empty((count, 5, 3))
    R, p = np.empty((3, 3)), np.empty(3)
    for m in range(count):
        for i in range(3):
            p[i] = p_FT[i]
            for j in range(3):
                R[i, j] = R_FT[i, j]
        pose_links(joints[m], chain, R, p, rotations[m], positions[m], axes[m], origins[m])
    return rotations, positions, axes, origins


@compiled
def hand_jacobian(q: Vector, chain: ArmChain) -> tuple[Vector, Vector, Vector]:
    """Returns rotation and position of the hand in T, and its Jacobian (6, 5), angular first."""
    R, p, rows = np.eye(3), np.zeros(3), chain.rows[5] + 1
    rotations, positions = np.empty((rows, 3, 3)), np.empty((rows, 3))
    axes, origins = np.empty((5, 3)), np.empty((5, 3))
    pose_links(q, chain, R, p, rotations, positions, axes, origins)
    J = np.empty((6, 5))
    for k in range(5):
        x, y, z = p[0] - origins[k, 0], p[1] - origins[k, 1], p[2] - origins[k, 2]
        u, v, w = axes[k]
        J[0, k], J[1, k], J[2, k] = u, v, w
        J[3, k], J[4, k], J[5, k] = v * z - w * y, w * x - u * z, u * y - v * x
    return R, p, J


@compiled
def placed_points(rotations: Vector, positions: Vector, link: Numbers, points: Vector) -> Vector:
    """Returns points (S, 3) of links (S,) at link poses (M, L, ...), (M, S, 3) [m]."""
    placed = np.empty((len(rotations), len(link), 3))
    for m in range(len(rotations)):
        for s in range(len(link)):
            x, y, z = points[s]
            for i in range(3):
                R = rotations[m, link[s], i]
                placed[m, s, i] = R[0] * x + R[1] * y + R[2] * z + positions[m, link[s], i]
    return placed


@compiled
def reach_point(
    target: Vector,
    joints: Vector,
    limits: Vector,
    chain: ArmChain,
    steps: int,
    damping: float,
    largest: float,
) -> Vector:
    """Moves postures until their hands are at a point, by damped least squares.

    Args:
        target: (3,) in T [m].
        joints: (M, 5) modified in place [rad].
        limits: (2, 5) lower and upper position limits, kept by clipping [rad].
        chain: Of the arm.
        steps: Number of steps.
        damping: See `damped_least_squares` [m/rad].
        largest: Largest motion of a joint in one step [rad].

    Returns:
        (M,) distances of the hands from the point [m].
    """
    left, rows = np.empty(len(joints)), chain.rows[5] + 1
    R, p, error, J = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty((3, 5))
    L, z, change = np.empty((3, 3)), np.empty(3), np.empty(5)
    rotations, positions = np.empty((rows, 3, 3)), np.empty((rows, 3))
    axes, origins = np.empty((5, 3)), np.empty((5, 3))
    for m in range(len(joints)):
        q = joints[m]
        for step in range(steps + 1):
            for i in range(3):
                p[i] = 0.0
                for j in range(3):
                    R[i, j] = 1.0 if i == j else 0.0
            pose_links(q, chain, R, p, rotations, positions, axes, origins)
            for i in range(3):
                error[i] = target[i] - p[i]
            left[m] = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
            if step == steps:
                break
            for k in range(5):
                u, v, w = axes[k]
                x, y, c = p[0] - origins[k, 0], p[1] - origins[k, 1], p[2] - origins[k, 2]
                J[0, k], J[1, k], J[2, k] = v * c - w * y, w * x - u * c, u * y - v * x
            # J J' + damping² 1 = L L', then J' (L L')⁻¹ error.
            for i in range(3):
                z[i] = error[i]
                for j in range(i + 1):
                    entry = damping * damping if i == j else 0.0
                    for k in range(5):
                        entry += J[i, k] * J[j, k]
                    for k in range(j):
                        entry -= L[i, k] * L[j, k]
                    L[i, j] = math.sqrt(entry) if i == j else entry / L[j, j]
                for j in range(i):
                    z[i] -= L[i, j] * z[j]
                z[i] /= L[i, i]
            for i in range(2, -1, -1):
                for j in range(i + 1, 3):
                    z[i] -= L[j, i] * z[j]
                z[i] /= L[i, i]
            most = largest
            for k in range(5):
                change[k] = J[0, k] * z[0] + J[1, k] * z[1] + J[2, k] * z[2]
                most = max(most, abs(change[k]))
            for k in range(5):
                moved = q[k] + change[k] / (most / largest)
                q[k] = min(max(moved, limits[0, k]), limits[1, k])
    return left
