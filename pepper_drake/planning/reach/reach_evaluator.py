"""Simulates and evaluates movements in a planning scene, and adapts the demonstrated one."""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling, Coupling
from pepper_drake.models.control_model import arm_joints
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import NEAR
from pepper_drake.planning.collision.path_distances import (
    PathDistances,
    arm_motion,
    path_distances,
)
from pepper_drake.planning.ik.goal_configurations import axis_error
from pepper_drake.planning.reach.barrier_for_path import fit_barrier_to_path
from pepper_drake.planning.reach.kinematic_simulation import KinematicSimulator
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.movement_from_path import (
    fit_primitive_to_joint_path,
    reachable_pre_grasp,
)
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.planning_scene import PlanningScene, PlanningSceneBuilder
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan, quality
from pepper_drake.planning.reach.reach_task import ReachTask
from pepper_drake.planning.trajectories.trajectory_adapter import (
    AdaptedTrajectory,
    TrajectoryAdapter,
)

Vector = npt.NDArray[np.float64]


class ReachEvaluator:
    """Simulates and evaluates movements: primitive, coupling, inverse kinematics and limits.

    Stateless: results depend on the arguments only.

    Args:
        primitive: Primitive with orientation and posture.
        task: Arm, goal and criteria.

    Attributes:
        demonstrated: The movement as it was demonstrated.
        params: Criteria of a good reach.
        scenes: Builds planning scenes from observations.
        adapter: Adapts movements; None for no adaptation.
        kinematics: Kinematics of the arm.
        limits: Limits of the arm's commands.
        time_step: Time between commands [s].

    Raises:
        InputError: The primitive has no orientation or no posture.
    """

    def __init__(self, primitive: MovementPrimitive, task: ReachTask) -> None:
        if primitive.orientation is None or primitive.posture is None:
            raise InputError(
                f"primitive {primitive.name}: it has no orientation or no posture; "
                "learn it from a demonstration with rotations and joints"
            )
        model, params = task.model, task.params
        params.clearance.check()
        self.demonstrated = Movement(primitive, task.coupling, task.X_OG)
        self.params = params
        self._axis = task.axis
        self.kinematics = arm_kinematics(model, task.arm)
        self.scenes = PlanningSceneBuilder(model, task.arm, task.goal_solids, params)
        self._simulator = KinematicSimulator(
            model, self.kinematics, task.ik, params.settle, params.still_speed
        )
        self.time_step = task.ik.time_step
        self.limits = model.command_limits(
            arm_joints(task.arm), speed_fraction=task.ik.speed_fraction
        )
        self.adapter: TrajectoryAdapter | None = None
        if params.adapt and isinstance(task.coupling, BarrierCoupling):
            demonstrated = primitive.posture.at(np.linspace(0.0, 1.0, 100))
            self.adapter = TrajectoryAdapter(
                model,
                task.arm,
                demonstrated[None],
                primitive.duration,
                params.adaptation,
                params.clearance,
                task.axis,
            )

    def quality(self, plan: ReachPlan) -> tuple[bool, bool, bool, float, float]:
        """Returns the sort key of a plan; see `reach_plan.quality`."""
        return quality(plan, self.params)

    def is_good(self, plan: ReachPlan) -> bool:
        """True if a plan is clear, has the clearance `want`, and is followed closely."""
        clear, _, followed, *_ = self.quality(plan)
        return clear and followed and plan.clearance >= self.params.clearance.want

    def adapted(
        self,
        scene: PlanningScene,
        simulated: Vector | None = None,
        *,
        deform: bool = True,
        plan: bool = True,
        allowance: float = 0.0,
    ) -> Iterator[ReachPlan]:
        """Yields the demonstrated movement, adapted and simulated, if a path exists.

        Args:
            scene: The planning scene.
            simulated: (K, 5) joints of the movement without adaptation [rad], one more path to
                start from.
            deform: Whether demonstrations are deformed; otherwise only the path planner is used.
            plan: Whether a path planner is asked where no demonstration can be adapted.
            allowance: By how much the clearance may fall short [m].
        """
        if self.adapter is None:
            return
        X_TG = scene.X_TO @ self.demonstrated.X_OG
        path = self.adapter.adapt(
            scene.arm.position,
            X_TG,
            scene.checker,
            simulated,
            deform=deform,
            plan=plan,
            allowance=allowance,
        )
        if path is not None and path.slack > -self.params.clearance.search_target:
            yield self.evaluate(scene, self.movement_along(scene, path), allowance)

    def movement_along(
        self, scene: PlanningScene, path: AdaptedTrajectory, origin: Origin = Origin.ADAPTED
    ) -> Movement:
        """Returns a movement along a joint path."""
        demonstrated = self.demonstrated
        primitive = fit_primitive_to_joint_path(
            self.kinematics,
            path.joints,
            path.duration,
            f"{demonstrated.primitive.name}, adapted",
            self.params.rest_fraction,
        )
        X_OG = reachable_pre_grasp(demonstrated.X_OG, scene.X_TO, self.kinematics, path.joints[-1])
        coupling = self.coupling_along(scene, primitive)
        return Movement(primitive, coupling, X_OG, origin=origin)

    def coupling_along(self, scene: PlanningScene, primitive: MovementPrimitive) -> Coupling | None:
        """Returns the demonstrated movement's coupling; a barrier is fitted to the primitive."""
        coupling = self.demonstrated.coupling
        if not isinstance(coupling, BarrierCoupling):
            return coupling
        tau = primitive.duration
        # Samples every 0.02 s or less, of few different numbers: the response to each is kept.
        step = 0.02 / math.ceil(tau)
        hand = replace(primitive, orientation=None, posture=None).rollout(step, duration=1.0)
        return fit_barrier_to_path(
            coupling,
            scene.field,
            hand.positions,
            hand.velocities / tau,
            hand.accelerations / tau**2,
            margin=self.params.barrier_margin,
        )

    def evaluate(
        self, scene: PlanningScene, movement: Movement, allowance: float = 0.0
    ) -> ReachPlan:
        """Simulates and evaluates a movement.

        Args:
            scene: The planning scene.
            movement: The movement, which starts from the scene's arm state.
            allowance: By how much the clearance may fall short [m].
        """
        params, arm = self.params, scene.arm
        X_TG = movement.hand_goal(scene.X_TO)
        collision_checked = params.collision_checked and movement.coupling is not None
        simulated = movement if collision_checked else replace(movement, coupling=None)
        hand = self._simulator.roll_out(simulated, arm, X_TG, scene.field)
        joint_path = self._simulator.track(arm, hand, params.tolerance.arrive)
        poses = self.kinematics.poses(joint_path)
        reached = poses.hand_position
        error = float(np.linalg.norm(reached[-1] - X_TG.translation()))
        behind = float(np.linalg.norm(reached - hand.positions[: len(reached)], axis=1).max())
        motion = arm_motion(self.kinematics, poses)
        along = partial(path_distances, path=joint_path, motion=motion)
        clearance = along(scene.checker.distances).minimum
        near_body = partial(scene.checker.self_distances, within=params.hanging_clearance + NEAR)
        status, message = PlanStatus.CLEAR, ""
        if error > params.tolerance.arrive:
            status = PlanStatus.OUT_OF_REACH
            message = f"the hand would end {1000 * error:.0f} mm from its goal"
        elif behind > params.following.plan:
            status = PlanStatus.CANNOT_FOLLOW
            message = f"the hand would fall {1000 * behind:.0f} mm behind its movement"
        elif self._hits_body(along(near_body, below=params.hanging_clearance), movement.origin):
            status = PlanStatus.SELF_COLLISION
            message = "the arm would run into the robot's own body"
        elif collision_checked and clearance < params.clearance.start - allowance:
            status = PlanStatus.NO_CLEAR_PATH
            message = (
                f"the arm would come {1000 * clearance:.0f} mm close to an obstacle, "
                f"less than {1000 * params.clearance.start:.0f} mm"
            )
        elif (
            collision_checked
            and along(scene.checker.object_distances, below=params.object_clearance).minimum
            < params.object_clearance
        ):
            status = PlanStatus.NO_CLEAR_PATH
            message = "the arm would touch the goal object"
        elif (
            movement.origin in (Origin.ADAPTED, Origin.DETOUR)
            and (turned := self._turned_away(scene, poses.hand_rotation[-1:])) > 0.0
        ):
            status = PlanStatus.TURNED_AWAY
            message = (
                f"the hand's axis would be {np.degrees(turned):.1f} degrees off, more than "
                f"{np.degrees(self._largest_turn):.1f} (goal.pre_grasp.tolerance less a margin)"
            )
        return ReachPlan(
            status,
            message,
            scene.base_pose,
            error,
            clearance,
            joint_path,
            movement,
            collision_checked,
            self.time_step,
            following_error=behind,
        )

    def explained(self, refused: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns the best of plans none of which is clear, with the reason for that.

        What is wrong with the demonstrated movement is not the reason where it could be adapted.
        """
        arrives = refused.status in (PlanStatus.CLEAR, PlanStatus.NO_CLEAR_PATH)
        if self.adapter is None or arrives or refused.movement is not self.demonstrated:
            return refused
        scene = self.scenes(observation.from_base_pose(refused.base_pose))
        shoulder = self.kinematics.poses(scene.arm.position[None]).origins[0, 0]
        p_TG = (scene.X_TO @ self.demonstrated.X_OG).translation()
        if np.linalg.norm(p_TG - shoulder) > self.params.reach:
            return refused
        message = f"no clear path to the goal was found; as it was demonstrated, {refused.message}"
        return replace(refused, status=PlanStatus.NO_CLEAR_PATH, message=message)

    def _hits_body(self, own: PathDistances, origin: Origin) -> bool:
        """True if distances to the own body are too small.

        An arm on its way that is a little too near may leave: it comes no nearer, and ends clear.
        """
        params, needed = self.params, self.params.hanging_clearance
        lacks = needed - own.distances[0]
        may_leave = (
            origin in (Origin.DETOUR, Origin.RETREAT, Origin.RETURN)
            and 0.0 < lacks <= params.body_clearance_allowance
            and own.distances[-1] >= needed
        )
        return own.minimum < (own.distances[0] if may_leave else needed)

    def _turned_away(self, scene: PlanningScene, R_TH: Vector) -> float:
        """Returns the error of the task axis of a hand (1, 3, 3) if it is too large, else 0 [rad].

        Where a taught movement turns the hand is for whoever taught it to say.
        """
        R_TG = (scene.X_TO @ self.demonstrated.X_OG).rotation().matrix()
        error = float(axis_error(R_TH, R_TG, self._axis.direction)[0])
        return error if error > self._largest_turn else 0.0

    @property
    def _largest_turn(self) -> float:
        """Largest error of the task axis that plans have [rad]."""
        tolerance = self._axis.tolerance
        return tolerance - min(self.params.turn_error, 0.5 * tolerance)
