"""Poses of torso, hands and cameras from joint encoders and odometry."""

from collections.abc import Mapping

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, InputPort, OutputPort

from pepper_drake.models.control_model import BODY_JOINTS, ControlModel
from pepper_drake.models.pepper import hand_frame
from pepper_drake.perception.cameras.camera import HeadCamera
from pepper_drake.systems.framework import LeafSystem, ValueProducer

CAMERA_FRAMES = {
    "camera_top": "CameraTop_optical_frame",
    "camera_bottom": "CameraBottom_optical_frame",
    "camera_depth": "CameraDepth_optical_frame",
}
"""Each camera's optical frame."""


def head_camera_pose(
    model: ControlModel, context: Context, name: str, cameras: Mapping[str, HeadCamera]
) -> RigidTransform:
    """Returns a camera's X_WC: as calibrated, or else as in the model.

    Args:
        model: Pepper's kinematics.
        context: Context of the model's plant.
        name: The station's name of the camera.
        cameras: The calibrated cameras by that name.
    """
    if name in cameras:
        return model.pose(context, "Head") @ cameras[name].X_HeadC
    return model.pose(context, CAMERA_FRAMES[name])


class RobotKinematics(LeafSystem):
    """Forward kinematics of the measured joints and of the base's odometry.

    The same system serves the simulated and the real robot: it reads only the robot's own
    measurements.

    .. pydrake_system::

        name: RobotKinematics
        input_ports:
        - joint_position
        - base_pose
        output_ports:
        - robot_position
        - torso_pose
        - left_hand_pose
        - right_hand_pose
        - left_hand_position
        - left_hand_orientation
        - right_hand_position
        - right_hand_orientation
        - camera_top_pose
        - camera_bottom_pose
        - camera_depth_pose

    Inputs: `joint_position` (15), rad, in the order of `BODY_JOINTS`; `base_pose` (3), x and y in m
    and yaw in rad, in W.
    Outputs: `robot_position` (18), the control model's positions; `torso_pose` X_WT; the hands'
    X_TH in the torso frame; the cameras' X_WC, all RigidTransform. The hands' poses are available
    as vectors, too: position (3), m, and unit quaternion w, x, y, z (4).

    Args:
        model: Pepper.
        cameras: Cameras whose calibrated pose replaces the model's, by the station's name.
    """

    def __init__(
        self, model: ControlModel, cameras: Mapping[str, HeadCamera] | None = None
    ) -> None:
        super().__init__()
        self._model = model
        self._cameras = cameras or {}
        self.joint_position_input: InputPort = self.DeclareVectorInputPort(
            "joint_position", len(BODY_JOINTS)
        )
        self.base_pose_input: InputPort = self.DeclareVectorInputPort("base_pose", 3)
        inputs = {self.joint_position_input.ticket(), self.base_pose_input.ticket()}
        self._kinematics = self.DeclareCacheEntry(
            "plant context at the measured positions",
            ValueProducer(
                allocate=lambda: Value[object](model.create_context()), calc=self._calc_kinematics
            ),
            prerequisites_of_calc=inputs,
        )
        self.DeclareVectorOutputPort(
            "robot_position",
            model.plant.num_positions(),
            self._calc_robot_position,
            prerequisites_of_calc=inputs,
        )
        self._declare_pose("torso_pose", "torso", None)
        for arm in ("left", "right"):
            self._declare_pose(f"{arm}_hand_pose", hand_frame(arm), "torso")
            self._declare_vectors(f"{arm}_hand", hand_frame(arm))
        for camera in CAMERA_FRAMES:
            self._declare_camera(camera)

    def _declare_pose(self, name: str, frame: str, relative_to: str | None) -> OutputPort:
        def calc(context: Context, output: Value) -> None:
            plant_context = self._kinematics.Eval(context)
            output.set_value(self._model.pose(plant_context, frame, relative_to))

        return self.DeclareAbstractOutputPort(
            name,
            lambda: Value(RigidTransform()),
            calc,
            prerequisites_of_calc={self._kinematics.ticket()},
        )

    def _declare_camera(self, name: str) -> None:
        def calc(context: Context, output: Value) -> None:
            plant_context = self._kinematics.Eval(context)
            output.set_value(head_camera_pose(self._model, plant_context, name, self._cameras))

        self.DeclareAbstractOutputPort(
            f"{name}_pose",
            lambda: Value(RigidTransform()),
            calc,
            prerequisites_of_calc={self._kinematics.ticket()},
        )

    def _declare_vectors(self, name: str, frame: str) -> None:
        def calc_position(context: Context, output: BasicVector) -> None:
            X_TH = self._model.pose(self._kinematics.Eval(context), frame, "torso")
            output.SetFromVector(X_TH.translation())

        def calc_orientation(context: Context, output: BasicVector) -> None:
            X_TH = self._model.pose(self._kinematics.Eval(context), frame, "torso")
            output.SetFromVector(X_TH.rotation().ToQuaternion().wxyz())

        ready = {self._kinematics.ticket()}
        self.DeclareVectorOutputPort(
            f"{name}_position", 3, calc_position, prerequisites_of_calc=ready
        )
        self.DeclareVectorOutputPort(
            f"{name}_orientation", 4, calc_orientation, prerequisites_of_calc=ready
        )

    def _calc_kinematics(self, context: Context, plant_context: Value) -> None:
        self._model.plant.SetPositions(
            plant_context.get_mutable_value(),
            self._model.positions(
                self.joint_position_input.Eval(context), self.base_pose_input.Eval(context)
            ),
        )

    def _calc_robot_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(
            self._model.positions(
                self.joint_position_input.Eval(context), self.base_pose_input.Eval(context)
            )
        )
