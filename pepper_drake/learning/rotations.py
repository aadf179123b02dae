"""Unit quaternions (w, x, y, z): product, logarithm, exponential, angular velocity, angles.

All functions are vectorised over leading axes; those of the control tick treat a single quaternion
in plain numbers, which is many times faster. Rotation vectors and angular velocities are
expressed in the frame in which the orientation is measured (not in the body). References: Ude,
Nemec, Petric, Morimoto 2014, doi:10.1109/ICRA.2014.6907291; Sola 2017, arXiv:1711.02508.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# Below this angle [rad] series replace the quotients: their error is then under 1e-16.
_SMALL = 1e-4


def multiply(p: npt.ArrayLike, q: npt.ArrayLike) -> Array:
    """Returns the quaternion product p q, (..., 4)."""
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    if p.ndim == q.ndim == 1:
        return np.array(_product(p.tolist(), q.tolist()))
    return np.stack(_product(np.moveaxis(p, -1, 0), np.moveaxis(q, -1, 0)), axis=-1)


def _product(p: Any, q: Any) -> tuple[Any, Any, Any, Any]:
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def conjugate(q: npt.ArrayLike) -> Array:
    """Returns the conjugate, which is the inverse of a unit quaternion, (..., 4)."""
    return np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def normalize(q: npt.ArrayLike) -> Array:
    """Returns q divided by its norm, (..., 4)."""
    q = np.asarray(q, dtype=float)
    if q.ndim == 1:
        return q / math.sqrt(q.dot(q))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def exp_map(rotation_vector: npt.ArrayLike) -> Array:
    """Returns the quaternion (..., 4) of rotation vectors (..., 3) [rad]."""
    vector = np.asarray(rotation_vector, dtype=float)
    if vector.ndim == 1:
        half_angle = 0.5 * math.sqrt(vector.dot(vector))
        factor = 0.5 * _sinc(half_angle)
        x, y, z = vector.tolist()
        return np.array((math.cos(half_angle), factor * x, factor * y, factor * z))
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    # sin(half) / (2 half), and numpy's sinc is sin(pi x) / (pi x).
    return np.concatenate((np.cos(half), 0.5 * np.sinc(half / np.pi) * vector), axis=-1)


def log_map(q: npt.ArrayLike) -> Array:
    """Returns the rotation vector (..., 3) [rad] of unit quaternions, at most pi long."""
    q = np.asarray(q, dtype=float)
    if q.ndim == 1:
        w, x, y, z = q.tolist()
        length = math.sqrt(x * x + y * y + z * z)
        if length < _SMALL:
            scale = 2.0 + length**2 / 3.0
        else:
            scale = 2.0 * math.atan2(length, abs(w)) / length
        scale = -scale if w < 0.0 else scale
        return np.array((scale * x, scale * y, scale * z))
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    small = sine < _SMALL
    factor = np.where(small, 2.0 + sine**2 / 3.0, 2.0 * half / np.where(small, 1.0, sine))
    return factor * q[..., 1:]


def nearest_log(q: npt.ArrayLike, reference: npt.ArrayLike) -> Array:
    """Returns the rotation vector (3,) of q that is closest to a reference (3,).

    Rotation vectors v and v (1 + 2 pi k / |v|) are the same rotation: this selects the branch, so
    that a rotation by more than half a turn stays continuous.
    """
    vector = log_map(q)
    angle = math.sqrt(vector.dot(vector))
    reference = np.asarray(reference, dtype=float)
    if angle < _SMALL:
        # The axis is free: whole turns about the reference's own axis are equally valid.
        length = float(np.linalg.norm(reference))
        turns = round(length / (2.0 * np.pi))
        return vector + (2.0 * np.pi * turns / length) * reference if turns else vector
    axis = vector / angle
    turns = round((float(axis @ reference) - angle) / (2.0 * np.pi))
    return vector + 2.0 * np.pi * turns * axis


def make_continuous(q: npt.ArrayLike) -> Array:
    """Returns (N, 4) with signs chosen so that neighbours lie on the same half sphere."""
    q = np.asarray(q, dtype=float)
    flips = np.sum(q[1:] * q[:-1], axis=-1) < 0.0
    return q * np.concatenate(([1.0], np.where(np.cumsum(flips) % 2, -1.0, 1.0)))[:, None]


def unwrapped_log(q: npt.ArrayLike) -> Array:
    """Returns the rotation vectors (N, 3) of a motion (N, 4), continuous from its *last* sample."""
    vectors = log_map(q)
    if not np.any(np.linalg.norm(np.diff(vectors, axis=0), axis=1) > 1.0):
        return vectors
    for k in range(len(vectors) - 2, -1, -1):
        if np.linalg.norm(vectors[k] - vectors[k + 1]) > 1.0:
            vectors[k] = nearest_log(np.asarray(q)[k], vectors[k + 1])
    return vectors


def left_jacobian(rotation_vector: npt.ArrayLike) -> Array:
    """Returns J (..., 3, 3) with angular velocity = J(v) dv/dt (Sola 2017, equation 145)."""
    vector = np.asarray(rotation_vector, dtype=float)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    cosine = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    sine = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    hat = _hat(vector)
    return np.eye(3) + cosine * hat + sine * (hat @ hat)


def angular_velocity(rotation_vector: npt.ArrayLike, rates: npt.ArrayLike) -> Array:
    """Returns the angular velocity (..., 3) [rad/s], J(v) dv/dt; see `left_jacobian`."""
    vector, rates = np.asarray(rotation_vector, dtype=float), np.asarray(rates, dtype=float)
    if vector.ndim == rates.ndim == 1:
        angle = math.sqrt(vector.dot(vector))
        cosine = 0.5 * _sinc(0.5 * angle) ** 2
        if angle < _SMALL:
            sine = 1.0 / 6.0 - angle**2 / 120.0
        else:
            sine = (angle - math.sin(angle)) / angle**3
        v, u = vector.tolist(), rates.tolist()
        once = _cross(v, u)
        twice = _cross(v, once)
        return np.array([u[k] + cosine * once[k] + sine * twice[k] for k in range(3)])
    return (left_jacobian(vector) @ rates[..., None])[..., 0]


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _sinc(x: float) -> float:
    """sin(x) / x."""
    return math.sin(x) / x if x > _SMALL else 1.0 - x * x / 6.0


def inverse_left_jacobian(rotation_vector: npt.ArrayLike) -> Array:
    """Returns the inverse (..., 3, 3) of `left_jacobian` (Sola 2017, equation 146)."""
    vector = np.asarray(rotation_vector, dtype=float)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    square = np.where(
        small,
        1.0 / 12.0 + angle**2 / 720.0,
        1.0 / safe**2 - 0.5 / (safe * np.tan(0.5 * safe)),
    )
    hat = _hat(vector)
    return np.eye(3) - 0.5 * hat + square * (hat @ hat)


def _hat(vector: Array) -> Array:
    hat = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    hat[..., 0, 1], hat[..., 0, 2] = -z, y
    hat[..., 1, 0], hat[..., 1, 2] = z, -x
    hat[..., 2, 0], hat[..., 2, 1] = -y, x
    return hat


def from_angles(angles: npt.ArrayLike) -> Array:
    """Returns quaternions (..., 4) of roll, pitch, yaw (..., 3): Rz(yaw) Ry(pitch) Rx(roll)."""
    half = 0.5 * np.asarray(angles, dtype=float)
    cr, cp, cy = np.moveaxis(np.cos(half), -1, 0)
    sr, sp, sy = np.moveaxis(np.sin(half), -1, 0)
    return np.stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ),
        axis=-1,
    )


def to_angles(q: npt.ArrayLike) -> Array:
    """Returns roll, pitch, yaw (..., 3) [rad] of unit quaternions; pitch in [-pi/2, pi/2]."""
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack((roll, pitch, yaw), axis=-1)


def angle_rates_to_angular_velocity(angles: npt.ArrayLike, rates: npt.ArrayLike) -> Array:
    """Returns the angular velocity (..., 3) [rad/s] of roll, pitch, yaw and their rates."""
    _, pitch, yaw = np.moveaxis(np.asarray(angles, dtype=float), -1, 0)
    d_roll, d_pitch, d_yaw = np.moveaxis(np.asarray(rates, dtype=float), -1, 0)
    forward = np.cos(pitch) * d_roll
    return np.stack(
        (
            np.cos(yaw) * forward - np.sin(yaw) * d_pitch,
            np.sin(yaw) * forward + np.cos(yaw) * d_pitch,
            d_yaw - np.sin(pitch) * d_roll,
        ),
        axis=-1,
    )
