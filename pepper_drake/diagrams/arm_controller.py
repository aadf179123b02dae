"""The arm controller: computes the arm's next joint command from a movement and perception."""

from collections.abc import Sequence

from pydrake.systems.framework import DiagramBuilder, System

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams, hand_key
from pepper_drake.systems.framework import Diagram, build_into, connect, export_input
from pepper_drake.systems.primitive.canonical_system import CanonicalSystem
from pepper_drake.systems.primitive.coupling_sum import CouplingSum
from pepper_drake.systems.primitive.feedforward_pose import FeedforwardPose
from pepper_drake.systems.primitive.hand_goal_pose import HandGoalPose
from pepper_drake.systems.primitive.nominal_posture import NominalPosture
from pepper_drake.systems.primitive.obstacle_coupling import ObstacleCoupling
from pepper_drake.systems.primitive.orientation_transformation_system import (
    OrientationTransformationSystem,
)
from pepper_drake.systems.primitive.phase_stopping_coupling import PhaseStoppingCoupling
from pepper_drake.systems.primitive.transformation_system import TransformationSystem
from pepper_drake.systems.robot.arm_command import ArmCommand
from pepper_drake.systems.robot.arm_differential_ik import ArmDifferentialIk
from pepper_drake.systems.robot.pose_vectors import PoseVectors


class ArmController(Diagram):
    """Canonical and transformation systems, couplings, inverse kinematics and joint command.

    .. pydrake_system::

        name: ArmController
        input_ports:
        - movement
        - object_pose
        - torso_pose
        - hand_pose
        - arm_position
        - cloud (optional)
        - predicted_cloud (optional)
        - slowdown (optional)
        - speed (optional)
        - external_coupling (optional)
        - arm_mode (optional)
        - joint_target (optional)
        - stop_reason (optional)
        output_ports:
        - position_command
        - velocity_command
        - desired_position
        - desired_orientation
        - goal_position
        - phase
        - tau
        - slowdown
        - coupling
        - active
        - limp

    Inputs: `movement`, abstract Movement; `object_pose` X_WO, `torso_pose` X_WT and `hand_pose`
    X_TH (RigidTransform); `arm_position` (5), measured [rad]; `cloud` and `predicted_cloud`,
    present obstacles and the predicted positions of moving ones (PointCloud in T [m]); `speed` (1),
    speed scale of the movement, along the same path; `slowdown` (1) and `external_coupling` (3)
    [m], added to those of the obstacles; `arm_mode`, `joint_target` and `stop_reason`: see
    `ArmCommand`.

    Outputs: `position_command` (5) [rad] and `velocity_command` (5) [rad/s] of the arm's joints;
    `desired_position` (3) [m] and `desired_orientation` (4; w, x, y, z) of the hand in T;
    `goal_position` (3), the hand's goal in T [m]; `phase` (1), `tau` (1) [s]; `slowdown` (1) and
    `coupling` (3) [m], the sums of all couplings; `active` (1), 1 while the arm moves by itself;
    `limp` (1), 1 while it is limp.
    """

    def __init__(
        self,
        model: ControlModel,
        arm: str,
        primitive: MovementPrimitive,
        start_position: Sequence[float],
        *,
        ik: DifferentialIkParams | None = None,
        phase_stopping: PhaseStopping | None = None,
    ) -> None:
        """Makes the controller.

        Args:
            model: Pepper.
            arm: "left" or "right".
            primitive: An example of the primitives to perform, with orientation and posture.
            start_position: The arm's joints (5,) in uninitialized contexts [rad].
            ik: Parameters of the inverse kinematics, with the controller's period.
            phase_stopping: Waiting of the movement for a hand that is pushed; None for none.

        Raises:
            InputError: The primitive has no orientation or no posture.
        """
        super().__init__()
        if primitive.posture is None or primitive.orientation is None:
            raise InputError(
                f"primitive {primitive.name}: it has no orientation or no posture; learn it from "
                "a demonstration with rotations and joints"
            )
        self._ik = ik or DifferentialIkParams()
        self._builder = builder = DiagramBuilder()
        self._add_primitive(primitive)
        self._add_couplings(phase_stopping)
        self._add_joints(model, arm, start_position)
        self._export()
        del self._builder
        build_into(builder, self)

    def _add_primitive(self, primitive: MovementPrimitive) -> None:
        """Adds the canonical system and both transformation systems, with hand pose and goal."""
        add, time_step = self._builder.AddNamedSystem, self._ik.time_step
        self._goal = add("hand_goal", HandGoalPose(time_step=time_step))
        self._hand = add("hand_pose", PoseVectors())
        self._canonical = add("canonical_system", CanonicalSystem(primitive, time_step=time_step))
        self._translation = add(
            "transformation_system", TransformationSystem(primitive, time_step=time_step)
        )
        self._rotation = add(
            "orientation_transformation_system",
            OrientationTransformationSystem(primitive, time_step=time_step),
        )
        connect(self._builder, self._goal, self._canonical, "goal_position")
        for system, kind in ((self._translation, "position"), (self._rotation, "orientation")):
            connect(self._builder, self._canonical, system, "phase", "phase_velocity", "tau")
            connect(self._builder, self._goal, system, f"goal_{kind}")
            connect(self._builder, self._hand, system, **{kind: f"start_{kind}"})

    def _add_couplings(self, phase_stopping: PhaseStopping | None) -> None:
        """Adds the coupling terms and their sum."""
        add, translation = self._builder.AddNamedSystem, self._translation
        self._obstacles = add("obstacle_coupling", ObstacleCoupling())
        connect(
            self._builder,
            translation,
            self._obstacles,
            "position",
            "velocity",
            "nominal_acceleration",
        )
        connect(self._builder, self._goal, self._obstacles, "goal_position")
        connect(self._builder, self._canonical, self._obstacles, "tau")
        self._sum = add("total_coupling", CouplingSum(3))
        connect(
            self._builder, self._obstacles, self._sum, slowdown="slowdown_0", coupling="coupling_0"
        )
        connect(self._builder, self._sum, self._canonical, "slowdown")
        connect(self._builder, self._sum, translation, "coupling")
        self._performers: list[System] = []
        if phase_stopping is not None:
            waiting = add(
                "phase_stopping", PhaseStoppingCoupling(phase_stopping, self._ik.time_step)
            )
            connect(self._builder, translation, waiting, position="desired_position")
            connect(self._builder, self._hand, waiting, position="measured_position")
            connect(self._builder, waiting, self._sum, slowdown="slowdown_2", coupling="coupling_2")
            self._performers.append(waiting)

    def _add_joints(self, model: ControlModel, arm: str, start: Sequence[float]) -> None:
        """Adds inverse kinematics and joint command."""
        add, params = self._builder.AddNamedSystem, self._ik
        bus = add("feedforward_pose", FeedforwardPose(hand_key(arm), params.tracking_gain))
        for system, kind in ((self._translation, "position"), (self._rotation, "orientation")):
            connect(self._builder, system, bus, kind, f"next_{kind}")
        self._posture = add("nominal_posture", NominalPosture())
        connect(self._builder, self._canonical, self._posture, "phase")
        ik = add("differential_ik", ArmDifferentialIk(model, arm, params))
        connect(self._builder, bus, ik, "desired_cartesian_poses")
        self._command = add(
            "arm_command",
            ArmCommand(
                limits=model.command_limits(arm_joints(arm), speed_fraction=params.speed_fraction),
                start_position=start,
                time_constant=params.target_time_constant,
                catch_up_steps=params.catch_up_steps,
                time_step=params.time_step,
            ),
        )
        connect(self._builder, ik, self._command, commanded_velocity="desired_velocity")
        connect(self._builder, self._command, ik, position_command="position")
        connect(self._builder, self._posture, ik, joint_position="nominal_posture")

    def _export(self) -> None:
        """Exports the ports; `movement` goes to all systems that need it."""
        builder, goal, command = self._builder, self._goal, self._command
        performers = [goal, self._canonical, self._translation, self._rotation, self._obstacles]
        performers += [self._posture, command, *self._performers]
        export_input(builder, "movement", *(part.GetInputPort("movement") for part in performers))
        paced = (self._canonical, self._translation, self._rotation)
        export_input(builder, "speed", *(part.GetInputPort("speed") for part in paced))
        for system, port, name in (
            (goal, "object_pose", "object_pose"),
            (goal, "torso_pose", "torso_pose"),
            (self._hand, "pose", "hand_pose"),
            (command, "measured_position", "arm_position"),
            (self._obstacles, "cloud", "cloud"),
            (self._obstacles, "predicted_cloud", "predicted_cloud"),
            (self._sum, "slowdown_1", "slowdown"),
            (self._sum, "coupling_1", "external_coupling"),
            (command, "arm_mode", "arm_mode"),
            (command, "joint_target", "joint_target"),
            (command, "stop_reason", "stop_reason"),
        ):
            builder.ExportInput(system.GetInputPort(port), name)
        for system, port, name in (
            (command, "position_command", "position_command"),
            (command, "velocity_command", "velocity_command"),
            (self._translation, "position", "desired_position"),
            (self._rotation, "orientation", "desired_orientation"),
            (goal, "goal_position", "goal_position"),
            (self._canonical, "phase", "phase"),
            (self._canonical, "tau", "tau"),
            (self._sum, "slowdown", "slowdown"),
            (self._sum, "coupling", "coupling"),
            (command, "active", "active"),
            (command, "limp", "limp"),
        ):
            builder.ExportOutput(system.GetOutputPort(port), name)
