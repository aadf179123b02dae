"""Gaze policy: chooses the head's target and camera, and moves the head by one step."""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import HeadCamera
from pepper_drake.perception.gaze.gaze_params import GazeParams
from pepper_drake.perception.gaze.head_aiming import (
    Gaze,
    aim_for_two_cameras,
    aim_head,
    choose_camera,
    clamp_head,
    image_offset,
    step_head_trajectory,
)
from pepper_drake.perception.gaze.view_planning import (
    VIEW_POINTS,
    best_view,
    next_best_view,
    surroundings,
    view_weights,
    visible,
)

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GazeState:
    """State of the head between two steps.

    Attributes:
        head: Commanded HeadYaw and HeadPitch (2,) [rad].
        velocity: Their velocities (2,) [rad/s].
        camera: Index of the camera in use; -1 for none.
        in_view: Whether the object is in that camera's field of view at the commanded angles.
        reachable: Whether it is at any angles within the limits.
        arrived: Time at which the head arrived at its target [s]; infinite while it moves.
        glancing: Whether its target is beside the object.
        target: Head angles (2,) of a scan [rad]; NaN without a scan.
        search_start: Time at which a search for the object began, later by what it waited for
            images [s]; NaN without one.
        search_until: Time since then up to which enough images have come [s].
        search_delay: Time for which it has waited [s].
        image_time: Capture time of the newest image during the search [s].
        turned_back: Time at which it turned back to the object, or the scan began [s]; infinite
            during a glance.
        age: Time since the object was last seen, at the last step [s].
        seen: Times (N,) at which `VIEW_POINTS` were last in the secondary camera's image [s].
    """

    head: Vector
    velocity: Vector
    camera: int
    in_view: bool
    reachable: bool
    arrived: float
    glancing: bool
    target: Vector
    search_start: float
    search_until: float
    search_delay: float
    image_time: float
    turned_back: float
    age: float
    seen: Vector

    @classmethod
    def initial(cls) -> "GazeState":
        """Returns the state before the first step, with the head straight."""
        nothing = np.full(2, np.nan)
        return cls(
            np.zeros(2),
            np.zeros(2),
            -1,
            False,
            False,
            math.inf,
            False,
            nothing,
            math.nan,
            0.0,
            0.0,
            -math.inf,
            math.inf,
            math.inf,
            _NEVER_SEEN,
        )

    def to_vector(self) -> Vector:
        """Returns the state as numbers (17 + N,)."""
        flags = (self.camera, self.in_view, self.reachable, self.arrived, self.glancing)
        return np.concatenate(
            (
                self.head,
                self.velocity,
                flags,
                self.target,
                [self.search_start, self.search_until, self.search_delay, self.image_time],
                [self.turned_back, self.age],
                self.seen,
            )
        )

    @classmethod
    def from_vector(cls, vector: Vector) -> "GazeState":
        """Returns the state from its numbers."""
        camera, in_view, reachable, arrived, glancing = vector[4:9].tolist()
        start, until, delay, image_time, turned_back, age = vector[11:17].tolist()
        return cls(
            vector[:2].copy(),
            vector[2:4].copy(),
            int(camera),
            in_view > 0.0,
            reachable > 0.0,
            arrived,
            glancing > 0.0,
            vector[9:11].copy(),
            start,
            until,
            delay,
            image_time,
            turned_back,
            age,
            vector[17:].copy(),
        )


_UP = np.array([0.0, -1.0])
"""Turn of the head (2,) that looks higher."""
_NEVER_SEEN = np.zeros(len(VIEW_POINTS))


_AT_REST = np.zeros(3)
_SAME_IMAGE = 1e-6
"""Largest difference of one image's capture times, computed from its age [s]."""


class GazeObservation(NamedTuple):
    """Inputs of one step of the head.

    Attributes:
        time: [s].
        X_WT: Pose of the torso.
        X_WO: Pose of the object; None while unknown.
        age: Time since the object was last seen [s].
        image_age: Age of the newest image in which it is searched for [s].
        velocity: The object's velocity (3,) in W [m/s].
        scan_enabled: Whether the head may scan around an object at rest.
        look_at: Point (3,) in W to look at [m]; None for none.
        cloud: Returns the points (P, 3) of obstacles in W [m], read only when needed.
    """

    time: float
    X_WT: RigidTransform
    X_WO: RigidTransform | None
    age: float = 0.0
    image_age: float = 0.0
    velocity: Vector = _AT_REST
    scan_enabled: bool = False
    look_at: Vector | None = None
    cloud: Callable[[], Vector] = lambda: np.zeros((0, 3))


@functools.lru_cache(maxsize=128)
def _shared_gaze(
    cameras: tuple[HeadCamera, ...],
    secondary_camera: HeadCamera,
    p_TP: tuple[float, float, float],
    radius: float,
    aside: float,
    current: HeadCamera | None,
    largest_offset: float,
) -> Gaze:
    """Caches `aim_for_two_cameras`: an object at rest costs nothing."""
    return aim_for_two_cameras(
        cameras,
        secondary_camera,
        p_TP,
        radius=radius,
        aside=aside,
        current=current,
        largest_offset=largest_offset,
    )


def _is_near(aim: Vector, head: Vector, params: GazeParams) -> bool:
    return bool(np.abs(aim - head).max() < params.following_angle)


class GazePolicy:
    """Turns the head so that a camera keeps an object in its image.

    Without a secondary camera the object is centred in the image. With one, the object is brought
    as close to the centre of the secondary camera's image as possible while a first camera still
    sees it well. A moving object is centred in any case, where it is by now. A missed one is
    searched for with all cameras: above and below its last position, or along its motion. One that
    was not seen yet is searched for all around, no faster than images come. During a
    scan around an object at rest the head glances, between two looks at the object, at the places
    around it that the secondary camera has not seen for longest, or at a given point.

    Args:
        p_OP: The point on the object to look at (3,) [m].
        cameras: The cameras in order of preference.
        secondary_camera: A camera that should see the object's surroundings; None for none.
        radius: Radius of the part of the object that has to stay in view [m].
        side: Side of the reaching arm, 1 left or -1 right.
        search: Head angles (2,) [rad] of the search by the time since it began [s], side, and
            whether the object was seen before; None to stay still.
        time_step: Time between two steps [s].
        params: Timing and limits.
    """

    def __init__(
        self,
        p_OP: npt.ArrayLike,
        *,
        cameras: Sequence[HeadCamera],
        secondary_camera: HeadCamera | None,
        radius: float,
        side: float,
        search: Callable[[float, float, bool], Vector] | None,
        time_step: float,
        params: GazeParams,
    ) -> None:
        self._p_OP = np.asarray(p_OP, dtype=float)
        self._cameras, self._secondary = tuple(cameras), secondary_camera
        self._radius, self._side, self._search = radius, side, search
        self._time_step, self._params = time_step, params

    def step(self, state: GazeState, now: GazeObservation) -> GazeState:
        """Returns the state one step later."""
        params = self._params
        gaze, p_TP = None, np.zeros(3)
        if now.X_WO is None:
            aim = state.head
            state = self._searching(state, now)
            if self._search is not None:
                was_seen, searched = 0.0 < now.age < math.inf, now.time - state.search_start
                aim = clamp_head(self._search(searched, self._side, was_seen))
        else:
            # Until the arm moves, the base may: what its odometry errs by looks like motion.
            follows = now.scan_enabled and self._moves(now)
            p_WP = now.X_WO @ self._p_OP
            if follows:
                p_WP = p_WP + now.velocity * min(now.age, params.lead_time)
            p_TP = now.X_WT.inverse() @ p_WP
            gaze, state = self._aim(state, now, p_TP, follows)
            aim = gaze.head
            latest = params.missed_age_moving if follows else params.missed_age
            is_missed = self._secondary is not None and now.age > latest
            camera = -1 if is_missed else self._cameras.index(gaze.camera)
            state = replace(state, camera=camera, search_start=math.nan)
        head, velocity = step_head_trajectory(
            state.head,
            state.velocity,
            aim,
            self._time_step,
            max_velocity=params.max_velocity,
            max_acceleration=params.max_acceleration,
        )
        return replace(
            state,
            head=head,
            velocity=velocity,
            age=now.age,
            reachable=gaze is not None and gaze.in_view,
            in_view=gaze is not None and image_offset(gaze.camera, head, p_TP) < 1,
        )

    def _searching(self, state: GazeState, now: GazeObservation) -> GazeState:
        """Returns the state of the search, which waits for images where they come seldom."""
        params, taken = self._params.search, now.time - now.image_age
        start, until, delay = state.search_start, state.search_until, state.search_delay
        if math.isnan(start):
            start, until, delay = now.time, 0.5 * params.first_duration, 0.0
        elif taken > state.image_time + _SAME_IMAGE:
            most = now.time - start + params.first_duration
            until = min(until + params.view_duration / params.view_images, most)
        wait = max(now.time - until - start, 0.0)
        return replace(
            state,
            camera=-1,
            target=np.full(2, np.nan),
            search_start=start + wait,
            search_until=until,
            search_delay=delay + wait,
            image_time=taken,
        )

    def _moves(self, now: GazeObservation) -> bool:
        """True if the object moves.

        Before the arm moves, the object's motion matters less than the place to look at; that of an
        object far away is mostly noise.
        """
        is_fast = math.hypot(*now.velocity.tolist()) > self._params.rest_speed
        return is_fast and (now.scan_enabled or now.look_at is None)

    def _motion(self, camera: HeadCamera, now: GazeObservation, p_TP: Vector) -> Vector:
        """Returns how the head turns to follow the object (2,), the larger of both angles one.

        An object that moves along the line of sight is looked for higher and lower.
        """
        later = p_TP + self._time_step * now.X_WT.rotation().inverse().multiply(now.velocity)
        turn = (aim_head(camera, later) - aim_head(camera, p_TP)) / self._time_step
        fastest = np.abs(turn).max()
        return np.asarray(turn / fastest) if fastest > self._params.turn_speed else _UP

    def _aim(
        self, state: GazeState, now: GazeObservation, p_TP: Vector, follows: bool
    ) -> tuple[Gaze, GazeState]:
        """Aims at the object, which the head follows if it moves, or beside it during a scan."""
        params, secondary = self._params, self._secondary
        current = self._cameras[state.camera] if state.camera >= 0 else None
        scans = now.look_at is not None or now.scan_enabled
        latest = params.centering_age if scans else params.missed_age
        if secondary is None or self._moves(now) or now.age > latest:
            gaze = choose_camera(self._cameras, p_TP, current=current)
            missed = params.lead_time if follows else params.missed_age
            if secondary is not None and now.age > missed:
                swing = params.swing * np.sin(2 * np.pi * (now.age - missed) / params.swing_period)
                along = self._motion(gaze.camera, now, p_TP) if follows else _UP
                gaze = replace(gaze, head=clamp_head(gaze.head + swing * along))
            elif np.allclose(state.velocity, 0.0) and _is_near(gaze.head, state.head, params):
                gaze = replace(gaze, head=state.head)
            return gaze, replace(state, target=np.full(2, np.nan))
        place = tuple((params.place_grid * np.round(p_TP / params.place_grid)).tolist())
        shared = functools.partial(
            _shared_gaze,
            self._cameras,
            secondary,
            place,
            largest_offset=params.largest_offset,
        )
        radius = self._radius + (params.view_margin if scans else 0.0)
        gaze = shared(radius, 0.0, current)
        if not scans or np.isnan(state.target).any():
            state = replace(state, target=gaze.head, glancing=False, turned_back=now.time)
        has_dwelt, arrived = self._dwell(state, now.time)
        state = replace(state, arrived=arrived)
        if has_dwelt:
            places = surroundings(p_TP, self._side)
            in_image = visible(secondary, state.head, places)
            state = replace(state, seen=np.where(in_image, now.time, state.seen))
        # Of images that come late, none is ever young; one that was taken since is as good.
        is_new = now.age < state.age and now.time - now.age >= state.turned_back
        if scans and (is_new or now.age < params.scan_age) and (has_dwelt or not state.glancing):
            target = self._next_glance(state, now, p_TP, secondary)
            state = replace(state, target=target, glancing=True, turned_back=math.inf)
        elif scans and has_dwelt and state.glancing:
            # Back by the shortest path.
            heads = [shared(radius, aside, gaze.camera).head for aside in params.glance_angles]
            turns = np.abs(np.array(heads) - state.head).max(axis=1)
            target = heads[int(np.argmin(turns))]
            state = replace(state, target=target, glancing=False, turned_back=now.time)
        return replace(gaze, head=state.target), state

    def _next_glance(
        self, state: GazeState, now: GazeObservation, p_TP: Vector, camera: HeadCamera
    ) -> Vector:
        """Returns the head angles (2,) [rad] of the next best view."""
        params = self._params
        if now.look_at is None:
            middle = aim_head(camera, p_TP)
            heads = [clamp_head(middle + [aside, 0.0]) for aside in params.glance_angles]
        else:
            heads = [best_view(camera, now.X_WT.inverse() @ now.look_at)]
        turns = np.abs(np.array(heads) - state.head).max(axis=1)
        durations = params.dwell + 2.0 * np.sqrt(turns / params.max_acceleration)
        places = surroundings(p_TP, self._side)
        weights = view_weights(places, self._movable(now), params.view)
        unseen = now.time - state.seen
        best = next_best_view(camera, heads, durations, places, weights, unseen, params.view)
        return heads[best]

    def _movable(self, now: GazeObservation) -> Vector:
        """Returns the points (P, 3) [m] in T above the surface on which the object stands."""
        points = now.cloud()
        if now.X_WO is None or not len(points):
            return np.zeros((0, 3))
        off = points - now.X_WO.translation()
        above = off[:, 2] > self._params.movable_height
        above &= np.sum(off**2, axis=1) < self._params.movable_distance**2
        return np.asarray(now.X_WT.inverse() @ points[above].T).T

    def _dwell(self, state: GazeState, time: float) -> tuple[bool, float]:
        """Tells if the head dwelt at its target for one glance; returns the dwell's start [s]."""
        params = self._params
        off = np.abs(state.target - state.head).max()
        if off > params.dwell_angle or np.abs(state.velocity).max() > params.dwell_speed:
            return False, math.inf
        arrived = state.arrived if math.isfinite(state.arrived) else time
        return (False, arrived) if time - arrived < params.dwell - 1e-9 else (True, time)
