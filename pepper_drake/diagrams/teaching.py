"""Kinesthetic teaching in simulation: a limp arm, a hand that guides it, and a recorder."""

from collections.abc import Mapping

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, System
from pydrake.systems.primitives import ConstantVectorSource, ZeroOrderHold

from pepper_drake.diagrams.station import PepperStation, StationConfig, select_joints
from pepper_drake.models.control_model import BODY_JOINTS, CONTROL_PERIOD, shared_control_model
from pepper_drake.models.pepper import JOINT_GROUPS, arm_group, hand_frame
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.guiding.hand_guide import HandGuide, HandGuideParams
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge

_DRAGGED = 0.1
"""Stiffness of joints that a person drags: they follow within the motors' rated efforts."""


class Teaching(Diagram):
    """Pepper stands, one arm is free, and a person moves it; the motion is recorded.

    Either the arm is limp and a guide pulls its hand, or the joints are dragged. Gravity is
    compensated on the whole robot; all other joints are held where they start. The base stands at
    the world's origin. Nothing else is in the world: demonstrations know no obstacles.

    .. pydrake_system::

        name: Teaching
        input_ports:
        - guide_pose (guided by the hand)
        - guide_velocity (guided by the hand; optional)
        - joint_target (guided by the joints)
        output_ports:
        - hand_pose
        - torso_pose
        - joint_position
        - guide_force (guided by the hand)
        - query

    `guide_pose` is X_WG and `guide_velocity` V_WG; see HandGuide. `joint_target` (5) has the angles
    [rad] to which the arm's joints are dragged, shoulder to wrist: those of one control period
    later, sampled once in each. `hand_pose` is X_TH, `torso_pose` X_WT; `joint_position` (15) is
    in the order of `BODY_JOINTS`; `guide_force` (6) torque and force on the hand in W; `query` the
    geometry.

    Attributes:
        plant: The plant with Pepper alone.
        recorder: The MotionRecorder of the taught arm.
    """

    def __init__(
        self,
        arm: str,
        positions: Mapping[str, float],
        *,
        guided_by: str = "hand",
        params: HandGuideParams | None = None,
        record_period: float = 0.01,
        meshcat: Meshcat | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            arm: The arm that is taught, "left" or "right".
            positions: Where every joint starts [rad, m], by name.
            guided_by: "hand" or "joints".
            params: How firmly the guide holds the hand.
            record_period: The recorder's step [s].
            meshcat: Where to show the robot, if anywhere.
        """
        super().__init__()
        self.arm = arm
        taught = JOINT_GROUPS[arm_group(arm)]
        by_hand = guided_by == "hand"
        builder = DiagramBuilder()
        config = StationConfig(cameras=False)
        config.stiffness[arm_group(arm)] = 0.0 if by_hand else _DRAGGED
        self.station: PepperStation = builder.AddNamedSystem(
            "station", PepperStation(None, config, shared_control_model(), positions)
        )
        self.plant: MultibodyPlant = self.station.plant
        self._command_joints(builder, taught, positions, held=by_hand)
        if by_hand:
            self._add_hand_guide(builder, params)
        hand_pose = self.station.GetOutputPort(f"{arm}_hand_pose")
        joint_position = self.station.GetOutputPort("joint_position")
        self.recorder = builder.AddNamedSystem(
            "recorder", MotionRecorder(taught, time_step=record_period)
        )
        builder.Connect(hand_pose, self.recorder.GetInputPort("hand_pose"))
        builder.Connect(
            select_joints(builder, joint_position, "arm_position", taught),
            self.recorder.GetInputPort("joint_position"),
        )
        if meshcat is not None:
            visualizer = builder.AddNamedSystem("visualizer", MeshcatVisualizer(meshcat))
            builder.Connect(
                self.station.GetOutputPort("ground_truth.query"),
                visualizer.query_object_input_port(),
            )
        builder.ExportOutput(hand_pose, "hand_pose")
        builder.ExportOutput(self.station.GetOutputPort("torso_pose"), "torso_pose")
        builder.ExportOutput(joint_position, "joint_position")
        builder.ExportOutput(self.station.GetOutputPort("ground_truth.query"), "query")
        build_into(builder, self)

    def _command_joints(
        self,
        builder: DiagramBuilder,
        taught: tuple[str, ...],
        positions: Mapping[str, float],
        *,
        held: bool,
    ) -> None:
        """Commands the arm where it is dragged, and all else where it starts."""
        commands: System
        if held:
            resting = [positions[name] for name in BODY_JOINTS]
            commands = builder.AddNamedSystem("joint_commands", ConstantVectorSource(resting))
        else:
            commands = builder.AddNamedSystem(
                "joint_commands", JointCommandMerge({"arm": taught}, positions)
            )
            # Held, so that nothing is computed at the plant's rate.
            hold = builder.AddNamedSystem("target", ZeroOrderHold(CONTROL_PERIOD, len(taught)))
            builder.Connect(hold.get_output_port(), commands.GetInputPort("arm_command"))
            builder.ExportInput(hold.get_input_port(), "joint_target")
        builder.Connect(
            commands.get_output_port(), self.station.GetInputPort("joint_position_command")
        )
        base = builder.AddNamedSystem("base_stands", ConstantVectorSource(np.zeros(3)))
        builder.Connect(base.get_output_port(), self.station.GetInputPort("base_velocity_command"))

    def _add_hand_guide(self, builder: DiagramBuilder, params: HandGuideParams | None) -> None:
        guide = builder.AddNamedSystem(
            "hand_guide", HandGuide(self.plant.GetFrameByName(hand_frame(self.arm)), params)
        )
        for source, target in (
            ("ground_truth.body_poses", guide.body_poses_input),
            ("ground_truth.body_velocities", guide.body_spatial_velocities_input),
        ):
            builder.Connect(self.station.GetOutputPort(source), target)
        builder.Connect(guide.spatial_forces_output, self.station.GetInputPort("applied_forces"))
        builder.ExportInput(guide.guide_pose_input, "guide_pose")
        builder.ExportInput(guide.guide_velocity_input, "guide_velocity")
        builder.ExportOutput(guide.force_output, "guide_force")
