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

_CENTRE = np.zeros((1, 3))


class LeaningPlacement:
    """Chooses the base placement and, for a low goal, the hip angle.

    A low goal should be in view of a colour camera from the placement, past tablet and arm: if it
    is not seen, a reach ends unconfirmed. Where the present hip angle offers no such placement,
    others are tried; where none does, placements are enough that show the marker's centre.

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
        corners = np.array([[0, 0, 0], [-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
        self._whole = 0.5 * task.marker_size * corners

    def plan(self, observation: Observation) -> ReachPlan:
        """Returns the best plan over base placements and, for a low goal, hip angles."""
        if not self.is_low(observation):
            return self._placements.plan(observation)
        for p_M in (self._whole, _CENTRE):
            for leaning in self._postures(observation):
                in_view = partial(self.in_view, observation=leaning, p_M=p_M)
                plan = self._placements.plan(leaning, in_view)
                if not self.shows_marker(plan, leaning, p_M):
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

    def in_view(self, places: Vector, observation: Observation, p_M: Vector) -> Mask:
        """Tells at which base poses (N, 3) a colour camera can see points of the marker.

        Args:
            places: The base poses.
            observation: The observation.
            p_M: The points (P, 3) [m]; the marker is at the first.
        """
        assert self._X_OM is not None
        X_WM, pose = observation.X_WO @ self._X_OM, self._evaluator.scenes.torso_pose
        hiding = self._body(observation, pose(observation))
        X_TW = [pose(observation.from_base_pose(place)).inverse() for place in places]
        return np.array([self._is_visible(X @ X_WM, p_M, hiding) for X in X_TW], dtype=bool)

    def shows_marker(
        self, plan: ReachPlan, observation: Observation, p_M: Vector = _CENTRE
    ) -> bool:
        """True if a plan is clear and a colour camera can see points of the marker at its end.

        Args:
            plan: A base placement.
            observation: The observation.
            p_M: The points (P, 3) [m]; the marker is at the first.
        """
        if plan.status != PlanStatus.CLEAR or plan.joint_path is None or self._X_OM is None:
            return False
        placed = observation.from_base_pose(plan.base_pose)
        X_WT = self._evaluator.scenes.torso_pose(placed)
        kinematics = self._evaluator.kinematics
        arm = kinematics.sphere_centers_at(plan.joint_path[-1:])[0]
        body, radii = self._body(placed, X_WT)
        hiding = np.concatenate((body, arm)), np.concatenate((radii, kinematics.spheres.radii))
        return self._is_visible(X_WT.inverse() @ observation.X_WO @ self._X_OM, p_M, hiding)

    def _is_visible(self, X_TM: RigidTransform, p_M: Vector, hiding: tuple[Vector, Vector]) -> bool:
        """True if a colour camera aimed at the first of some points sees all past spheres."""
        p_T = (X_TM @ p_M.T).T.reshape(-1, 3)
        centers, radii = hiding
        for camera in (CAMERA_TOP, CAMERA_BOTTOM):
            head = clamp_head(aim_head(camera, p_T[0]))
            if not visible(camera, head, p_T[:1], self._params.lean.image_border)[0]:
                continue
            p_TC = camera_pose(camera, head).translation()
            rays, offsets = p_T - p_TC, centers - p_TC
            along = offsets @ rays.T / np.sum(rays**2, axis=1)
            nearest = np.clip(along, 0.0, 1.0)[..., None] * rays
            if np.all(np.linalg.norm(nearest - offsets[:, None], axis=2) > radii[:, None]):
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
