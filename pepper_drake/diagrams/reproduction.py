"""A primitive performed without cameras by a compliant arm."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, LogVectorOutput, VectorLogSink

from pepper_drake.diagrams.arm_controller import ArmController
from pepper_drake.diagrams.compliance import ComplianceConfig, add_hand_force
from pepper_drake.diagrams.lone_pepper import add_lone_pepper
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.systems.framework import Diagram, build_into, connect


@dataclass(frozen=True)
class ReproductionParams:
    """Tracking and compliance of the arm."""

    stiffness: float = ComplianceConfig.stiffness
    """Stiffness of the arm, from 0, limp, to 1: at 0.05, 5 N at the hand move it by some 3 cm."""
    tracking: PhaseStopping | None = field(default_factory=PhaseStopping)
    """Phase stopping while the hand is pushed; None for none."""
    ik: DifferentialIkParams = field(default_factory=DifferentialIkParams)
    station: StationConfig = field(default_factory=StationConfig)
    """The simulated robot, without cameras; the arm has the stiffness above."""
    log_period: float = 0.01
    """Period of all logs [s]."""


class Reproduction(Diagram):
    """A compliant arm performs a primitive: the station, simulated or real, and the controller.

    .. pydrake_system::

        name: Reproduction
        input_ports:
        - movement
        - goal_pose
        - cloud (optional)
        - push (optional, simulated)
        output_ports:
        - hand_position
        - torso_pose
        - query (simulated)
        - phase, active

    The goal is given, not perceived. Inputs: `movement`, abstract `Movement`; `goal_pose`, pose in
    T of the object that its X_OG refers to; `cloud` of obstacles in T (PointCloud) [m]; `push` (6),
    torque and force on the hand in W [N m, N]. Outputs: `hand_position` (3) in T [m]; `torso_pose`
    X_WT; `query`, the geometry; the others: see `ArmController`.

    Attributes:
        plant: The simulated plant with Pepper alone; None for a real robot.
        logs: Vector logs by signal name.
    """

    def __init__(
        self,
        primitive: MovementPrimitive,
        *,
        arm: str,
        positions: Mapping[str, float],
        params: ReproductionParams | None = None,
        robot: Diagram | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            primitive: The primitive, with orientation and posture.
            arm: "left" or "right".
            positions: Start positions of all joints by name [rad, m].
            params: Tracking and compliance of the arm.
            robot: A real robot's station, already at `positions`; simulated if omitted.

        Raises:
            InputError: The primitive has no orientation or no posture.
        """
        super().__init__()
        self.primitive, self.arm = primitive, arm
        self.params = params = params or ReproductionParams()
        builder = DiagramBuilder()
        controller = ArmController(
            shared_control_model(),
            arm,
            primitive,
            [positions.get(name, 0.0) for name in arm_joints(arm)],
            ik=params.ik,
            phase_stopping=params.tracking,
        )
        builder.AddNamedSystem("arm_controller", controller)
        station, commands, arm_position = add_lone_pepper(
            builder, arm, positions, params.stiffness, robot, params.station
        )
        self.plant: MultibodyPlant | None = None if robot is not None else station.plant
        builder.Connect(arm_position, controller.GetInputPort("arm_position"))
        connect(builder, station, controller, **{f"{arm}_hand_pose": "hand_pose"})
        # The goal is given in T.
        torso = builder.AddNamedSystem("torso", ConstantValueSource(Value(RigidTransform())))
        builder.Connect(torso.get_output_port(), controller.GetInputPort("torso_pose"))
        connect(builder, controller, commands, position_command="arm_command")
        builder.ExportInput(controller.GetInputPort("movement"), "movement")
        builder.ExportInput(controller.GetInputPort("object_pose"), "goal_pose")
        builder.ExportInput(controller.GetInputPort("cloud"), "cloud")
        ports = {
            "hand_position": station.GetOutputPort(f"{arm}_hand_position"),
            "hand_orientation": station.GetOutputPort(f"{arm}_hand_orientation"),
            "arm_position": arm_position,
            "joint_command": controller.GetOutputPort("position_command"),
            "joint_velocity_command": controller.GetOutputPort("velocity_command"),
        }
        for name in ("desired_position", "phase", "tau", "slowdown", "coupling", "active"):
            ports[name] = controller.GetOutputPort(name)
        for name in ("hand_position", "phase", "active"):
            builder.ExportOutput(ports[name], name)
        builder.ExportOutput(station.GetOutputPort("torso_pose"), "torso_pose")
        if robot is None:
            force = add_hand_force(builder, station, arm)
            builder.ExportInput(force.force_input, "push")
            builder.ExportOutput(station.GetOutputPort("ground_truth.query"), "query")
            ports["state"] = station.GetOutputPort("ground_truth.state")
        self.logs: dict[str, VectorLogSink] = {
            name: LogVectorOutput(port, builder, params.log_period) for name, port in ports.items()
        }
        build_into(builder, self)
