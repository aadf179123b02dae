"""Base placement: candidate base poses around the goal."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.planning.collision.body_clearance import (
    BodyClearance,
    body_links,
    drive_poses,
)
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams

Vector = npt.NDArray[np.float64]

HasRoom = Callable[[Vector], npt.NDArray[np.bool_]]
"""Tells at which base poses (N, 3) the body is free of collisions, (N,)."""

_BATCH = 12
"""Number of base poses that are checked for collisions at once."""


class BasePlacement:
    """Candidate base poses, ranked by how comfortably the arm reaches the goal from them.

    Args:
        model: Pepper.
        arm: "left" or "right".
        X_OG: The hand's pre-grasp pose in the goal object's frame.
        demonstrated_goal: End of the demonstration (3,) in T [m].
        params: Criteria of a good reach.
    """

    def __init__(
        self,
        model: ControlModel,
        arm: str,
        X_OG: RigidTransform,
        demonstrated_goal: Vector,
        params: ReachPlannerParams,
    ) -> None:
        self._model, self._arm, self._X_OG = model, arm, X_OG
        self._demonstrated_goal, self._params = demonstrated_goal, params
        self.body_clearances = BodyClearance(model, body_links(model, without_arm=arm))
        self.resting_clearances = BodyClearance(model, body_links(model))

    def __call__(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        has_room: HasRoom,
    ) -> Iterator[Vector]:
        """Yields candidate base poses (3,), the most comfortable first.

        Args:
            base_pose: Present pose of the base (3,), x, y, yaw in W [m, rad].
            joint_position: (15,) in the order of `BODY_JOINTS` [rad].
            X_WO: The goal object's pose.
            has_room: Tells at which base poses the body is free of collisions.
        """
        params = self._params
        for margin, count in (
            (params.reach_margin, params.max_placements_with_margin),
            (0.0, params.max_simulated_placements),
        ):
            places = np.array(list(self.within_reach(base_pose, joint_position, X_WO, margin)))
            yield from _spread(_free(places, has_room), count)

    def wide_candidates(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        has_room: HasRoom,
    ) -> Iterator[Vector]:
        """Yields base poses all around the goal, comfortable or not; see `__call__`."""
        places = np.array(list(self.within_reach(base_pose, joint_position, X_WO, 0.0)))
        yield from _spread(_free(places, has_room), self._params.wide_search_placements)

    def is_reachable(self, base_pose: Vector, joint_position: Vector, X_WO: RigidTransform) -> bool:
        """True if the goal is at a height within the arm's reach."""
        return next(self.within_reach(base_pose, joint_position, X_WO, 0.0), None) is not None

    def _torso_pose(self, base_pose: Vector, joint_position: Vector) -> RigidTransform:
        context = self._model.create_context()
        self._model.plant.SetPositions(context, self._model.positions(joint_position, base_pose))
        return self._model.pose(context, "torso")

    def within_reach(
        self, base_pose: Vector, joint_position: Vector, X_WO: RigidTransform, margin: float
    ) -> Iterator[tuple[float, float, float]]:
        """Yields base poses with the goal within the arm's reach, the most comfortable first.

        With a margin, poses come first from which the goal may move away by that distance [m].
        """
        params = self._params
        side = 1.0 if self._arm == "left" else -1.0
        X_WG = X_WO @ self._X_OG
        X_BT = RigidTransform(
            RollPitchYaw(0, 0, base_pose[2]), [base_pose[0], base_pose[1], 0]
        ).inverse() @ self._torso_pose(base_pose, joint_position)
        shoulder = self._model.plant.GetJointByName(
            JOINT_GROUPS[f"{self._arm}_arm"][0]
        ).frame_on_parent()
        # U is a frame at the torso's origin that does not lean with it.
        R_UT = X_BT.rotation()
        p_US = R_UT @ shoulder.GetFixedPoseInBodyFrame().translation()
        preferred = self._preferred_goal(p_US, R_UT @ self._demonstrated_goal)
        # The robot faces the direction of the fingers.
        fingers = X_WG.rotation().col(0)
        heading = np.arctan2(fingers[1], fingers[0])
        z_UG = X_WG.translation()[2] - X_BT.translation()[2]
        ahead = np.array([margin, 0.0, 0.0])
        options = []
        for x in np.arange(0.16, 0.33, 0.02):
            for y in np.arange(0.08, 0.27, 0.04):
                p_UG = np.array([x, side * y, z_UG])
                if np.linalg.norm(p_UG - p_US) > params.reach:
                    continue
                stretched = float(np.linalg.norm(p_UG + ahead - p_US)) - params.reach
                for turn in np.radians([0, -15, 15, -30, 30]):
                    discomfort = (
                        ((x - preferred[0]) / 0.05) ** 2
                        + ((y - side * preferred[1]) / 0.06) ** 2
                        + (turn / 0.35) ** 2
                        + (max(stretched, 0.0) / 0.01) ** 2
                    )
                    options.append((discomfort, x, side * y, heading + turn))
        for _, x, y, yaw in sorted(options):
            # p_WG = p_WB + R_WB (p_BU + p_UG), in the plane.
            forward, left = X_BT.translation()[0] + x, X_BT.translation()[1] + y
            yield (
                X_WG.translation()[0] - np.cos(yaw) * forward + np.sin(yaw) * left,
                X_WG.translation()[1] - np.sin(yaw) * forward - np.cos(yaw) * left,
                yaw,
            )

    def _preferred_goal(self, p_US: Vector, p_UG: Vector) -> Vector:
        """Returns x and y (2,) of the demonstration's end, or the default if out of reach [m]."""
        params = self._params
        if np.linalg.norm(p_UG - p_US) <= params.reach + 0.02 and p_UG[0] > 0.1:
            return p_UG[:2]
        side = 1.0 if self._arm == "left" else -1.0
        return np.array([params.hand_x, side * params.hand_y])

    def drive_clearances(
        self,
        base_pose: Vector,
        places: Vector,
        joint_position: Vector,
        field: PointCloudDistance,
        within: float,
    ) -> Vector:
        """Returns the least clearance (N,) [m] of the robot on straight drives to base poses.

        Args:
            base_pose: Present pose of the base, x, y [m], yaw [rad] in W.
            places: Goals of the drives (N, 3).
            joint_position: Joints during the drive (15,) [rad].
            field: The obstacles, in W.
            within: Larger clearances are infinite [m].
        """
        drives = [drive_poses(base_pose, place) for place in places]
        if not drives:
            return np.zeros(0)
        clearances = self.resting_clearances(np.concatenate(drives), joint_position, field, within)
        ends = np.cumsum([len(drive) for drive in drives])[:-1]
        return np.array([part.min() for part in np.split(clearances, ends)])


def _free(places: Vector, has_room: HasRoom) -> Iterator[Vector]:
    """Yields the base poses of (N, 3) that are free of collisions, checked in batches."""
    for first in range(0, len(places), _BATCH):
        batch = places[first : first + _BATCH]
        yield from batch[has_room(batch)]


def _spread(poses: Iterable[Vector], count: int) -> Iterator[Vector]:
    """Yields up to `count` poses, each different enough from all before it."""
    taken: list[Vector] = []
    for pose in poses:
        scaled = pose * [1.0, 1.0, 0.15]
        if all(np.linalg.norm(scaled - other) > 0.035 for other in taken):
            taken.append(scaled)
            yield pose
            if len(taken) == count:
                return
