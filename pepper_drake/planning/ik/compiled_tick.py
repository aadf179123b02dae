"""One tick of the arm's command, compiled: inverse kinematics, then the limits of the joints.

The inverse kinematics is the program of Drake's DifferentialInverseKinematicsSystem, term by term:
two least-squares costs, which weight position over orientation, and two joint-centering costs, each
in the null space of one rotation axis, which together pull every joint to the nominal posture with
unit weight. The tests compare it with that system and with another solver. Drake solves it with
OSQP, which without an active bound stops at a gradient of a thousandth of its terms, and makes
program, contexts and solver anew every tick. Here the minimum is exact to rounding, and found in
microseconds.

The functions use scalars, not arrays: allocating an array takes longer than the arithmetic.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled
from pepper_drake.models.control_model import LimitArrays
from pepper_drake.planning.collision.compiled_arm import ArmChain, hand_jacobian
from pepper_drake.planning.safety.compiled_limits import limited_step

Vector = npt.NDArray[np.float64]


class IkNumbers(NamedTuple):
    """`DifferentialIkParams` and joint limits for compiled code.

    Attributes:
        position: Weight of the hand's linear velocity.
        orientation: Weight of its angular velocity.
        posture_gain: Gain towards the nominal posture [1/s].
        rate: Gain from pose error to velocity [1/s].
        limit_margin: Distance to a position limit at which motion towards it ends [rad].
        limit_influence: Distance below which motion towards it is slowed down [rad].
        twist: (6,) limits of the desired angular [rad/s] and linear [m/s] velocity.
        lower: (5,) lower position limits [rad].
        upper: (5,) upper position limits [rad].
        slowest: (5,) lower velocity limits [rad/s].
        fastest: (5,) upper velocity limits [rad/s].
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


@compiled
def _quaternion(R: Vector) -> Vector:
    """Returns the unit quaternion w, x, y, z of a matrix (Shepperd 1978, doi 10.2514/3.55767b)."""
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


@compiled
def quaternions(rotations: Vector) -> Vector:
    """Returns the unit quaternions (N, 4) w, x, y, z of matrices (N, 3, 3)."""
    found = np.empty((len(rotations), 4))
    for n in range(len(rotations)):
        found[n] = _quaternion(rotations[n])
    return found


@compiled
def _rotation_vector(asked: Vector, R: Vector) -> Vector:
    """Returns the rotation vector (3,) in T [rad] from R to the desired quaternion."""
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


@compiled
def _solve_free(H: Vector, g: Vector, side: npt.NDArray[np.int64], L: Vector, v: Vector) -> None:
    """Minimises over the free components of v, the others fixed, by Cholesky factorisation in L."""
    n = len(g)
    for i in range(n):
        if side[i] != 0:
            continue
        total = g[i]
        for j in range(n):
            if side[j] != 0:
                total -= H[i, j] * v[j]
        for j in range(i):
            if side[j] == 0:
                entry = H[i, j]
                for k in range(j):
                    if side[k] == 0:
                        entry -= L[i, k] * L[j, k]
                L[i, j] = entry / L[j, j]
                total -= L[i, j] * v[j]
        square = H[i, i]
        for k in range(i):
            if side[k] == 0:
                square -= L[i, k] * L[i, k]
        if not (square > 0.0 and math.isfinite(square) and math.isfinite(total)):
            raise np.linalg.LinAlgError("the program has no finite minimum")
        L[i, i] = math.sqrt(square)
        v[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        if side[i] == 0:
            for j in range(i + 1, n):
                if side[j] == 0:
                    v[i] -= L[j, i] * v[j]
            v[i] /= L[i, i]


@compiled
def solve_box_qp(H: Vector, g: Vector, low: Vector, high: Vector) -> Vector:
    """Returns the minimiser of v' H v / 2 - g' v over low <= v <= high, H positive definite.

    Principal pivoting by least index, which terminates for every positive definite H (Judice and
    Pires 1992, doi 10.1007/BF00940318): a component out of its bounds is set to the bound, one on a
    bound whose gradient points inward is freed. Without an active bound it is one linear solve.

    Raises:
        LinAlgError: A number is not finite.
    """
    n = len(g)
    side = np.zeros(n, dtype=np.int64)  # -1 on the lower bound, 1 on the upper, 0 free.
    v, L = np.zeros(n), np.empty((n, n))
    # Rounding at a degenerate minimum could cause cycling: stop after the number of active sets.
    for _ in range(3**n):
        for i in range(n):
            if side[i] != 0:
                v[i] = low[i] if side[i] < 0 else high[i]
        _solve_free(H, g, side, L, v)
        changed = False
        for i in range(n):
            if side[i] == 0:
                if v[i] < low[i] or v[i] > high[i]:
                    side[i] = -1 if v[i] < low[i] else 1
                    changed = True
            else:
                slope = g[i]
                for j in range(n):
                    slope -= H[i, j] * v[j]
                if side[i] * slope < 0.0:
                    side[i] = 0
                    changed = True
            if changed:
                break
        if not changed:
            break
    return np.minimum(np.maximum(v, low), high)


@compiled
def _add_centering(H: Vector, g: Vector, pull: Vector, J: Vector) -> None:
    """Adds a centering cost in the null space of a row J (5,) of the hand's Jacobian.

    Drake projects on the basis of the null space that Gaussian elimination gives: e_k - r_k e_m
    with r_k = J_k / J_m, m the pivot.
    """
    m = np.argmax(np.abs(J))
    if J[m] == 0.0:
        for i in range(5):
            H[i, i] += 1.0
            g[i] += pull[i]
        return
    for i in range(5):
        if i != m:
            share = J[i] / J[m]
            centered = pull[i] - share * pull[m]
            H[i, i] += 1.0
            H[i, m] -= share
            H[m, i] -= share
            H[m, m] += share * share
            g[i] += centered
            g[m] -= share * centered


@compiled
def ik_velocity(
    q: Vector,
    nominal: Vector,
    position: Vector,
    rotation: Vector,
    chain: ArmChain,
    numbers: IkNumbers,
) -> Vector:
    """Returns joint velocities (5,) [rad/s]; see `CompiledIk.velocity`."""
    R, p, J = hand_jacobian(q, chain)
    turn = _rotation_vector(rotation, R)
    H, g = np.zeros((5, 5)), np.zeros(5)
    for r in range(6):
        weight = numbers.orientation if r < 3 else numbers.position
        error = turn[r] if r < 3 else position[r - 3] - p[r - 3]
        rate = min(max(numbers.rate * error, -numbers.twist[r]), numbers.twist[r])
        for i in range(5):
            g[i] += weight * J[r, i] * rate
            for j in range(5):
                H[i, j] += weight * (J[r, i] * J[r, j])
    pull = numbers.posture_gain * (nominal - q)
    for axis in range(2):
        _add_centering(H, g, pull, J[axis])
    low, high = numbers.slowest.copy(), numbers.fastest.copy()
    span = numbers.limit_influence - numbers.limit_margin
    for k in range(5):
        below, above = q[k] - numbers.lower[k], numbers.upper[k] - q[k]
        share = min(max((min(below, above) - numbers.limit_margin) / span, 0.0), 1.0)
        if below < above:
            low[k] *= share
        else:
            high[k] *= share
    return solve_box_qp(H, g, low, high)


@compiled
def track_path(
    joints: Vector,
    velocity: Vector,
    nominal: Vector,
    positions: Vector,
    rotations: Vector,
    chain: ArmChain,
    numbers: IkNumbers,
    limits: LimitArrays,
    time_step: float,
    ends: int,
    goal: Vector,
    tolerance: float,
    still_speed: float,
) -> Vector:
    """Returns joint commands (N, 5) [rad] along a path; see `CompiledIk.track`."""
    count = len(positions) + 1
    commands = np.empty((count, 5))
    commands[0] = joints
    for n in range(1, count):
        wished = ik_velocity(
            joints, nominal[n - 1], positions[n - 1], rotations[n - 1], chain, numbers
        )
        joints, velocity = limited_step(joints, velocity, wished, limits, time_step)
        commands[n] = joints
        if n >= ends and n % 5 == 0 and np.abs(velocity).max() < still_speed:
            off = hand_jacobian(joints, chain)[1] - goal
            if np.sqrt(np.sum(off * off)) < tolerance:
                return commands[: n + 1]
    return commands
