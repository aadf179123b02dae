"""Teaching and reaching in one diagram: the arm is led by hand, or performs what it learned."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource

from pepper_drake.diagrams.arm_controller import ArmController
from pepper_drake.diagrams.head_perception import HeadPerception
from pepper_drake.diagrams.station import PepperStation, StationConfig, select_joints
from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    shared_control_model,
)
from pepper_drake.models.pepper import JOINT_GROUPS, arm_group, hand_frame
from pepper_drake.models.scene import Scene
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.ik.differential_ik import (
    DifferentialIkParams,
)
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.guiding.guide_target import GuideTarget
from pepper_drake.systems.guiding.hand_guide import HandGuide
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder
from pepper_drake.systems.guiding.velocity_guide import VelocityGuide
from pepper_drake.systems.robot.cloud_clearance import CloudClearance
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge
from pepper_drake.systems.robot.reference_filter import ReferenceFilter
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor

Vector = npt.NDArray[np.float64]

PUBLISH_PERIOD = 1 / 32
"""Between two frames [s]."""

_STAYS = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
"""A path of nowhere: it puts an object on rails, and a port moves it."""


def with_movable_objects(scene: Scene, names: Collection[str] = ()) -> Scene:
    """Returns the scene with the goal object and some obstacles on rails.

    Args:
        scene: As it is; what has a path in it can be moved in any case.
        names: Obstacles that can be moved besides.

    Raises:
        InputError: There is no obstacle of such a name.
    """
    known = [obstacle.name for obstacle in scene.obstacles]
    for name in names:
        if name not in known:
            raise InputError(
                f'there is no obstacle "{name}" in the scene; it has {", ".join(known) or "none"}'
            )
    obstacles = [
        replace(o, path=_STAYS) if o.path or o.name in names else o for o in scene.obstacles
    ]
    return replace(scene, goal=replace(scene.goal, path=_STAYS), obstacles=obstacles)


class LiveTeaching(Diagram):
    """Pepper in a scene; one arm is limp and guided, or goes where it is told, or reaches.

    .. pydrake_system::

        name: LiveTeaching
        input_ports:
        - arm_mode
        - guide_target
        - guide_velocity
        - joint_target
        - movement
        - goal_object.target
        - (name of an obstacle).target
        - ...

    Inputs: `arm_mode` (1), an ArmMode; `guide_target`, X_TG where the guide should go
    (RigidTransform), and `guide_velocity` (6), which has precedence unless it is zero, angular and
    linear in the axes of T [rad/s, m/s]; `joint_target` (5) [rad] of the arm in the mode JOINTS;
    `movement`, the Movement that the arm performs in the mode HAND; the offset of what can be moved
    (3) [m] from where the scene has it, in W.

    Attributes:
        station: Pepper in its scene.
        recorder: Of the taught arm.
        perception: What it sees.
        movables: What has a port for its offset.
    """

    def __init__(
        self,
        scene: Scene,
        primitive: MovementPrimitive,
        *,
        station: StationConfig | None = None,
        ik: DifferentialIkParams | None = None,
        minimum_clearance: float = 0.002,
        meshcat: Meshcat | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            scene: Where Pepper stands.
            primitive: An example of what the arm performs, with orientation and posture.
            station: How the robot is simulated; the taught arm starts limp whatever it says.
            ik: Parameters of the inverse kinematics.
            minimum_clearance: Distance of the arm to the cloud at which it is stopped [m].
            meshcat: Where to show it, if anywhere.
        """
        super().__init__()
        self.scene = scene = with_movable_objects(scene)
        self.arm = scene.arm
        self._ik_params = ik or DifferentialIkParams()
        self._minimum_clearance = minimum_clearance
        config = replace(
            station or StationConfig(), goal_motion_port=True, obstacle_motion_ports=True
        )
        self._model = shared_control_model()
        self._builder = builder = DiagramBuilder()
        self.station: PepperStation = builder.AddNamedSystem(
            "station", PepperStation(scene, config, self._model)
        )
        self.station.set_stiffness(arm_group(scene.arm), 0.0)
        self.perception = builder.AddNamedSystem("perception", HeadPerception(scene, self.station))
        self.perception.connect(builder, self.station)
        self._add_objects()
        self._add_arm(primitive)
        self._add_guide()
        self._add_recorder()
        self._add_safety()
        if meshcat is not None:
            self.visualizer = builder.AddNamedSystem(
                "visualizer",
                MeshcatVisualizer(
                    meshcat,
                    MeshcatVisualizerParams(
                        publish_period=PUBLISH_PERIOD, delete_on_initialization_event=False
                    ),
                ),
            )
            builder.Connect(
                self._out("ground_truth.query"), self.visualizer.query_object_input_port()
            )
        del self._builder
        build_into(builder, self)

    def _out(self, name: str) -> OutputPort:
        return self.station.GetOutputPort(name)

    def _connect(self, source: OutputPort, system: System, *names: str) -> None:
        for name in names:
            self._builder.Connect(source, system.GetInputPort(name))

    def _add_objects(self) -> None:
        """What moves the goal object and the obstacles to where they are wanted."""
        self.movables = [moving.name for moving in self.station.scene_models.moving]
        for name in self.movables:
            follower = self._builder.AddNamedSystem(f"{name}_mover", ReferenceFilter(3))
            self._builder.Connect(
                follower.desired_state_output, self.station.GetInputPort(f"{name}.desired_state")
            )
            self._builder.ExportInput(follower.target_input, f"{name}.target")
        base = self._builder.AddNamedSystem("base_stands", ConstantVectorSource(np.zeros(3)))
        self._builder.Connect(
            base.get_output_port(), self.station.GetInputPort("base_velocity_command")
        )

    def _add_arm(self, primitive: MovementPrimitive) -> None:
        """The arm's controller, whose command is merged with the head's."""
        builder, arm = self._builder, self.arm
        start = self.scene.robot.positions()
        self.controller = controller = builder.AddNamedSystem(
            "arm_controller",
            ArmController(
                self._model,
                arm,
                primitive,
                [start[name] for name in arm_joints(arm)],
                ik=self._ik_params,
            ),
        )
        for name in ("arm_mode", "joint_target", "movement"):
            builder.ExportInput(controller.GetInputPort(name), name)
        measured = self._out("joint_position")
        self.arm_position = select_joints(builder, measured, "arm_position", arm_joints(arm))
        self._connect(self.arm_position, controller, "arm_position")
        self._connect(self._out("torso_pose"), controller, "torso_pose")
        self._connect(self._out(f"{arm}_hand_pose"), controller, "hand_pose")
        for name, port in (
            ("object_pose", "object_pose"),
            ("cloud_torso", "cloud"),
            ("predicted_cloud_torso", "predicted_cloud"),
        ):
            self._connect(self.perception.GetOutputPort(name), controller, port)
        self._connect(controller.GetOutputPort("active"), self.perception, "scan_enabled")
        self.commands = builder.AddNamedSystem(
            "joint_commands",
            JointCommandMerge({"head": JOINT_GROUPS["head"], "arm": arm_joints(arm)}, start),
        )
        self._connect(
            self.perception.GetOutputPort("head_position_command"), self.commands, "head_command"
        )
        self._connect(controller.GetOutputPort("position_command"), self.commands, "arm_command")

    def _add_guide(self) -> None:
        """The guide that holds the hand while the arm is limp."""
        builder = self._builder
        self.target = builder.AddNamedSystem("guide_target", GuideTarget())
        self.guide = builder.AddNamedSystem("guide", VelocityGuide())
        self.hand_guide = builder.AddNamedSystem(
            "hand_guide", HandGuide(self.station.plant.GetFrameByName(hand_frame(self.arm)))
        )
        builder.ExportInput(self.target.target_pose_input, "guide_target")
        builder.ExportInput(self.target.velocity_input, "guide_velocity")
        builder.Connect(self.guide.guide_pose_output, self.target.guide_pose_input)
        builder.Connect(self.target.velocity_output, self.guide.velocity_input)
        for system in (self.target, self.guide):
            self._connect(self._out("torso_pose"), system, "torso_pose")
        self._connect(self._out(f"{self.arm}_hand_pose"), self.guide, "hand_pose")
        builder.Connect(self.guide.guide_pose_output, self.hand_guide.guide_pose_input)
        builder.Connect(self.guide.guide_velocity_output, self.hand_guide.guide_velocity_input)
        builder.Connect(self.controller.GetOutputPort("limp"), self.hand_guide.holding_input)
        self._connect(self._out("ground_truth.body_poses"), self.hand_guide, "body_poses")
        self._connect(
            self._out("ground_truth.body_velocities"), self.hand_guide, "body_spatial_velocities"
        )
        builder.Connect(
            self.hand_guide.spatial_forces_output, self.station.GetInputPort("applied_forces")
        )

    def _add_recorder(self) -> None:
        self.recorder = self._builder.AddNamedSystem(
            "recorder", MotionRecorder(arm_joints(self.arm))
        )
        self._connect(self._out(f"{self.arm}_hand_pose"), self.recorder, "hand_pose")
        self._connect(self.arm_position, self.recorder, "joint_position")

    def _add_safety(self) -> None:
        """The monitor that stops the arm before a command or an obstacle does harm."""
        builder = self._builder
        self.safety = builder.AddNamedSystem(
            "safety_monitor",
            SafetyMonitor(
                limits=self._model.command_limits(BODY_JOINTS),
                start_position=[self.scene.robot.positions()[name] for name in BODY_JOINTS],
                minimum_clearance=self._minimum_clearance,
                time_step=self._ik_params.time_step,
            ),
        )
        builder.Connect(
            self.commands.get_output_port(), self.safety.GetInputPort("joint_position_command")
        )
        self._connect(self._out("joint_position"), self.safety, "joint_position")
        builder.Connect(
            self.safety.GetOutputPort("safe_joint_position_command"),
            self.station.GetInputPort("joint_position_command"),
        )
        clearance = builder.AddNamedSystem(
            "seen_clearance",
            CloudClearance(ExactDistance(self._model, arm_kinematics(self._model, self.arm))),
        )
        for name in ("cloud", "predicted_cloud"):
            self._connect(self.perception.GetOutputPort(f"{name}_torso"), clearance, name)
        self._connect(self.controller.GetOutputPort("active"), clearance, "active")
        self._connect(self.arm_position, clearance, "joint_position")
        self._connect(
            self.controller.GetOutputPort("velocity_command"), clearance, "joint_velocity"
        )
        self._connect(clearance.get_output_port(), self.safety, "clearance")
