"""Base placements with the torso leaning forward, for goals low in front of the robot."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP
from pepper_drake.perception.gaze.head_aiming import aim_head, camera_pose, clamp_head
from pepper_drake.perception.gaze.view_planning import visible
from pepper_drake.planning.reach.base_placement_planner import BasePlacementPlanner
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_evaluator import ReachEvaluator
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_task import ReachTask

Vector = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


class LeaningPlacement:
    """Chooses the base placement and, for a low goal, the hip angle.

    A low goal should be in view of a colour camera from the placement, past tablet and arm: if it
    is not seen, a reach ends unconfirmed. Where the present hip angle offers no such placement,
    others are tried.

    Args:
        placements: Finds base placements for the present hip angle.
        evaluator: Simulates movements.
        body: Returns centres (S, 3) in T and radii (S,) [m] of spheres around the body that may
            hide the goal, for an observation and its X_WT.
        task: Goal, marker and criteria.
    """

    def __init__(
        self,
        placements: BasePlacementPlanner,
        evaluator: ReachEvaluator,
        body: Callable[[Observation, RigidTransform], tuple[Vector, Vector]],
        task: ReachTask,
    ) -> None:
        self._placements, self._evaluator, self._body = placements, evaluator, body
        self._X_OG, self._X_OM, self._params = task.X_OG, task.X_OM, task.params

    def plan(self, observation: Observation) -> ReachPlan:
        """Returns the best plan over base placements and, for a low goal, hip angles."""
        if self.is_low(observation):
            for leaning in self._postures(observation):
                plan = self._placements.plan(leaning, partial(self.in_view, observation=leaning))
                if not self.shows_marker(plan, leaning):
                    continue
                if leaning is observation:
                    return plan
                if self.may_lean(plan, observation, leaning.hip_pitch):
                    return replace(plan, hip_pitch=leaning.hip_pitch)
        return self._placements.plan(observation)

    def is_low(self, observation: Observation) -> bool:
        """True if the hand's goal is so low that the robot may lean."""
        z_WG = float((observation.X_WO @ self._X_OG).translation()[2])
        z_WT = float(self._evaluator.scenes.torso_pose(observation).translation()[2])
        return self._X_OM is not None and z_WG - z_WT < self._params.lean.height

    def in_view(self, places: Vector, observation: Observation) -> Mask:
        """Tells at which base poses (N, 3) a colour camera can see the marker past the body."""
        assert self._X_OM is not None
        p_WM = (observation.X_WO @ self._X_OM).translation()
        p_TM = np.zeros((len(places), 3))
        for k, place in enumerate(places):
            X_WT = self._evaluator.scenes.torso_pose(observation.from_base_pose(place))
            p_TM[k] = X_WT.inverse() @ p_WM
        hiding = self._body(observation, self._evaluator.scenes.torso_pose(observation))
        return np.array([self._is_visible(p, hiding) for p in p_TM], dtype=bool)

    def shows_marker(self, plan: ReachPlan, observation: Observation) -> bool:
        """True if a plan is clear and a colour camera can see the marker at its end."""
        if plan.status != PlanStatus.CLEAR or plan.joint_path is None or self._X_OM is None:
            return False
        placed = observation.from_base_pose(plan.base_pose)
        X_WT = self._evaluator.scenes.torso_pose(placed)
        p_TM = (X_WT.inverse() @ observation.X_WO @ self._X_OM).translation()
        kinematics = self._evaluator.kinematics
        arm = kinematics.sphere_centers_at(plan.joint_path[-1:])[0]
        body, radii = self._body(placed, X_WT)
        hiding = np.concatenate((body, arm)), np.concatenate((radii, kinematics.spheres.radii))
        return self._is_visible(p_TM, hiding)

    def _is_visible(self, p_TM: Vector, hiding: tuple[Vector, Vector]) -> bool:
        """True if a colour camera that is aimed at a point in T sees it past spheres."""
        centers, radii = hiding
        for camera in (CAMERA_TOP, CAMERA_BOTTOM):
            head = clamp_head(aim_head(camera, p_TM))
            if not visible(camera, head, p_TM[None], self._params.lean.image_border)[0]:
                continue
            p_TC = camera_pose(camera, head).translation()
            ray = p_TM - p_TC
            nearest = np.clip((centers - p_TC) @ ray / (ray @ ray), 0.0, 1.0)
            gaps = np.linalg.norm(p_TC + np.outer(nearest, ray) - centers, axis=1) - radii
            if gaps.min() > 0.0:
                return True
        return False

    def may_lean(
        self, plan: ReachPlan, observation: Observation, hip_pitch: float, lost: float = 0.0
    ) -> bool:
        """True if the drive as the torso is now, and then leaning, keep clear of obstacles.

        Args:
            plan: A base placement.
            observation: The observation.
            hip_pitch: The hip angle there [rad].
            lost: By how much the clearance may fall short [m].
        """
        least, place = self._evaluator.params.drive_clearance - lost, plan.base_pose[None]
        field = self._placements.standing_field(observation)
        if not self._placements.has_room(place, observation, field, lost)[0]:
            return False
        resting = self._placements.places.resting_clearances
        return all(
            resting(place, one.joint_position, field)[0] >= least
            for one in observation.leaning_to(hip_pitch)
        )

    def _postures(self, observation: Observation) -> Iterator[Observation]:
        """Yields the observation, and then with each other hip angle."""
        yield observation
        for angle in self._params.lean.hip_pitch:
            if abs(angle - observation.hip_pitch) > 0.05:
                yield observation.with_hip_pitch(angle)
