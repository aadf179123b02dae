"""Reaching: Pepper's station, perception, primitive and inverse kinematics in one diagram."""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import cast

from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, LogVectorOutput, VectorLogSink

from pepper_drake.diagrams.arm_controller import ArmController
from pepper_drake.diagrams.compliance import (
    ComplianceConfig,
    add_hand_force,
    add_pushes,
)
from pepper_drake.diagrams.head_perception import HeadPerception, PerceptionConfig
from pepper_drake.diagrams.station import PepperStation, StationConfig, select_joints
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.coupling import Coupling
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.models.objects import GOAL_OBJECT
from pepper_drake.models.pepper import JOINT_GROUPS, arm_group
from pepper_drake.models.scene import Scene
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.ik.contact_detection import ContactParams
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams, ReachTiming
from pepper_drake.planning.reach.reach_plan import Planner
from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.planning.reach.timed_planner import TimedPlanner
from pepper_drake.planning.trajectories.trajectory_adapter import AdaptationParams
from pepper_drake.systems.faults.fault_memory import Role
from pepper_drake.systems.faults.faulty_planner import FaultyPlanner, slowed_latency
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.reach_supervisor import ReachSupervisor
from pepper_drake.systems.robot.base_position_controller import BasePositionController
from pepper_drake.systems.robot.body_watch import BodyWatch
from pepper_drake.systems.robot.cloud_clearance import CloudClearance
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor
from pepper_drake.systems.robot.touch_monitor import TouchMonitor
from pepper_drake.systems.robot.triggered_trajectory import TriggeredTrajectory
from pepper_drake.systems.robot.true_clearance import TrueClearance


@dataclass
class ReachingConfig:
    """Configuration of the reach."""

    station: StationConfig = field(default_factory=StationConfig)
    ik: DifferentialIkParams = field(default_factory=DifferentialIkParams)
    planner: ReachPlannerParams = field(default_factory=ReachPlannerParams)
    planner_class: type[ReachPlanner] = ReachPlanner
    timing: ReachTiming = field(default_factory=ReachTiming)
    perception: PerceptionConfig = field(default_factory=PerceptionConfig)
    contact: ContactParams = field(default_factory=ContactParams)
    """When a joint counts as held by something; an arm that gives way has no such limit."""
    compliance: ComplianceConfig | None = None
    """Compliance of the reaching arm when it is pushed; a stiff arm if None."""
    log_period: float = 0.01
    """Period of all logs [s]."""
    is_guided: bool = False
    """True if a person moves objects and arm: nothing moves by itself, and nothing is logged."""


class Reaching(Diagram):
    """The whole loop, from the cameras' images to the joints' commands.

    It is simulated, or with `robot`, a `HardwareStation`, performed by a robot.

    .. pydrake_system::

        name: Reaching
        input_ports:
        - command (optional)
        - primitive (optional)
        - arm_mode (optional)
        - joint_target (optional)
        - reset (optional)
        - applied_forces (optional; not of an arm that gives way)
        - (name of what moves).desired_state (guided)
        output_ports:
        - torso_pose, hand_pose, arm_position, limp (guided)
        - ground_truth.query (simulated), .body_poses, .body_velocities (guided)

    Inputs: `command` (1), a `ReachCommand`, and `primitive`, abstract MovementPrimitive: see
    `ReachSupervisor`; `arm_mode` (1), an `ArmMode`, and `joint_target` (5) [rad]: see `ArmCommand`;
    `reset` (1): see `SafetyMonitor`; `applied_forces` and `desired_state`: see `PepperStation`.
    Without any it is one reach. How stiff the arm is, is not among them: gains are the plant's
    and not the context's (`PepperStation.set_stiffness`).

    Attributes:
        station: Pepper in its scene; another station with the same ports may take its place.
        supervisor: What decides.
        logs: Vector logs by the name of what they log.
    """

    def __init__(
        self,
        scene: Scene,
        primitive: MovementPrimitive,
        coupling: Coupling | None,
        config: ReachingConfig,
        station: Diagram | None = None,
    ) -> None:
        """Makes the loop.

        Args:
            scene: What Pepper is in.
            primitive: The movement that was taught.
            coupling: How obstacles bend it; None for not at all.
            config: How it is built.
            station: The robot, if another than one of `config.station` in the scene.
        """
        super().__init__()
        self.scene, self.primitive, self.config = scene, primitive, config
        self._builder = builder = DiagramBuilder()
        model = shared_control_model()
        self.shapes = ExactDistance(model, arm_kinematics(model, scene.arm))
        # A real robot's station has the same ports, less those of the truth.
        chosen = station or PepperStation(scene, config.station, model)
        self.station: PepperStation = builder.AddNamedSystem("station", cast(PepperStation, chosen))
        self._faults = (
            chosen.config.faults if isinstance(chosen, PepperStation) else config.station.faults
        )
        self.logs: dict[str, VectorLogSink] = {}

        self._add_perception()
        self._add_supervisor(coupling)
        self._add_controller()
        self._add_commands(coupled=coupling is not None)
        self._add_motions()
        self._add_triggers()
        if config.is_guided:
            self._export_for_guide()
        else:
            self._add_logs()
        if self.station.HasOutputPort("ground_truth.query"):
            builder.ExportOutput(
                self.station.GetOutputPort("ground_truth.query"), "ground_truth.query"
            )
        del self._builder
        build_into(builder, self)

    def _connect(self, source: OutputPort, system: object, *names: str) -> None:
        for name in names:
            self._builder.Connect(source, system.GetInputPort(name))  # type: ignore[attr-defined]

    def _add_perception(self) -> None:
        """Goal estimator, obstacle cloud, and the head that looks at the goal."""
        self.perception = self._builder.AddNamedSystem(
            "perception", HeadPerception(self.scene, self.station, self.config.perception)
        )
        self.perception.connect(self._builder, self.station)

    def _add_supervisor(self, coupling: Coupling | None) -> None:
        """The supervisor with its planner, and the base that it drives."""
        builder, station = self._builder, self.station
        pre_grasp = self.scene.goal.pre_grasp
        axis = pre_grasp.axis
        make_planner = partial(
            self.config.planner_class,
            model=station.control_model,
            arm=self.scene.arm,
            X_OG=self.scene.pre_grasp(),
            coupling=coupling,
            ik=self.config.ik,
            params=self.config.planner,
            adaptation=AdaptationParams(
                axis=(axis[0], axis[1], axis[2]), axis_tolerance=pre_grasp.tolerance
            ),
            goal_solids=MarkedObject.from_scene(self.scene.goal).solids,
        )
        self.planner = make_planner(primitive=self.primitive)
        fault = self._faults.fault("planner")
        planner: Planner = self.planner
        if fault is not None:
            planner = FaultyPlanner(self.planner, fault, self._faults.seed)
        self.timed_planner = TimedPlanner(planner)
        timing = replace(
            self.config.timing, latency=slowed_latency(self.config.timing.latency, fault)
        )
        self.supervisor = builder.AddNamedSystem(
            "supervisor",
            ReachSupervisor(
                self.timed_planner,
                timing,
                arm=self.scene.arm,
                planner_for=lambda primitive: make_planner(primitive=primitive),
            ),
        )
        for name in ("command", "primitive"):
            builder.ExportInput(self.supervisor.GetInputPort(name), name)
        for name in (
            *("object_pose", "goal_valid", "goal_age", "cloud", "predicted_cloud"),
            *("cloud_time", "cloud_fault", "image_ages"),
        ):
            self._connect(self.perception.GetOutputPort(name), self.supervisor, name)
        if self.perception.HasOutputPort("space"):
            self._connect(self.perception.GetOutputPort("space"), self.supervisor, "space")
        for output, name in (
            ("joint_position", "joint_position"),
            ("base_pose", "base_pose"),
            (f"{self.scene.arm}_hand_pose", "hand_pose"),
        ):
            self._connect(station.GetOutputPort(output), self.supervisor, name)
        self.started = self.supervisor.GetOutputPort("started")
        self._connect(self.started, self.perception, "scan_enabled")
        self._connect(self.supervisor.GetOutputPort("look_at"), self.perception, "look_at")
        self._add_base()

    def _add_base(self) -> None:
        """Drives the base where the supervisor sends it, and stops it before what is seen."""
        builder, station = self._builder, self.station
        self.driver = driver = builder.AddNamedSystem("base_driver", BasePositionController())
        builder.Connect(self.supervisor.GetOutputPort("base_goal"), driver.base_goal_input)
        builder.Connect(station.GetOutputPort("base_pose"), driver.base_pose_input)
        velocity = driver.GetOutputPort("base_velocity_command")
        command = self._faults.tap(builder, "base_command", {"velocity": (Role.VALUE, velocity)})
        builder.Connect(command["velocity"], station.GetInputPort("base_velocity_command"))
        self._connect(driver.GetOutputPort("arrived"), self.supervisor, "arrived")
        self.body_watch = watch = builder.AddNamedSystem(
            "body_watch", BodyWatch(station.control_model, self.scene.arm)
        )
        for name, source in (
            ("cloud", self.perception.GetOutputPort("cloud")),
            ("predicted_cloud", self.perception.GetOutputPort("predicted_cloud")),
            ("joint_position", station.GetOutputPort("joint_position")),
            ("base_pose", station.GetOutputPort("base_pose")),
            ("base_velocity_command", velocity),
            ("active", self.started),
        ):
            self._connect(source, watch, name)
        self._connect(watch.GetOutputPort("stop_base"), self.supervisor, "base_blocked")

    def _add_controller(self) -> None:
        """The arm's controller, and what the arm gives way to."""
        builder, station, arm = self._builder, self.station, self.scene.arm
        compliance = self.config.compliance
        start = self.scene.robot.positions()
        self.controller = controller = builder.AddNamedSystem(
            "arm_controller",
            ArmController(
                station.control_model,
                arm,
                self.primitive,
                [start[name] for name in arm_joints(arm)],
                ik=self.config.ik,
                phase_stopping=None if compliance is None else compliance.tracking,
            ),
        )
        self.active = controller.GetOutputPort("active")
        self.arm_position = select_joints(
            builder, station.GetOutputPort("joint_position"), "arm_position", arm_joints(arm)
        )
        for name, source in (
            ("movement", self.supervisor.GetOutputPort("movement")),
            ("object_pose", self.perception.GetOutputPort("object_pose")),
            ("torso_pose", station.GetOutputPort("torso_pose")),
            ("hand_pose", station.GetOutputPort(f"{arm}_hand_pose")),
            ("arm_position", self.arm_position),
            ("cloud", self.perception.GetOutputPort("cloud_torso")),
            ("predicted_cloud", self.perception.GetOutputPort("predicted_cloud_torso")),
        ):
            self._connect(source, controller, name)
        for output, name in (
            ("goal_position", "goal_position"),
            ("desired_position", "desired_position"),
            ("tau", "tau"),
            ("position_command", "arm_position_command"),
            ("velocity_command", "arm_velocity_command"),
        ):
            self._connect(controller.GetOutputPort(output), self.supervisor, name)
        if compliance is not None:
            station.set_stiffness(arm_group(arm), compliance.stiffness)
            force = add_hand_force(
                builder, station.plant, arm, station.GetInputPort("applied_forces")
            )
            push = add_pushes(builder, compliance.pushes, self.started, force)
            self.logs["push"] = LogVectorOutput(push, builder, self.config.log_period)
        elif station.HasInputPort("applied_forces"):
            builder.ExportInput(station.GetInputPort("applied_forces"), "applied_forces")
        for name in ("arm_mode", "joint_target"):
            builder.ExportInput(controller.GetInputPort(name), name)

    def _add_commands(self, *, coupled: bool) -> None:
        """All joints' commands together, through the safety monitor, to the station."""
        builder, station, arm = self._builder, self.station, self.scene.arm
        model = station.control_model
        merge = builder.AddNamedSystem(
            "joint_commands",
            JointCommandMerge(
                {"head": JOINT_GROUPS["head"], "arm": arm_joints(arm)},
                self.scene.robot.positions(),
            ),
        )
        self._connect(self.perception.GetOutputPort("head_position_command"), merge, "head_command")
        self._connect(self.controller.GetOutputPort("position_command"), merge, "arm_command")

        self.seen_clearance = builder.AddNamedSystem(
            "seen_clearance", CloudClearance(self.shapes, time_step=0.05)
        )
        for name in ("cloud", "predicted_cloud"):
            source = self.perception.GetOutputPort(f"{name}_torso")
            self._connect(source, self.seen_clearance, name)
        self._connect(self.active, self.seen_clearance, "active")
        self._connect(self.arm_position, self.seen_clearance, "joint_position")
        self._connect(
            self.controller.GetOutputPort("velocity_command"),
            self.seen_clearance,
            "joint_velocity",
        )

        self.safety = builder.AddNamedSystem(
            "safety_monitor",
            SafetyMonitor(
                limits=model.command_limits(BODY_JOINTS),
                start_position=[self.scene.robot.positions()[name] for name in BODY_JOINTS],
                minimum_clearance=self.config.planner.clearance.stop,
                contact=self._contact_params(),
                time_step=self.config.ik.time_step,
            ),
        )
        wishes = {"position": (Role.VALUE, merge.get_output_port())}
        wish = self._faults.tap(builder, "commands", wishes)["position"]
        self._connect(wish, self.safety, "joint_position_command")
        self._connect(station.GetOutputPort("joint_position"), self.safety, "joint_position")
        if self.config.planner.collision_checked and coupled:
            for watch, name in (
                (self.seen_clearance, "clearance"),
                (self.body_watch, "body_clearance"),
            ):
                self._connect(watch.GetOutputPort("approach_clearance"), self.safety, name)
            predicted = self.seen_clearance.GetOutputPort("predicted_approach_clearance")
            self._connect(predicted, self.supervisor, "predicted_clearance")
        builder.ExportInput(self.safety.reset_input, "reset")
        self._connect(self.controller.GetOutputPort("limp"), self.safety, "limp")
        for name in ("measurement_age", "missing_joint"):
            self._connect(station.GetOutputPort(name), self.safety, name)
        self._connect(self.perception.GetOutputPort("goal_gap"), self.safety, "goal_gap")
        self._connect(self.driver.GetOutputPort("held"), self.safety, "base_held")
        stop = self.safety.GetOutputPort("stop_reason")
        for system in (self.supervisor, self.controller):
            self._connect(stop, system, "stop_reason")
        self._connect(self.safety.GetOutputPort("stop_joint"), self.supervisor, "stop_joint")
        stops = builder.AddNamedSystem("base_stop", Adder(2, 1))
        builder.Connect(stop, stops.get_input_port(0))
        builder.Connect(self.body_watch.GetOutputPort("stop_base"), stops.get_input_port(1))
        builder.Connect(stops.get_output_port(), self.driver.stop_input)
        self.command = self.safety.GetOutputPort("safe_joint_position_command")
        arriving = self._faults.tap(
            builder,
            "actuators",
            {"position": (Role.VALUE, self.command)},
            elements=body_indices([*JOINT_GROUPS["head"], *arm_joints(arm)]),
            neutral=station.GetOutputPort("joint_position"),
        )
        builder.Connect(arriving["position"], station.GetInputPort("joint_position_command"))

    def _contact_params(self) -> ContactParams | None:
        """When a joint counts as held, on a robot of this latency and slack."""
        if self.config.compliance is not None:
            return None
        wear = self.config.station.wear
        if wear is None:
            return self.config.contact
        return replace(
            self.config.contact,
            latency=self.config.contact.latency + wear.command_latency,
            angle=self.config.contact.angle + 0.5 * float(wear.backlash.max()),
        )

    def _add_motions(self) -> None:
        """Moves goal object and obstacles once the arm starts, if that is asked for."""
        for moving in self.station.scene_models.moving:
            port = f"{moving.name}.desired_state"
            if self.config.is_guided:
                self._builder.ExportInput(self.station.GetInputPort(port), port)
            elif self.station.HasInputPort(port):
                name = "goal_motion" if moving.name == GOAL_OBJECT else f"{moving.name}_motion"
                path = self._builder.AddNamedSystem(name, TriggeredTrajectory(moving.path))
                self._builder.Connect(self.started, path.trigger_input)
                self._connect(path.get_output_port(), self.station, port)

    def _add_triggers(self) -> None:
        """Tells faults that wait for the arm when it starts."""
        for injector in self._faults.waiting(self._builder):
            self._connect(self.started, injector, "trigger")
        for system in (self.station, self.perception):
            if system.HasInputPort("fault_trigger"):
                self._connect(self.started, system, "fault_trigger")

    def _export_for_guide(self) -> None:
        """Exports what a person who leads the hand has to know."""
        builder, station = self._builder, self.station
        for port, name in (
            (station.GetOutputPort("torso_pose"), "torso_pose"),
            (station.GetOutputPort(f"{self.scene.arm}_hand_pose"), "hand_pose"),
            (self.arm_position, "arm_position"),
            (self.controller.GetOutputPort("limp"), "limp"),
        ):
            builder.ExportOutput(port, name)
        for name in ("ground_truth.body_poses", "ground_truth.body_velocities"):
            builder.ExportOutput(station.GetOutputPort(name), name)

    def _add_logs(self) -> None:
        """Logs what the report and the figures need, and watches the true clearance."""
        builder, station = self._builder, self.station
        sources = {
            "joint_position": station.GetOutputPort("joint_position"),
            "joint_command": self.command,
            "base_pose": station.GetOutputPort("base_pose"),
            "hand_position": station.GetOutputPort(f"{self.scene.arm}_hand_position"),
            "mode": self.supervisor.GetOutputPort("mode"),
            "movement_origin": self.supervisor.GetOutputPort("movement_origin"),
            "seen_clearance": self.seen_clearance.GetOutputPort("clearance"),
            "body_clearance": self.body_watch.GetOutputPort("clearance"),
        }
        if station.HasOutputPort("ground_truth.query"):
            self.clearance = builder.AddNamedSystem(
                "clearance_monitor",
                TrueClearance(
                    robot=station.robot_geometries(), obstacles=station.obstacle_geometries()
                ),
            )
            self._connect(station.GetOutputPort("ground_truth.query"), self.clearance, "query")
            touch = builder.AddNamedSystem(
                "touch_monitor",
                TouchMonitor(robot=station.robot_bodies(), goal=station.goal_bodies()),
            )
            self._connect(
                station.GetOutputPort("ground_truth.contact_results"), touch, "contact_results"
            )
            sources["contact_force"] = touch.get_output_port()
            sources["state"] = station.GetOutputPort("ground_truth.state")
            sources["clearance"] = self.clearance.get_output_port()
        for name in ("desired_position", "goal_position", "phase", "tau", "coupling"):
            sources[name] = self.controller.GetOutputPort(name)
        for name, source in sources.items():
            self.logs[name] = LogVectorOutput(source, builder, self.config.log_period)
