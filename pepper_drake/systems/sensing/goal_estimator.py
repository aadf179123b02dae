"""Estimator of the goal object's pose from the images of the head's colour cameras."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, EventStatus, State
from pydrake.systems.sensors import ImageRgba8U

from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP, CameraIntrinsics
from pepper_drake.perception.cameras.image_future import IMMEDIATE
from pepper_drake.perception.goal.detection import MarkedObject, detect_goal
from pepper_drake.perception.goal.imm_filter import (
    GoalFilterParameters,
    GoalMeasurement,
    GoalState,
    update_goal,
)
from pepper_drake.perception.goal.marker_params import DEFAULT_MARKER, MarkerParams
from pepper_drake.systems.framework import LeafSystem

_THUMBNAIL_STEP = 7
"""Images are compared by every seventh pixel of every seventh row."""


@dataclass(frozen=True)
class _PendingMeasurement:
    """An image that is being processed.

    Attributes:
        measurement: Future of the measurement, which is None if the marker is not found.
        due: Simulation time at which the measurement becomes available [s].
    """

    measurement: Future[GoalMeasurement | None]
    due: float


@dataclass(frozen=True)
class _Memory:
    """The estimator's immutable state.

    Attributes:
        goal: The filter's estimate.
        time_stamps: Time stamp of the last image received from each camera [s].
        thumbnails: Subsampled pixels of it.
        usable: Time stamp of each camera's newest usable image [s].
        pending: Images being processed, oldest first.
    """

    goal: GoalState
    time_stamps: Mapping[str, float]
    thumbnails: Mapping[str, npt.NDArray[np.uint8]]
    usable: Mapping[str, float] = field(default_factory=dict)
    pending: tuple[_PendingMeasurement, ...] = ()

    def __deepcopy__(self, memo: dict) -> _Memory:
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self


class GoalEstimator(LeafSystem):
    """Finds the goal object's marker in the colour images and tracks the object's pose.

    .. pydrake_system::

        name: GoalEstimator
        input_ports:
        - color_image_top
        - time_stamp_top
        - X_WC_top
        - color_image_bottom
        - time_stamp_bottom
        - X_WC_bottom
        output_ports:
        - object_pose
        - valid
        - age
        - position_covariance
        - velocity
        - image_ages

    The three inputs of a camera (ImageRgba8U; s; RigidTransform at the image's time) come from a
    CameraModel; a camera with any of them unconnected is not used. The system checks for a new time
    stamp every `period` and processes each image once. Images that are empty, of another size than
    the camera's, older than the last or dated in the future are skipped. So is one identical to the
    last: real sensors are noisy, and identical pixels mean a frozen camera.

    `object_pose` (RigidTransform X_WO) is the pose last published: it changes when the estimate
    has moved by more than 3 mm or become much more certain (see GoalFilterParameters), is held
    while the marker is occluded, and is the identity before the first. `valid` is 1 while the goal
    was seen within the last `hold_seconds`, else 0. `age` [s] is the time since it was seen;
    infinite before the first.
    `position_covariance` is the row-major (3, 3) covariance [m^2] of the object's position in W;
    infinite on its diagonal before the first. `velocity` [m/s] is the object's in W. `image_ages`
    (2) [s] are the ages of the newest usable images of the top and of the bottom camera; infinite
    before the first.

    A measurement becomes available `latency` after its image was received, the time allowed for
    processing by the executor. The results do not depend on the executor's speed.

    State: filter and last images (abstract). Event: one periodic unrestricted update.

    Args:
        marked: The object to look for.
        top: The top camera's intrinsics; Pepper's if omitted.
        bottom: The bottom camera's intrinsics; Pepper's if omitted.
        parameters: Noise, gates and thresholds of the filter.
        marker: Detection of the marker, and its noise.
        period: Time between checks for a new image [s].
        offset: Time of the first check [s]; after the cameras', so that an image taken in the same
            period is used in it.
        latency: Processing time of an image [s]; at zero the simulation waits.
        executor: Processes the images; if omitted, the simulation waits for each.
        expects_noise: Whether identical images mean a frozen camera; set to False only when the
            images are rendered without noise.

    Examples:
        >>> import cv2
        >>> from pydrake.math import RollPitchYaw
        >>> from pydrake.systems.analysis import Simulator
        >>> X_OM = RigidTransform(RollPitchYaw(np.pi / 2, 0.0, 0.0), [0.0, 0.0, 0.0])
        >>> marked = MarkedObject(marker_id=7, marker_size=0.06, X_OM=X_OM)
        >>> estimator = GoalEstimator(marked, expects_noise=False)
        >>> simulator = Simulator(estimator)
        >>> context = simulator.get_mutable_context()
        >>> camera = CAMERA_TOP.intrinsics
        >>> image = ImageRgba8U(camera.width, camera.height)
        >>> image.mutable_data[:] = 255
        >>> book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        >>> marker = cv2.aruco.generateImageMarker(book, 7, 96)
        >>> image.mutable_data[192:288, 332:428, :3] = marker[:, :, None]
        >>> X_WC = RigidTransform(RollPitchYaw(-np.pi / 2, 0.0, -np.pi / 2), [0.0, 0.0, 1.0])
        >>> for time in (0.0, 0.2, 0.4):
        ...     _ = simulator.AdvanceTo(time)
        ...     for name, value in (
        ...         ("color_image", image), ("time_stamp", [time]), ("X_WC", X_WC)
        ...     ):
        ...         _ = estimator.GetInputPort(f"{name}_top").FixValue(context, value)
        >>> _ = simulator.AdvanceTo(0.45)
        >>> X_WO = estimator.GetOutputPort("object_pose").Eval(context)
        >>> print(X_WO.translation().round(2))  # 37 cm in front of the camera, 4 cm to its right.
        [ 0.37 -0.04  1.  ]
    """

    def __init__(
        self,
        marked: MarkedObject,
        *,
        top: CameraIntrinsics | None = None,
        bottom: CameraIntrinsics | None = None,
        parameters: GoalFilterParameters | None = None,
        marker: MarkerParams = DEFAULT_MARKER,
        period: float = 0.02,
        offset: float = 0.01,
        latency: float = 0.0,
        executor: Executor = IMMEDIATE,
        expects_noise: bool = True,
    ) -> None:
        super().__init__()
        self._executor = executor
        self.marked = marked
        self._parameters = GoalFilterParameters() if parameters is None else parameters
        self._marker = marker
        self._expects_noise = expects_noise
        self._latency = latency
        self._intrinsics = {
            "top": CAMERA_TOP.intrinsics if top is None else top,
            "bottom": CAMERA_BOTTOM.intrinsics if bottom is None else bottom,
        }
        self._images, self._stamps, self._poses = {}, {}, {}
        for name in self._intrinsics:
            self._images[name] = self.DeclareAbstractInputPort(
                f"color_image_{name}", Value(ImageRgba8U())
            )
            self._stamps[name] = self.DeclareVectorInputPort(f"time_stamp_{name}", 1)
            self._poses[name] = self.DeclareAbstractInputPort(
                f"X_WC_{name}", Value(RigidTransform())
            )
        self._memory = self.DeclareAbstractState(Value(_Memory(GoalState(), {}, {})))
        state = {self.abstract_state_ticket(self._memory)}
        state_and_time = state | {self.time_ticket()}
        self.DeclareAbstractOutputPort(
            "object_pose",
            lambda: Value(RigidTransform()),
            self._calc_object_pose,
            prerequisites_of_calc=state,
        )
        self.DeclareVectorOutputPort(
            "valid", 1, self._calc_valid, prerequisites_of_calc=state_and_time
        )
        self.DeclareVectorOutputPort("age", 1, self._calc_age, prerequisites_of_calc=state_and_time)
        self.DeclareVectorOutputPort(
            "position_covariance", 9, self._calc_covariance, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "velocity", 3, self._calc_velocity, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "image_ages", 2, self._calc_image_ages, prerequisites_of_calc=state_and_time
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset, self._look)

    def goal_state(self, context: Context) -> GoalState:
        """Returns the filter's estimate in this context."""
        return self._get_memory(context).goal

    def _get_memory(self, context: Context) -> _Memory:
        return context.get_abstract_state(int(self._memory)).get_value()

    def _look(self, context: Context, state: State) -> EventStatus:
        before = self._get_memory(context)
        memory = self._use_due(before, context.get_time())
        for name in self._intrinsics:
            memory = self._use_due(self._use_camera(context, name, memory), context.get_time())
        if memory is before:
            return EventStatus.DidNothing()
        state.get_mutable_abstract_state(int(self._memory)).set_value(memory)
        return EventStatus.Succeeded()

    def _use_camera(self, context: Context, name: str, memory: _Memory) -> _Memory:
        ports = (self._stamps[name], self._images[name], self._poses[name])
        if not all(port.HasValue(context) for port in ports):
            return memory
        time = float(self._stamps[name].Eval(context)[0])
        if not memory.time_stamps.get(name, -np.inf) < time <= context.get_time():
            return memory
        image = self._images[name].Eval(context).data
        thumbnail = image[::_THUMBNAIL_STEP, ::_THUMBNAIL_STEP].copy()
        last = memory.thumbnails.get(name)
        used = replace(
            memory,
            time_stamps={**memory.time_stamps, name: time},
            thumbnails={**memory.thumbnails, name: thumbnail},
        )
        is_frozen = last is not None and np.array_equal(last, thumbnail)
        camera = self._intrinsics[name]
        fits = image.shape[:2] == (camera.height, camera.width)
        if not fits or (self._expects_noise and is_frozen):
            return used
        track = memory.goal.track
        is_recent = track is not None and memory.goal.age(time) <= self._parameters.hold_seconds
        measurement = self._executor.submit(
            detect_goal,
            image.copy(),  # The port's value is overwritten by the next image.
            time,
            RigidTransform(self._poses[name].Eval(context)),
            camera,
            self.marked,
            p_WM_expected=track.p_WM if track is not None and is_recent else None,
            R_WO_expected=track.R_WO if track is not None else None,
            params=self._marker,
        )
        added = _PendingMeasurement(measurement, context.get_time() + self._latency)
        usable = {**memory.usable, name: time}
        return replace(used, usable=usable, pending=(*memory.pending, added))

    def _use_due(self, memory: _Memory, time: float) -> _Memory:
        """Applies the measurements that are due, waiting for them if necessary."""
        p_OM = self.marked.X_OM.translation()
        pending = memory.pending
        while pending and pending[0].due <= time + 1e-9:
            measurement = pending[0].measurement.result()
            pending = pending[1:]
            memory = replace(memory, pending=pending)
            if measurement is not None:
                goal = update_goal(memory.goal, measurement, p_OM, self._parameters)
                memory = replace(memory, goal=goal)
        return memory

    def _calc_object_pose(self, context: Context, output: Value) -> None:
        published = self.goal_state(context).published
        output.set_value(RigidTransform() if published is None else published)

    def _calc_valid(self, context: Context, output: BasicVector) -> None:
        valid = self.goal_state(context).is_valid(context.get_time(), self._parameters)
        output.SetAtIndex(0, float(valid))

    def _calc_age(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self.goal_state(context).age(context.get_time()))

    def _calc_image_ages(self, context: Context, output: BasicVector) -> None:
        usable = self._get_memory(context).usable
        times = [usable.get(name, -np.inf) for name in self._intrinsics]
        output.SetFromVector(context.get_time() - np.array(times))

    def _calc_covariance(self, context: Context, output: BasicVector) -> None:
        track = self.goal_state(context).track
        if track is None:
            output.SetFromVector(np.diag(np.full(3, np.inf)).ravel())
        else:
            output.SetFromVector(track.object_covariance(self.marked.X_OM.translation()).ravel())

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        track = self.goal_state(context).track
        output.SetFromVector(np.zeros(3) if track is None else track.velocity)
