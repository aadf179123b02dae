"""Depth images from a stereo pair of colour cameras."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, EventStatus, State
from pydrake.systems.sensors import ImageDepth16U, ImageRgba8U

from pepper_drake.perception.cameras.camera import CameraIntrinsics, HeadCamera
from pepper_drake.perception.cameras.image_future import completed_image, empty_image
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.perception.stereo.matching import StereoParameters, rectify
from pepper_drake.perception.stereo.pipeline import compute_stereo_depth
from pepper_drake.perception.stereo.segmentation import SegmentationParameters
from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.sensing.camera_model import Frame


class StereoDepth(LeafSystem):
    """Matches the images of two cameras and outputs a depth image, like a depth camera.

    .. pydrake_system::

        name: StereoDepth
        input_ports:
        - color_image_left
        - color_image_right
        - time_stamp
        - X_WC
        - position (optional)
        output_ports:
        - depth_image
        - time_stamp
        - X_WC
        - position

    The inputs come from two CameraModels that capture at the same time. `time_stamp`, `position`
    (the robot's joints) and `X_WC`, the pose of a frame in which the left camera is fixed, are
    those of the left one. The system checks for a new time stamp every `period` and does nothing
    without one. The images are segmented; pixels that belong to no segment or to the robot's own
    body are left out. Images that are empty, of different size or dated in the future are skipped.

    The outputs are a CameraModel's, of the rectified left camera, whose intrinsics are
    `intrinsics`: `depth_image` (ImageDepth16U, whole millimetres, 0 where nothing was matched),
    `time_stamp`, `X_WC` and `position`. A DepthPointCloudSource with these intrinsics and
    `stereo_obstacle_parameters` as parameters makes the cloud.

    State: the last depth image (abstract). Event: one periodic unrestricted update.

    Args:
        left: The left camera.
        right: The right camera.
        robot: The robot's shapes, to mask it; needs `position`.
        X_CL: Pose of the left camera in the frame of `X_WC`; the identity if omitted.
        parameters: Parameters of the matching.
        segmentation: Parameters of the segmentation.
        period: Time between checks for new images [s].
        offset: Time of the first check [s]; after the cameras'.
        num_positions: Size of the input `position`.

    Attributes:
        intrinsics: Intrinsics of the depth images.
    """

    def __init__(
        self,
        left: HeadCamera,
        right: HeadCamera,
        robot: RobotSolids | None = None,
        *,
        X_CL: RigidTransform | None = None,
        parameters: StereoParameters | None = None,
        segmentation: SegmentationParameters | None = None,
        period: float = 0.02,
        offset: float = 0.005,
        num_positions: int = 0,
    ) -> None:
        super().__init__()
        self._rectification = rectify(left, right)
        self._robot = robot
        self._X_CL = RigidTransform() if X_CL is None else X_CL
        self._parameters = StereoParameters() if parameters is None else parameters
        self._segmentation = SegmentationParameters() if segmentation is None else segmentation
        self.intrinsics: CameraIntrinsics = self._rectification.intrinsics

        self._left = self.DeclareAbstractInputPort("color_image_left", Value(ImageRgba8U()))
        self._right = self.DeclareAbstractInputPort("color_image_right", Value(ImageRgba8U()))
        self._time_stamp = self.DeclareVectorInputPort("time_stamp", 1)
        self._X_WC = self.DeclareAbstractInputPort("X_WC", Value(RigidTransform()))
        self._position = self.DeclareVectorInputPort("position", num_positions)

        none = Frame(empty_image(), -np.inf, 0, RigidTransform(), np.zeros(num_positions))
        self._frame = self.DeclareAbstractState(Value(none))
        state = {self.abstract_state_ticket(self._frame)}
        self.DeclareAbstractOutputPort(
            "depth_image",
            lambda: Value(ImageDepth16U()),
            self._calc_image,
            prerequisites_of_calc=state,
        )
        self.DeclareVectorOutputPort(
            "time_stamp", 1, self._calc_time_stamp, prerequisites_of_calc=state
        )
        self.DeclareAbstractOutputPort(
            "X_WC", lambda: Value(RigidTransform()), self._calc_X_WC, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "position", num_positions, self._calc_position, prerequisites_of_calc=state
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset, self._look)

    def _get_frame(self, context: Context) -> Frame:
        return context.get_abstract_state(int(self._frame)).get_value()

    def _look(self, context: Context, state: State) -> EventStatus:
        last = self._get_frame(context)
        time = float(self._time_stamp.Eval(context)[0])
        left, right = self._left.Eval(context).data, self._right.Eval(context).data
        size = (self.intrinsics.height, self.intrinsics.width)
        if left.shape[:2] != size or right.shape[:2] != size:
            return EventStatus.DidNothing()
        if not last.time < time <= context.get_time():
            return EventStatus.DidNothing()
        X_WC = self._rectification.rectified_pose(self._X_WC.Eval(context) @ self._X_CL)
        position, solids, poses = last.position, [], []
        if self._position.HasValue(context):
            position = self._position.Eval(context)
            if self._robot is not None:
                solids, poses = self._robot.solids, self._robot.poses(position)
        view = compute_stereo_depth(
            left,
            right,
            self._rectification,
            X_WC,
            solids,
            poses,
            self._parameters,
            self._segmentation,
        )
        millimetres = np.rint(1000 * view.depth).astype(np.uint16)[..., None]
        frame = Frame(completed_image(millimetres), time, last.number + 1, X_WC, position)
        state.get_mutable_abstract_state(int(self._frame)).set_value(frame)
        return EventStatus.Succeeded()

    def _calc_image(self, context: Context, output: Value) -> None:
        pixels = self._get_frame(context).image.pixels()
        image = ImageDepth16U(*pixels.shape[1::-1]) if pixels.size else ImageDepth16U()
        if pixels.size:
            image.mutable_data[:] = pixels
        output.set_value(image)

    def _calc_time_stamp(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self._get_frame(context).time)

    def _calc_X_WC(self, context: Context, output: Value) -> None:
        output.set_value(self._get_frame(context).X_WC)

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._get_frame(context).position)
