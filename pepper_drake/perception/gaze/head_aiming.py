"""Aiming of the head: head angles for a camera to look at a point, and choice of the camera.

Head angles are (HeadYaw, HeadPitch) [rad]. HeadYaw turns about the torso's z at `P_T_NECK`, then
HeadPitch about y; positive pitch looks down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.models.pepper import head_pitch_limits
from pepper_drake.perception.cameras.camera import HeadCamera
from pepper_drake.perception.gaze.gaze_params import GazeParams, HeadSearchParams

P_T_NECK = (-0.038, 0.0, 0.1699)
"""Intersection of the axes of HeadYaw and HeadPitch in the torso frame [m]."""

HEAD_YAW_LIMIT = 2.08567
"""Largest HeadYaw to either side [rad]."""

_HALVINGS = 6
"""Bisection steps between two gazes, to about a hundredth of the angle between them."""

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Gaze:
    """Gaze of one camera at a point.

    Attributes:
        camera: The camera.
        head: Head angles (2,) within the coupled limits that bring the point closest to the
            image's centre.
        offset: The point's distance from the image's centre at these angles: 0 at the centre, 1 at
            the border, more outside.
        in_view: Whether the point is in the image at these angles.
    """

    camera: HeadCamera
    head: Vector
    offset: float
    in_view: bool


def camera_pose(camera: HeadCamera, head: npt.ArrayLike) -> RigidTransform:
    """Returns the pose X_TC of a camera in the torso frame at head angles (2,)."""
    yaw, pitch = np.asarray(head, dtype=float)
    return RigidTransform(RollPitchYaw(0, pitch, yaw), P_T_NECK) @ camera.X_HeadC


def aim_head(camera: HeadCamera, p_TP: npt.ArrayLike) -> Vector:
    """Computes the head angles that put a point on a camera's optical axis, ignoring limits.

    In closed form: yaw brings the point into the vertical plane of the optical axis, pitch then
    onto the axis. For a point closer to the neck than the axis, the error is minimal.

    Args:
        camera: The camera.
        p_TP: The point in the torso frame (3,) [m].

    Returns:
        (HeadYaw, HeadPitch), rad, in (-pi, pi].
    """
    x, y, z = (np.asarray(p_TP, dtype=float) - P_T_NECK).tolist()
    ahead, aside, up = camera.p_HeadC
    radius = math.hypot(x, y)
    yaw = math.atan2(y, x) - math.asin(min(max(aside / max(radius, 1e-9), -1.0), 1.0))
    forward = math.sqrt(max(radius**2 - aside**2, 0.0))
    # The optical axis in the head's vertical plane, (ahead, up) + s (cos tilt, -sin tilt),
    # intersects the circle around the neck through the point.
    c, s = math.cos(camera.tilt), -math.sin(camera.tilt)
    along = ahead * c + up * s
    reach = math.sqrt(max(forward**2 + z**2 - (ahead**2 + up**2 - along**2), 0.0)) - along
    elevation_on_axis = math.atan2(up + reach * s, ahead + reach * c)
    pitch = elevation_on_axis - math.atan2(z, forward)
    return np.array([math.remainder(yaw, math.tau), math.remainder(pitch, math.tau)])


def clamp_head(head: npt.ArrayLike) -> Vector:
    """Clamps head angles (2,) to the limits; those of pitch depend on yaw."""
    return np.array(_clamped(*np.asarray(head, dtype=float).tolist()))


def _clamped(yaw: float, pitch: float) -> tuple[float, float]:
    yaw = min(max(yaw, -HEAD_YAW_LIMIT), HEAD_YAW_LIMIT)
    lower, upper = head_pitch_limits(yaw)
    return yaw, min(max(pitch, lower), upper)


def image_offset(camera: HeadCamera, head: npt.ArrayLike, p_TP: npt.ArrayLike) -> float:
    """Returns a point's distance from the image's centre: 0 there, 1 at the border.

    Args:
        camera: The camera.
        head: Head angles (2,).
        p_TP: The point in the torso frame (3,) [m].

    Returns:
        The larger of the two distances along the image's axes, each relative to half the image,
        without lens distortion; infinite behind the camera.
    """
    angles = np.asarray(head, dtype=float).tolist()
    return _offset(camera, angles, (np.asarray(p_TP, dtype=float) - P_T_NECK).tolist())


def _offset(
    camera: HeadCamera, head: Sequence[float], p_NeckP_T: Sequence[float], radius: float = 0.0
) -> float:
    """Computes `image_offset` with plain numbers, as it runs many times per tick.

    With a radius [m], it is that of the farthest corner of a square around the point.
    """
    # The point rotated by -yaw, then by -(pitch + tilt).
    yaw, pitch = head
    x, y, z = p_NeckP_T
    ahead, aside, up = camera.p_HeadC
    cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
    forward, left = x * cos_yaw + y * sin_yaw, y * cos_yaw - x * sin_yaw
    cos_pitch, sin_pitch = math.cos(pitch), math.sin(pitch)
    forward, rise = (
        forward * cos_pitch - z * sin_pitch - ahead,
        forward * sin_pitch + z * cos_pitch - up,
    )
    cos_tilt, sin_tilt = math.cos(camera.tilt), math.sin(camera.tilt)
    depth = forward * cos_tilt - rise * sin_tilt
    if depth <= 0:
        return math.inf
    rise = forward * sin_tilt + rise * cos_tilt
    intrinsics = camera.intrinsics
    return max(
        (abs(left - aside) + radius) / depth * intrinsics.focal_x / (intrinsics.width / 2),
        (abs(rise) + radius) / depth * intrinsics.focal_y / (intrinsics.height / 2),
    )


def look_at(camera: HeadCamera, p_TP: npt.ArrayLike) -> Gaze:
    """Computes the gaze of a camera that brings a point closest to the image's centre.

    Args:
        camera: The camera.
        p_TP: The point in the torso frame (3,) [m].
    """
    head = clamp_head(aim_head(camera, p_TP))
    offset = image_offset(camera, head, p_TP)
    return Gaze(camera, head, offset, offset < 1)


_SEARCH_VIEWS = tuple(
    (third / 3, is_high)
    for thirds, is_high in (((-1, -3), False), ((-3, -1, 1, 3), True), ((3, 1), False))
    for third in thirds
)
"""Views of the search: yaw towards the arm's side, relative to the largest; whether it is high."""


def head_search_pattern(
    time: float, side: float, was_seen: bool = False, params: HeadSearchParams | None = None
) -> Vector:
    """Returns head angles of the search for the goal.

    Args:
        time: Time since the search began [s].
        side: Side of the reaching arm, 1 left or -1 right.
        was_seen: Whether the goal was seen before.
        params: Parameters of the search; the defaults if None.

    Returns:
        Head yaw and pitch (2,) [rad], constant for each of eight overlapping views, since a marker
        is only found in several images with little motion blur: first slightly to the arm's side,
        which shows the space ahead and within reach, then to the other side, back above, and so on.
    """
    params = params or HeadSearchParams()
    low_pitch = params.lost_pitch if was_seen else params.low_pitch
    if time < params.first_duration:
        return np.array([side * params.first_yaw, low_pitch])
    view = int((time - params.first_duration) / params.view_duration)
    yaw, is_high = _SEARCH_VIEWS[view % len(_SEARCH_VIEWS)]
    return np.array([side * yaw * params.sweep, params.high_pitch if is_high else low_pitch])


def choose_camera(
    cameras: Sequence[HeadCamera],
    p_TP: npt.ArrayLike,
    *,
    current: HeadCamera | None = None,
    good_offset: float = 0.5,
    patience: float = 0.15,
) -> Gaze:
    """Chooses the camera that sees a point best.

    It is the first camera that sees the point well; if none does, the one that brings it closest to
    the image's centre.

    Args:
        cameras: The cameras in order of preference.
        p_TP: The point in the torso frame (3,) [m].
        current: The camera in use; it is kept until it is worse than `good_offset` by `patience`
            (hysteresis).
        good_offset: Offset up to which a camera sees a point well.
        patience: Hysteresis; see `current`.
    """
    gazes = [look_at(camera, p_TP) for camera in cameras]
    for gaze in gazes:
        if current is not None and gaze.camera.name == current.name:
            if gaze.offset <= good_offset + patience and not any(
                other.offset <= good_offset - patience for other in gazes[: gazes.index(gaze)]
            ):
                return gaze
            break
    good = [gaze for gaze in gazes if gaze.offset <= good_offset]
    return good[0] if good else min(gazes, key=lambda gaze: gaze.offset)


def aim_for_two_cameras(
    cameras: Sequence[HeadCamera],
    other: HeadCamera,
    p_TP: npt.ArrayLike,
    *,
    radius: float = 0.0,
    aside: float = 0.0,
    current: HeadCamera | None = None,
    patience: float = 0.15,
    largest_offset: float = GazeParams.largest_offset,
) -> Gaze:
    """Chooses camera and head angles so that another camera sees an object, too.

    Starting with the object centred in a camera's image, the head turns towards centring it in the
    other camera's, as far as the first still has all of it in its image. The camera that leaves the
    other one the best view is chosen.

    Args:
        cameras: The cameras one of which has to see the object.
        other: The camera that should see the object's surroundings as well as possible.
        p_TP: The object's centre in the torso frame (3,) [m].
        radius: Radius of the object [m].
        aside: Angle by which the other camera should look past the object, positive left [rad].
        current: The camera in use; it is kept until another one's view is better by `patience`.
        patience: Hysteresis; see `current`.
        largest_offset: Largest offset of the whole object from the centre of the first's image.

    Returns:
        The gaze of the chosen camera; that of `choose_camera` if none has the whole object in view.
    """
    middle = aim_head(other, p_TP)
    p_NeckP_T = (np.asarray(p_TP, dtype=float) - P_T_NECK).tolist()
    best, least = None, math.inf
    for camera in cameras:
        own = look_at(camera, p_TP)
        if _offset(camera, own.head.tolist(), p_NeckP_T, radius) > largest_offset:
            continue
        gaze = _turned_towards(own, clamp_head(middle), p_TP, radius, largest_offset)
        loss = image_offset(other, gaze.head, p_TP)
        if current is not None and camera.name == current.name:
            loss -= patience
        if loss < least:
            best, least = gaze, loss
    if best is None:
        return choose_camera(cameras, p_TP, current=current)
    if aside == 0.0:
        return best
    # Yaw first: pitch matters less.
    own = look_at(best.camera, p_TP)
    yaw, pitch = clamp_head(middle + [aside, 0.0])
    turned = _turned_towards(own, np.array([yaw, own.head[1]]), p_TP, radius, largest_offset)
    return _turned_towards(turned, np.array([turned.head[0], pitch]), p_TP, radius, largest_offset)


def _turned_towards(
    gaze: Gaze, wanted: Vector, p_TP: npt.ArrayLike, radius: float, largest_offset: float
) -> Gaze:
    """Turns a gaze towards head angles as far as its camera still sees the whole object."""
    best, share, step = gaze, 1.0, 1.0
    yaw, pitch = gaze.head.tolist()
    turn, nod = (wanted - gaze.head).tolist()
    p_NeckP_T = (np.asarray(p_TP, dtype=float) - P_T_NECK).tolist()
    for _ in range(_HALVINGS):
        head = _clamped(yaw + share * turn, pitch + share * nod)
        step *= 0.5
        if _offset(gaze.camera, head, p_NeckP_T, radius) <= largest_offset:
            best = Gaze(gaze.camera, np.array(head), _offset(gaze.camera, head, p_NeckP_T), True)
            if share == 1.0:
                break
            share += step
        else:
            share -= step
    return best


def step_head_trajectory(
    head: npt.ArrayLike,
    velocity: npt.ArrayLike,
    target: npt.ArrayLike,
    time_step: float,
    *,
    max_velocity: float,
    max_acceleration: float,
) -> tuple[Vector, Vector]:
    """Moves the head one step towards its target, at limited velocity and acceleration.

    Each angle brakes in time to stop at the target. The result is within the coupled limits.

    Args:
        head: Head angles (2,).
        velocity: Their velocities (2,) [rad/s].
        target: Target head angles (2,).
        time_step: [s].
        max_velocity: [rad/s].
        max_acceleration: [rad/s^2].

    Returns:
        Head angles and velocities after the step.
    """
    start, speed = np.asarray(head, dtype=float), np.asarray(velocity, dtype=float)
    error = np.asarray(target, dtype=float) - start
    # Largest velocity from which braking in whole steps still stops at the target.
    brake = max_acceleration * time_step / 2
    stopping = np.sqrt(brake**2 + 2 * max_acceleration * np.abs(error)) - brake
    wanted = np.sign(error) * np.minimum(
        np.minimum(stopping, max_velocity), np.abs(error) / time_step
    )
    change = max_acceleration * time_step
    speed = speed + np.clip(wanted - speed, -change, change)
    moved = clamp_head(start + speed * time_step)
    return moved, (moved - start) / time_step
