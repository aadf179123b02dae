"""Teaching and reaching in one diagram: the arm is guided, or performs what it learned."""

from dataclasses import replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.diagrams.compliance import add_hand_guide
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station import PepperStation
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.movable_objects import with_movable_objects
from pepper_drake.models.pepper import arm_group
from pepper_drake.models.scene import Scene
from pepper_drake.systems.framework import Diagram, build_into, connect
from pepper_drake.systems.guiding.guide_target import GuideTarget
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder
from pepper_drake.systems.guiding.velocity_guide import VelocityGuide
from pepper_drake.systems.robot.reference_filter import ReferenceFilter


class LiveTeaching(Diagram):
    """Reaching with a guide: one arm is limp and guided, or moves to joint targets, or reaches.

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
        - (name of an object).target
        - ...

    Inputs: the first five are those of `Reaching`; `guide_target`, desired guide pose X_TG
    (RigidTransform); `guide_velocity` (6) in T, which takes precedence unless zero [rad/s, m/s];
    `target` (3), offset of an object from its position in the scene, in W [m].

    Attributes:
        recorder: The recorder of the taught arm.
        movables: Names of the objects with a port for their offset.
    """

    def __init__(
        self,
        scene: Scene,
        primitive: MovementPrimitive,
        coupling: Coupling | None,
        *,
        config: ReachingConfig | None = None,
    ) -> None:
        """Makes the diagram.

        Args:
            scene: Pepper's surroundings.
            primitive: Performed until another is taught; with orientation and posture.
            coupling: Coupling with obstacles; None for none.
            config: Configuration; the taught arm always starts limp, the base stays, and there are
                no time limits.
        """
        super().__init__()
        self.scene, self.arm = with_movable_objects(scene), scene.arm
        config = config or ReachingConfig()
        robot = replace(config.station, goal_motion_port=True, obstacle_motion_ports=True)
        timing = replace(config.timing, drives=False, holding=np.inf)
        timing = replace(timing, reach_timeout=np.inf, blocked_timeout=np.inf)
        config = replace(config, station=robot, timing=timing, is_guided=True)
        self._builder = builder = DiagramBuilder()
        self.reaching = Reaching(self.scene, primitive, coupling, config)
        builder.AddNamedSystem("reaching", self.reaching)
        self.station: PepperStation = self.reaching.station
        self.station.set_stiffness(arm_group(scene.arm), 0.0)
        for name in ("command", "primitive", "arm_mode", "joint_target", "reset"):
            builder.ExportInput(self.reaching.GetInputPort(name), name)
        self.movables = [moving.name for moving in self.station.scene_models.moving]
        for name in self.movables:
            mover = builder.AddNamedSystem(f"{name}_mover", ReferenceFilter(3))
            connect(builder, mover, self.reaching, desired_state=f"{name}.desired_state")
            builder.ExportInput(mover.target_input, f"{name}.target")
        self._add_guide()
        self.recorder = builder.AddNamedSystem("recorder", MotionRecorder(arm_joints(self.arm)))
        connect(builder, self.reaching, self.recorder, "hand_pose", arm_position="joint_position")
        query = self.reaching.GetOutputPort("ground_truth.query")
        builder.ExportOutput(query, "ground_truth.query")
        del self._builder
        build_into(builder, self)

    def _add_guide(self) -> None:
        """Adds the guide that holds the hand while the arm is limp."""
        builder, reaching = self._builder, self.reaching
        target = builder.AddNamedSystem("guide_target", GuideTarget())
        self.guide = guide = builder.AddNamedSystem("guide", VelocityGuide())
        hand_guide = add_hand_guide(builder, reaching, self.station.plant, self.arm)
        builder.ExportInput(target.target_pose_input, "guide_target")
        builder.ExportInput(target.velocity_input, "guide_velocity")
        connect(builder, guide, target, "guide_pose")
        connect(builder, target, guide, "velocity_command")
        connect(builder, guide, hand_guide, "guide_pose", "guide_velocity")
        connect(builder, reaching, target, "torso_pose")
        connect(builder, reaching, guide, "torso_pose", "hand_pose", limp="holding")
        connect(builder, reaching, hand_guide, limp="holding")
