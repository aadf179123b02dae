"""Tracks a marker in the images of a camera."""

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, DiscreteValues
from pydrake.systems.sensors import ImageRgba8U

from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.goal.detection import MarkedObject, detect_goal
from pepper_drake.systems.framework import LeafSystem

_NEVER = [-np.inf, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


class MarkerTracker(LeafSystem):
    """Measures a marker's pose in every image, searching near its last pose.

    .. pydrake_system::

        name: MarkerTracker
        input_ports:
        - color_image
        - time_stamp
        output_ports:
        - sighting

    `color_image` (ImageRgba8U) and `time_stamp` (1) [s] are a CameraModel's. `sighting` (8) is the
    time of the last image in which the marker was seen [s], minus infinity before the first, and
    its p_TM [m] and unit quaternion w, x, y, z of R_TM at that time.

    State: the sighting (8), discrete with period `time_step`.
    """

    def __init__(
        self,
        marked: MarkedObject,
        intrinsics: CameraIntrinsics,
        X_TC: RigidTransform,
        time_step: float = 0.1,
    ) -> None:
        """Makes the tracker.

        Args:
            marked: The marker, on an object whose z axis is up when it is held upright.
            intrinsics: The camera's intrinsics.
            X_TC: Pose of its optical frame.
            time_step: Period of the update [s]; the camera's.
        """
        super().__init__()
        self._marked, self._intrinsics, self._X_TC = marked, intrinsics, X_TC
        self.image_input = self.DeclareAbstractInputPort("color_image", Value(ImageRgba8U()))
        self.time_stamp_input = self.DeclareVectorInputPort("time_stamp", 1)
        self._sighting = self.DeclareDiscreteState(_NEVER)
        # After the camera, which captures at multiples of its period.
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.5 * time_step, self._update)
        self.sighting_output = self.DeclareVectorOutputPort(
            "sighting", 8, self._calc_sighting, {self.discrete_state_ticket(self._sighting)}
        )

    def _update(self, context: Context, state: DiscreteValues) -> None:
        last = context.get_discrete_state(self._sighting).value()
        time = float(self.time_stamp_input.Eval(context)[0])
        if not time > last[0]:
            return
        seen_before = np.isfinite(last[0])
        X_OM = self._marked.X_OM
        expected = RotationMatrix(Quaternion(last[4:])) @ X_OM.rotation().inverse()
        measurement = detect_goal(
            self.image_input.Eval(context).data,
            time,
            self._X_TC,
            self._intrinsics,
            self._marked,
            p_WM_expected=last[1:4] if seen_before else None,
            R_WO_expected=expected if seen_before else None,
        )
        if measurement is None:
            return
        rotation = (measurement.R_WO @ X_OM.rotation()).ToQuaternion().wxyz()
        state.set_value(self._sighting, np.concatenate(([time], measurement.p_WM, rotation)))

    def _calc_sighting(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._sighting).value())
