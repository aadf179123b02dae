"""The arm's differential inverse kinematics, compiled and solved exactly.

The program is that of `differential_ik.make_differential_ik`, Drake's system, term by term; the
tests hold it against that system and against another solver. Drake solves it by OSQP, which without
an active bound is content with a gradient of a thousandth of its terms, and makes program, contexts
and solver anew every tick. Here its minimum is found to rounding, in microseconds. numba keeps what
it compiled beside this file, or in $NUMBA_CACHE_DIR.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.planning.collision.arm_kinematics import ArmChain
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams, arm_joint_limits

Vector = npt.NDArray[np.float64]


class _Weights(NamedTuple):
    """Numbers of `DifferentialIkParams` that the compiled code needs, and the joints' limits.

    Attributes:
        position: Weight of the hand's linear velocity.
        orientation: Weight of its angular velocity.
        posture_gain: Pull to the nominal posture [1/s].
        rate: Share of the pose error that is made up for in a tick, per time step [1/s].
        limit_margin: Distance to a position limit at which motion towards it ends [rad].
        limit_influence: Distance from which on motion towards it is slowed [rad].
        twist: (6,) largest angular [rad/s] and linear [m/s] velocity asked for.
        lower: (5,) position limits [rad].
        upper: (5,) position limits [rad].
        slowest: (5,) velocity limits [rad/s].
        fastest: (5,) velocity limits [rad/s].
    """

    position: float
    orientation: float
    posture_gain: float
    rate: float
    limit_margin: float
    limit_influence: float
    twist: Vector
    lower: Vector
    upper: Vector
    slowest: Vector
    fastest: Vector


class CompiledIk:
    """Joint velocities of one arm that take its hand to a pose, as Drake's system gives them.

    Args:
        model: Pepper.
        chain: Of the arm.
        arm: "left" or "right".
        params: Weights and limits.
    """

    def __init__(
        self, model: ControlModel, chain: ArmChain, arm: str, params: DifferentialIkParams
    ) -> None:
        self._chain = chain
        limits = arm_joint_limits(model, arm, params)
        rows = model.position_indices(arm_joints(arm))
        self._weights = _Weights(
            params.position_weight,
            params.orientation_weight,
            params.posture_gain,
            params.tracking_gain / params.time_step,
            params.limit_margin,
            params.limit_influence,
            np.repeat([params.angular_velocity_limit, params.linear_velocity_limit], 3),
            limits.position_lower()[rows],
            limits.position_upper()[rows],
            limits.velocity_lower()[rows],
            limits.velocity_upper()[rows],
        )

    def velocity(
        self, joints: Vector, nominal: Vector, position: Vector, rotation: Vector
    ) -> Vector:
        """Joint velocities (5,) [rad/s].

        Args:
            joints: (5,) present [rad].
            nominal: (5,) nominal posture [rad].
            position: (3,) asked of the hand, p_TH [m]; see `feedforward_pose`.
            rotation: (4,) likewise, unit quaternion w, x, y, z.
        """
        # Copies: compiled anew it would be for arrays that may not be written or have gaps.
        found: Vector = _velocity(
            np.array(joints),
            np.array(nominal),
            np.array(position),
            np.array(rotation),
            self._chain,
            self._weights,
        )
        return found


@njit(cache=True)
def _hand(q: Vector, chain: ArmChain) -> tuple[Vector, Vector, Vector]:
    """Rotation and position of the hand in T, and its Jacobian (6, 5), angular first."""
    R, p = np.eye(3), np.zeros(3)
    axes, origins = np.empty((5, 3)), np.empty((5, 3))
    for k in range(5):
        p = p + R @ chain.positions[k]
        R = R @ chain.rotations[k]
        number = chain.axis_numbers[k]
        axes[k], origins[k] = chain.senses[k] * R[:, number], p
        a, b = (number + 1) % 3, (number + 2) % 3
        cos, sin = np.cos(q[k]), chain.senses[k] * np.sin(q[k])
        R_a = R[:, a] * cos + R[:, b] * sin
        R[:, b] = R[:, b] * cos - R[:, a] * sin
        R[:, a] = R_a
    p = p + R @ chain.positions[5]
    R = R @ chain.rotations[5]
    J = np.empty((6, 5))
    for k in range(5):
        J[:3, k] = axes[k]
        J[3:, k] = np.cross(axes[k], p - origins[k])
    return R, p, J


@njit(cache=True)
def _quaternion(R: Vector) -> Vector:
    """Unit quaternion w, x, y, z of a rotation matrix (Shepperd 1978, doi 10.2514/3.55767b)."""
    found = np.empty(4)
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace >= max(R[0, 0], R[1, 1], R[2, 2]):
        found[0] = 1.0 + trace
        found[1], found[2] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0]
        found[3] = R[1, 0] - R[0, 1]
    else:
        i = np.argmax(np.diag(R))
        j, k = (i + 1) % 3, (i + 2) % 3
        found[0] = R[k, j] - R[j, k]
        found[1 + i] = 1.0 + 2.0 * R[i, i] - trace
        found[1 + j] = R[j, i] + R[i, j]
        found[1 + k] = R[k, i] + R[i, k]
    return found / np.sqrt(np.sum(found * found))


@njit(cache=True)
def _rotation_vector(asked: Vector, R: Vector) -> Vector:
    """Rotation vector (3,) in T [rad] that takes R to the quaternion asked for."""
    w, x, y, z = _quaternion(R)
    aw, ax, ay, az = asked
    scalar = aw * w + ax * x + ay * y + az * z
    vector = np.array(
        [
            ax * w - aw * x - ay * z + az * y,
            ay * w - aw * y - az * x + ax * z,
            az * w - aw * z - ax * y + ay * x,
        ]
    )
    length = np.sqrt(np.sum(vector * vector))
    if length < 1e-300:
        return np.zeros(3)
    angle = 2.0 * np.arctan2(length, abs(scalar))
    return vector * (angle / length if scalar >= 0.0 else -angle / length)


@njit(cache=True)
def solve_box_qp(H: Vector, g: Vector, low: Vector, high: Vector) -> Vector:
    """The minimum of v' H v / 2 - g' v over low <= v <= high, H positive definite.

    Principal pivoting by least index, which ends for every positive definite H (Judice and Pires
    1992, doi 10.1007/BF00940318): a component out of its bounds is put on the bound, one on a bound
    whose gradient points inward is freed. Without an active bound it is one linear solve.

    Raises:
        LinAlgError: A number is not finite.
    """
    n = len(g)
    side = np.zeros(n, dtype=np.int64)  # -1 on the lower bound, 1 on the upper, 0 free.
    v = np.zeros(n)
    # Rounding at a degenerate minimum could go round in circles: the number of sets is the limit.
    for _ in range(3**n):
        A, b = H.copy(), g.copy()
        for i in range(n):
            if side[i] != 0:
                A[i, :] = 0.0
                A[i, i] = 1.0
                b[i] = low[i] if side[i] < 0 else high[i]
        v = np.linalg.solve(A, b).astype(np.float64)
        for i in range(n):
            if side[i] != 0:
                v[i] = b[i]  # Without what elimination rounded.
        changed = False
        for i in range(n):
            if side[i] == 0:
                if v[i] < low[i] or v[i] > high[i]:
                    side[i] = -1 if v[i] < low[i] else 1
                    changed = True
            elif side[i] * (g[i] - np.sum(H[i] * v)) < 0.0:
                side[i] = 0
                changed = True
            if changed:
                break
        if not changed:
            break
    return np.minimum(np.maximum(v, low), high)


@njit(cache=True)
def _velocity(
    q: Vector,
    nominal: Vector,
    position: Vector,
    rotation: Vector,
    chain: ArmChain,
    weights: _Weights,
) -> Vector:
    R, p, J = _hand(q, chain)
    twist = np.empty(6)
    twist[:3] = _rotation_vector(rotation, R)
    twist[3:] = position - p
    for k in range(6):
        twist[k] = min(max(weights.rate * twist[k], -weights.twist[k]), weights.twist[k])
    pull = weights.posture_gain * (nominal - q)
    H = weights.orientation * (J[:3].T @ J[:3]) + weights.position * (J[3:].T @ J[3:])
    g = weights.orientation * (J[:3].T @ twist[:3]) + weights.position * (J[3:].T @ twist[3:])
    # Each of the two centering costs is blind to turns of the hand about one axis. Drake weighs by
    # the null space's basis that Gaussian elimination gives: e_k - row_k / row_m e_m, m the pivot.
    for axis in range(2):
        pivot = np.argmax(np.abs(J[axis]))
        P = np.eye(5)
        if J[axis, pivot] != 0.0:
            P[:, pivot] = -J[axis] / J[axis, pivot]
            P[pivot, :] = 0.0
        H += P.T @ P
        g += P.T @ (P @ pull)
    low, high = weights.slowest.copy(), weights.fastest.copy()
    span = weights.limit_influence - weights.limit_margin
    for k in range(5):
        below, above = q[k] - weights.lower[k], weights.upper[k] - q[k]
        share = min(max((min(below, above) - weights.limit_margin) / span, 0.0), 1.0)
        if below < above:
            low[k] *= share
        else:
            high[k] *= share
    return solve_box_qp(H, g, low, high)
