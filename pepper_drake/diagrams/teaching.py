"""Kinesthetic teaching in simulation: a limp arm, a guide, and a recorder."""

from collections.abc import Mapping

from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ZeroOrderHold

from pepper_drake.diagrams.compliance import add_hand_guide
from pepper_drake.diagrams.lone_pepper import add_lone_pepper
from pepper_drake.models.control_model import CONTROL_PERIOD, arm_joints
from pepper_drake.systems.framework import Diagram, build_into, connect
from pepper_drake.systems.guiding.hand_guide import HandGuideParams
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder


class Teaching(Diagram):
    """Records the motion of one arm moved by a person.

    Either the arm is limp and a guide pulls its hand, or the joints are dragged. The other joints
    are held at their start positions, the base at the world's origin; there are no obstacles.

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

    `guide_pose` is X_WG and `guide_velocity` V_WG; see `HandGuide`. `joint_target` (5) is sampled
    once per control period and reached at its end [rad]. `hand_pose` is X_TH, `torso_pose`
    X_WT; `joint_position` (15) is in the order of `BODY_JOINTS` [rad]; `guide_force` (6), torque
    and force on the hand in W [N m, N]; `query` the geometry.

    Attributes:
        plant: The plant with Pepper alone.
        recorder: The `MotionRecorder` of the taught arm.
    """

    def __init__(
        self,
        arm: str,
        positions: Mapping[str, float],
        *,
        guided_by: str = "hand",
        params: HandGuideParams | None = None,
        dragged_stiffness: float = 0.1,
        record_period: float = 0.01,
    ) -> None:
        """Makes the diagram.

        Args:
            arm: The arm that is taught, "left" or "right".
            positions: Start positions of all joints by name [rad, m].
            guided_by: "hand" or "joints".
            params: Stiffness and damping of the guide's grip.
            dragged_stiffness: Stiffness of dragged joints: they follow within the rated efforts.
            record_period: The recorder's step [s].
        """
        super().__init__()
        self.arm = arm
        by_hand, taught = guided_by == "hand", arm_joints(arm)
        builder = DiagramBuilder()
        self.station, commands, arm_position = add_lone_pepper(
            builder, arm, positions, 0.0 if by_hand else dragged_stiffness
        )
        self.plant = self.station.plant
        if by_hand:
            guide = add_hand_guide(builder, self.station, self.plant, arm, params)
            builder.ExportInput(guide.guide_pose_input, "guide_pose")
            builder.ExportInput(guide.guide_velocity_input, "guide_velocity")
            builder.ExportOutput(guide.force_output, "guide_force")
        else:
            # Held, so that it is not computed at the plant's rate.
            hold = builder.AddNamedSystem("target", ZeroOrderHold(CONTROL_PERIOD, len(taught)))
            builder.Connect(hold.get_output_port(), commands.get_input_port())
            builder.ExportInput(hold.get_input_port(), "joint_target")
        self.recorder = builder.AddNamedSystem(
            "recorder", MotionRecorder(taught, time_step=record_period)
        )
        connect(builder, self.station, self.recorder, **{f"{arm}_hand_pose": "hand_pose"})
        builder.Connect(arm_position, self.recorder.GetInputPort("joint_position"))
        builder.ExportOutput(self.station.GetOutputPort(f"{arm}_hand_pose"), "hand_pose")
        for name in ("torso_pose", "joint_position"):
            builder.ExportOutput(self.station.GetOutputPort(name), name)
        builder.ExportOutput(self.station.GetOutputPort("ground_truth.query"), "query")
        build_into(builder, self)
