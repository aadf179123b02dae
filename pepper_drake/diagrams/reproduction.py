"""A primitive performed without cameras, by an arm that gives way when it is pushed."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantValueSource,
    ConstantVectorSource,
    LogVectorOutput,
    VectorLogSink,
)

from pepper_drake.diagrams.arm_controller import ArmController
from pepper_drake.diagrams.compliance import ComplianceConfig, add_hand_force
from pepper_drake.diagrams.station import PepperStation, StationConfig, select_joints
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import arm_group
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge


@dataclass(frozen=True)
class ReproductionParams:
    """Tracking and compliance of the arm.

    With a stiffness of 0.05, 20 N m/rad at each joint, 5 N at the hand move it by some 3 cm; a
    stiff arm would not notice them.
    """

    stiffness: float = ComplianceConfig.stiffness
    """Stiffness of the arm, as NAOqi has it: from 0, limp, to 1."""
    tracking: PhaseStopping | None = field(default_factory=PhaseStopping)
    """Phase stopping while the hand is pushed; None to do without."""
    ik: DifferentialIkParams = field(default_factory=DifferentialIkParams)
    log_period: float = 0.01
    """[s]."""


class Reproduction(Diagram):
    """Pepper alone performs a primitive: the station, its arm soft, and the arm controller.

    It is simulated, or with `robot`, a `HardwareStation`, performed by a robot.

    .. pydrake_system::

        name: Reproduction
        input_ports:
        - movement
        - goal_pose
        - cloud (optional)
        - push (optional, simulated)
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
        - active
        - query (simulated)

    The goal is known, not seen. Inputs: `movement`, abstract Movement: it starts where the hand is
    when its number becomes 1; `goal_pose` X_TG of the object that its X_OG refers to; `cloud`
    obstacles, a PointCloud in T [m]; `push` (6) torque and force on the hand, in W [N m, N].
    Outputs: `hand_pose` X_TH (RigidTransform), its position (3) [m], `torso_pose` X_WT;
    `joint_position` (15) in the order of `BODY_JOINTS` [rad]; those of the `ArmController`; `query`
    the geometry.

    Attributes:
        plant: The simulated plant with Pepper alone; None for a robot.
        logs: Vector logs by the name of what they log.
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
            primitive: With orientation and posture.
            arm: "left" or "right".
            positions: Where every joint starts [rad, m], by name.
            params: How the arm follows and gives way.
            robot: A robot's station, which stands as `positions` say; simulated if left out.

        Raises:
            InputError: The primitive has no orientation or no posture.
        """
        super().__init__()
        self.primitive, self.arm = primitive, arm
        self.params = params = params or ReproductionParams()
        joints, model = arm_joints(arm), shared_control_model()
        controller = ArmController(
            model,
            arm,
            primitive,
            [positions.get(name, 0.0) for name in joints],
            ik=params.ik,
            phase_stopping=params.tracking,
        )
        builder = DiagramBuilder()
        builder.AddNamedSystem("arm_controller", controller)
        self.plant: MultibodyPlant | None = None
        simulated: PepperStation | None = None
        if robot is None:
            config = StationConfig(cameras=False)
            config.stiffness[arm_group(arm)] = params.stiffness
            robot = simulated = PepperStation(None, config, model, positions)
            self.plant = simulated.plant
        station = builder.AddNamedSystem("station", robot)
        measured = station.GetOutputPort("joint_position")
        arm_position = select_joints(builder, measured, "arm_position", joints)
        commands = builder.AddNamedSystem(
            "joint_commands", JointCommandMerge({"arm": joints}, positions)
        )
        base = builder.AddNamedSystem("base_stands", ConstantVectorSource(np.zeros(3)))
        # The goal is given in T.
        torso = builder.AddNamedSystem("torso", ConstantValueSource(Value(RigidTransform())))
        for source, target in (
            (arm_position, controller.GetInputPort("arm_position")),
            (station.GetOutputPort(f"{arm}_hand_pose"), controller.GetInputPort("hand_pose")),
            (torso.get_output_port(), controller.GetInputPort("torso_pose")),
            (controller.GetOutputPort("position_command"), commands.get_input_port()),
            (commands.get_output_port(), station.GetInputPort("joint_position_command")),
            (base.get_output_port(), station.GetInputPort("base_velocity_command")),
        ):
            builder.Connect(source, target)
        builder.ExportInput(controller.GetInputPort("movement"), "movement")
        builder.ExportInput(controller.GetInputPort("object_pose"), "goal_pose")
        builder.ExportInput(controller.GetInputPort("cloud"), "cloud")
        outputs = {
            "hand_pose": station.GetOutputPort(f"{arm}_hand_pose"),
            "hand_position": station.GetOutputPort(f"{arm}_hand_position"),
            "torso_pose": station.GetOutputPort("torso_pose"),
            "joint_position": measured,
        }
        controlled = ("desired_position", "phase", "tau", "slowdown", "coupling", "active")
        outputs |= {name: controller.GetOutputPort(name) for name in controlled}
        for name, port in outputs.items():
            builder.ExportOutput(port, name)
        logged = {name: outputs[name] for name in ("hand_position", *controlled)}
        logged |= {
            "hand_orientation": station.GetOutputPort(f"{arm}_hand_orientation"),
            "arm_position": arm_position,
            "joint_command": controller.GetOutputPort("position_command"),
            "joint_velocity_command": controller.GetOutputPort("velocity_command"),
        }
        if simulated is not None:
            forces = station.GetInputPort("applied_forces")
            force = add_hand_force(builder, simulated.plant, arm, forces)
            builder.ExportInput(force.force_input, "push")
            builder.ExportOutput(station.GetOutputPort("ground_truth.query"), "query")
            logged["state"] = station.GetOutputPort("ground_truth.state")
        self.logs: dict[str, VectorLogSink] = {
            name: LogVectorOutput(port, builder, params.log_period) for name, port in logged.items()
        }
        build_into(builder, self)
