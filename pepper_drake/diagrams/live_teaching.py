"""Teaching and reaching in one diagram: the arm is led by hand, or performs what it learned."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource, MatrixGain

from pepper_drake.diagrams.head_perception import add_perception
from pepper_drake.diagrams.station import PepperStation, StationConfig
from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.coupling import Coupling
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.models.pepper import JOINT_GROUPS, arm_group, hand_frame
from pepper_drake.models.scene import Scene
from pepper_drake.planning.collision.arm_geometry import ArmGeometry
from pepper_drake.planning.ik.differential_ik import (
    DifferentialIkParams,
    hand_key,
    make_differential_ik,
)
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.guiding.guide_target import GuideTarget
from pepper_drake.systems.guiding.hand_guide import HandGuide
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder
from pepper_drake.systems.guiding.velocity_guide import VelocityGuide
from pepper_drake.systems.primitive.canonical_system import CanonicalSystem
from pepper_drake.systems.primitive.feedforward_pose import FeedforwardPose
from pepper_drake.systems.primitive.hand_goal_pose import HandGoalPose
from pepper_drake.systems.primitive.nominal_posture import NominalPosture
from pepper_drake.systems.primitive.obstacle_coupling import ObstacleCoupling
from pepper_drake.systems.primitive.orientation_transformation_system import (
    OrientationTransformationSystem,
)
from pepper_drake.systems.primitive.transformation_system import TransformationSystem
from pepper_drake.systems.robot.arm_command import ArmCommand
from pepper_drake.systems.robot.arm_mode_switch import ArmModeSwitch
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
        - primitive
        - goal_object.target
        - (name of an obstacle).target
        - ...

    Inputs: `arm_mode` (1), an ArmMode; `guide_target`, X_TG where the guide should go
    (RigidTransform), and `guide_velocity` (6), which has precedence unless it is zero, angular and
    linear in the axes of T [rad/s, m/s]; `joint_target` (5) [rad] of the arm in the mode JOINTS;
    `primitive`, the MovementPrimitive that the arm performs in the mode HAND (optional; else the
    one that the diagram was made with); the offset of what can be moved (3) [m] from where the
    scene has it, in W.

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
        coupling: Coupling | None,
        *,
        station: StationConfig | None = None,
        ik: DifferentialIkParams | None = None,
        minimum_clearance: float = 0.002,
        meshcat: Meshcat | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            scene: Where Pepper stands.
            primitive: What the arm performs before it was taught anything, with orientation and
                posture.
            coupling: How obstacles bend it; None to do without.
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
        self.perception = add_perception(builder, scene, self.station)
        self._add_objects()
        self._add_arm()
        self._add_guide()
        self._add_recorder()
        self._add_goal()
        self._add_safety()
        self._add_motion(primitive, coupling)
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

    def _add_arm(self) -> None:
        """The arm's mode and command, merged with the head's."""
        builder, arm, params = self._builder, self.arm, self._ik_params
        self.arm_mode = builder.AddNamedSystem(
            "arm_mode", ArmModeSwitch(time_step=params.time_step)
        )
        builder.ExportInput(self.arm_mode.mode_input, "arm_mode")
        builder.ExportInput(self.arm_mode.GetInputPort("joint_target"), "joint_target")
        self.arm_command = builder.AddNamedSystem(
            "arm_command",
            ArmCommand(
                limits=self._model.command_limits(
                    arm_joints(arm), speed_fraction=params.speed_fraction
                ),
                start_position=[self.scene.robot.positions()[name] for name in arm_joints(arm)],
                time_step=params.time_step,
            ),
        )
        always = builder.AddNamedSystem("always", ConstantVectorSource([1.0]))
        self._connect(always.get_output_port(), self.arm_command, "active")
        self.arm_position = self._select("arm_position", arm_joints(arm))
        for system in (self.arm_mode, self.arm_command):
            self._connect(self.arm_position, system, "measured_position")
        command = self.arm_command.GetOutputPort("position_command")
        self._connect(command, self.arm_mode, "position_command")
        self._connect(self.arm_mode.desired_velocity_output, self.arm_command, "desired_velocity")
        look_at = self.perception.look_at
        self._connect(self._select("head_position", JOINT_GROUPS["head"]), look_at, "head_position")
        self.commands = builder.AddNamedSystem(
            "joint_commands",
            JointCommandMerge(
                {"head": JOINT_GROUPS["head"], "arm": arm_joints(arm)},
                self.scene.robot.positions(),
            ),
        )
        self._connect(look_at.GetOutputPort("head_position_command"), self.commands, "head_command")
        self._connect(command, self.commands, "arm_command")

    def _select(self, name: str, joints: tuple[str, ...]) -> OutputPort:
        """Adds what picks some joints out of the measured ones."""
        selector = self._builder.AddNamedSystem(
            name, MatrixGain(D=np.eye(len(BODY_JOINTS))[body_indices(joints)])
        )
        self._builder.Connect(self._out("joint_position"), selector.get_input_port())
        return selector.get_output_port()

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
        builder.Connect(self.arm_mode.holding_output, self.hand_guide.holding_input)
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

    def _add_goal(self) -> None:
        self.hand_goal = self._builder.AddNamedSystem(
            "hand_goal", HandGoalPose(self.scene.pre_grasp(), time_step=self._ik_params.time_step)
        )
        self._connect(self.perception.object_pose, self.hand_goal, "object_pose")
        self._connect(self._out("torso_pose"), self.hand_goal, "torso_pose")

    def _add_safety(self) -> None:
        """The monitor that stops the arm before a command or an obstacle does harm."""
        builder = self._builder
        self.safety = builder.AddNamedSystem(
            "safety_monitor",
            SafetyMonitor(
                limits=self._model.command_limits(BODY_JOINTS),
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
        if self.perception.cloud_source is None:
            return
        clearance = builder.AddNamedSystem(
            "seen_clearance", CloudClearance(ArmGeometry(self._model, self.arm))
        )
        self._connect(self.perception.cloud_source.GetOutputPort("cloud_torso"), clearance, "cloud")
        self._connect(self.arm_mode.moving_output, clearance, "active")
        self._connect(self.arm_position, clearance, "joint_position")
        self._connect(
            self.arm_command.GetOutputPort("velocity_command"), clearance, "joint_velocity"
        )
        self._connect(clearance.get_output_port(), self.safety, "clearance")

    def _add_motion(self, primitive: MovementPrimitive, coupling: Coupling | None) -> None:
        """The primitive's systems, and the coupling that bends it around obstacles."""
        builder = self._builder
        active = self.arm_mode.active_output
        time_step = self._ik_params.time_step
        goal = self.hand_goal.GetOutputPort("goal_position")
        self.canonical = builder.AddNamedSystem(
            "canonical_system", CanonicalSystem(primitive, time_step=time_step)
        )
        self.translation = builder.AddNamedSystem(
            "transformation_system", TransformationSystem(primitive, time_step=time_step)
        )
        self.rotation = builder.AddNamedSystem(
            "orientation_transformation_system",
            OrientationTransformationSystem(primitive, time_step=time_step),
        )
        builder.ExportInput(self.canonical.GetInputPort("primitive"), "primitive")
        for system in (self.translation, self.rotation):
            builder.ConnectInput("primitive", system.GetInputPort("primitive"))
        self._connect(active, self.canonical, "active")
        self._connect(goal, self.canonical, "goal_position")
        for system in (self.translation, self.rotation):
            self._connect(active, system, "active")
            for name in ("phase", "phase_velocity", "tau"):
                self._connect(self.canonical.GetOutputPort(name), system, name)
        hand = f"{self.arm}_hand"
        self._connect(goal, self.translation, "goal_position")
        self._connect(self._out(f"{hand}_position"), self.translation, "start_position")
        self._connect(
            self.hand_goal.GetOutputPort("goal_orientation"), self.rotation, "goal_orientation"
        )
        self._connect(self._out(f"{hand}_orientation"), self.rotation, "start_orientation")
        self.coupling = None
        if coupling is not None:
            self.coupling = builder.AddNamedSystem("obstacle_coupling", ObstacleCoupling(coupling))
            if self.perception.cloud_source is not None:
                cloud = self.perception.cloud_source.GetOutputPort("cloud_torso")
                self._connect(cloud, self.coupling, "cloud")
            for name in ("position", "velocity", "nominal_acceleration"):
                self._connect(self.translation.GetOutputPort(name), self.coupling, name)
            self._connect(active, self.coupling, "active")
            self._connect(goal, self.coupling, "goal_position")
            self._connect(self.canonical.GetOutputPort("tau"), self.coupling, "tau")
            self._connect(self.coupling.GetOutputPort("coupling"), self.translation, "coupling")
            self._connect(self.coupling.GetOutputPort("slowdown"), self.canonical, "slowdown")
        self._add_inverse_kinematics(primitive)

    def _add_inverse_kinematics(self, primitive: MovementPrimitive) -> None:
        """From the hand's next pose to the arm's joint velocities."""
        builder, model, params = self._builder, self._model, self._ik_params
        bus = builder.AddNamedSystem(
            "hand_pose_bus", FeedforwardPose(hand_key(self.arm), params.tracking_gain)
        )
        for name in ("position", "next_position"):
            self._connect(self.translation.GetOutputPort(name), bus, name)
        for name in ("orientation", "next_orientation"):
            self._connect(self.rotation.GetOutputPort(name), bus, name)
        posture = builder.AddNamedSystem("nominal_posture", NominalPosture(primitive))
        builder.ConnectInput("primitive", posture.GetInputPort("primitive"))
        self._connect(self.canonical.GetOutputPort("phase"), posture, "phase")
        ik = builder.AddNamedSystem(
            "differential_ik", make_differential_ik(model, self.arm, params)
        )
        # The hand's pose in T depends on the arm's joints alone, so all others may be zero.
        widen = np.zeros((model.plant.num_positions(), 5))
        widen[model.position_indices(arm_joints(self.arm)), range(5)] = 1
        for source, port in (
            (self.arm_command.GetOutputPort("position_command"), "position"),
            (posture.get_output_port(), "nominal_posture"),
        ):
            wide = builder.AddNamedSystem(f"ik_{port}", MatrixGain(D=widen))
            builder.Connect(source, wide.get_input_port())
            self._connect(wide.get_output_port(), ik, port)
        self._connect(bus.get_output_port(), ik, "desired_cartesian_poses")
        self._connect(ik.get_output_port(), self.arm_mode, "hand_velocity")
