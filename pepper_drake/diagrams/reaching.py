"""Reaching: Pepper's station, perception, supervisor, controller and safety in one diagram."""

from dataclasses import replace
from functools import partial
from typing import cast

from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from pepper_drake.diagrams.arm_controller import ArmController
from pepper_drake.diagrams.compliance import add_compliance
from pepper_drake.diagrams.ground_truth import add_ground_truth
from pepper_drake.diagrams.head_perception import HeadPerception
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.safety_layer import SafetyLayer
from pepper_drake.diagrams.sequencing import add_sequencer
from pepper_drake.diagrams.station import PepperStation, select_joints
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.models.control_model import arm_joints, body_indices, shared_control_model
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.scene import Scene
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_plan import Planner
from pepper_drake.planning.reach.reach_task import ReachTask
from pepper_drake.planning.reach.timed_planner import TimedPlanner
from pepper_drake.systems.faults.fault_memory import Role
from pepper_drake.systems.faults.faulty_planner import faulty
from pepper_drake.systems.framework import Diagram, build_into, connect
from pepper_drake.systems.reach_supervisor import ReachSupervisor
from pepper_drake.systems.robot.triggered_trajectory import TriggeredTrajectory


class Reaching(Diagram):
    """The whole loop, from camera images to joint commands.

    It runs in simulation or, with a `HardwareStation`, on a robot.

    .. pydrake_system::

        name: Reaching
        input_ports:
        - command, primitive (optional; not with tasks)
        - arm_mode, joint_target (optional)
        - reset (optional)
        - applied_forces (optional; not with a compliant arm)
        - (name of a moving object).desired_state (guided)
        output_ports:
        - torso_pose, hand_pose, arm_position, limp
        - ground_truth.query, .body_poses, .body_velocities (simulated)

    Inputs: `command` (1), a `ReachCommand`, and `primitive`, abstract MovementPrimitive: see
    `ReachSupervisor`; `arm_mode` (1), an `ArmMode`, and `joint_target` (5) [rad]: see `ArmCommand`;
    `reset` (1): see `SafetyMonitor`; `applied_forces` and `desired_state`: see `PepperStation`.
    With all inputs unconnected it performs one reach. The arm's stiffness is no input: gains belong
    to the plant, not to the context (`PepperStation.set_stiffness`).

    Attributes:
        station: Pepper in its scene, or another station with the same ports.
        logs: Vector logs by signal name.
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
            scene: Pepper's surroundings.
            primitive: The taught movement.
            coupling: Coupling with obstacles; None for none.
            config: Configuration of the loop.
            station: The robot's station; one of `config.station` in the scene if omitted.
        """
        super().__init__()
        self.scene, self.primitive, self.config = scene, primitive, config
        self._builder = builder = DiagramBuilder()
        model = shared_control_model()
        # A real robot's station has the same ports except for `ground_truth.*`.
        chosen = cast(PepperStation, station or PepperStation(scene, config.station, model))
        self.station: PepperStation = builder.AddNamedSystem("station", chosen)
        self._is_simulated = isinstance(chosen, PepperStation)
        self._faults = chosen.config.faults if self._is_simulated else config.station.faults
        self._is_checked = config.planner.collision_checked and coupling is not None
        self.logs: dict[str, VectorLogSink] = {}
        self._add_systems(coupling)
        self._connect_systems()
        self.sequencer = add_sequencer(builder, self) if config.tasks else None
        self._add_commands()
        self._add_motions()
        self._add_exports()
        if not config.is_guided:
            self._add_logs()
        for system in (self.station, self.perception, self.safety):
            if system.HasInputPort("fault_trigger"):
                connect(builder, self.supervisor, system, started="fault_trigger")
        for injector in self._faults.waiting(builder):
            connect(builder, self.supervisor, injector, started="trigger")
        del self._builder
        build_into(builder, self)

    def _add_systems(self, coupling: Coupling | None) -> None:
        """Adds perception, supervisor with its planner, arm controller and safety layer."""
        add, scene, config = self._builder.AddNamedSystem, self.scene, self.config
        station, compliance, model = self.station, config.compliance, self.station.control_model
        self.perception = add("perception", HeadPerception(scene, station, config.perception))
        self.perception.connect(self._builder, station)
        params = config.planner
        if not self._is_simulated:  # A link commands head and arm only.
            params = replace(params, lean=replace(params.lean, hip_pitch=[]))
        task = ReachTask.in_scene(
            scene, model, coupling, config.ik, params, config.station.camera_period
        )
        self.planner = config.planner_class(self.primitive, task)
        planner, timing = faulty(self.planner, config.timing, self._faults)
        self.timed_planner = TimedPlanner(planner)
        supervisor = ReachSupervisor(
            self.timed_planner, timing, arm=scene.arm, planner_for=self._planner_for
        )
        start = scene.robot.positions()
        contact = config.contact.on_worn_robot(config.station.wear)
        controller = ArmController(
            model,
            scene.arm,
            self.primitive,
            [start[name] for name in arm_joints(scene.arm)],
            ik=config.ik,
            phase_stopping=None if compliance is None else compliance.tracking,
        )
        safety = SafetyLayer(
            model,
            scene,
            config.safety if self._is_simulated else config.safety.over_link(),
            self._faults,
            contact=contact if compliance is None else None,
            control_period=config.ik.time_step,
            minimum_clearance=config.planner.clearance.stop if self._is_checked else None,
        )
        self.supervisor = add("supervisor", supervisor)
        self.controller = add("arm_controller", controller)
        self.safety = add("safety", safety)

    def _planner_for(self, wanted: MovementPrimitive | Movement) -> Planner:
        """Returns a planner for another movement; the timed one for the reach itself."""
        if isinstance(wanted, MovementPrimitive):
            return self.planner.with_primitive(wanted)
        first = self.planner.demonstrated
        if wanted.primitive is first.primitive and wanted.X_OG is first.X_OG:
            return self.timed_planner
        return self.planner.with_primitive(wanted.primitive, wanted.X_OG)

    def _connect_systems(self) -> None:
        """Connects the five subsystems."""
        wire = partial(connect, self._builder)
        station, perception, supervisor = self.station, self.perception, self.supervisor
        controller, safety, arm = self.controller, self.safety, self.scene.arm
        hand = {f"{arm}_hand_pose": "hand_pose"}
        ports = ("object_pose", "goal_valid", "goal_age", "image_ages", "cloud", "predicted_cloud")
        wire(perception, supervisor, *ports, "cloud_time", "cloud_fault")
        wire(perception, supervisor, "head_position_command", "search_delay")
        if perception.HasOutputPort("space"):
            wire(perception, supervisor, "space")
        wire(station, supervisor, "joint_position", "base_pose", **hand)
        wire(supervisor, perception, "look_at", started="scan_enabled")
        wire(supervisor, controller, "movement", "speed")
        wire(station, controller, "torso_pose", **hand)
        clouds = {f"{cloud}_torso": cloud for cloud in ("cloud", "predicted_cloud")}
        wire(perception, controller, "object_pose", **clouds)
        wire(controller, supervisor, "goal_position", "desired_position", "tau")
        commands = {f"{kind}_command": f"arm_{kind}_command" for kind in ("position", "velocity")}
        wire(controller, supervisor, **commands)
        self.arm_position = select_joints(
            self._builder, station.GetOutputPort("joint_position"), "arm_position", arm_joints(arm)
        )
        for system in (controller, safety):
            self._builder.Connect(self.arm_position, system.GetInputPort("arm_position"))
        wire(perception, safety, "cloud", "predicted_cloud", *clouds, "goal_gap")
        wire(perception, safety, head_position_command="head_command")
        wire(station, safety, "joint_position", "base_pose", "measurement_age", "missing_joint")
        wire(supervisor, safety, "base_goal", "hip_pitch_goal", "started")
        wire(controller, safety, "limp", active="arm_active")
        wire(controller, safety, position_command="arm_command", velocity_command="arm_velocity")
        wire(safety, supervisor, "arrived", "base_blocked", "stop_reason", "stop_joint")
        if self._is_checked:
            wire(safety, supervisor, "predicted_clearance")
        wire(safety, controller, "stop_reason")

    def _add_commands(self) -> None:
        """Connects safe commands to the station, through fault injectors, and forces."""
        builder, station, config = self._builder, self.station, self.config
        self.command = self.safety.GetOutputPort("joint_position_command")
        joints = self._faults.tap(
            builder,
            "actuators",
            {"position": (Role.VALUE, self.command)},
            elements=body_indices([*JOINT_GROUPS["head"], *arm_joints(self.scene.arm)]),
            neutral=station.GetOutputPort("joint_position"),
        )
        builder.Connect(joints["position"], station.GetInputPort("joint_position_command"))
        connect(builder, self.safety, station, "base_velocity_command")
        if config.compliance is not None:
            started = self.supervisor.GetOutputPort("started")
            push = add_compliance(builder, station, self.scene.arm, config.compliance, started)
            self.logs["push"] = LogVectorOutput(push, builder, config.log_period)
        elif station.HasInputPort("applied_forces"):
            builder.ExportInput(station.GetInputPort("applied_forces"), "applied_forces")

    def _add_motions(self) -> None:
        """Moves goal object and obstacles once the arm starts, if configured."""
        builder, station = self._builder, self.station
        for moving in station.scene_models.moving:
            port = f"{moving.name}.desired_state"
            if self.config.is_guided:
                builder.ExportInput(station.GetInputPort(port), port)
            elif station.HasInputPort(port):
                path = TriggeredTrajectory(moving.path)
                builder.AddNamedSystem(f"{moving.name}_motion", path)
                connect(builder, self.supervisor, path, started="trigger")
                builder.Connect(path.get_output_port(), station.GetInputPort(port))

    def _add_exports(self) -> None:
        """Exports the user's commands, and the outputs that a guide needs."""
        builder, station = self._builder, self.station
        inputs = {"reset": self.safety} | dict.fromkeys(
            ("arm_mode", "joint_target"), self.controller
        )
        if self.sequencer is None:
            inputs |= dict.fromkeys(("command", "primitive"), self.supervisor)
        for name, system in inputs.items():
            builder.ExportInput(system.GetInputPort(name), name)
        builder.ExportOutput(station.GetOutputPort(f"{self.scene.arm}_hand_pose"), "hand_pose")
        builder.ExportOutput(self.arm_position, "arm_position")
        builder.ExportOutput(self.controller.GetOutputPort("limp"), "limp")
        truth = (f"ground_truth.{kind}" for kind in ("query", "body_poses", "body_velocities"))
        for name in filter(station.HasOutputPort, ("torso_pose", *truth)):
            builder.ExportOutput(station.GetOutputPort(name), name)

    def _add_logs(self) -> None:
        """Logs the signals of report and figures, and monitors the true clearance."""
        builder, station = self._builder, self.station
        sources = {
            "joint_command": self.command,
            "hand_position": station.GetOutputPort(f"{self.scene.arm}_hand_position"),
            "seen_clearance": self.safety.GetOutputPort("clearance"),
            "body_clearance": self.safety.GetOutputPort("body_clearance"),
        }
        if station.HasOutputPort("ground_truth.query"):
            self.clearance, truth = add_ground_truth(builder, station)
            sources |= truth
        for system, *names in (
            (station, "joint_position", "base_pose", "hand_opening"),
            (self.supervisor, "mode", "movement_origin"),
            (self.controller, "desired_position", "goal_position", "phase", "tau", "coupling"),
        ):
            sources |= {name: system.GetOutputPort(name) for name in names}
        if self.sequencer is not None:
            sources["task"] = self.sequencer.GetOutputPort("task")
        for name, source in sources.items():
            self.logs[name] = LogVectorOutput(source, builder, self.config.log_period)
