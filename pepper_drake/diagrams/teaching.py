"""Kinesthetic teaching in simulation: a limp arm, a hand that guides it, and a recorder."""

from collections.abc import Mapping

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from pepper_drake.diagrams.lone_pepper import LIMP, add_lone_pepper
from pepper_drake.models.pepper import JOINT_GROUPS, arm_group, hand_frame
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.guiding.hand_guide import HandGuide, HandGuideParams
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder

_HELD = PdControllerGains(p=40.0, d=3.0)
"""A person's hold on the joints that are dragged: they follow within the motors' rated efforts."""


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

    `guide_pose` is X_WG and `guide_velocity` V_WG; see HandGuide. `joint_target` (10) has the
    angles [rad] to which the arm's joints are dragged, shoulder to wrist, then the angles' rates
    [rad/s]. `hand_pose` is X_TH, `torso_pose` X_WT; `joint_position` (15) is in the order of
    `BODY_JOINTS`; `guide_force` (6) torque and force on the hand in W; `query` the geometry.

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
        time_step: float = 0.002,
        record_period: float = 0.01,
        meshcat: Meshcat | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            arm: The arm that is taught, "left" or "right".
            positions: Where every joint starts [rad, m], by name.
            guided_by: "hand" or "joints".
            params: How firmly the guide holds the hand.
            time_step: The plant's step [s].
            record_period: The recorder's step [s].
            meshcat: Where to show the robot, if anywhere.
        """
        super().__init__()
        self.arm = arm
        taught = JOINT_GROUPS[arm_group(arm)]
        by_hand = guided_by == "hand"
        builder = DiagramBuilder()
        robot = add_lone_pepper(
            builder, arm, positions, arm_gains=LIMP if by_hand else _HELD, time_step=time_step
        )
        self.plant: MultibodyPlant = robot.plant
        hand_pose = robot.kinematics.GetOutputPort(f"{arm}_hand_pose")
        if by_hand:
            start = [positions[joint] for joint in taught]
            hold = builder.AddNamedSystem("limp", ConstantVectorSource(np.r_[start, np.zeros(5)]))
            builder.Connect(hold.get_output_port(), robot.arm_target)
            self._add_hand_guide(builder, params)
        else:
            builder.ExportInput(robot.arm_target, "joint_target")

        self.recorder = builder.AddNamedSystem(
            "recorder", MotionRecorder(taught, time_step=record_period)
        )
        builder.Connect(hand_pose, self.recorder.GetInputPort("hand_pose"))
        builder.Connect(robot.arm_position, self.recorder.GetInputPort("joint_position"))
        if meshcat is not None:
            MeshcatVisualizer.AddToBuilder(builder, robot.scene_graph, meshcat)
        builder.ExportOutput(hand_pose, "hand_pose")
        builder.ExportOutput(robot.kinematics.GetOutputPort("torso_pose"), "torso_pose")
        builder.ExportOutput(robot.joint_position, "joint_position")
        builder.ExportOutput(robot.scene_graph.get_query_output_port(), "query")
        build_into(builder, self)

    def _add_hand_guide(self, builder: DiagramBuilder, params: HandGuideParams | None) -> None:
        plant = self.plant
        guide = builder.AddNamedSystem(
            "hand_guide", HandGuide(plant.GetFrameByName(hand_frame(self.arm)), params)
        )
        builder.Connect(plant.get_body_poses_output_port(), guide.body_poses_input)
        builder.Connect(
            plant.get_body_spatial_velocities_output_port(), guide.body_spatial_velocities_input
        )
        builder.Connect(guide.spatial_forces_output, plant.get_applied_spatial_force_input_port())
        builder.ExportInput(guide.guide_pose_input, "guide_pose")
        builder.ExportInput(guide.guide_velocity_input, "guide_velocity")
        builder.ExportOutput(guide.force_output, "guide_force")
