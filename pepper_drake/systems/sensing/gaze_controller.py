"""The head follows the goal object, and the camera that sees it best is switched on."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    InputPort,
    OutputPort,
)

from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP, HeadCamera
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
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.systems.framework import LeafSystem

_HEAD, _VELOCITY, _TARGET = slice(0, 2), slice(2, 4), slice(9, 11)
_CAMERA, _IN_VIEW, _REACHABLE, _ARRIVED, _GLANCING = 4, 5, 6, 7, 8
_SEEN = slice(11, 11 + len(VIEW_POINTS))

_MISSED = 1.9
"""Age at which the object was missed in images that should have shown it [s]."""
_UNSURE = 1.6
"""Age at which it is brought to the middle of the image [s]."""
_JUST_SEEN = 0.35
"""Up to this age the object may leave the image [s]: images are old by a quarter of a second."""
_AT_REST = 0.02
"""Speed of an object from which the eye may be taken [m/s]."""
_ASIDE = (-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75)
"""By which glances go past the object [rad]."""
_DWELL = 0.2
"""For how long a glance stays [s]: a period of the cameras."""
_NEAR, _SLOW = 0.05, 0.6
"""A head that dwells is so near to its target, rad, and so slow [rad/s]."""
_LEVEL, _AROUND = 0.03, 0.8
"""Height above the object's foot and distance within which points may move [m]."""
_GRID = 0.02
"""Nearer places are one, where a shared gaze is concerned [m]."""
_SPARE = 0.012
"""Displacement [m] of an object at which it is still in view."""
_SWING, _SWING_PERIOD = 0.4, 2.4
"""A missed object is looked for this much above and below where it was, rad, in that time [s]."""

Vector = NDArray[np.float64]
Search = Callable[[float, float], Vector]


def _is_enabled(index: int, state: Vector) -> Vector:
    """1 when the camera of that index is in use, or when none is yet."""
    return np.isin(state[[_CAMERA]], (index, -1)).astype(float)


@functools.lru_cache(maxsize=128)
def _shared_gaze(
    cameras: tuple[HeadCamera, ...],
    secondary_camera: HeadCamera,
    p_TP: tuple[float, float, float],
    radius: float,
    aside: float,
    current: HeadCamera | None,
) -> Gaze:
    """`aim_for_two_cameras`, computed once for each place: an object at rest costs nothing."""
    return aim_for_two_cameras(
        cameras, secondary_camera, p_TP, radius=radius, aside=aside, current=current
    )


class GazeController(LeafSystem):
    """Turns the head so that a camera keeps the goal object in the middle of its image.

    .. pydrake_system::

        name: GazeController
        input_ports:
        - object_pose
        - X_WT
        - valid (optional)
        - head_position (optional)
        - age (optional)
        - velocity (optional)
        - scan_enabled (optional)
        - cloud (optional)
        - look_at (optional)
        output_ports:
        - head_position_command
        - head_velocity_command
        - in_view
        - reachable
        - best_camera
        - top_enabled
        - bottom_enabled

    `object_pose` (RigidTransform X_WO) and `valid` come from a GoalEstimator, `X_WT` is the torso's
    measured pose. While `valid` is zero the head searches, or stays where it is without a search.
    The head starts from `head_position` (2; measured HeadYaw, HeadPitch, rad), or from zero.

    `head_position_command` (2; HeadYaw, HeadPitch, rad) and `head_velocity_command` (2; rad/s) are
    held, within the limits of velocity and acceleration and within Pepper's joint limits, those of
    HeadPitch as HeadYaw has them. `in_view` is 1 when the commanded angles put the object into the
    best camera's image, `reachable` when any angles within the limits would; both are 0 without a
    valid object. `best_camera` is that camera's index in `cameras`, and `<name>_enabled` is 1 for
    it and 0 for the other, ready for CameraModel's `enabled`. Without a valid object all are
    enabled: whichever sees it first finds it.

    With a `secondary_camera` the head does not bring the object to the middle of the image, but as
    near to the middle of the other's as it goes while a camera still sees the object well. An
    object that moves, by its `velocity` (3; m/s), is brought to the middle all the same; one that
    was missed, by its `age` (1; s since it was last seen), is looked for with all cameras above and
    below where it was. While it is `scan_enabled` (1; not zero) and the object at rest, the head
    glances between two looks at the object at what the other did not see for longest, near the
    object and on the reaching arm's `side` of it above all, and where something stands or hangs in
    the `cloud` (PointCloud in W): it may move. See `perception.outlook`. While `look_at` (3, in W,
    m) is finite, it glances there instead.

    State: head angles, velocities, camera, in_view, reachable, when the head arrived, glancing, its
    target, when each of the places around the object was seen (11 + N, discrete).
    Events: one periodic discrete update; one at initialization.

    Args:
        p_OP: The point on the object to look at (3,) [m]: its marker.
        cameras: The top and the bottom camera, in order of preference; Pepper's if left out. The
            top one looks along with the depth camera.
        secondary_camera: One that should see what is around the object, too: the depth camera.
        radius: Of what has to stay in view of the object then [m]: half its marker's diagonal.
        side: Of the reaching arm, 1 left or -1 right.
        search: Head angles (2,) [rad] of the search for the object, by the time [s] and `side`.
        time_step: Period of the update [s].
        max_velocity: rad/s. Low, because images taken by a fast head are blurred.
        max_acceleration: rad/s^2.
    """

    def __init__(
        self,
        p_OP: ArrayLike = (0, 0, 0),
        *,
        cameras: Sequence[HeadCamera] | None = None,
        secondary_camera: HeadCamera | None = None,
        radius: float = 0.0,
        side: float = 1,
        search: Search | None = None,
        time_step: float = 0.02,
        max_velocity: float = 1.0,
        max_acceleration: float = 4.0,
    ) -> None:
        super().__init__()
        self._p_OP = np.asarray(p_OP, dtype=float)
        self._cameras = (CAMERA_TOP, CAMERA_BOTTOM) if cameras is None else tuple(cameras)
        self._companion, self._radius, self._side = secondary_camera, radius, side
        self._search, self._time_step = search, time_step
        self._max_velocity = max_velocity
        self._max_acceleration = max_acceleration

        self._object_pose = self.DeclareAbstractInputPort("object_pose", Value(RigidTransform()))
        self._X_WT = self.DeclareAbstractInputPort("X_WT", Value(RigidTransform()))
        self._valid = self.DeclareVectorInputPort("valid", 1)
        self._head_position = self.DeclareVectorInputPort("head_position", 2)
        self._age = self.DeclareVectorInputPort("age", 1)
        self._velocity = self.DeclareVectorInputPort("velocity", 3)
        self._cloud = self.DeclareAbstractInputPort("cloud", Value(PointCloud()))
        self._watchful = self.DeclareVectorInputPort("scan_enabled", 1)
        self._look_at = self.DeclareVectorInputPort("look_at", 3)

        self._state = self.DeclareDiscreteState(
            np.concatenate(
                ([0, 0, 0, 0, -1, 0, 0, np.inf, 0, np.nan, np.nan], np.zeros(len(VIEW_POINTS)))
            )
        )
        self._declare_output("head_position_command", 2, lambda state: state[_HEAD])
        self._declare_output("head_velocity_command", 2, lambda state: state[_VELOCITY])
        self._declare_output("in_view", 1, lambda state: state[[_IN_VIEW]])
        self._declare_output("reachable", 1, lambda state: state[[_REACHABLE]])
        self._declare_output("best_camera", 1, lambda state: np.maximum(state[[_CAMERA]], 0))
        names = [camera.name for camera in self._cameras]
        for name, camera in (("top", CAMERA_TOP), ("bottom", CAMERA_BOTTOM)):
            self._declare_output(
                f"{name}_enabled", 1, functools.partial(_is_enabled, names.index(camera.name))
            )
        self.DeclareInitializationDiscreteUpdateEvent(self._start)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _declare_output(
        self,
        name: str,
        size: int,
        pick: Callable[[Vector], Vector],
    ) -> OutputPort:
        def calc(context: Context, output: BasicVector) -> None:
            output.SetFromVector(pick(context.get_discrete_state(self._state).value()))

        return self.DeclareVectorOutputPort(
            name, size, calc, prerequisites_of_calc={self.discrete_state_ticket(self._state)}
        )

    def _start(self, context: Context, discrete: DiscreteValues) -> EventStatus:
        if not self._head_position.HasValue(context):
            return EventStatus.DidNothing()
        state = discrete.get_mutable_vector(self._state).get_mutable_value()
        state[_HEAD] = clamp_head(self._head_position.Eval(context))
        return EventStatus.Succeeded()

    def _scalar(self, context: Context, port: InputPort, otherwise: float) -> float:
        """The size of what is at an optional port."""
        return math.hypot(*port.Eval(context).tolist()) if port.HasValue(context) else otherwise

    def _aim(self, context: Context, state: Vector, p_TP: Vector) -> Gaze:
        """Turns the eye to the object, or aside when another camera may have the view."""
        index = int(state[_CAMERA])
        current = self._cameras[index] if index >= 0 else None
        age = self._scalar(context, self._age, 0.0)
        wanted = self._wanted(context)
        is_watchful = wanted is not None or self._scalar(context, self._watchful, 0.0) > 0.5
        is_moving = self._scalar(context, self._velocity, 0.0) > _AT_REST
        if self._companion is None or is_moving or age > (_UNSURE if is_watchful else _MISSED):
            state[_TARGET] = np.nan
            gaze = choose_camera(self._cameras, p_TP, current=current)
            if self._companion is not None and age > _MISSED:
                swing = _SWING * np.sin(2 * np.pi * (age - _MISSED) / _SWING_PERIOD)
                gaze = replace(gaze, head=clamp_head(gaze.head - [0.0, swing]))
            return gaze
        place = tuple((_GRID * np.round(p_TP / _GRID)).tolist())
        shared = functools.partial(_shared_gaze, self._cameras, self._companion, place)
        gaze = shared(self._radius + (_SPARE if is_watchful else 0.0), 0.0, current)
        if not is_watchful or np.isnan(state[_TARGET]).any():
            state[_TARGET], state[_GLANCING] = gaze.head, 0.0
        time, seen = context.get_time(), state[_SEEN]
        has_dwelt = self._has_dwelt(context, state)
        if has_dwelt:
            places = surroundings(p_TP, self._side)
            seen[visible(self._companion, state[_HEAD], places)] = time
        if is_watchful and age < _JUST_SEEN and (has_dwelt or state[_GLANCING] == 0.0):
            if wanted is None:
                middle = aim_head(self._companion, p_TP)
                heads = [clamp_head(middle + [aside, 0.0]) for aside in _ASIDE]
            else:
                heads = [best_view(self._companion, wanted)]
            ways = np.abs(np.array(heads) - state[_HEAD]).max(axis=1)
            durations = _DWELL + 2.0 * np.sqrt(ways / self._max_acceleration)
            places = surroundings(p_TP, self._side)
            weights = view_weights(places, self._things(context))
            best = next_best_view(self._companion, heads, durations, places, weights, time - seen)
            state[_TARGET], state[_GLANCING] = heads[best], 1.0
        elif is_watchful and has_dwelt and state[_GLANCING] > 0.0:
            # Back by the shortest way.
            radius = self._radius + _SPARE
            heads = [shared(radius, aside, gaze.camera).head for aside in _ASIDE]
            ways = np.abs(np.array(heads) - state[_HEAD]).max(axis=1)
            state[_TARGET], state[_GLANCING] = heads[int(np.argmin(ways))], 0.0
        return replace(gaze, head=state[_TARGET].copy())

    def _wanted(self, context: Context) -> Vector | None:
        """The place (3,) in T that has to be looked at [m]; None if there is none."""
        if not self._look_at.HasValue(context):
            return None
        p_WP = self._look_at.Eval(context)
        return self._X_WT.Eval(context).inverse() @ p_WP if np.isfinite(p_WP).all() else None

    def _things(self, context: Context) -> Vector:
        """Points (P, 3) [m] in T above the surface on which the object stands."""
        if not self._cloud.HasValue(context):
            return np.zeros((0, 3))
        points = cloud_points(self._cloud.Eval(context))
        p_WO = self._object_pose.Eval(context).translation()
        off = points - p_WO
        above = (off[:, 2] > _LEVEL) & (np.sum(off**2, axis=1) < _AROUND**2)
        return np.asarray(self._X_WT.Eval(context).inverse() @ points[above].T).T

    def _has_dwelt(self, context: Context, state: Vector) -> bool:
        """True if the head has been at its target for long enough to take an image there."""
        time = context.get_time()
        off = np.abs(state[_TARGET] - state[_HEAD]).max()
        if off > _NEAR or np.abs(state[_VELOCITY]).max() > _SLOW:
            state[_ARRIVED] = np.inf
            return False
        if not np.isfinite(state[_ARRIVED]):
            state[_ARRIVED] = time
        if time - state[_ARRIVED] < _DWELL - 1e-9:
            return False
        state[_ARRIVED] = time
        return True

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        state = discrete.get_mutable_vector(self._state).get_mutable_value()
        head = state[_HEAD].copy()
        state[_IN_VIEW] = state[_REACHABLE] = 0
        gaze = None
        p_TP = np.zeros(3)
        if not self._valid.HasValue(context) or self._valid.Eval(context)[0] > 0:
            X_TO = self._X_WT.Eval(context).InvertAndCompose(self._object_pose.Eval(context))
            p_TP = X_TO @ self._p_OP
            gaze = self._aim(context, state, p_TP)
            target = gaze.head
            state[_REACHABLE] = gaze.in_view
            state[_CAMERA] = self._cameras.index(gaze.camera)
            if self._companion is not None and self._scalar(context, self._age, 0.0) > _MISSED:
                state[_CAMERA] = -1
        else:
            target = head
            if self._search is not None:
                target = clamp_head(self._search(context.get_time(), self._side))
            state[_CAMERA] = -1
            state[_TARGET] = np.nan
        state[_HEAD], state[_VELOCITY] = step_head_trajectory(
            head,
            state[_VELOCITY],
            target,
            self._time_step,
            max_velocity=self._max_velocity,
            max_acceleration=self._max_acceleration,
        )
        if gaze is not None:
            state[_IN_VIEW] = image_offset(gaze.camera, state[_HEAD], p_TP) < 1
