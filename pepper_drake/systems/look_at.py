"""The head follows the goal object, and the camera that sees it best is switched on."""

import functools
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    LeafSystem,
    OutputPort,
)

from pepper_drake.perception.camera import CAMERA_BOTTOM, CAMERA_TOP, HeadCamera
from pepper_drake.perception.gaze import choose_camera, clamp_head, image_offset, step_head

_HEAD, _VELOCITY = slice(0, 2), slice(2, 4)
_CAMERA, _IN_VIEW, _REACHABLE = 4, 5, 6

Vector = npt.NDArray[np.float64]


def _is_enabled(index: int, state: Vector) -> Vector:
    """1 when the camera of that index is in use, or when none is yet."""
    return np.isin(state[[_CAMERA]], (index, -1)).astype(float)


class LookAt(LeafSystem):
    """Turns the head so that a camera keeps the goal object in the middle of its image.

    .. pydrake_system::

        name: LookAt
        input_ports:
        - object_pose
        - X_WT
        - valid (optional)
        - head_position (optional)
        - resting_head (optional)
        output_ports:
        - head_position_command
        - head_velocity_command
        - in_view
        - reachable
        - best_camera
        - top_enabled
        - bottom_enabled

    `object_pose` (RigidTransform X_WO) and `valid` come from a GoalEstimator, `X_WT` is the torso's
    measured pose. While `valid` is zero the head goes to `resting_head` (2; rad), or stays where it
    is when that is unconnected. The head starts from `head_position` (2; measured HeadYaw,
    HeadPitch, rad), or from zero.

    `head_position_command` (2; HeadYaw, HeadPitch, rad) and `head_velocity_command` (2; rad/s) are
    held, within the limits of velocity and acceleration and within Pepper's joint limits, those of
    HeadPitch as HeadYaw has them. `in_view` is 1 when the commanded angles put the object into the
    best camera's image, `reachable` when any angles within the limits would; both are 0 without a
    valid object. `best_camera` is that camera's index in `cameras`, and `<name>_enabled` is 1 for
    it and 0 for the other, ready for CameraModel's `enabled`. Without a valid object all are
    enabled: whichever sees it first finds it.

    State: head angles, velocities, camera, in_view, reachable (7, discrete).
    Events: one periodic discrete update; one at initialization.

    Args:
        p_OP: The point on the object to look at (3,), m: its marker.
        cameras: The top and the bottom camera, in order of preference; the top one looks along
            with the depth camera.
        time_step: Period of the update, s.
        max_velocity: rad/s. Low, because images taken by a fast head are blurred.
        max_acceleration: rad/s^2.
    """

    def __init__(
        self,
        p_OP: npt.ArrayLike = (0.0, 0.0, 0.0),
        *,
        cameras: Sequence[HeadCamera] = (CAMERA_TOP, CAMERA_BOTTOM),
        time_step: float = 0.02,
        max_velocity: float = 1.0,
        max_acceleration: float = 4.0,
    ) -> None:
        super().__init__()
        self._p_OP = np.asarray(p_OP, dtype=float)
        self._cameras = tuple(cameras)
        self._time_step = time_step
        self._max_velocity = max_velocity
        self._max_acceleration = max_acceleration

        self._object_pose = self.DeclareAbstractInputPort("object_pose", Value(RigidTransform()))
        self._X_WT = self.DeclareAbstractInputPort("X_WT", Value(RigidTransform()))
        self._valid = self.DeclareVectorInputPort("valid", 1)
        self._head_position = self.DeclareVectorInputPort("head_position", 2)
        self._resting_head = self.DeclareVectorInputPort("resting_head", 2)

        self._state = self.DeclareDiscreteState(np.array([0, 0, 0, 0, -1, 0, 0], dtype=float))
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

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        state = discrete.get_mutable_vector(self._state).get_mutable_value()
        head = state[_HEAD].copy()
        state[_IN_VIEW] = state[_REACHABLE] = 0
        gaze = None
        p_TP = np.zeros(3)
        if not self._valid.HasValue(context) or self._valid.Eval(context)[0] > 0:
            X_TO = self._X_WT.Eval(context).InvertAndCompose(self._object_pose.Eval(context))
            p_TP = X_TO @ self._p_OP
            index = int(state[_CAMERA])
            current = self._cameras[index] if index >= 0 else None
            gaze = choose_camera(self._cameras, p_TP, current=current)
            target = gaze.head
            state[_CAMERA] = self._cameras.index(gaze.camera)
            state[_REACHABLE] = gaze.in_view
        else:
            resting = self._resting_head
            target = clamp_head(resting.Eval(context)) if resting.HasValue(context) else head
            state[_CAMERA] = -1
        state[_HEAD], state[_VELOCITY] = step_head(
            head,
            state[_VELOCITY],
            target,
            self._time_step,
            max_velocity=self._max_velocity,
            max_acceleration=self._max_acceleration,
        )
        if gaze is not None:
            state[_IN_VIEW] = image_offset(gaze.camera, state[_HEAD], p_TP) < 1
