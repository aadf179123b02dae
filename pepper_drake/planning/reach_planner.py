"""Can the hand get there, and from where? The whole reach, played through before the arm moves."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.coupling import BarrierCoupling, Coupling
from pepper_drake.learning.obstacle_field import ObstacleField
from pepper_drake.perception.solids import Solid
from pepper_drake.planning.adapted_movement import adapted_pre_grasp, primitive_of_joint_path
from pepper_drake.planning.arm_adapter import AdaptationParams, AdaptedPath, ArmAdapter
from pepper_drake.planning.arm_geometry import ArmGeometry
from pepper_drake.planning.control_model import ControlModel, arm_joints, body_indices
from pepper_drake.planning.differential_ik import DifferentialIkParams
from pepper_drake.planning.movement import Movement
from pepper_drake.planning.quiet_coupling import quiet_coupling
from pepper_drake.planning.reach_plan import (
    ReachPlan,
    ReachPlannerParams,
    ReachVerdict,
    quality,
)
from pepper_drake.planning.rehearsal import ArmState, Rehearsal
from pepper_drake.planning.self_clearance import SelfClearance
from pepper_drake.planning.situation import Situation, Situations
from pepper_drake.planning.standing_places import HasRoom, StandingPlaces
from pepper_drake.planning.withdrawal import withdrawal_path

__all__ = ["ReachPlan", "ReachPlanner", "ReachPlannerParams", "ReachVerdict"]

Vector = npt.NDArray[np.float64]

_SHORTEST = 0.8
"""The least duration of a movement that is adapted on its way, s."""


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
        self.shown = Movement(primitive, coupling, X_OG)
        self.params = params
        self._geometry = ArmGeometry(model, arm)
        self._self_clearance = SelfClearance(model, self._geometry)
        self._situations = Situations(
            model, self._geometry, self._self_clearance, goal_solids, params
        )
        self._rehearsal = Rehearsal(model, self._geometry, ik, params.settle)
        self._limits = model.command_limits(arm_joints(arm), speed_fraction=ik.speed_fraction)
        self.arm_in_body = body_indices(arm_joints(arm))
        self._places = StandingPlaces(model, arm, X_OG, primitive.goal, params)
        self._adapter: ArmAdapter | None = None
        if params.adapt and isinstance(coupling, BarrierCoupling):
            shown = primitive.posture.at(np.linspace(0.0, 1.0, 100))
            self._adapter = ArmAdapter(
                model,
                arm,
                shown[None],
                primitive.duration,
                adaptation if adaptation is not None else AdaptationParams(),
            )

    def plan_stand(
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
            cloud_W: (P, 3) obstacles, m.

        Returns:
            The best plan found: clear, or nearly so, if there is one. It has to be checked again,
            with `check_reach`, from that place.
        """
        params = self.params
        field = ObstacleField(cloud_W, extension=params.solid_depth)
        if not self._places.any_within_reach(base_pose, joint_position, X_WO):
            return ReachPlan(
                ReachVerdict.OUT_OF_REACH,
                "the goal is higher or lower than the arm can reach",
                base_pose,
            )

        def has_room(places: Vector) -> npt.NDArray[np.bool_]:
            room = self._places.body_clearances(places, joint_position, field)
            return room >= params.body_clearance

        supposed = self._situations.supposed(cloud_W, X_WO, base_pose)
        usual, everywhere = (
            (
                self._situations(pose, joint_position, X_WO, cloud_W, supposed)
                for pose in places(base_pose, joint_position, X_WO, has_room)
            )
            for places in (self._places, self._places.everywhere)
        )
        best: ReachPlan | None = None
        for plan in self._plans(usual, everywhere):
            best = plan if best is None else max(best, plan, key=self._quality)
            if self._is_good(plan) and self._is_brisk(plan):
                break
        if best is None:
            return ReachPlan(
                ReachVerdict.NO_STANDING_ROOM,
                "nowhere near the goal is there room for the robot to stand",
                base_pose,
            )
        return best

    def _plans(
        self, usual: Iterator[Situation], everywhere: Iterator[Situation]
    ) -> Iterator[ReachPlan]:
        """Plans from several places, the most promising first.

        With adaptation the first of the usual places is tried with the movement as it was shown,
        and adapted to; then those of the others from which the goal is reached with most ease are
        adapted to; and if there is no way from any, those of places everywhere.
        """
        afar = self.params.afar
        if self._adapter is None:
            yield from (self._play(situation, self.shown, afar) for situation in usual)
            return
        first = next(usual, None)
        if first is None:
            return
        shown = self._play(first, self.shown, afar)
        yield shown
        way = self._is_way(shown)
        for plan in self._adapted(first, shown.joint_path, plan=False, allowance=afar):
            way |= self._is_way(plan)
            yield plan
        easiest: list[Situation] = []
        for situations, allowance in ((usual, afar), (everywhere, 0.0)):
            if situations is everywhere and way:
                return
            easiest = self._easiest(situations, allowance)
            for situation in easiest:
                for plan in self._adapted(situation, plan=False, allowance=allowance):
                    way |= self._is_way(plan)
                    yield plan
        for situation in easiest[:1] if not way else ():
            yield from self._adapted(situation)

    def _easiest(self, situations: Iterator[Situation], allowance: float) -> list[Situation]:
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
        """Plays the reach through from where the robot stands; see `plan_stand`.

        Args:
            base_pose: Where the base is.
            joint_position: (15,) rad.
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles, m.
            movement: What is tried first: the one that `plan_stand` found, or, left out, the one
                that was shown. If that does not pass, it is adapted.
        """
        field = self._situations.supposed(cloud_W, X_WO, base_pose)
        situation = self._situations(base_pose, joint_position, X_WO, cloud_W, field)
        best = self._play(situation, self.shown if movement is None else movement)
        if self._is_good(best):
            return best
        for plan in self._adapted(situation, best.joint_path):
            best = max(best, plan, key=self._quality)
        if movement is not None and best.verdict != ReachVerdict.CLEAR:
            best = max(best, self._play(situation, self.shown), key=self._quality)
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
            joint_position: (15,) the present commands, rad.
            joint_velocity: (5,) the arm's, of the commands, rad/s.
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles as they are seen now, m.

        Returns:
            The best plan found for the rest: the old movement's if that is clear all the same, and
            not clear if there is none.
        """
        field = self._situations.supposed(cloud_W, X_WO, base_pose)
        situation = self._situations(
            base_pose, joint_position, X_WO, cloud_W, field, joint_velocity
        )
        rest = self._rest(plan, situation.arm)
        duration = max((len(rest) - 1) * self._rehearsal.time_step, _SHORTEST)
        X_TG = situation.X_TO @ self.shown.X_OG
        path = None
        if self._adapter is not None:
            path = self._adapter.readapt(
                situation.arm.position, X_TG, situation.surroundings, rest, duration
            )
        if path is None:
            return ReachPlan(ReachVerdict.NO_CLEAR_PATH, "there is no clear way on", base_pose)
        return self._play(situation, self._movement(situation, path))

    def clearance_ahead(
        self,
        plan: ReachPlan,
        *,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
    ) -> float:
        """How near the rest of a plan's path would come to what is seen now, m; see `replan`.

        It is infinite if nothing is near.
        """
        field = self._situations.supposed(cloud_W, X_WO, base_pose)
        situation = self._situations(base_pose, joint_position, X_WO, cloud_W, field)
        rest = self._rest(plan, situation.arm)
        return float(situation.surroundings.clearances(rest[::5]).min())

    def withdraw(
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
            joint_position: (15,) the present commands, rad.
            joint_velocity: (5,) the arm's, of the commands, rad/s.
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles as they are seen now, m.

        Returns:
            A plan whose end is not the goal. It is the best that can be done, clear or not.
        """
        field = self._situations.supposed(cloud_W, X_WO, base_pose)
        situation = self._situations(
            base_pose, joint_position, X_WO, cloud_W, field, joint_velocity
        )
        assert plan.joint_path is not None
        arm, kinematics = situation.arm, self._geometry.kinematics
        came = plan.joint_path[: self._nearest(plan, arm) + 1]
        joints, duration = withdrawal_path(
            came,
            arm.position,
            arm.velocity,
            situation.surroundings.clearances,
            self.params.withdrawal_clearance,
            self._limits,
        )
        primitive = primitive_of_joint_path(kinematics, joints, duration, "withdrawal")
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
        return plan.verdict == ReachVerdict.CLEAR and plan.clearance >= least

    def _is_brisk(self, plan: ReachPlan) -> bool:
        longest = self.params.slowest * self.shown.primitive.duration
        return plan.movement is not None and plan.movement.primitive.duration <= longest

    def _is_good(self, plan: ReachPlan) -> bool:
        wanted = self.params.wanted_clearance
        return plan.verdict == ReachVerdict.CLEAR and plan.clearance >= wanted

    def places_to_stand(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        has_room: HasRoom,
    ) -> Iterator[Vector]:
        """Places (3,) from which a reach is tried, x, y, yaw in W; see `StandingPlaces`."""
        return self._places(base_pose, joint_position, X_WO, has_room)

    def demonstrated_path(self, count: int = 200) -> Vector:
        """The primitive's own path (count, 3), from its own start to its own goal, m."""
        primitive = self.shown.primitive
        return primitive.rollout(time_step=primitive.duration / (count - 1)).positions

    def _ease(self, situation: Situation, allowance: float) -> float:
        """The least cost of a clear posture at the goal; infinite if there is none."""
        assert self._adapter is not None
        _, cost = self._adapter.goal_postures(
            situation.X_TO @ self.shown.X_OG,
            situation.surroundings,
            allowance=allowance,
        )
        return float(cost.min(initial=np.inf))

    def _adapted(
        self,
        situation: Situation,
        played: Vector | None = None,
        *,
        plan: bool = True,
        allowance: float = 0.0,
    ) -> Iterator[ReachPlan]:
        """The shown movement adapted and played through, if there is a way; see `ArmAdapter`."""
        if self._adapter is None:
            return
        X_TG = situation.X_TO @ self.shown.X_OG
        path = self._adapter.adapt(
            situation.arm.position,
            X_TG,
            situation.surroundings,
            played,
            plan=plan,
            allowance=allowance,
        )
        if path is not None and path.slack > -self._adapter.params.cost.clearance:
            yield self._play(situation, self._movement(situation, path), allowance)

    def _movement(self, situation: Situation, path: AdaptedPath) -> Movement:
        """A path of the arm's joints as a movement that keeps to it."""
        shown, kinematics = self.shown, self._geometry.kinematics
        primitive = primitive_of_joint_path(
            kinematics, path.joints, path.duration, f"{shown.primitive.name}, adapted"
        )
        X_OG = adapted_pre_grasp(shown.X_OG, situation.X_TO, kinematics, path.joints[-1])
        return Movement(primitive, self._quiet_coupling(situation, primitive), X_OG)

    def _quiet_coupling(
        self, situation: Situation, primitive: MovementPrimitive
    ) -> Coupling | None:
        """The barrier of the movement that was shown, silent along a planned one."""
        if not isinstance(self.shown.coupling, BarrierCoupling):
            return self.shown.coupling
        hand = primitive.rollout(time_step=0.02)
        return quiet_coupling(
            self.shown.coupling,
            situation.field,
            hand.positions,
            hand.velocities,
            hand.accelerations,
        )

    def _play(self, situation: Situation, movement: Movement, allowance: float = 0.0) -> ReachPlan:
        """Plays a movement through and judges it; a little less clearance may be enough [m]."""
        params, arm = self.params, situation.arm
        X_TG = situation.X_TO @ movement.X_OG
        vetted = params.vetted and movement.coupling is not None
        played = movement if vetted else replace(movement, coupling=None)
        hand = self._rehearsal.roll_out(played, arm, X_TG, situation.field)
        joint_path = self._rehearsal.track(arm, hand, params.position_tolerance)
        reached = self._geometry.kinematics.poses(joint_path).hand_position
        error = float(np.linalg.norm(reached[-1] - X_TG.translation()))
        behind = float(np.linalg.norm(reached - hand.positions[: len(reached)], axis=1).max())
        clearance = float(situation.surroundings.clearances(joint_path[::3]).min())
        verdict, sentence = ReachVerdict.CLEAR, ""
        if error > params.position_tolerance:
            verdict = ReachVerdict.OUT_OF_REACH
            sentence = f"the hand would end {1000 * error:.0f} mm from its goal"
        elif behind > params.following_error:
            verdict = ReachVerdict.CANNOT_FOLLOW
            sentence = f"the hand would fall {1000 * behind:.0f} mm behind its movement"
        elif self._self_clearance(situation.body, joint_path[::5]).min() < params.self_clearance:
            verdict = ReachVerdict.SELF_COLLISION
            sentence = "the arm would run into the robot's own body"
        elif vetted and clearance < params.least_clearance - allowance:
            verdict = ReachVerdict.NO_CLEAR_PATH
            sentence = (
                f"the arm would come {1000 * clearance:.0f} mm near to what was seen, "
                f"less than {1000 * params.least_clearance:.0f} mm"
            )
        elif movement is not self.shown and self._touches_object(situation, joint_path):
            verdict = ReachVerdict.NO_CLEAR_PATH
            sentence = "the arm would touch the goal object"
        return ReachPlan(
            verdict, sentence, situation.base_pose, error, clearance, joint_path, movement, vetted
        )

    def _touches_object(self, situation: Situation, joint_path: Vector) -> bool:
        gaps = situation.surroundings.object_clearances(joint_path[::3])
        return bool(gaps.min() < self.params.object_clearance)
