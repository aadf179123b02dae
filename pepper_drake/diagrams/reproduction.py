"""A primitive performed without cameras, by an arm that gives way when it is pushed."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import (
    LogVectorOutput,
    MatrixGain,
    VectorLogSink,
)

from pepper_drake.diagrams.compliance import add_hand_force, add_tracking, connect_couplings
from pepper_drake.diagrams.lone_pepper import LonePepper, add_lone_pepper
from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.coupling import Coupling
from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.ik.differential_ik import (
    DifferentialIkParams,
    hand_key,
    make_differential_ik,
)
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.primitive.canonical_system import CanonicalSystem
from pepper_drake.systems.primitive.feedforward_pose import FeedforwardPose
from pepper_drake.systems.primitive.nominal_posture import NominalPosture
from pepper_drake.systems.primitive.obstacle_coupling import ObstacleCoupling
from pepper_drake.systems.primitive.orientation_transformation_system import (
    OrientationTransformationSystem,
)
from pepper_drake.systems.primitive.transformation_system import TransformationSystem
from pepper_drake.systems.robot.arm_command import ArmCommand
from pepper_drake.systems.robot.joint_command_interpolator import JointCommandInterpolator

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ReproductionParams:
    """How the arm follows, and how it gives way.

    20 N m/rad at each joint let 5 N at the hand move it by some 3 cm; a stiff arm (400) would not
    notice them.
    """

    stiffness: float = 20.0
    """Of each arm joint [N m/rad]."""
    damping: float = 2.0
    """Of each arm joint [N m s/rad]."""
    tracking: PhaseStopping | None = field(default_factory=PhaseStopping)
    """How the movement waits for a hand that is pushed; None for one that does not."""
    ik: DifferentialIkParams = field(default_factory=DifferentialIkParams)
    plant_time_step: float = 0.002
    """[s]."""
    log_period: float = 0.01
    """[s]."""


class Reproduction(Diagram):
    """Pepper alone performs a primitive: canonical and transformation systems, IK, soft arm.

    .. pydrake_system::

        name: Reproduction
        input_ports:
        - active
        - goal_position
        - goal_orientation
        - cloud (optional; with a coupling only)
        - push (optional)
        output_ports:
        - hand_pose
        - hand_position
        - torso_pose
        - joint_position
        - desired_position
        - phase
        - tau
        - slowdown
        - coupling
        - query

    The goal is known, not seen. Inputs: `active` (1), 0 or 1: the movement starts where the hand is
    when it becomes 1; `goal_position` (3) [m] and `goal_orientation` (4), unit quaternion w, x, y,
    z, of the hand in T; `cloud` obstacles, a PointCloud in T [m]; `push` (6) torque and force on
    the hand, in W [N m, N]. Outputs: `hand_pose` X_TH (RigidTransform), its position (3) [m],
    `torso_pose` X_WT; `joint_position` (15) in the order of `BODY_JOINTS` [rad];
    `desired_position` (3) of the hand in T [m]; `phase` (1), `tau` (1) [s]; `slowdown` (1) and
    `coupling` (3) [m], all that acts on phase and position; `query` the geometry.

    Attributes:
        plant: The plant with Pepper alone.
        logs: Vector logs by the name of what they log.
    """

    def __init__(
        self,
        primitive: MovementPrimitive,
        *,
        arm: str,
        positions: Mapping[str, float],
        coupling: Coupling | None = None,
        params: ReproductionParams | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            primitive: With orientation and posture.
            arm: "left" or "right".
            positions: Where every joint starts [rad, m], by name.
            coupling: How obstacles bend the movement; None to do without.
            params: How the arm follows and gives way.

        Raises:
            InputError: The primitive has no orientation or no posture.
        """
        super().__init__()
        if primitive.posture is None or primitive.orientation is None:
            raise InputError(
                f"primitive {primitive.name}: it has no orientation or no posture; learn it from "
                "a demonstration with rotations and joints"
            )
        self.primitive, self.arm = primitive, arm
        self.params = params or ReproductionParams()
        self._positions = dict(positions)
        self.logs: dict[str, VectorLogSink] = {}
        self._builder = builder = DiagramBuilder()
        gains = PdControllerGains(p=self.params.stiffness, d=self.params.damping)
        self._robot: LonePepper = add_lone_pepper(
            builder, arm, positions, arm_gains=gains, time_step=self.params.plant_time_step
        )
        self.plant: MultibodyPlant = self._robot.plant
        self._add_primitive()
        self._add_couplings(coupling)
        self._add_inverse_kinematics()
        self._add_push()
        self._export()
        del self._builder
        build_into(builder, self)

    def _connect(self, source: OutputPort, system: object, *names: str) -> None:
        for name in names:
            self._builder.Connect(source, system.GetInputPort(name))  # type: ignore[attr-defined]

    def _hand(self, port: str) -> OutputPort:
        return self._robot.kinematics.GetOutputPort(f"{self.arm}_hand_{port}")

    def _add_primitive(self) -> None:
        """Canonical system and both transformation systems, from where the hand is."""
        builder, time_step = self._builder, self.params.ik.time_step
        self._canonical = builder.AddNamedSystem(
            "canonical_system", CanonicalSystem(self.primitive, time_step=time_step)
        )
        self._translation = builder.AddNamedSystem(
            "transformation_system", TransformationSystem(self.primitive, time_step=time_step)
        )
        self._rotation = builder.AddNamedSystem(
            "orientation_transformation_system",
            OrientationTransformationSystem(self.primitive, time_step=time_step),
        )
        builder.ExportInput(self._canonical.GetInputPort("active"), "active")
        builder.ExportInput(self._canonical.GetInputPort("goal_position"), "goal_position")
        builder.ConnectInput("goal_position", self._translation.GetInputPort("goal_position"))
        builder.ExportInput(self._rotation.GetInputPort("goal_orientation"), "goal_orientation")
        for system in (self._translation, self._rotation):
            builder.ConnectInput("active", system.GetInputPort("active"))
            for name in ("phase", "phase_velocity", "tau"):
                self._connect(self._canonical.GetOutputPort(name), system, name)
        self._connect(self._hand("position"), self._translation, "start_position")
        self._connect(self._hand("orientation"), self._rotation, "start_orientation")

    def _add_couplings(self, coupling: Coupling | None) -> None:
        """What obstacles and what the hand's own deviation do to phase and position."""
        builder = self._builder
        stubborn = PhaseStopping(stopping=0.0, pull=0.0)
        tracking = add_tracking(
            builder,
            self.params.tracking or stubborn,
            self.params.ik.time_step,
            desired_position=self._translation.GetOutputPort("position"),
            measured_position=self._hand("position"),
        )
        builder.ConnectInput("active", tracking.active_input)
        acting: list[System] = [tracking]
        if coupling is not None:
            obstacles = builder.AddNamedSystem("obstacle_coupling", ObstacleCoupling(coupling))
            builder.ExportInput(obstacles.GetInputPort("cloud"), "cloud")
            builder.ConnectInput("active", obstacles.GetInputPort("active"))
            builder.ConnectInput("goal_position", obstacles.GetInputPort("goal_position"))
            for name in ("position", "velocity", "nominal_acceleration"):
                self._connect(self._translation.GetOutputPort(name), obstacles, name)
            self._connect(self._canonical.GetOutputPort("tau"), obstacles, "tau")
            acting.append(obstacles)
        sums = connect_couplings(builder, acting, self._canonical, self._translation)
        for name, port in sums.items():
            builder.ExportOutput(port, name)
            self._log(name, port)

    def _add_inverse_kinematics(self) -> None:
        """From the hand's next pose to the arm's next command."""
        builder, arm, params = self._builder, self.arm, self.params.ik
        model = shared_control_model()
        bus = builder.AddNamedSystem(
            "hand_pose_bus", FeedforwardPose(hand_key(arm), params.tracking_gain)
        )
        for system, name in ((self._translation, "position"), (self._rotation, "orientation")):
            for port in (name, f"next_{name}"):
                self._connect(system.GetOutputPort(port), bus, port)
        posture = builder.AddNamedSystem("nominal_posture", NominalPosture(self.primitive))
        self._connect(self._canonical.GetOutputPort("phase"), posture, "phase")
        ik = builder.AddNamedSystem("differential_ik", make_differential_ik(model, arm, params))
        command = builder.AddNamedSystem(
            "arm_command",
            ArmCommand(
                limits=model.command_limits(arm_joints(arm), speed_fraction=params.speed_fraction),
                start_position=[self._positions[name] for name in arm_joints(arm)],
                time_step=params.time_step,
            ),
        )
        widen = np.zeros((model.plant.num_positions(), 5))
        widen[model.position_indices(arm_joints(arm)), range(5)] = 1
        for source, port in (
            (command.GetOutputPort("position_command"), "position"),
            (posture.get_output_port(), "nominal_posture"),
        ):
            wide = builder.AddNamedSystem(f"ik_{port}", MatrixGain(D=widen))
            builder.Connect(source, wide.get_input_port())
            self._connect(wide.get_output_port(), ik, port)
        self._connect(bus.get_output_port(), ik, "desired_cartesian_poses")
        builder.ConnectInput("active", command.GetInputPort("active"))
        self._connect(ik.get_output_port(), command, "desired_velocity")
        self._connect(self._robot.arm_position, command, "measured_position")
        servo = builder.AddNamedSystem("joint_servo", JointCommandInterpolator(5, params.time_step))
        builder.Connect(command.GetOutputPort("position_command"), servo.command_input)
        builder.Connect(servo.get_output_port(), self._robot.arm_target)
        self._log("joint_command", command.GetOutputPort("position_command"))
        self._log("joint_velocity_command", command.GetOutputPort("velocity_command"))

    def _add_push(self) -> None:
        """What pushes at the hand from outside."""
        plant = self.plant
        force = add_hand_force(
            self._builder, plant, self.arm, plant.get_applied_spatial_force_input_port()
        )
        self._builder.ExportInput(force.force_input, "push")

    def _export(self) -> None:
        builder, robot = self._builder, self._robot
        outputs = {
            "hand_pose": self._hand("pose"),
            "hand_position": self._hand("position"),
            "torso_pose": robot.kinematics.GetOutputPort("torso_pose"),
            "joint_position": robot.joint_position,
            "desired_position": self._translation.GetOutputPort("position"),
            "phase": self._canonical.GetOutputPort("phase"),
            "tau": self._canonical.GetOutputPort("tau"),
            "query": robot.scene_graph.get_query_output_port(),
        }
        for name, port in outputs.items():
            builder.ExportOutput(port, name)
        for name in ("hand_position", "desired_position", "phase", "tau"):
            self._log(name, outputs[name])
        self._log("hand_orientation", self._hand("orientation"))
        self._log("arm_position", robot.arm_position)
        self._log("state", self.plant.get_state_output_port())

    def _log(self, name: str, port: OutputPort) -> None:
        self.logs[name] = LogVectorOutput(port, self._builder, self.params.log_period)
