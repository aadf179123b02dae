"""Signals between a simulated robot and its controllers, with wear, faults and guards."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import Adder, ConstantVectorSource, MatrixGain

from pepper_drake.diagrams.selection import add_selector
from pepper_drake.models.control_model import BODY_JOINTS, CommandLimits
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.robot_calibration import RobotCalibration
from pepper_drake.models.robot_wear import RobotWear
from pepper_drake.perception.cameras.camera import HeadCamera, moved_camera
from pepper_drake.systems.faults.fault_memory import Role
from pepper_drake.systems.faults.fault_set import FaultSet
from pepper_drake.systems.robot.base_velocity_controller import BaseVelocityController
from pepper_drake.systems.robot.joint_command_interpolator import JointCommandInterpolator
from pepper_drake.systems.robot.measurement_guard import MeasurementAges, MeasurementGuard
from pepper_drake.systems.robot.worn_joints import CommandLatency, JointBacklash

STATION_SIGNALS = ("top", "bottom", "depth", "stamps", "encoders", "base_pose")
"""The signals that can fail inside a station; the others fail outside it."""

_BEYOND = 0.3
"""Joint measurements farther outside the limits are impossible [rad]."""
_FARTHEST = 100.0
"""Larger base positions [m] and yaw angles [rad] are impossible."""


def add_offset(
    builder: DiagramBuilder, name: str, port: OutputPort, offset: Sequence[float]
) -> OutputPort:
    """Adds a constant (n,) to a vector port."""
    constant = builder.AddNamedSystem(f"{name}_offset", ConstantVectorSource(offset))
    adder = builder.AddNamedSystem(name, Adder(2, len(offset)))
    builder.Connect(port, adder.get_input_port(0))
    builder.Connect(constant.get_output_port(), adder.get_input_port(1))
    return adder.get_output_port()


def calibrated_commands(
    builder: DiagramBuilder, commands: InputPort, calibration: RobotCalibration | None
) -> InputPort:
    """Returns the input port for commands of true joint angles.

    Args:
        builder: The station's builder.
        commands: Input port for commands in encoder readings (15) [rad].
        calibration: The robot's calibration; None for none.
    """
    if calibration is None:
        return commands
    offsets = builder.AddNamedSystem(
        "calibrated_offsets", ConstantVectorSource(calibration.joint_values("offset"))
    )
    adder = builder.AddNamedSystem("calibrated_commands", Adder(2, len(BODY_JOINTS)))
    builder.Connect(offsets.get_output_port(), adder.get_input_port(1))
    builder.Connect(adder.get_output_port(), commands)
    return adder.get_input_port(0)


def calibrated_joints(
    builder: DiagramBuilder, encoders: OutputPort, calibration: RobotCalibration | None
) -> OutputPort:
    """Returns the true joint angles (15) [rad], from encoder readings and a calibration."""
    if calibration is None:
        return encoders
    offsets = -np.array(calibration.joint_values("offset"))
    return add_offset(builder, "calibrated_joints", encoders, offsets.tolist())


def add_servos(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    pepper: ModelInstanceIndex,
    base_pose: OutputPort,
    start: Mapping[str, float],
    *,
    wear: RobotWear | None,
    calibration: RobotCalibration | None,
    period: float,
) -> OutputPort | None:
    """Computes the desired state of the plant's servos from joint and base commands.

    Args:
        builder: The station's; it exports `joint_position_command` and `base_velocity_command`.
        plant: The plant with Pepper.
        pepper: Pepper's model instance.
        base_pose: True x, y [m], yaw [rad] of the base in W.
        start: Positions of all joints by name at the start.
        wear: The robot's errors; None for none.
        calibration: Estimate of these errors; None for none.
        period: The control period [s].

    Returns:
        The motors' lead over the joints (15) [rad], if there is backlash.
    """
    joints = builder.AddNamedSystem(
        "joint_servo", JointCommandInterpolator(len(BODY_JOINTS), period)
    )
    commands = add_motor_commands(
        builder, joints.get_input_port(), [start[name] for name in BODY_JOINTS], wear, period
    )
    builder.ExportInput(
        calibrated_commands(builder, commands, calibration), "joint_position_command"
    )
    joint_state, gap = add_slack(builder, joints.get_output_port(), wear, period)
    base = builder.AddNamedSystem(
        "base_servo",
        BaseVelocityController([start[name] for name in JOINT_GROUPS["base"]], time_step=period),
    )
    builder.ExportInput(base.velocity_input, "base_velocity_command")
    builder.Connect(base_pose, base.base_pose_input)

    n, nb = len(BODY_JOINTS), len(JOINT_GROUPS["base"])
    places = {name: (0, k) for k, name in enumerate(BODY_JOINTS)}
    places |= {name: (1, k) for k, name in enumerate(JOINT_GROUPS["base"])}
    order = [
        places[plant.get_joint_actuator(index).joint().name()]
        for index in plant.GetJointActuatorIndices(pepper)
    ]
    rates = [(source, k + (n, nb)[source]) for source, k in order]
    desired = add_selector(
        builder, "actuator_order", [joint_state, base.get_output_port()], [*order, *rates]
    )
    builder.Connect(desired, plant.get_desired_state_input_port(pepper))
    return gap


def add_motor_commands(
    builder: DiagramBuilder,
    commands: InputPort,
    start: Sequence[float],
    wear: RobotWear | None,
    period: float,
) -> InputPort:
    """Adds a worn robot's command latency and encoder offsets before the joint servos.

    Args:
        builder: The station's builder.
        commands: Input port of the servos (15) [rad].
        start: The joints at the start (15,) [rad].
        wear: The robot's errors; None for none.
        period: The control period [s].

    Returns:
        The input port for the commands.
    """
    if wear is None:
        return commands
    steps = round(wear.command_latency / period)
    latency = builder.AddNamedSystem(
        "command_latency", CommandLatency(start, max(steps, 1), period)
    )
    offset_command = add_offset(
        builder,
        "encoder_command",
        latency.get_output_port(),
        (-wear.encoder_offset).tolist(),
    )
    builder.Connect(offset_command, commands)
    return latency.command_input


def add_slack(
    builder: DiagramBuilder, motors: OutputPort, wear: RobotWear | None, period: float
) -> tuple[OutputPort, OutputPort | None]:
    """Adds a worn robot's backlash between motors and joints.

    Args:
        builder: The station's builder.
        motors: Desired positions and velocities of the motors (30) [rad, rad/s].
        wear: The robot's errors; None for none.
        period: The control period [s].

    Returns:
        Desired state of the joints (30), and the motors' lead over them (15) [rad], if there is
        backlash.
    """
    if wear is None:
        return motors, None
    # Updated after each of the interpolator's two ticks per period.
    slack = builder.AddNamedSystem(
        "joint_backlash",
        JointBacklash(wear.backlash, time_step=0.5 * period, offset=0.25 * period),
    )
    builder.Connect(motors, slack.motor_input)
    return slack.GetOutputPort("joint_state"), slack.GetOutputPort("gap")


def add_measurements(
    builder: DiagramBuilder,
    joints: OutputPort,
    base: OutputPort,
    start: dict[str, float],
    *,
    gap: OutputPort | None,
    wear: RobotWear | None,
    calibration: RobotCalibration | None,
    faults: FaultSet,
    failing_joints: Sequence[int],
    limits: CommandLimits,
) -> dict[str, OutputPort]:
    """Adds the measurements of joints and base, with wear, faults, guards and calibration.

    Args:
        builder: The station's; it exports the measurements, `measurement_age` and `missing_joint`.
        joints: True joint positions (15) [rad].
        base: True x, y [m], yaw [rad] of the base in W.
        start: Positions of all joints by name at the start.
        gap: Lead of the motors, which the encoders measure, over the joints (15) [rad].
        wear: The robot's errors; None for none.
        calibration: Estimate of these errors; None for none.
        faults: Faults of encoders and odometry.
        failing_joints: Indices of the joints one of which fails if an encoder fails.
        limits: Limits of the joints; measurements far outside are rejected.

    Returns:
        The ports `joint_position` (15) and `base_pose` (3); always finite numbers.
    """
    if wear is not None:
        joints = add_offset(builder, "encoders", joints, wear.encoder_offset.tolist())
        if gap is not None:
            ahead = builder.AddNamedSystem("motor_encoders", Adder(2, len(BODY_JOINTS)))
            builder.Connect(joints, ahead.get_input_port(0))
            builder.Connect(gap, ahead.get_input_port(1))
            joints = ahead.get_output_port()
        # The displacement since the start is measured too large or too small.
        origin = np.array([start[name] for name in JOINT_GROUPS["base"]])
        slip = builder.AddNamedSystem("odometry_slip", MatrixGain(D=np.diag(1.0 + wear.odometry)))
        builder.Connect(base, slip.get_input_port())
        base = add_offset(
            builder, "odometry", slip.get_output_port(), (-wear.odometry * origin).tolist()
        )
    joints = faults.tap(
        builder, "encoders", {"position": (Role.VALUE, joints)}, elements=failing_joints
    )["position"]
    base = faults.tap(builder, "base_pose", {"pose": (Role.VALUE, base)})["pose"]
    ports, ages, missing = {}, [], None
    joint_range = (limits.position_lower - _BEYOND, limits.position_upper + _BEYOND)
    for name, port, names, (lower, upper) in (
        ("joint_position", joints, BODY_JOINTS, joint_range),
        ("base_pose", base, JOINT_GROUPS["base"], (-_FARTHEST, _FARTHEST)),
    ):
        guard = builder.AddNamedSystem(
            f"{name}_guard",
            MeasurementGuard([start[joint] for joint in names], lower=lower, upper=upper),
        )
        builder.Connect(port, guard.measured_input)
        ports[name] = guard.GetOutputPort("measured")
        if name == "joint_position":
            ports[name] = calibrated_joints(builder, ports[name], calibration)
        ages.append(guard.GetOutputPort("age"))
        missing = guard.GetOutputPort("missing") if missing is None else missing
        builder.ExportOutput(ports[name], name)
    both = builder.AddNamedSystem("measurement_age", MeasurementAges())
    for k, age in enumerate(ages):
        builder.Connect(age, both.get_input_port(k))
    builder.ExportOutput(both.get_output_port(), "measurement_age")
    assert missing is not None
    builder.ExportOutput(missing, "missing_joint")
    return ports


def worn_camera(wear: RobotWear | None, name: str, camera: HeadCamera) -> HeadCamera:
    """Returns a camera with a worn robot's errors, by the station's name of it."""
    own = None if wear is None else wear.cameras.get(name)
    if own is None:
        return camera
    return moved_camera(camera, own.position, own.rotation, own.focal)


def add_camera_faults(
    builder: DiagramBuilder,
    faults: FaultSet,
    name: str,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Injects the faults of a camera and of all time stamps behind a camera's ports.

    Args:
        builder: The station's builder.
        faults: The run's faults.
        name: The camera's name, as in "camera_depth".
        ports: Its ports `image`, `pose`, `time_stamp` and `position`.

    Returns:
        The ports to export instead, under the same names.
    """
    roles = {"image": Role.VALUE, "time_stamp": Role.STAMP}
    signal = name.removeprefix("camera_")
    carried = {key: (roles.get(key, Role.CARRIED), port) for key, port in ports.items()}
    ports = faults.tap(builder, signal, carried)
    # For a fault of the time stamps themselves, the stamp is the value.
    stamps = {"time_stamp": (Role.VALUE, ports["time_stamp"])}
    return ports | faults.tap(builder, "stamps", stamps, suffix=f"_{signal}")


def export_triggers(builder: DiagramBuilder, faults: FaultSet) -> None:
    """Exports `fault_trigger` for all faults of a builder that wait for the arm to start."""
    port = None
    for injector in faults.waiting(builder):
        trigger = injector.GetInputPort("trigger")
        if port is None:
            port = builder.ExportInput(trigger, "fault_trigger")
        else:
            builder.ConnectInput(port, trigger)
