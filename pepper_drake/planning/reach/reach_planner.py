"""Can the hand get there, and from where? The whole reach, played through before the arm moves."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.coupling import BarrierCoupling, Coupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel, arm_joints, body_indices
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.planning.collision.arm_geometry import ArmGeometry
from pepper_drake.planning.collision.self_clearance import SelfClearance
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.barrier_for_path import fit_barrier_to_path
from pepper_drake.planning.reach.base_placement import BasePlacement, HasRoom
from pepper_drake.planning.reach.kinematic_simulation import ArmState, KinematicSimulator
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.movement_from_path import (
    fit_primitive_to_joint_path,
    reachable_pre_grasp,
)
from pepper_drake.planning.reach.planning_scene import PlanningScene, PlanningSceneBuilder
from pepper_drake.planning.reach.reach_plan import (
    PlanStatus,
    ReachPlan,
    ReachPlannerParams,
    quality,
)
from pepper_drake.planning.trajectories.retreat import retreat_trajectory
from pepper_drake.planning.trajectories.trajectory_adapter import (
    AdaptationParams,
    AdaptedTrajectory,
    TrajectoryAdapter,
)

__all__ = ["PlanStatus", "ReachPlan", "ReachPlanner", "ReachPlannerParams"]

Vector = npt.NDArray[np.float64]

_SHORTEST = 0.8
"""The least duration of a movement that is adapted on its way [s]."""


class ReachPlanner:
    """Plays reaches through: primitive, coupling and inverse kinematics on what was seen.

    A movement that would not pass is adapted: the whole arm's path is bent until it does, and
    becomes a primitive again. The planner moves nothing and remembers nothing: a call depends on
    its arguments alone.

    Args:
        model: Pepper.
        arm: "left" or "right".
        X_OG: The hand's pre-grasp pose in the goal object's frame.
        primitive: With orientation and posture.
        coupling: None to do without.
        ik: Parameters of the inverse kinematics.
        params: What counts as good.
        adaptation: How a movement is adapted.
        goal_solids: The goal object's shapes in its frame: an adapted movement keeps off them.

    Attributes:
        shown: The movement as it was shown.
        arm_in_body: Where the arm's joints are among `BODY_JOINTS`.

    Raises:
        InputError: The primitive has no orientation or no posture.
    """

    def __init__(
        self,
        *,
        model: ControlModel,
        arm: str,
        X_OG: RigidTransform,
        primitive: MovementPrimitive,
        coupling: Coupling | None,
        ik: DifferentialIkParams,
        params: ReachPlannerParams,
        adaptation: AdaptationParams | None = None,
        goal_solids: Sequence[Solid] = (),
    ) -> None:
        if primitive.orientation is None or primitive.posture is None:
            raise InputError(
                f"primitive {primitive.name}: it has no orientation or no posture; "
                "learn it from a demonstration with rotations and joints"
            )
        self.demonstrated = Movement(primitive, coupling, X_OG)
        self.params = params
        self._geometry = ArmGeometry(model, arm)
        self._self_clearance = SelfClearance(model, self._geometry)
        self._situations = PlanningSceneBuilder(
            model, self._geometry, self._self_clearance, goal_solids, params
        )
        self._rehearsal = KinematicSimulator(model, self._geometry, ik, params.settle)
        self._limits = model.command_limits(arm_joints(arm), speed_fraction=ik.speed_fraction)
        self.arm_in_body = body_indices(arm_joints(arm))
        self._places = BasePlacement(model, arm, X_OG, primitive.goal, params)
        self._adapter: TrajectoryAdapter | None = None
        if params.adapt and isinstance(coupling, BarrierCoupling):
            demonstrated = primitive.posture.at(np.linspace(0.0, 1.0, 100))
            self._adapter = TrajectoryAdapter(
                model,
                arm,
                demonstrated[None],
                primitive.duration,
                adaptation if adaptation is not None else AdaptationParams(),
            )

    def plan_base_placement(
        self,
        *,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
    ) -> ReachPlan:
        """Finds a place to stand from which the reach is clear.

        Args:
            base_pose: Where the base is, x, y, yaw in W.
            joint_position: (15,) rad, in the order of `BODY_JOINTS`.
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles [m].

        Returns:
            The best plan found: clear, or nearly so, if there is one. It has to be checked again,
            with `check_reach`, from that place.
        """
        params = self.params
        field = PointCloudDistance(cloud_W, extension=params.solid_depth)
        if not self._places.is_reachable(base_pose, joint_position, X_WO):
            return ReachPlan(
                PlanStatus.OUT_OF_REACH,
                "the goal is higher or lower than the arm can reach",
                base_pose,
            )

        def has_room(places: Vector) -> npt.NDArray[np.bool_]:
            room = self._places.body_clearances(places, joint_position, field)
            return room >= params.body_clearance

        with_extrapolated_surface = self._situations.with_extrapolated_surface(
            cloud_W, X_WO, base_pose
        )
        usual, wide_candidates = (
            (
                self._situations(pose, joint_position, X_WO, cloud_W, with_extrapolated_surface)
                for pose in places(base_pose, joint_position, X_WO, has_room)
            )
            for places in (self._places, self._places.wide_candidates)
        )
        best: ReachPlan | None = None
        for plan in self._plans(usual, wide_candidates):
            best = plan if best is None else max(best, plan, key=self._quality)
            if self._is_good(plan) and self._is_brisk(plan):
                break
        if best is None:
            return ReachPlan(
                PlanStatus.NO_STANDING_ROOM,
                "nowhere near the goal is there room for the robot to stand",
                base_pose,
            )
        return best

    def _plans(
        self, usual: Iterator[PlanningScene], wide_candidates: Iterator[PlanningScene]
    ) -> Iterator[ReachPlan]:
        """Plans from several places, the most promising first.

        With adaptation the first of the usual places is tried with the movement as it was shown,
        and adapted to; then those of the others from which the goal is reached with most ease are
        adapted to; and if there is no way from any, those of places everywhere.
        """
        far_allowance = self.params.far_allowance
        if self._adapter is None:
            yield from (
                self._play(situation, self.demonstrated, far_allowance) for situation in usual
            )
            return
        first = next(usual, None)
        if first is None:
            return
        demonstrated = self._play(first, self.demonstrated, far_allowance)
        yield demonstrated
        way = self._is_way(demonstrated)
        for plan in self._adapted(
            first, demonstrated.joint_path, plan=False, allowance=far_allowance
        ):
            way |= self._is_way(plan)
            yield plan
        easiest: list[PlanningScene] = []
        for situations, allowance in ((usual, far_allowance), (wide_candidates, 0.0)):
            if situations is wide_candidates and way:
                return
            easiest = self._easiest(situations, allowance)
            for situation in easiest:
                for plan in self._adapted(situation, plan=False, allowance=allowance):
                    way |= self._is_way(plan)
                    yield plan
        for situation in easiest[:1] if not way else ():
            yield from self._adapted(situation)

    def _easiest(
        self, situations: Iterator[PlanningScene], allowance: float
    ) -> list[PlanningScene]:
        """Those with the cheapest clear postures at the goal, a few, the cheapest first."""
        ease = [(self._ease(one, allowance), number, one) for number, one in enumerate(situations)]
        easiest = sorted(item for item in ease if np.isfinite(item[0]))
        return [situation for _, _, situation in easiest[: self.params.places_adapted]]

    def check_reach(
        self,
        *,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
        movement: Movement | None = None,
    ) -> ReachPlan:
        """Plays the reach through from where the robot stands; see `plan_base_placement`.

        Args:
            base_pose: Where the base is.
            joint_position: (15,) rad.
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles [m].
            movement: What is tried first: the one that `plan_base_placement` found, or, left out,
                the one that was shown. If that does not pass, it is adapted.
        """
        field = self._situations.with_extrapolated_surface(cloud_W, X_WO, base_pose)
        situation = self._situations(base_pose, joint_position, X_WO, cloud_W, field)
        best = self._play(situation, self.demonstrated if movement is None else movement)
        if self._is_good(best):
            return best
        for plan in self._adapted(situation, best.joint_path):
            best = max(best, plan, key=self._quality)
        if movement is not None and best.status != PlanStatus.CLEAR:
            best = max(best, self._play(situation, self.demonstrated), key=self._quality)
        return best

    def replan(
        self,
        plan: ReachPlan,
        *,
        base_pose: Vector,
        joint_position: Vector,
        joint_velocity: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
    ) -> ReachPlan:
        """Adapts the rest of a movement while the arm is on its way.

        The new movement starts where the arm's command is, with its velocity, and is like what
        was left of the old one.

        Args:
            plan: What the arm performs.
            base_pose: Where the base is.
            joint_position: (15,) the present commands [rad].
            joint_velocity: (5,) the arm's, of the commands [rad/s].
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles as they are seen now [m].

        Returns:
            The best plan found for the rest: the old movement's if that is clear all the same, and
            not clear if there is none.
        """
        field = self._situations.with_extrapolated_surface(cloud_W, X_WO, base_pose)
        situation = self._situations(
            base_pose, joint_position, X_WO, cloud_W, field, joint_velocity
        )
        rest = self._rest(plan, situation.arm)
        duration = max((len(rest) - 1) * self._rehearsal.time_step, _SHORTEST)
        X_TG = situation.X_TO @ self.demonstrated.X_OG
        path = None
        if self._adapter is not None:
            path = self._adapter.adapt_remaining(
                situation.arm.position, X_TG, situation.surroundings, rest, duration
            )
        if path is None:
            return ReachPlan(PlanStatus.NO_CLEAR_PATH, "there is no clear way on", base_pose)
        return self._play(situation, self._movement(situation, path))

    def remaining_clearance(
        self,
        plan: ReachPlan,
        *,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
    ) -> float:
        """How near the rest of a plan's path would come to what is seen now [m]; see `replan`.

        It is infinite if nothing is near.
        """
        field = self._situations.with_extrapolated_surface(cloud_W, X_WO, base_pose)
        situation = self._situations(base_pose, joint_position, X_WO, cloud_W, field)
        rest = self._rest(plan, situation.arm)
        return float(situation.surroundings.clearances(rest[::5]).min())

    def plan_retreat(
        self,
        plan: ReachPlan,
        *,
        base_pose: Vector,
        joint_position: Vector,
        joint_velocity: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
    ) -> ReachPlan:
        """The way back to where there is room, for when there is none on; see `withdrawal`.

        Args:
            plan: What the arm performs.
            base_pose: Where the base is.
            joint_position: (15,) the present commands [rad].
            joint_velocity: (5,) the arm's, of the commands [rad/s].
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles as they are seen now [m].

        Returns:
            A plan whose end is not the goal. It is the best that can be done, clear or not.
        """
        field = self._situations.with_extrapolated_surface(cloud_W, X_WO, base_pose)
        situation = self._situations(
            base_pose, joint_position, X_WO, cloud_W, field, joint_velocity
        )
        assert plan.joint_path is not None
        arm, kinematics = situation.arm, self._geometry.kinematics
        came = plan.joint_path[: self._nearest(plan, arm) + 1]
        joints, duration = retreat_trajectory(
            came,
            arm.position,
            arm.velocity,
            situation.surroundings.clearances,
            self.params.withdrawal_clearance,
            self._limits,
        )
        primitive = fit_primitive_to_joint_path(kinematics, joints, duration, "withdrawal")
        end = kinematics.poses(joints[-1:])
        X_TG = RigidTransform(
            RotationMatrix.ProjectToRotationMatrix(end.hand_rotation[0]), end.hand_position[0]
        )
        X_OG = situation.X_TO.inverse() @ X_TG
        coupling = self._quiet_coupling(situation, primitive)
        return self._play(situation, Movement(primitive, coupling, X_OG))

    def _rest(self, plan: ReachPlan, arm: ArmState) -> Vector:
        """What is left (N, 5) of a plan's path from where the arm is, at least two postures."""
        assert plan.joint_path is not None
        return plan.joint_path[min(self._nearest(plan, arm), len(plan.joint_path) - 2) :]

    def _nearest(self, plan: ReachPlan, arm: ArmState) -> int:
        """The posture of a plan's path that is nearest to where the arm is."""
        assert plan.joint_path is not None
        return int(np.argmin(np.sum((plan.joint_path - arm.position) ** 2, axis=1)))

    def _quality(self, plan: ReachPlan) -> tuple[bool, bool, float, float]:
        return quality(plan, self.params.wanted_clearance)

    def _is_way(self, plan: ReachPlan) -> bool:
        """Whether it would do from near, too."""
        least = self.params.least_clearance
        return plan.status == PlanStatus.CLEAR and plan.clearance >= least

    def _is_brisk(self, plan: ReachPlan) -> bool:
        longest = self.params.slowest * self.demonstrated.primitive.duration
        return plan.movement is not None and plan.movement.primitive.duration <= longest

    def _is_good(self, plan: ReachPlan) -> bool:
        wanted = self.params.wanted_clearance
        return plan.status == PlanStatus.CLEAR and plan.clearance >= wanted

    def candidate_base_poses(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        has_room: HasRoom,
    ) -> Iterator[Vector]:
        """Places (3,) from which a reach is tried, x, y, yaw in W; see `BasePlacement`."""
        return self._places(base_pose, joint_position, X_WO, has_room)

    def demonstrated_path(self, count: int = 200) -> Vector:
        """The primitive's own path (count, 3), from its own start to its own goal [m]."""
        primitive = self.demonstrated.primitive
        return primitive.rollout(time_step=primitive.duration / (count - 1)).positions

    def _ease(self, situation: PlanningScene, allowance: float) -> float:
        """The least cost of a clear posture at the goal; infinite if there is none."""
        assert self._adapter is not None
        _, cost = self._adapter.goal_postures(
            situation.X_TO @ self.demonstrated.X_OG,
            situation.surroundings,
            allowance=allowance,
        )
        return float(cost.min(initial=np.inf))

    def _adapted(
        self,
        situation: PlanningScene,
        rollout: Vector | None = None,
        *,
        plan: bool = True,
        allowance: float = 0.0,
    ) -> Iterator[ReachPlan]:
        """The demonstrated movement, adapted and simulated, if a path exists."""
        if self._adapter is None:
            return
        X_TG = situation.X_TO @ self.demonstrated.X_OG
        path = self._adapter.adapt(
            situation.arm.position,
            X_TG,
            situation.surroundings,
            rollout,
            plan=plan,
            allowance=allowance,
        )
        if path is not None and path.slack > -self._adapter.params.cost.clearance:
            yield self._play(situation, self._movement(situation, path), allowance)

    def _movement(self, situation: PlanningScene, path: AdaptedTrajectory) -> Movement:
        """A path of the arm's joints as a movement that keeps to it."""
        demonstrated, kinematics = self.demonstrated, self._geometry.kinematics
        primitive = fit_primitive_to_joint_path(
            kinematics, path.joints, path.duration, f"{demonstrated.primitive.name}, adapted"
        )
        X_OG = reachable_pre_grasp(demonstrated.X_OG, situation.X_TO, kinematics, path.joints[-1])
        return Movement(primitive, self._quiet_coupling(situation, primitive), X_OG)

    def _quiet_coupling(
        self, situation: PlanningScene, primitive: MovementPrimitive
    ) -> Coupling | None:
        """The barrier of the movement that was shown, silent along a planned one."""
        if not isinstance(self.demonstrated.coupling, BarrierCoupling):
            return self.demonstrated.coupling
        hand = primitive.rollout(time_step=0.02)
        return fit_barrier_to_path(
            self.demonstrated.coupling,
            situation.field,
            hand.positions,
            hand.velocities,
            hand.accelerations,
        )

    def _play(
        self, situation: PlanningScene, movement: Movement, allowance: float = 0.0
    ) -> ReachPlan:
        """Plays a movement through and judges it; a little less clearance may be enough [m]."""
        params, arm = self.params, situation.arm
        X_TG = situation.X_TO @ movement.X_OG
        collision_checked = params.collision_checked and movement.coupling is not None
        rollout = movement if collision_checked else replace(movement, coupling=None)
        hand = self._rehearsal.roll_out(rollout, arm, X_TG, situation.field)
        joint_path = self._rehearsal.track(arm, hand, params.position_tolerance)
        reached = self._geometry.kinematics.poses(joint_path).hand_position
        error = float(np.linalg.norm(reached[-1] - X_TG.translation()))
        behind = float(np.linalg.norm(reached - hand.positions[: len(reached)], axis=1).max())
        clearance = float(situation.surroundings.clearances(joint_path[::3]).min())
        status, message = PlanStatus.CLEAR, ""
        if error > params.position_tolerance:
            status = PlanStatus.OUT_OF_REACH
            message = f"the hand would end {1000 * error:.0f} mm from its goal"
        elif behind > params.following_error:
            status = PlanStatus.CANNOT_FOLLOW
            message = f"the hand would fall {1000 * behind:.0f} mm behind its movement"
        elif self._self_clearance(situation.body, joint_path[::5]).min() < params.self_clearance:
            status = PlanStatus.SELF_COLLISION
            message = "the arm would run into the robot's own body"
        elif collision_checked and clearance < params.least_clearance - allowance:
            status = PlanStatus.NO_CLEAR_PATH
            message = (
                f"the arm would come {1000 * clearance:.0f} mm near to what was seen, "
                f"less than {1000 * params.least_clearance:.0f} mm"
            )
        elif movement is not self.demonstrated and self._touches_object(situation, joint_path):
            status = PlanStatus.NO_CLEAR_PATH
            message = "the arm would touch the goal object"
        return ReachPlan(
            status,
            message,
            situation.base_pose,
            error,
            clearance,
            joint_path,
            movement,
            collision_checked,
        )

    def _touches_object(self, situation: PlanningScene, joint_path: Vector) -> bool:
        gaps = situation.surroundings.object_clearances(joint_path[::3])
        return bool(gaps.min() < self.params.object_clearance)
