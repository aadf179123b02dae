"""HardwareStation: a real robot with the ports of `PepperStation`, without ground truth."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    EventStatus,
    State,
)
from pydrake.systems.sensors import ImageDepth16U, ImageRgba8U

from pepper_drake.diagrams.robot_signals import calibrated_commands, calibrated_joints
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.hardware.link_process import LinkProcess
from pepper_drake.hardware.mailbox import CAMERA_NAMES, STREAM
from pepper_drake.hardware.paced_run import DiagramClock
from pepper_drake.models.control_model import BODY_JOINTS, CONTROL_PERIOD, ControlModel
from pepper_drake.models.objects import NO_SCENE, SceneModels
from pepper_drake.models.robot_calibration import RobotCalibration
from pepper_drake.models.robot_wear import WearSizes
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.perception.calibration.calibrated_cameras import (
    HEAD_CAMERA_MODELS,
    calibrated_cameras,
)
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.systems.framework import Diagram, LeafSystem, build_into
from pepper_drake.systems.robot.robot_kinematics import RobotKinematics, head_camera_pose
from pepper_drake.systems.sensing.camera_model import fill_image

Vector = npt.NDArray[np.float64]

_VELOCITY_SAMPLES = 3
_LEFT = np.full(len(HANDS), np.nan)
_HAND_PORTS = tuple(
    f"{arm}_hand_{what}"
    for arm in ("left", "right")
    for what in ("pose", "position", "orientation")
)


@dataclass(frozen=True)
class LinkStatus:
    """Status of the link for the station.

    Attributes:
        is_fresh: Whether the state is recent enough to act upon.
        age: Age of the state [s].
        round_trip: Round-trip time of a call [s].
        fault: Word of the fault, or "".
        message: Sentence of the fault.
    """

    is_fresh: bool = True
    age: float = 0.0
    round_trip: float = 0.0
    fault: str = ""
    message: str = ""


@dataclass(frozen=True)
class _Measured:
    """The newest states (time, joints, base and hands; newest last) and the link's status."""

    rows: tuple[tuple[float, Vector], ...]
    status: LinkStatus

    def __deepcopy__(self, memo: dict) -> "_Measured":
        return self


@dataclass(frozen=True)
class _Received:
    """The newest image of a camera, with the measurements at its capture."""

    time: float
    pixels: npt.NDArray[Any]
    X_WC: RigidTransform
    position: Vector
    number: int

    def __deepcopy__(self, memo: dict) -> "_Received":
        return self


class RobotInterface(LeafSystem):
    """The robot's measurements and commands, exchanged with the link every 20 ms.

    .. pydrake_system::

        name: RobotInterface
        input_ports:
        - joint_position_command
        - base_velocity_command
        - hand_command (optional)
        - camera_top.enabled (optional)
        - camera_bottom.enabled (optional)
        - camera_depth.enabled (optional)
        output_ports:
        - joint_position
        - joint_velocity
        - base_pose
        - hand_opening
        - measurement_age
        - missing_joint
        - link_status

    Inputs: `joint_position_command` (15), rad, in the order of `BODY_JOINTS`, of which head and
    working arm are passed on; `base_velocity_command` (3), m/s, m/s, rad/s in the base's frame;
    `hand_command` (2), openings in the order of `HANDS`, NaN for a hand that is not moved;
    `NAME.enabled` (1), 0 for no images of that camera; unconnected, the camera is on.
    Outputs: `joint_position` (15), rad; `joint_velocity` (15), rad/s, over three measurements;
    `base_pose` (3), x, y in m and yaw in rad, by the robot's odometry; `hand_opening` (2);
    `measurement_age` (2), time since joints and base were measured [s]; `missing_joint` (1),
    always -1: the robot measures all joints at once; `link_status`, a LinkStatus.
    State: the newest measurements (abstract) and the last command (15). Events: a periodic
    unrestricted update to read, a periodic publish to command.
    """

    def __init__(self, link: LinkProcess) -> None:
        """Declares the ports.

        Args:
            link: A link that is ready.
        """
        super().__init__()
        self._link, self._wall = link, link.clock.now
        n = len(BODY_JOINTS)
        self._command = self.DeclareVectorInputPort("joint_position_command", n)
        self._base = self.DeclareVectorInputPort("base_velocity_command", 3)
        self._hands = self.DeclareVectorInputPort("hand_command", len(HANDS))
        self._enabled = [self.DeclareVectorInputPort(f"{c}.enabled", 1) for c in CAMERA_NAMES]
        self._measured = self.DeclareAbstractState(Value(self._read(())))
        self._last_command = self.DeclareDiscreteState(np.full(n, np.nan))
        ticket = {self.abstract_state_ticket(self._measured)}
        for name, size, calc in (
            ("joint_position", n, lambda rows: rows[-1][1][:n]),
            ("joint_velocity", n, _velocity),
            ("base_pose", 3, lambda rows: rows[-1][1][n : n + 3]),
            ("hand_opening", len(HANDS), lambda rows: rows[-1][1][n + 3 :]),
        ):
            self.DeclareVectorOutputPort(
                name, size, self._calc_of(calc), prerequisites_of_calc=ticket
            )
        self.DeclareVectorOutputPort(
            "measurement_age", 2, self._calc_age, prerequisites_of_calc=ticket
        )
        self.DeclareVectorOutputPort(
            "missing_joint",
            1,
            lambda context, output: output.SetAtIndex(0, -1.0),
            prerequisites_of_calc={self.nothing_ticket()},
        )
        self.DeclareAbstractOutputPort(
            "link_status",
            lambda: Value(LinkStatus()),
            self._calc_status,
            prerequisites_of_calc=ticket,
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(CONTROL_PERIOD, 0.0, self._update)
        self.DeclarePeriodicPublishEvent(CONTROL_PERIOD, 0.0, self._send)

    def _read(self, before: tuple[tuple[float, Vector], ...]) -> _Measured:
        state = self._link.state()
        stamp = float(state["time"])
        row = np.concatenate((state["positions"], state["base_pose"], state["hands"]))
        rows = before
        if not rows or stamp > rows[-1][0]:
            rows = (*before, (stamp, row))[-_VELOCITY_SAMPLES:]
        age = self._wall() - stamp
        fault = str(state["fault"])
        return _Measured(
            rows,
            LinkStatus(
                age < 0.1 and not fault,
                age,
                float(state["round_trip"]),
                fault,
                str(state["detail"]),
            ),
        )

    def _get(self, context: Context) -> _Measured:
        return context.get_abstract_state(int(self._measured)).get_value()

    def _update(self, context: Context, state: State) -> EventStatus:
        measured = self._read(self._get(context).rows)
        state.get_mutable_abstract_state(int(self._measured)).set_value(measured)
        state.get_mutable_discrete_state(self._last_command).SetFromVector(
            self._command.Eval(context)
        )
        return EventStatus.Succeeded()

    def _send(self, context: Context) -> EventStatus:
        command = self._command.Eval(context)
        last = context.get_discrete_state(self._last_command).value()
        rate = (command - last) / CONTROL_PERIOD if np.isfinite(last).all() else 0.0 * command
        self._link.command(
            mode=STREAM,
            positions=command,
            velocities=rate,
            base_velocity=self._base.Eval(context),
            hands=self._hands.Eval(context) if self._hands.HasValue(context) else _LEFT,
            enabled=[
                not p.HasValue(context) or bool(p.Eval(context)[0] > 0) for p in self._enabled
            ],
        )
        return EventStatus.Succeeded()

    def _calc_of(
        self, calc: Callable[[tuple[tuple[float, Vector], ...]], Vector]
    ) -> Callable[[Context, BasicVector], None]:
        def calc_port(context: Context, output: BasicVector) -> None:
            output.SetFromVector(calc(self._get(context).rows))

        return calc_port

    def _calc_age(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([self._get(context).status.age] * 2)

    def _calc_status(self, context: Context, output: Value) -> None:
        output.set_value(self._get(context).status)


def _velocity(rows: tuple[tuple[float, Vector], ...]) -> Vector:
    """Returns the joints' mean velocity (15,) over the newest measurements [rad/s]."""
    n = len(BODY_JOINTS)
    if len(rows) < 2:
        return np.zeros(n)
    (t0, first), (t1, last) = rows[0], rows[-1]
    return (last[:n] - first[:n]) / (t1 - t0)


class ReceivedCamera(LeafSystem):
    """A camera of the robot: its newest image, and the robot's positions at its capture.

    .. pydrake_system::

        name: ReceivedCamera
        output_ports:
        - image
        - time_stamp
        - X_WC
        - position

    Outputs: `image`, an ImageRgba8U, or an ImageDepth16U in millimetres; `time_stamp` (1), s, in
    the diagram's time, minus infinity before the first image; `X_WC`, a RigidTransform, and
    `position` (18), the control model's positions, both of the capture. State: the newest image
    (abstract). Events: a periodic unrestricted update that polls it.
    """

    def __init__(
        self,
        link: LinkProcess,
        camera: int,
        model: ControlModel,
        clock: DiagramClock,
        period: float = CONTROL_PERIOD,
        calibration: RobotCalibration | None = None,
    ) -> None:
        """Declares the ports.

        Args:
            link: A link that is ready.
            camera: NAOqi's id of the camera.
            model: Pepper's kinematics.
            clock: The diagram's clock.
            period: Polling period [s].
            calibration: Of the robot, or None.
        """
        super().__init__()
        self._record = link.mailbox.images[camera]
        self._model, self._clock = model, clock
        self._name = CAMERA_NAMES[camera]
        self._cameras = calibrated_cameras(calibration)
        self._offsets = np.zeros(len(BODY_JOINTS))
        if calibration is not None:
            self._offsets += calibration.joint_values("offset")
        self._is_depth = CAMERA_NAMES[camera] == "camera_depth"
        none = _Received(
            -np.inf,
            np.zeros((0, 0, 1 if self._is_depth else 4)),
            RigidTransform(),
            np.zeros(model.plant.num_positions()),
            self._record.writes,
        )
        self._state = self.DeclareAbstractState(Value(none))
        ticket = {self.abstract_state_ticket(self._state)}
        image_type = ImageDepth16U if self._is_depth else ImageRgba8U
        self.DeclareAbstractOutputPort(
            "image", lambda: Value(image_type()), self._calc_image, prerequisites_of_calc=ticket
        )
        self.DeclareVectorOutputPort(
            "time_stamp", 1, self._calc_time_stamp, prerequisites_of_calc=ticket
        )
        self.DeclareAbstractOutputPort(
            "X_WC", lambda: Value(RigidTransform()), self._calc_pose, prerequisites_of_calc=ticket
        )
        self.DeclareVectorOutputPort(
            "position",
            model.plant.num_positions(),
            self._calc_position,
            prerequisites_of_calc=ticket,
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def _get(self, context: Context) -> _Received:
        return context.get_abstract_state(int(self._state)).get_value()

    def _update(self, context: Context, state: State) -> EventStatus:
        writes = self._record.writes
        if writes == self._get(context).number:
            return EventStatus.DidNothing()
        record = self._record.read()
        height, width = int(record["height"]), int(record["width"])
        data = np.array(record["pixels"])
        pixels: npt.NDArray[Any]
        if self._is_depth:
            pixels = data[: 2 * height * width].view(np.uint16).reshape(height, width, 1)
        else:
            pixels = np.full((height, width, 4), 255, np.uint8)
            pixels[..., :3] = data[: 3 * height * width].reshape(height, width, 3)
        joints = record["positions"] - self._offsets
        position = self._model.positions(joints, record["base_pose"])
        plant_context = self._model.create_context()
        self._model.plant.SetPositions(plant_context, position)
        state.get_mutable_abstract_state(int(self._state)).set_value(
            _Received(
                self._clock.at(float(record["time"])),
                pixels,
                head_camera_pose(self._model, plant_context, self._name, self._cameras),
                position,
                writes,
            )
        )
        return EventStatus.Succeeded()

    def _calc_image(self, context: Context, output: Value) -> None:
        fill_image(output.get_mutable_value(), self._get(context).pixels)

    def _calc_time_stamp(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self._get(context).time)

    def _calc_pose(self, context: Context, output: Value) -> None:
        output.set_value(self._get(context).X_WC)

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._get(context).position)


class HardwareStation(Diagram):
    """A robot behind a link, in the place of `PepperStation`.

    .. pydrake_system::

        name: HardwareStation
        input_ports:
        - joint_position_command
        - base_velocity_command
        - hand_command (optional)
        - camera_top.enabled
        - camera_bottom.enabled
        - camera_depth.enabled
        output_ports:
        - joint_position
        - joint_velocity
        - base_pose
        - hand_opening
        - measurement_age
        - missing_joint
        - link_status
        - robot_position
        - torso_pose
        - left_hand_pose
        - left_hand_position
        - left_hand_orientation
        - right_hand_pose
        - right_hand_position
        - right_hand_orientation
        - camera_top.image
        - camera_top.pose
        - camera_top.time_stamp
        - camera_top.position
        - camera_bottom.image
        - camera_bottom.pose
        - camera_bottom.time_stamp
        - camera_bottom.position
        - camera_depth.image
        - camera_depth.pose
        - camera_depth.time_stamp
        - camera_depth.position

    The ports have the meaning of `PepperStation`'s; there are no `ground_truth.*`. It must be
    advanced in real time (`paced_run.run_paced`).

    Attributes:
        link: The link.
        control_model: Pepper's kinematics.
        depth_intrinsics: Of the depth camera's images.
        config: As of a simulated station with noisy cameras.
        scene_models: No bodies: the world is only known by perception.
        clock: The diagram's clock.
    """

    def __init__(
        self,
        link: LinkProcess,
        model: ControlModel,
        clock: DiagramClock | None = None,
        calibration: RobotCalibration | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            link: A link that is ready.
            model: Pepper's kinematics.
            clock: The diagram's clock; a new one that starts now if left out.
            calibration: Of the robot, or None.
        """
        super().__init__()
        self.link, self.control_model = link, model
        self.clock = clock or DiagramClock(link.clock.now, link.clock.sleep)
        cameras = calibrated_cameras(calibration)
        depth = (HEAD_CAMERA_MODELS | cameras)["camera_depth"]
        self.depth_intrinsics: CameraIntrinsics = depth.intrinsics
        self.scene_models: SceneModels = NO_SCENE
        self.config = StationConfig(calibration=calibration)
        builder = DiagramBuilder()
        robot = builder.AddNamedSystem("robot", RobotInterface(link))
        name = "joint_position_command"
        commands = calibrated_commands(builder, robot.GetInputPort(name), calibration)
        builder.ExportInput(commands, name)
        for name in ("base_velocity_command", "hand_command"):
            builder.ExportInput(robot.GetInputPort(name), name)
        joints = calibrated_joints(builder, robot.GetOutputPort("joint_position"), calibration)
        builder.ExportOutput(joints, "joint_position")
        measured = ("joint_velocity", "base_pose", "hand_opening", "measurement_age")
        for name in (*measured, "missing_joint", "link_status"):
            builder.ExportOutput(robot.GetOutputPort(name), name)
        kinematics = builder.AddNamedSystem("kinematics", RobotKinematics(model, cameras))
        builder.Connect(joints, kinematics.joint_position_input)
        builder.Connect(robot.GetOutputPort("base_pose"), kinematics.base_pose_input)
        for name in ("robot_position", "torso_pose", *_HAND_PORTS):
            builder.ExportOutput(kinematics.GetOutputPort(name), name)
        for number, name in enumerate(CAMERA_NAMES):
            builder.ExportInput(robot.GetInputPort(f"{name}.enabled"), f"{name}.enabled")
            camera = builder.AddNamedSystem(
                name,
                ReceivedCamera(link, number, model, self.clock, calibration=calibration),
            )
            exports = (("image", "image"), ("X_WC", "pose"), ("time_stamp", "time_stamp"))
            for port, export in (*exports, ("position", "position")):
                builder.ExportOutput(camera.GetOutputPort(port), f"{name}.{export}")
        build_into(builder, self)

    def obstacle_parameters(self, parameters: ObstacleParameters) -> ObstacleParameters:
        """Adapts the parameters of obstacle detection to the usual wear of a real robot."""
        approach = parameters.approach.with_pointing_error(WearSizes().pointing_error)
        return replace(parameters, approach=approach)
