"""Adapts a demonstrated movement of the whole arm to a scene."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.compiled import load_compiled
from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.planning.collision.arm_collision_checker import ArmCollisionChecker
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.clearance_table import ClearanceTable
from pepper_drake.planning.collision.compiled_arm import reach_point
from pepper_drake.planning.collision.compiled_grid import keep_distances, looked_up
from pepper_drake.planning.ik.goal_configurations import GoalConfigurations, orientation_error
from pepper_drake.planning.trajectories.adaptation_params import AdaptationParams, GoalAxis
from pepper_drake.planning.trajectories.compiled_cost import rate_paths
from pepper_drake.planning.trajectories.joint_trajectories import (
    minimum_duration,
    resampled,
    retarget,
    smoothed,
    time_parameterize,
)
from pepper_drake.planning.trajectories.rrt_connect import rrt_connect
from pepper_drake.planning.trajectories.trajectory_cost import TrajectoryCost
from pepper_drake.planning.trajectories.trajectory_search import SearchResult, optimize_trajectory

Vector = npt.NDArray[np.float64]

PLANNED = -1
"""The origin of a path from the path planner."""

_LOOKED_AT = 32
"""Number of goal configurations evaluated in a batch."""


_DOWN = GoalAxis()


@dataclass(frozen=True, eq=False)
class AdaptedTrajectory:
    """A joint path adapted to a scene.

    Attributes:
        joints: (N, 5) at even times [rad].
        duration: [s].
        slack: Least clearance minus the desired one [m].
        cost: Its cost.
        origin: Index of the demonstration behind it, or `PLANNED`.
        generations: Generations of the search.
    """

    joints: Vector
    duration: float
    slack: float
    cost: float
    origin: int
    generations: int


class TrajectoryAdapter:
    """Finds clear paths of an arm near demonstrated ones.

    Args:
        model: Pepper.
        arm: "left" or "right".
        demonstrations: (D, N, 5) joints at even relative times [rad], the reference first.
        duration: Duration of the demonstrations [s].
        params: Parameters of the adaptation.
        clearance: Clearances: `start` and `want` at the goal, `search_target` along the path, and
            `slow` for the fallback planner.
        axis: The axis of the hand whose direction matters.
    """

    def __init__(
        self,
        model: ControlModel,
        arm: str,
        demonstrations: Vector,
        duration: float,
        params: AdaptationParams,
        clearance: ClearanceTable,
        axis: GoalAxis = _DOWN,
    ) -> None:
        self._duration, self.params, self._clearance = duration, params, clearance
        self._axis = axis
        self._demonstrations = resampled(demonstrations, params.samples)
        self._kinematics = arm_kinematics(model, arm)
        limits = model.command_limits(arm_joints(arm), speed_fraction=params.speed_fraction)
        lower, upper = limits.position_lower.copy(), limits.position_upper.copy()
        for coupled in limits.coupled:
            lower[coupled.follower], upper[coupled.follower] = coupled.strictest
        self._lower, self._upper = lower + params.limit_margin, upper - params.limit_margin
        self._limits = limits.velocity, params.acceleration_fraction * limits.acceleration
        load_compiled(keep_distances, looked_up, rate_paths, reach_point)
        self._postures = GoalConfigurations(self._kinematics, self._lower, self._upper)

    def adapt(
        self,
        start: Vector,
        X_TG: RigidTransform,
        checker: ArmCollisionChecker,
        rollout: Vector | None = None,
        *,
        deform: bool = True,
        plan: bool = True,
        allowance: float = 0.0,
    ) -> AdaptedTrajectory | None:
        """Searches for a clear path from a posture to a hand goal.

        Args:
            start: (5,) rad.
            X_TG: Goal of the hand's position and, as far as possible, orientation.
            checker: Distances of the arm to obstacles.
            rollout: (K, 5) what the demonstration alone would make of it, one more to start from.
            deform: Whether demonstrations are deformed; otherwise only the path planner is used.
            plan: Whether the path planner is used if no deformed demonstration is clear.
            allowance: By how much the clearance at the goal may fall short [m].

        Returns:
            The best path found, whether it is clear or not; None if no clear posture reaches the
            goal, or the planner finds no path.
        """
        demonstrations = self._demonstrations
        if rollout is not None:
            # Barrier and limits make it jerky.
            own = smoothed(smoothed(resampled(rollout, self.params.samples)))[None]
            demonstrations = np.concatenate((own, demonstrations))
        goals = self.goal_postures(X_TG, checker, demonstrations[:, -1], allowance)
        return self._adapt(start, goals, checker, demonstrations, self._duration, plan, deform)

    def adapt_remaining(
        self,
        start: Vector,
        X_TG: RigidTransform,
        checker: ArmCollisionChecker,
        remaining: Vector,
        duration: float,
    ) -> AdaptedTrajectory | None:
        """Searches for a clear path that continues the arm's present motion; see `adapt`.

        Args:
            start: Present joints (5,) [rad].
            X_TG: The hand's goal.
            checker: Present distances of the arm to obstacles.
            remaining: Rest of the path (K, 5) [rad], with whose velocity the new path starts.
            duration: Duration of the rest [s].
        """
        rest = resampled(remaining, self.params.samples)[None]
        goals = self.goal_postures(X_TG, checker, rest[:, -1])
        return self._adapt(start, goals, checker, rest, duration, plan=False)

    def adapt_back(
        self, start: Vector, end: Vector, checker: ArmCollisionChecker, travelled: Vector
    ) -> AdaptedTrajectory | None:
        """Searches for a clear path to a posture, near known paths played backwards; see `adapt`.

        Args:
            start: Present joints (5,) [rad].
            end: The posture (5,) [rad].
            checker: Distances of the arm to obstacles.
            travelled: The path (K, 5) on which the arm came, used beside the demonstrations [rad].
        """
        came = resampled(travelled, self.params.samples)[None]
        backwards = np.concatenate((came, self._demonstrations))[:, ::-1]
        goals = end[None], np.zeros((1, len(backwards)))
        return self._adapt(start, goals, checker, backwards, self._duration)

    def _adapt(
        self,
        start: Vector,
        goals_with_costs: tuple[Vector, Vector],
        checker: ArmCollisionChecker,
        demonstrations: Vector,
        duration: float,
        plan: bool = True,
        deform: bool = True,
    ) -> AdaptedTrajectory | None:
        goals, discomfort = goals_with_costs
        if not len(goals):
            return None
        lower, upper = np.minimum(self._lower, start), np.maximum(self._upper, start)
        references: list[tuple[SearchResult, int]] = []
        if deform:
            shape = len(demonstrations), len(goals)
            origins, ends = (index.ravel() for index in np.indices(shape))
            paths = retarget(demonstrations[origins], start, goals[ends]).clip(lower, upper)
            rating = self._rate(paths, checker, duration)(paths)
            cost = rating.cost + discomfort[ends, origins]
            for one in _different(paths, cost, self.params.candidates):
                rated = float(rating.cost[one]), float(rating.slack[one])
                references.append((SearchResult(paths[one], *rated, 0), int(origins[one])))
        best: AdaptedTrajectory | None = None
        for number, (found, origin) in enumerate(
            itertools.chain(references, self._planned(start, goals, checker) if plan else ()),
            start=1,
        ):
            if found.slack <= self.params.search.min_slack:
                found = optimize_trajectory(
                    found.path,
                    self._rate(found.path[None], checker, duration),
                    lower=lower,
                    upper=upper,
                    params=self.params.search,
                )
            path = AdaptedTrajectory(
                found.path,
                max(float(minimum_duration(found.path, *self._limits)), duration),
                found.slack,
                found.cost,
                origin,
                found.generations,
            )
            best = path if best is None else max(best, path, key=self._rank)
            if self._rank(best) > (True, -self.params.good_cost):
                break
            if number >= len(references) and best.slack > self.params.accepted_slack:
                break  # The path planner is the last resort.
        return best

    def _rank(self, path: AdaptedTrajectory) -> tuple[bool, float]:
        """Returns a sort key of paths: clear ones by their cost, others by their slack."""
        clear = path.slack > self.params.accepted_slack
        return clear, -path.cost if clear else path.slack

    def _planned(
        self, start: Vector, goals: Vector, checker: ArmCollisionChecker
    ) -> Iterator[tuple[SearchResult, int]]:
        """Yields the path planner's path, not rated, if it finds one: one more to start from."""
        ends = checker.approximate_distances(np.concatenate((start[None], goals)))
        allowed = np.minimum(ends.min(axis=0), self._clearance.slow) - self.params.corner_slack
        corners = rrt_connect(
            start,
            goals,
            lambda postures: checker.keep_distances(postures, allowed),
            lower=np.minimum(self._lower, start),
            upper=np.maximum(self._upper, start),
            params=self.params.planner,
        )
        if corners is not None:
            path = time_parameterize(corners, self.params.samples)
            yield SearchResult(path, np.inf, -np.inf, 0), PLANNED

    def _rate(
        self, references: Vector, checker: ArmCollisionChecker, duration: float
    ) -> TrajectoryCost:
        return TrajectoryCost(
            checker,
            references,
            duration=duration,
            velocity=self._limits[0],
            acceleration=self._limits[1],
            params=self.params.cost,
            clearance=self._clearance.search_target,
        )

    def goal_postures(
        self,
        X_TG: RigidTransform,
        checker: ArmCollisionChecker,
        ends: Vector | None = None,
        allowance: float = 0.0,
    ) -> tuple[Vector, Vector]:
        """Returns clear goal configurations, and the cost of each for each demonstration.

        Args:
            X_TG: The hand's goal.
            checker: Distances of the arm to obstacles.
            ends: (D, 5) last postures of the demonstrations [rad]; the adapter's own by default.
            allowance: By how much the clearance may fall short [m].

        Returns:
            The best postures (G, 5) for each demonstration [rad]; and (G, D) their costs.
        """
        params = self.params
        ends = self._demonstrations[:, -1] if ends is None else ends
        p_TG, R_TG = X_TG.translation(), X_TG.rotation().matrix()
        axis, tolerance = self._axis
        near = self._postures.near(
            p_TG, params.ik_seeds, R_TG, axis, tolerance, params.ik_candidates
        )
        q, there = self._postures.solve(p_TG, np.concatenate((ends, near)))
        q = q[there]
        q = self._postures.well_turned(q, R_TG, axis, tolerance - params.turn_margin)
        turn = orientation_error(self._kinematics.poses(q).hand_rotation, R_TG)
        room = np.minimum(q - self._lower, self._upper - q).min(axis=1, initial=np.inf)
        shared = (turn / params.turn) ** 2 + 2.0 * np.maximum(1.0 - room / 0.1, 0.0) ** 2
        away = np.sum((q[:, None] - ends) ** 2, axis=2) / params.posture**2
        cost = shared[:, None] + away
        # The cheapest first, as the collision check takes longest.
        order = np.argsort(cost.min(axis=1), kind="stable")
        goals, costs, wanted = q[:0], cost[:0], params.goals_kept * len(ends)
        for first in range(0, len(q), _LOOKED_AT):
            some = order[first : first + _LOOKED_AT]
            least = self._goal_clearance(q[some], checker)
            clear = least >= self._clearance.start - allowance
            lack = np.maximum(1.0 - least[clear] / self._clearance.want, 0.0)
            goals = np.concatenate((goals, q[some[clear]]))
            costs = np.concatenate((costs, cost[some[clear]] + 5.0 * lack[:, None] ** 2))
            if len(goals) >= wanted:
                break
        if not len(goals):
            return goals, costs
        kept = np.unique(np.argsort(costs, axis=0, kind="stable")[: params.goals_kept])
        return goals[kept], costs[kept]

    def _goal_clearance(self, q: Vector, checker: ArmCollisionChecker) -> Vector:
        """Returns clearances (M,) of postures (M, 5); -inf if too close to the goal object [m]."""
        off_object = checker.object_distances(q) >= self.params.object_clearance
        clearance = np.full(len(q), -np.inf)
        clearance[off_object] = checker.distances(q[off_object])
        return clearance


def _different(paths: Vector, cost: Vector, count: int) -> list[int]:
    """Selects the cheapest paths that differ from each other by 0.2 rad (rms)."""
    chosen: list[int] = []
    for number in np.argsort(cost, kind="stable"):
        off = [np.sqrt(np.mean((paths[number] - paths[other]) ** 2)) for other in chosen]
        if all(distance > 0.2 for distance in off):
            chosen.append(int(number))
            if len(chosen) == count:
                break
    return chosen
