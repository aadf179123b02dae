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
from pepper_drake.systems.robot.base_position_controller import (
    BaseMotion,
    BasePositionController,
)
from pepper_drake.systems.robot.body_watch import BodyWatch
from pepper_drake.systems.robot.cloud_clearance import CloudClearance
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor

_MONITORED = ("measurement_age", "missing_joint", "goal_gap", "reset")
"""Inputs of the safety monitor alone."""


@dataclass
class SafetyParams:
    """Thresholds and periods of the safety layer."""

    time_step: float = 0.05
    """Period at which clearances are measured [s]; depth images come every 0.2 s."""
    lookahead: float = 0.1
    """Time by which the arm's motion is looked ahead [s]: `time_step`, and the time to brake."""
    slowest_approach: float = 0.01
    """Speed below which a link does not approach an obstacle [m/s]: noise and slack show less."""
    base_clearance: float = 0.01
    """Clearance of the body at which the base does not go on [m]; its spheres bulge out by 1 cm."""
    base_delay: float = 0.1
    """Time until the base begins to brake [s]."""
    longest_gap: float = 0.12
    """Time for which measurements and estimates may fail to come [s]: six control periods."""
    catch_time: float = 0.5
    """Time for joints that were led by hand to come to rest [s]."""
    link_gap: float = 2.0
    """The same of a robot over a link [s], which holds the arm after 0.1 s by itself, goes on where
    measurements come again, and ends the run after 1 s."""
    base: BaseMotion = field(default_factory=BaseMotion)
    link_base: BaseMotion = field(
        default_factory=lambda: BaseMotion(
            has_reference=False, position_tolerance=0.005, yaw_tolerance=0.01
        )
    )
    """The same of a robot over a link, whose base takes places, as ALMotion's `moveTo` does, no
    finer than this."""

    def over_link(self) -> "SafetyParams":
        """Returns those of a robot over a link, whose base is sent to places."""
        return replace(self, longest_gap=self.link_gap, base=self.link_base)


class SafetyLayer(Diagram):
    """Monitors the clearances of arm and body, checks all commands, drives and stops the robot.

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
    `arm_velocity` (5) [rad/s], as desired; `base_goal` x, y [m], yaw [rad] in W; `arm_active`
    (1), not zero while the arm moves by itself; `started` (1), not zero once it moved; the others:
    see `SafetyMonitor`. Outputs: `joint_position_command` (15) [rad] and `base_velocity_command`
    (3) [m/s, m/s, rad/s]; `clearance` of the arm and `body_clearance` to the cloud [m];
    `predicted_clearance` to which the arm's own motion leads [m]; `base_blocked` (1), 1 while the
    base waits for an obstacle; the others: see `SafetyMonitor` and `BasePositionController`.
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
            scene: Tells which arm reaches, and where the joints start.
            params: When the robot stops.
            faults: Commands that fail.
            contact: When a joint counts as held; None for an arm that gives way.
            control_period: Period of the commands [s].
            minimum_clearance: Distance of a link to an obstacle at which the robot stops [m]; None
                if it does not.
        """
        super().__init__()
        arm, start, period = scene.arm, scene.robot.positions(), params.time_step
        builder = DiagramBuilder()
        add = builder.AddNamedSystem
        parts = {"head": JOINT_GROUPS["head"], "arm": arm_joints(arm)}
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
        wanted = faults.tap(
            builder, "commands", {"position": (Role.VALUE, merge.get_output_port())}
        )
        builder.Connect(wanted["position"], monitor.GetInputPort("joint_position_command"))
        connect(builder, driver, body_watch, "base_velocity_command")
        # The base's pose changes with every step of a plant; commands are computed at the ticks.
        held = add("base_held", ZeroOrderHold(control_period, 1))
        builder.Connect(driver.GetOutputPort("held"), held.get_input_port())
        builder.Connect(held.get_output_port(), monitor.GetInputPort("base_held"))
        if minimum_clearance is not None:
            connect(builder, arm_watch, monitor, approach_clearance="clearance")
            connect(builder, body_watch, monitor, approach_clearance="body_clearance")
        stops = add("base_stop", Adder(2, 1))
        for k, (watch, reason) in enumerate(((monitor, "stop_reason"), (body_watch, "stop_base"))):
            builder.Connect(watch.GetOutputPort(reason), stops.get_input_port(k))
        builder.Connect(stops.get_output_port(), driver.GetInputPort("stop"))
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
            "base_goal": ((driver, "base_goal"),),
            "started": ((body_watch, "active"),),
            "joint_position": ((monitor, "joint_position"), (body_watch, "joint_position")),
            "arm_position": ((arm_watch, "joint_position"),),
            "base_pose": ((driver, "base_pose"), (body_watch, "base_pose")),
        }
        inputs |= {name: ((monitor, name),) for name in _MONITORED}
        for name, heard in inputs.items():
            export_input(builder, name, *(system.GetInputPort(port) for system, port in heard))
        for name, output in (
            ("joint_position_command", (monitor, "safe_joint_position_command")),
            ("base_velocity_command", (driver, "base_velocity_command")),
            ("arrived", (driver, "arrived")),
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
