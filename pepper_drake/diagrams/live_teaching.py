"""Teaching and reaching in one diagram: the arm is led by hand, or performs what it learned."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder, InputPort

from pepper_drake.diagrams.reaching import Reaching, ReachingConfig
from pepper_drake.diagrams.station import PepperStation, StationConfig
from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.coupling import Coupling
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.pepper import arm_group, hand_frame
from pepper_drake.models.scene import Obstacle, Scene
from pepper_drake.planning.reach.reach_parameters import ReachTiming
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.guiding.guide_target import GuideTarget
from pepper_drake.systems.guiding.hand_guide import HandGuide
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder
from pepper_drake.systems.guiding.velocity_guide import VelocityGuide
from pepper_drake.systems.robot.reference_filter import ReferenceFilter

PUBLISH_PERIOD = 1 / 32
"""Between two frames [s]."""

_STAYS = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
"""A path of nowhere: it puts an object on rails, and a port moves it."""

_SPARES = (
    Obstacle("spare_ball", "sphere", [0.045], color=[0.20, 0.55, 0.35, 1.0]),
    Obstacle("spare_box", "box", [0.08, 0.08, 0.08], color=[0.55, 0.35, 0.65, 1.0]),
    Obstacle("spare_bottle", "cylinder", [0.035, 0.22], color=[0.25, 0.45, 0.70, 1.0]),
)
SPARES = tuple(spare.name for spare in _SPARES)
"""Names of the obstacles that `with_spare_obstacles` adds."""


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


def with_spare_obstacles(scene: Scene) -> Scene:
    """Returns the scene with some obstacles more, on rails, out of sight below the floor.

    A plant takes no bodies once it is made: what a person adds to the scene comes from there.
    """
    taken = {obstacle.name for obstacle in scene.obstacles}
    spares = [
        replace(spare, position=[-1.0, 0.4 * index, -1.0], path=_STAYS)
        for index, spare in enumerate(_SPARES)
        if spare.name not in taken
    ]
    return replace(scene, obstacles=[*scene.obstacles, *spares])


class LiveTeaching(Diagram):
    """The reach with a guide: one arm is limp and led, or goes where it is told, or reaches.

    .. pydrake_system::

        name: LiveTeaching
        input_ports:
        - command
        - primitive
        - arm_mode
        - joint_target
        - reset
        - guide_target
        - guide_velocity
        - goal_object.target
        - (name of an obstacle).target
        - ...

    Inputs: the first five are those of `Reaching`; `guide_target`, X_TG where the guide should go
    (RigidTransform), and `guide_velocity` (6), which has precedence unless it is zero, angular and
    linear in the axes of T [rad/s, m/s]; the offset of what can be moved (3) [m] from where the
    scene has it, in W.

    Attributes:
        reaching: The reach.
        recorder: Of the taught arm.
        movables: What has a port for its offset.
    """

    def __init__(
        self,
        scene: Scene,
        primitive: MovementPrimitive,
        coupling: Coupling | None,
        *,
        station: StationConfig | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            scene: Where Pepper stands.
            primitive: What the arm performs before it was taught anything, with orientation and
                posture.
            coupling: How obstacles bend it; None to do without.
            station: How the robot is simulated; the taught arm starts limp whatever it says.
        """
        super().__init__()
        self.scene = scene = with_movable_objects(scene)
        self.arm = scene.arm
        config = ReachingConfig(
            station=replace(
                station or StationConfig(), goal_motion_port=True, obstacle_motion_ports=True
            ),
            timing=ReachTiming(
                drives=False, holding=np.inf, reach_timeout=np.inf, blocked_timeout=np.inf
            ),
            is_guided=True,
        )
        self._builder = builder = DiagramBuilder()
        self.reaching = builder.AddNamedSystem(
            "reaching", Reaching(scene, primitive, coupling, config)
        )
        self.station: PepperStation = self.reaching.station
        self.station.set_stiffness(arm_group(scene.arm), 0.0)
        for name in ("command", "primitive", "arm_mode", "joint_target", "reset"):
            builder.ExportInput(self.reaching.GetInputPort(name), name)
        self._add_objects()
        self._add_guide()
        self._add_recorder()
        builder.ExportOutput(
            self.reaching.GetOutputPort("ground_truth.query"), "ground_truth.query"
        )
        del self._builder
        build_into(builder, self)

    def _connect(self, output: str, *inputs: InputPort) -> None:
        for port in inputs:
            self._builder.Connect(self.reaching.GetOutputPort(output), port)

    def _add_objects(self) -> None:
        """Adds the systems that move the goal object and the obstacles to their targets."""
        self.movables = [moving.name for moving in self.station.scene_models.moving]
        for name in self.movables:
            follower = self._builder.AddNamedSystem(f"{name}_mover", ReferenceFilter(3))
            self._builder.Connect(
                follower.desired_state_output, self.reaching.GetInputPort(f"{name}.desired_state")
            )
            self._builder.ExportInput(follower.target_input, f"{name}.target")

    def _add_guide(self) -> None:
        """The guide that holds the hand while the arm is limp."""
        builder = self._builder
        target = builder.AddNamedSystem("guide_target", GuideTarget())
        self.guide = guide = builder.AddNamedSystem("guide", VelocityGuide())
        hand_guide = builder.AddNamedSystem(
            "hand_guide", HandGuide(self.station.plant.GetFrameByName(hand_frame(self.arm)))
        )
        builder.ExportInput(target.target_pose_input, "guide_target")
        builder.ExportInput(target.velocity_input, "guide_velocity")
        builder.Connect(guide.guide_pose_output, target.guide_pose_input)
        builder.Connect(target.velocity_output, guide.velocity_input)
        builder.Connect(guide.guide_pose_output, hand_guide.guide_pose_input)
        builder.Connect(guide.guide_velocity_output, hand_guide.guide_velocity_input)
        builder.Connect(
            hand_guide.spatial_forces_output, self.reaching.GetInputPort("applied_forces")
        )
        self._connect("torso_pose", target.torso_pose_input, guide.torso_pose_input)
        self._connect("hand_pose", guide.hand_pose_input)
        self._connect("limp", guide.holding_input, hand_guide.holding_input)
        self._connect("ground_truth.body_poses", hand_guide.body_poses_input)
        self._connect("ground_truth.body_velocities", hand_guide.body_spatial_velocities_input)

    def _add_recorder(self) -> None:
        self.recorder = self._builder.AddNamedSystem(
            "recorder", MotionRecorder(arm_joints(self.arm))
        )
        self._connect("hand_pose", self.recorder.GetInputPort("hand_pose"))
        self._connect("arm_position", self.recorder.GetInputPort("joint_position"))
