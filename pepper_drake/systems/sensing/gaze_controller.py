"""Turns the head to follow the goal object and enables the camera with the best view of it."""

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
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, InputPort

from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP, HeadCamera
from pepper_drake.perception.gaze.gaze_params import GazeParams
from pepper_drake.perception.gaze.gaze_policy import GazeObservation, GazePolicy, GazeState
from pepper_drake.perception.gaze.head_aiming import clamp_head
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.systems.framework import LeafSystem

Vector = NDArray[np.float64]
Search = Callable[[float, float, bool], Vector]


class GazeController(LeafSystem):
    """Turns the head so that a camera keeps the goal object at the centre of its image.

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
        - image_ages (optional)
        output_ports:
        - head_position_command
        - head_velocity_command
        - in_view
        - reachable
        - best_camera
        - top_enabled
        - bottom_enabled
        - search_delay

    `object_pose` (RigidTransform X_WO) and `valid` come from a GoalEstimator, `X_WT` is the torso's
    measured pose. While `valid` is zero the head searches, or stays still if there is no `search`.
    The head starts from `head_position` (2), measured [rad], or from zero.

    `head_position_command` (2; HeadYaw, HeadPitch, rad) and `head_velocity_command` (2; rad/s) are
    held, within the velocity and acceleration limits and Pepper's joint limits, where those of
    HeadPitch depend on HeadYaw. `in_view` is 1 when the commanded angles put the object into the
    best camera's image, `reachable` when any angles within the limits would; both are 0 without a
    valid object. `best_camera` is that camera's index in `cameras`, and `<name>_enabled` is 1 for
    it and 0 for the other, for CameraModel's `enabled`. Without a valid object all cameras are
    enabled, as any may find it first.

    `velocity` (3) is the object's [m/s], `age` (1) the time since it was last seen [s]. While
    `scan_enabled` (1) is not zero and the object at rest, the head glances at its surroundings
    between two looks at it, preferably on the reaching arm's `side` of it and near the points of
    `cloud` (PointCloud in W); while `look_at` (3, in W) [m] is finite, it glances there instead.
    See `GazePolicy`. `image_ages` (2) [s] of the cameras' newest images make the search wait for
    images; `search_delay` (1) [s] is how long it has waited.

    State: a `GazeState` as numbers (17 + N, discrete).
    Events: one periodic discrete update; one at initialization.

    Args:
        p_OP: The point on the object to look at (3,) [m]: its marker.
        cameras: The top and the bottom camera, in order of preference; Pepper's if omitted. The
            top one's view overlaps the depth camera's.
        secondary_camera: A camera that should see the object's surroundings: the depth camera.
        radius: Radius of the part of the object that has to stay in view then [m]: half its
            marker's diagonal.
        side: Side of the reaching arm, 1 left or -1 right.
        search: Head angles (2,) [rad] of the search for the object, by the time since it began
            [s], `side`, and whether the object was seen before.
        time_step: Period of the update [s].
        params: Timing and limits.
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
        params: GazeParams | None = None,
    ) -> None:
        super().__init__()
        chosen = (CAMERA_TOP, CAMERA_BOTTOM) if cameras is None else tuple(cameras)
        self._policy = GazePolicy(
            p_OP,
            cameras=chosen,
            secondary_camera=secondary_camera,
            radius=radius,
            side=side,
            search=search,
            time_step=time_step,
            params=params or GazeParams(),
        )
        self._object_pose = self.DeclareAbstractInputPort("object_pose", Value(RigidTransform()))
        self._X_WT = self.DeclareAbstractInputPort("X_WT", Value(RigidTransform()))
        self._valid = self.DeclareVectorInputPort("valid", 1)
        self._head_position = self.DeclareVectorInputPort("head_position", 2)
        self._age = self.DeclareVectorInputPort("age", 1)
        self._velocity = self.DeclareVectorInputPort("velocity", 3)
        self._cloud = self.DeclareAbstractInputPort("cloud", Value(PointCloud()))
        self._scan_enabled = self.DeclareVectorInputPort("scan_enabled", 1)
        self._look_at = self.DeclareVectorInputPort("look_at", 3)
        self._image_ages = self.DeclareVectorInputPort("image_ages", 2)

        self._state = self.DeclareDiscreteState(GazeState.initial().to_vector())
        self._declare_output("head_position_command", 2, lambda state: state.head)
        self._declare_output("head_velocity_command", 2, lambda state: state.velocity)
        self._declare_output("in_view", 1, lambda state: [state.in_view])
        self._declare_output("reachable", 1, lambda state: [state.reachable])
        self._declare_output("best_camera", 1, lambda state: [max(state.camera, 0)])
        self._declare_output("search_delay", 1, lambda state: [state.search_delay])
        names = [camera.name for camera in chosen]
        for name, camera in (("top", CAMERA_TOP), ("bottom", CAMERA_BOTTOM)):
            enabled = functools.partial(_is_enabled, names.index(camera.name))
            self._declare_output(f"{name}_enabled", 1, enabled)
        self.DeclareInitializationDiscreteUpdateEvent(self._start)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _declare_output(self, name: str, size: int, pick: Callable[[GazeState], ArrayLike]) -> None:
        def calc(context: Context, output: BasicVector) -> None:
            output.SetFromVector(np.asarray(pick(self._gaze_state(context)), dtype=float))

        self.DeclareVectorOutputPort(
            name, size, calc, prerequisites_of_calc={self.discrete_state_ticket(self._state)}
        )

    def _gaze_state(self, context: Context) -> GazeState:
        return GazeState.from_vector(context.get_discrete_state(self._state).value())

    def _start(self, context: Context, discrete: DiscreteValues) -> EventStatus:
        if not self._head_position.HasValue(context):
            return EventStatus.DidNothing()
        head = clamp_head(self._head_position.Eval(context))
        discrete.set_value(self._state, replace(self._gaze_state(context), head=head).to_vector())
        return EventStatus.Succeeded()

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        state = self._policy.step(self._gaze_state(context), self._observe(context))
        discrete.set_value(self._state, state.to_vector())

    def _observe(self, context: Context) -> GazeObservation:
        """Reads the inputs, with defaults for unconnected ones."""

        def norm(port: InputPort, otherwise: float) -> float:
            """Returns the norm of the vector at an optional port."""
            return math.hypot(*port.Eval(context).tolist()) if port.HasValue(context) else otherwise

        def points() -> Vector:
            if not self._cloud.HasValue(context):
                return np.zeros((0, 3))
            return cloud_points(self._cloud.Eval(context))

        look_at = self._look_at.Eval(context) if self._look_at.HasValue(context) else None
        searches = norm(self._valid, 1.0) == 0.0
        has_ages = searches and self._image_ages.HasValue(context)
        return GazeObservation(
            context.get_time(),
            self._X_WT.Eval(context),
            None if searches else self._object_pose.Eval(context),
            norm(self._age, 0.0),
            float(self._image_ages.Eval(context).min()) if has_ages else 0.0,
            self._velocity.Eval(context) if self._velocity.HasValue(context) else np.zeros(3),
            norm(self._scan_enabled, 0.0) > 0.5,
            look_at if look_at is not None and np.isfinite(look_at).all() else None,
            points,
        )


def _is_enabled(index: int, state: GazeState) -> list[bool]:
    """Tells whether the camera of that index is in use, or none is yet."""
    return [state.camera in (index, -1)]
