"""Where the robot may stand to reach a goal."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.models.control_model import ControlModel
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.planning.collision.body_clearance import BodyClearance, body_links
from pepper_drake.planning.reach.reach_plan import ReachPlannerParams

Vector = npt.NDArray[np.float64]

HasRoom = Callable[[Vector], npt.NDArray[np.bool_]]
"""Says at which of some places (N, 3) the body has room, (N,)."""

_AHEAD = 12
"""How many places are looked at for room at once."""


class BasePlacement:
    """Finds places to stand.

    Args:
        model: Pepper.
        arm: "left" or "right".
        X_OG: The hand's pre-grasp pose in the goal object's frame.
        shown_goal: (3,) where the demonstration ended, in T [m].
        params: What counts as good.
    """

    def __init__(
        self,
        model: ControlModel,
        arm: str,
        X_OG: RigidTransform,
        shown_goal: Vector,
        params: ReachPlannerParams,
    ) -> None:
        self._model, self._arm, self._X_OG = model, arm, X_OG
        self._shown_goal, self._params = shown_goal, params
        self.body_clearances = BodyClearance(model, body_links(model, without_arm=arm))

    def __call__(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        has_room: HasRoom,
    ) -> Iterator[Vector]:
        """Places (3,) from which a reach is tried, x, y, yaw in W, the most comfortable first.

        Args:
            base_pose: Where the base is.
            joint_position: (15,) rad.
            X_WO: The goal object's pose.
            has_room: Says at which of some places the body has room.
        """
        params = self._params
        for slack, count in ((params.slack, params.places_with_slack), (0.0, params.places_tried)):
            places = np.array(list(self.within_reach(base_pose, joint_position, X_WO, slack)))
            yield from _spread(_free(places, has_room), count)

    def wide_candidates(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        has_room: HasRoom,
    ) -> Iterator[Vector]:
        """Places all around, comfortable or not; see `__call__`."""
        places = np.array(list(self.within_reach(base_pose, joint_position, X_WO, 0.0)))
        yield from _spread(_free(places, has_room), self._params.places_searched)

    def is_reachable(self, base_pose: Vector, joint_position: Vector, X_WO: RigidTransform) -> bool:
        """Whether the goal is at a height that the arm reaches."""
        return next(self.within_reach(base_pose, joint_position, X_WO, 0.0), None) is not None

    def _torso_pose(self, base_pose: Vector, joint_position: Vector) -> RigidTransform:
        context = self._model.create_context()
        self._model.plant.SetPositions(context, self._model.positions(joint_position, base_pose))
        return self._model.pose(context, "torso")

    def within_reach(
        self, base_pose: Vector, joint_position: Vector, X_WO: RigidTransform, slack: float
    ) -> Iterator[tuple[float, float, float]]:
        """Places to stand with the goal within the arm's reach, the most comfortable first.

        With some slack, places from which the goal may move away by that much [m] come first.
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
        p_TS = shoulder.GetFixedPoseInBodyFrame().translation()
        preferred = self._preferred_goal(p_TS)
        # The robot faces where the fingers should point.
        fingers = X_WG.rotation().col(0)
        heading = np.arctan2(fingers[1], fingers[0])
        z_T = X_WG.translation()[2] - X_BT.translation()[2]
        ahead = np.array([slack, 0.0, 0.0])
        options = []
        for x in np.arange(0.16, 0.33, 0.02):
            for y in np.arange(0.08, 0.27, 0.04):
                p_TG = np.array([x, side * y, z_T])
                if np.linalg.norm(p_TG - p_TS) > params.reach:
                    continue
                stretched = float(np.linalg.norm(p_TG + ahead - p_TS)) - params.reach
                for turn in np.radians([0, -15, 15, -30, 30]):
                    discomfort = (
                        ((x - preferred[0]) / 0.05) ** 2
                        + ((y - side * preferred[1]) / 0.06) ** 2
                        + (turn / 0.35) ** 2
                        + (max(stretched, 0.0) / 0.01) ** 2
                    )
                    options.append((discomfort, x, side * y, heading + turn))
        for _, x, y, yaw in sorted(options):
            # p_WG = p_WB + R_WB (p_BT + p_TG), in the plane.
            forward, left = X_BT.translation()[0] + x, X_BT.translation()[1] + y
            yield (
                X_WG.translation()[0] - np.cos(yaw) * forward + np.sin(yaw) * left,
                X_WG.translation()[1] - np.sin(yaw) * forward - np.cos(yaw) * left,
                yaw,
            )

    def _preferred_goal(self, p_TS: Vector) -> Vector:
        """Where the demonstration ended, x and y (2,) in T, if the arm can reach there."""
        params, goal = self._params, self._shown_goal
        if np.linalg.norm(goal - p_TS) <= params.reach + 0.02 and goal[0] > 0.1:
            return goal[:2]
        side = 1.0 if self._arm == "left" else -1.0
        return np.array([params.hand_x, side * params.hand_y])


def _free(places: Vector, has_room: HasRoom) -> Iterator[Vector]:
    """Those of some places (N, 3) where there is room, a few looked at ahead."""
    for first in range(0, len(places), _AHEAD):
        some = places[first : first + _AHEAD]
        yield from some[has_room(some)]


def _spread(poses: Iterable[Vector], count: int) -> Iterator[Vector]:
    """The first pose, then each next one that differs from all before it, up to `count`."""
    taken: list[Vector] = []
    for pose in poses:
        scaled = pose * [1.0, 1.0, 0.15]
        if all(np.linalg.norm(scaled - other) > 0.035 for other in taken):
            taken.append(scaled)
            yield pose
            if len(taken) == count:
                return
