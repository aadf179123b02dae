"""The best plan over all base placements."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.planning.reach.base_placement import BasePlacement, HasRoom
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.planning_scene import PlanningScene
from pepper_drake.planning.reach.reach_evaluator import ReachEvaluator
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan

Vector = npt.NDArray[np.float64]

_ROUNDING = 1e-9
"""Error of equal clearances [m]."""


class BasePlacementPlanner:
    """Simulates reaches from candidate base poses and returns the best.

    Args:
        evaluator: Simulates, evaluates and adapts movements.
        places: Generates the candidates.

    Attributes:
        places: As given.
    """

    def __init__(self, evaluator: ReachEvaluator, places: BasePlacement) -> None:
        self._evaluator, self.places = evaluator, places

    def plan(
        self,
        observation: Observation,
        is_suitable: HasRoom = lambda places: np.isfinite(places[:, 0]),
    ) -> ReachPlan:
        """Returns the best plan over all suitable base placements; see `Planner`."""
        poses = (observation.base_pose, observation.joint_position, observation.X_WO)
        if not self.places.is_reachable(*poses):
            return ReachPlan(
                PlanStatus.OUT_OF_REACH,
                "the goal is higher or lower than the arm can reach",
                observation.base_pose,
            )

        field = self.standing_field(observation)

        def has_room(places: Vector) -> npt.NDArray[np.bool_]:
            suitable = is_suitable(places)
            suitable[suitable] = self.has_room(places[suitable], observation, field)
            return suitable

        scenes = self._evaluator.scenes
        obstacles = scenes.obstacle_field(observation)
        usual, wide = (
            (
                scenes(observation.from_base_pose(pose), obstacles)
                for pose in candidates(*poses, has_room)
            )
            for candidates in (self.places, self.places.wide_candidates)
        )
        best: ReachPlan | None = None
        for plan in self._plans(usual, wide):
            best = plan if best is None else max(best, plan, key=self._evaluator.quality)
            if self._evaluator.is_good(plan) and self._is_short(plan):
                break
        if best is None:
            return ReachPlan(
                PlanStatus.NO_STANDING_ROOM,
                "nowhere near the goal is there room for the robot to stand",
                observation.base_pose,
            )
        return self._evaluator.explained(best, observation)

    def has_room(
        self,
        places: Vector,
        observation: Observation,
        field: PointCloudDistance | None = None,
        lost: float = 0.0,
    ) -> npt.NDArray[np.bool_]:
        """Tells at which base poses (N, 3), and on the drive there, the body has its clearance.

        A robot that already stands nearer to an obstacle may drive, but comes no nearer.

        Args:
            places: x, y [m], yaw [rad] in W.
            observation: The observation.
            field: Distances to its obstacles, if they exist already.
            lost: By how much the clearance may fall short [m].
        """
        params, joints = self._evaluator.params, observation.joint_position
        if field is None:
            field = self.standing_field(observation)
        standing, driving = params.body_clearance - lost, params.drive_clearance - lost
        free = self.places.body_clearances(places, joints, field, standing) >= standing
        to = np.concatenate((observation.base_pose[None], places[free]))
        present, *drive = self.places.drive_clearances(
            observation.base_pose, to, joints, field, driving
        )
        free[free] = np.array(drive) >= min(driving, present - _ROUNDING)
        return free

    def standing_field(self, observation: Observation) -> PointCloudDistance:
        """Returns distances to obstacles, to the floor where it is hidden, and the goal object."""
        params, obstacles = self._evaluator.params, observation.obstacles
        if observation.space is not None and params.unseen.check_drive:
            hidden = observation.space.hidden_below(obstacles, params.unseen.cell)
            obstacles = np.concatenate((obstacles, hidden))
        obstacles = np.concatenate((obstacles, self._evaluator.scenes.goal_surface(observation)))
        return PointCloudDistance(obstacles, extension=params.solid_depth)

    def _plans(
        self, usual: Iterator[PlanningScene], wide: Iterator[PlanningScene]
    ) -> Iterator[ReachPlan]:
        """Yields plans from several places, the most promising first.

        With adaptation the first of the usual places is tried with the demonstrated movement, and
        adapted to; then those of the others with the cheapest goal configurations; if there is no
        path from any, those of the wide candidates; and then the path planner is asked for more of
        these.
        """
        evaluator, tolerance = self._evaluator, self._evaluator.params.predrive_clearance_tolerance
        if evaluator.adapter is None:
            for scene in usual:
                yield evaluator.evaluate(scene, evaluator.demonstrated, tolerance)
            return
        first = next(usual, None)
        if first is None:
            return
        demonstrated = evaluator.evaluate(first, evaluator.demonstrated, tolerance)
        yield demonstrated
        found = self._is_clear_from_near(demonstrated)
        for plan in evaluator.adapted(
            first, demonstrated.joint_path, plan=False, allowance=tolerance
        ):
            found |= self._is_clear_from_near(plan)
            yield plan
        params, easiest = evaluator.params, list[PlanningScene]()
        for scenes, allowance in ((usual, tolerance), (wide, 0.0)):
            if scenes is wide and found:
                return
            easiest = self._easiest(scenes, allowance)
            for scene in easiest[: params.max_adapted_placements]:
                for plan in evaluator.adapted(scene, plan=False, allowance=allowance):
                    found |= self._is_clear_from_near(plan)
                    yield plan
        for scene in () if found else easiest[: params.max_path_planner_placements]:
            for plan in evaluator.adapted(scene, deform=False):
                yield plan
                if evaluator.is_good(plan):
                    return

    def _easiest(self, scenes: Iterator[PlanningScene], allowance: float) -> list[PlanningScene]:
        """Returns those with a clear goal configuration, the one with the cheapest first."""
        ease = [(self._ease(one, allowance), number, one) for number, one in enumerate(scenes)]
        return [scene for cost, _, scene in sorted(ease) if np.isfinite(cost)]

    def _ease(self, scene: PlanningScene, allowance: float) -> float:
        """Returns the least cost of a clear goal configuration; infinite if there is none."""
        adapter = self._evaluator.adapter
        assert adapter is not None
        X_TG = scene.X_TO @ self._evaluator.demonstrated.X_OG
        _, cost = adapter.goal_postures(X_TG, scene.checker, allowance=allowance)
        return float(cost.min(initial=np.inf))

    def _is_clear_from_near(self, plan: ReachPlan) -> bool:
        """True if a plan is clear without the allowance for plans from a distance."""
        start = self._evaluator.params.clearance.start
        return plan.status == PlanStatus.CLEAR and plan.clearance >= start

    def _is_short(self, plan: ReachPlan) -> bool:
        evaluator = self._evaluator
        longest = (
            evaluator.params.acceptable_duration_ratio * evaluator.demonstrated.primitive.duration
        )
        return plan.movement is not None and plan.movement.primitive.duration <= longest
