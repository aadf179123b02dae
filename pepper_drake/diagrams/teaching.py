"""Kinesthetic teaching in simulation: a limp arm, a hand that guides it, and a recorder."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource, MatrixGain

from pepper_drake.learning import Demonstration
from pepper_drake.models.guide import GuideScript
from pepper_drake.models.pepper import JOINT_GROUPS, add_pepper, arm_group, hand_frame
from pepper_drake.models.scene import make_pose
from pepper_drake.planning.control_model import BODY_JOINTS, ControlModel
from pepper_drake.systems.hand_guide import HandGuide, HandGuideParams
from pepper_drake.systems.motion_recorder import MotionRecorder
from pepper_drake.systems.robot_kinematics import RobotKinematics
from pepper_drake.systems.scripted_guide import GuidePath, ScriptedGuide

_STIFF = PdControllerGains(p=400.0, d=20.0)
# Base and trunk carry the guide's pull without giving way.
_RIGID = PdControllerGains(p=4.0e4, d=2.0e3)
# NAOqi's stiffness zero: no position control, what is left is the friction of the gears.
_LIMP = PdControllerGains(p=1e-6, d=0.2)
_REST_SPEED, _REST_TURN_RATE = 0.005, 0.06
"""Below these [m/s, rad/s] the hand rests."""


class Teaching(Diagram):
    """Pepper stands, one arm is limp, and a guide pulls its hand; the motion is recorded.

    Gravity is compensated on the whole robot; all other joints are held where they start. The base
    stands at the world's origin. Nothing else is in the world: demonstrations know no obstacles.

    .. pydrake_system::

        name: Teaching
        input_ports:
        - guide_pose
        - guide_velocity
        output_ports:
        - hand_pose
        - joint_position
        - guide_force

    `guide_pose` is X_WG and `guide_velocity` (optional) V_WG; see HandGuide. `hand_pose` is X_TH,
    `joint_position` (15) is in the order of `BODY_JOINTS`, `guide_force` (6) torque and force on
    the hand in W.

    Attributes:
        plant: The plant with Pepper alone.
        recorder: The MotionRecorder of the taught arm.
    """

    def __init__(
        self,
        arm: str,
        positions: Mapping[str, float],
        *,
        params: HandGuideParams | None = None,
        time_step: float = 0.002,
        record_period: float = 0.01,
        meshcat: Meshcat | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            arm: The arm that is taught, "left" or "right".
            positions: Where every joint starts [rad, m], by name.
            params: How firmly the guide holds the hand.
            time_step: The plant's step [s].
            record_period: The recorder's step [s].
            meshcat: Where to show the robot, if anywhere.
        """
        super().__init__()
        self.arm = arm
        self._taught = JOINT_GROUPS[arm_group(arm)]
        builder = DiagramBuilder()
        plant, scene_graph = self._add_robot(builder, positions, time_step)
        guide = builder.AddNamedSystem(
            "hand_guide", HandGuide(plant.GetFrameByName(hand_frame(arm)), params)
        )
        builder.Connect(plant.get_body_poses_output_port(), guide.body_poses_input)
        builder.Connect(
            plant.get_body_spatial_velocities_output_port(), guide.body_spatial_velocities_input
        )
        builder.Connect(guide.spatial_forces_output, plant.get_applied_spatial_force_input_port())

        kinematics = builder.AddNamedSystem("kinematics", RobotKinematics(ControlModel()))
        joints = self._add_selector(builder, "joint_position", BODY_JOINTS)
        base = self._add_selector(builder, "base_pose", JOINT_GROUPS["base"])
        builder.Connect(joints, kinematics.joint_position_input)
        builder.Connect(base, kinematics.base_pose_input)
        hand_pose = kinematics.GetOutputPort(f"{arm}_hand_pose")

        self.recorder = builder.AddNamedSystem(
            "recorder", MotionRecorder(self._taught, time_step=record_period)
        )
        builder.Connect(hand_pose, self.recorder.GetInputPort("hand_pose"))
        builder.Connect(
            self._add_selector(builder, "arm_position", self._taught),
            self.recorder.GetInputPort("joint_position"),
        )
        if meshcat is not None:
            MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
        builder.ExportInput(guide.guide_pose_input, "guide_pose")
        builder.ExportInput(guide.guide_velocity_input, "guide_velocity")
        builder.ExportOutput(hand_pose, "hand_pose")
        builder.ExportOutput(joints, "joint_position")
        builder.ExportOutput(guide.force_output, "guide_force")
        builder.BuildInto(self)

    def _add_robot(
        self, builder: DiagramBuilder, positions: Mapping[str, float], time_step: float
    ) -> tuple[MultibodyPlant, SceneGraph]:
        """Adds Pepper, the taught arm limp and all other joints held."""
        plant, scene_graph = AddMultibodyPlant(
            MultibodyPlantConfig(
                time_step=time_step,
                discrete_contact_approximation="sap",
                use_sampled_output_ports=False,
            ),
            builder,
        )
        self.plant: MultibodyPlant = plant
        self._pepper = add_pepper(plant)
        actuators = [plant.get_mutable_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
        for actuator in actuators:
            name = actuator.joint().name()
            rigid = name in (*JOINT_GROUPS["base"], *JOINT_GROUPS["body"])
            gains = _LIMP if name in self._taught else _RIGID if rigid else _STIFF
            actuator.set_controller_gains(gains)
            plant.GetJointByName(name).set_default_positions([positions[name]])
        plant.Finalize()
        targets = [positions[actuator.joint().name()] for actuator in actuators]
        hold = builder.AddNamedSystem(
            "held_posture", ConstantVectorSource(np.r_[targets, np.zeros(len(targets))])
        )
        builder.Connect(hold.get_output_port(), plant.get_desired_state_input_port(self._pepper))
        return plant, scene_graph

    def _add_selector(
        self, builder: DiagramBuilder, name: str, joints: tuple[str, ...]
    ) -> OutputPort:
        """Adds what picks the positions of some joints out of the plant's state."""
        plant = self.plant
        rows = [plant.GetJointByName(joint).position_start() for joint in joints]
        selector = builder.AddNamedSystem(
            name, MatrixGain(D=np.eye(plant.num_multibody_states())[rows])
        )
        builder.Connect(plant.get_state_output_port(), selector.get_input_port())
        return selector.get_output_port()


@dataclass(frozen=True)
class GuidedRecording:
    """What came of guiding a hand through a script."""

    demonstration: Demonstration
    """The motion without the rest before and after it, from time 0."""
    guide_distance_rms: float
    """Distance of the hand from the guide over the whole time [m]."""
    final_distance: float
    """Distance of the hand from the guide when it comes to rest [m]."""


def record_guided(script: GuideScript, meshcat: Meshcat | None = None) -> GuidedRecording:
    """Guides the limp arm through a script in simulation and records it.

    Args:
        script: A guide script that passes its check.
        meshcat: Where to record the robot's motion as an animation, if anywhere.
    """
    builder = DiagramBuilder()
    teaching = builder.AddNamedSystem(
        "teaching", Teaching(script.arm, script.positions(), meshcat=meshcat)
    )
    plant = teaching.plant
    plant_context = plant.CreateDefaultContext()
    X_WT = plant.GetFrameByName("torso").CalcPoseInWorld(plant_context)
    X_WH = plant.GetFrameByName(hand_frame(script.arm)).CalcPoseInWorld(plant_context)
    path = GuidePath(
        [script.rest, *(script.rest + via.time for via in script.via_points)],
        [X_WH, *(X_WT @ make_pose(via.position, via.rpy) for via in script.via_points)],
    )
    guide = builder.AddNamedSystem("scripted_guide", ScriptedGuide(path))
    builder.Connect(guide.guide_pose_output, teaching.GetInputPort("guide_pose"))
    builder.Connect(guide.guide_velocity_output, teaching.GetInputPort("guide_velocity"))
    simulator = Simulator(builder.Build())
    if meshcat is not None:
        meshcat.StartRecording(set_visualizations_while_recording=False)
    simulator.AdvanceTo(path.end_time + script.rest)
    if meshcat is not None:
        meshcat.PublishRecording()

    recorded = teaching.recorder.demonstration(simulator.get_context(), name=script.name)
    guided = [(X_WT.inverse() @ path.pose(time)).translation() for time in recorded.times]
    distances = np.linalg.norm(recorded.positions - guided, axis=1)
    motion = recorded.trimmed(speed=_REST_SPEED, turn_rate=_REST_TURN_RATE)
    return GuidedRecording(
        demonstration=replace(motion, times=np.round(motion.times - motion.times[0], 9)),
        guide_distance_rms=float(np.sqrt(np.mean(distances**2))),
        final_distance=float(distances[-1]),
    )
