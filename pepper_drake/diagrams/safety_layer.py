"""Safety: clearances, limits and stops between the desired commands and the robot."""

from dataclasses import dataclass, field, replace

from pydrake.systems.framework import DiagramBuilder, System
from pydrake.systems.primitives import Adder, ZeroOrderHold

from pepper_drake.diagrams.robot_signals import export_triggers
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    ControlModel,
    arm_joints,
)
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.scene import Scene
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.safety.contact_detection import ContactParams
from pepper_drake.systems.faults.fault_memory import Role
from pepper_drake.systems.faults.fault_set import FaultSet
from pepper_drake.systems.framework import Diagram, build_into, connect, export_input
from pepper_drake.systems.robot.base_command_limiter import BaseCommandLimiter
from pepper_drake.systems.robot.base_position_controller import (
    BaseMotion,
    BasePositionController,
)
from pepper_drake.systems.robot.body_watch import BodyWatch
from pepper_drake.systems.robot.cloud_clearance import CloudClearance
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor
from pepper_drake.systems.robot.torso_lean import LeanMotion, TorsoLean

_MONITORED = ("measurement_age", "missing_joint", "goal_gap", "reset")
"""Inputs used by the safety monitor alone."""


@dataclass
class SafetyParams:
    """Thresholds and periods of the safety layer."""

    time_step: float = 0.05
    """Period at which clearances are measured [s]; depth images come every 0.2 s."""
    lookahead: float = 0.1
    """Time by which the arm's motion is extrapolated [s]: `time_step` plus the braking time."""
    slowest_approach: float = 0.01
    """Speed below which a link does not approach an obstacle [m/s]; exceeds noise and backlash."""
    base_clearance: float = 0.01
    """Clearance of the body below which the base stops [m]; its spheres protrude by 1 cm."""
    base_delay: float = 0.1
    """Time until the base begins to brake [s]."""
    longest_gap: float = 0.12
    """Longest tolerated gap in measurements and estimates [s]: six control periods."""
    catch_time: float = 0.5
    """Time for joints that were moved by hand to come to rest [s]."""
    link_gap: float = 2.0
    """`longest_gap` of a robot over a network link [s]. The link itself holds the arm after 0.1 s,
    continues when measurements return, and ends the run after 1 s."""
    base: BaseMotion = field(default_factory=BaseMotion)
    link_base: BaseMotion = field(
        default_factory=lambda: BaseMotion(
            has_reference=False, position_tolerance=0.005, yaw_tolerance=0.01
        )
    )
    """`base` of a robot over a network link, whose base is sent to poses, as by ALMotion's
    `moveTo`, with these tolerances."""

    lean: LeanMotion = field(default_factory=LeanMotion)
    """Leaning forward at the hip."""

    def over_link(self) -> "SafetyParams":
        """Returns the parameters for a robot over a network link."""
        return replace(self, longest_gap=self.link_gap, base=self.link_base)


class SafetyLayer(Diagram):
    """Monitors the clearances of arm and body, checks all commands, drives the base, and stops.

    .. pydrake_system::

        name: SafetyLayer
        input_ports:
        - cloud
        - cloud_torso
        - predicted_cloud
        - predicted_cloud_torso
        - head_command
        - arm_command
        - arm_velocity
        - arm_active
        - limp
        - base_goal
        - hip_pitch_goal
        - started
        - joint_position
        - arm_position
        - base_pose
        - measurement_age
        - missing_joint
        - goal_gap
        - reset
        output_ports:
        - joint_position_command
        - base_velocity_command
        - arrived
        - clearance
        - body_clearance
        - predicted_clearance
        - base_blocked
        - stop_reason
        - stop_joint

    Inputs: the clouds in W and T (PointCloud); `head_command` (2), `arm_command` (5) [rad] and
    `arm_velocity` (5) [rad/s], as desired; `base_goal` x, y [m], yaw [rad] in W; `hip_pitch_goal`
    (1) [rad]; `arm_active` (1), not zero while the arm moves by itself; `started` (1), not zero
    once it has started; the others: see `SafetyMonitor`. Outputs: `joint_position_command` (15)
    [rad] and
    `base_velocity_command` (3) [m/s, m/s, rad/s]; `clearance` of the arm and `body_clearance` to
    the cloud [m]; `predicted_clearance` to predicted obstacles that the arm's own motion approaches
    [m]; `base_blocked` (1), 1 while an obstacle blocks the base; the others: see `SafetyMonitor`
    and `BasePositionController`.
    """

    def __init__(
        self,
        model: ControlModel,
        scene: Scene,
        params: SafetyParams,
        faults: FaultSet,
        *,
        contact: ContactParams | None,
        control_period: float,
        minimum_clearance: float | None,
    ) -> None:
        """Makes the layer.

        Args:
            model: Pepper.
            scene: The scene, with the reaching arm and the joints' start positions.
            params: Thresholds and periods.
            faults: Faults of the commands.
            contact: Detection of a joint that is held; None for a compliant arm.
            control_period: Period of the commands [s].
            minimum_clearance: Distance of a link to an obstacle at which the robot stops [m]; None
                for no such stop.
        """
        super().__init__()
        arm, start, period = scene.arm, scene.robot.positions(), params.time_step
        builder = DiagramBuilder()
        add = builder.AddNamedSystem
        parts = {
            "head": JOINT_GROUPS["head"],
            "arm": arm_joints(arm),
            "body": JOINT_GROUPS["body"],
        }
        merge = add("joint_commands", JointCommandMerge(parts, start))
        shapes = ExactDistance(model, arm_kinematics(model, arm))
        arm_watch = add(
            "arm_watch",
            CloudClearance(
                shapes,
                lookahead=params.lookahead,
                slowest_approach=params.slowest_approach,
                time_step=period,
            ),
        )
        body_watch = add(
            "body_watch",
            BodyWatch(
                model,
                arm,
                stop_distance=params.base_clearance,
                acceleration=params.base.acceleration,
                turning_acceleration=params.base.turning_acceleration,
                hip_acceleration=params.lean.acceleration,
                delay=params.base_delay,
                slowest_approach=params.slowest_approach,
                time_step=period,
            ),
        )
        monitor = add(
            "safety_monitor",
            SafetyMonitor(
                limits=model.command_limits(BODY_JOINTS),
                start_position=[start[name] for name in BODY_JOINTS],
                minimum_clearance=minimum_clearance or 0.0,
                contact=contact,
                longest_gap=params.longest_gap,
                catch_time=params.catch_time,
                time_step=control_period,
            ),
        )
        driver = add("base_driver", BasePositionController(params.base))
        lean = add("torso_lean", TorsoLean(start, params.lean, time_step=control_period))
        connect(builder, driver, lean, arrived="base_arrived")
        connect(builder, lean, merge, "body_command")
        connect(builder, lean, body_watch, "hip_velocity")
        wanted = faults.tap(
            builder, "commands", {"position": (Role.VALUE, merge.get_output_port())}
        )
        builder.Connect(wanted["position"], monitor.GetInputPort("joint_position_command"))
        base_limiter = add(
            "base_limiter", BaseCommandLimiter(params.base, time_step=control_period)
        )
        velocity = faults.tap(
            builder,
            "base_command",
            {"velocity": (Role.VALUE, driver.GetOutputPort("base_velocity_command"))},
        )
        builder.Connect(velocity["velocity"], base_limiter.command_input)
        connect(
            builder, base_limiter, body_watch, safe_base_velocity_command="base_velocity_command"
        )
        # Held, as the base's pose changes with every step of the plant, commands only at ticks.
        held = add("base_held", ZeroOrderHold(control_period, 1))
        builder.Connect(driver.GetOutputPort("held"), held.get_input_port())
        builder.Connect(held.get_output_port(), monitor.GetInputPort("base_held"))
        if minimum_clearance is not None:
            connect(builder, arm_watch, monitor, approach_clearance="clearance")
            connect(builder, body_watch, monitor, approach_clearance="body_clearance")
        stops = add("base_stop", Adder(2, 1))
        for k, (watch, reason) in enumerate(((monitor, "stop_reason"), (body_watch, "stop_base"))):
            builder.Connect(watch.GetOutputPort(reason), stops.get_input_port(k))
        for mover in (driver, base_limiter, lean):
            builder.Connect(stops.get_output_port(), mover.GetInputPort("stop"))
        inputs: dict[str, tuple[tuple[System, str], ...]] = {
            "cloud": ((body_watch, "cloud"),),
            "predicted_cloud": ((body_watch, "predicted_cloud"),),
            "cloud_torso": ((arm_watch, "cloud"),),
            "predicted_cloud_torso": ((arm_watch, "predicted_cloud"),),
            "head_command": ((merge, "head_command"),),
            "arm_command": ((merge, "arm_command"),),
            "arm_velocity": ((arm_watch, "joint_velocity"),),
            "arm_active": ((arm_watch, "active"),),
            "limp": ((monitor, "limp"),),
            "base_goal": ((driver, "base_goal"), (base_limiter, "base_goal")),
            "hip_pitch_goal": ((lean, "hip_pitch_goal"),),
            "started": ((body_watch, "active"), (base_limiter, "started")),
            "joint_position": ((monitor, "joint_position"), (body_watch, "joint_position")),
            "arm_position": ((arm_watch, "joint_position"),),
            "base_pose": ((driver, "base_pose"), (body_watch, "base_pose")),
        }
        inputs |= {name: ((monitor, name),) for name in _MONITORED}
        for name, targets in inputs.items():
            export_input(builder, name, *(system.GetInputPort(port) for system, port in targets))
        for name, output in (
            ("joint_position_command", (monitor, "safe_joint_position_command")),
            ("base_velocity_command", (base_limiter, "safe_base_velocity_command")),
            ("arrived", (lean, "arrived")),
            ("clearance", (arm_watch, "clearance")),
            ("body_clearance", (body_watch, "clearance")),
            ("predicted_clearance", (arm_watch, "predicted_approach_clearance")),
            ("base_blocked", (body_watch, "stop_base")),
            ("stop_reason", (monitor, "stop_reason")),
            ("stop_joint", (monitor, "stop_joint")),
        ):
            builder.ExportOutput(output[0].GetOutputPort(output[1]), name)
        export_triggers(builder, faults)
        build_into(builder, self)
