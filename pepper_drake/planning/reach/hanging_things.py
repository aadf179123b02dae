"""Things near the goal that hang in the air, and so may move, such as a person's arm."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.perception.mapping.voxel_map import one_per_voxel
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.trajectories.retreat import NewObstacleParams, carries_object

Vector = npt.NDArray[np.float64]


class HangingThings(NamedTuple):
    """Points of things that hang in the air.

    Attributes:
        all: Points of all of them (N, 3), in W [m].
        coming: Those (M, 3) of things one of whose ends is hidden: they may come along their own
            axis unseen [m].
    """

    all: Vector
    coming: Vector


def hanging_things(observation: Observation, params: NewObstacleParams) -> HangingThings:
    """Returns what hangs in the air near the goal; nothing where no map of seen space is kept."""
    space, p_WO = observation.space, observation.p_WO
    near = np.linalg.norm(observation.cloud - p_WO, axis=1) < params.max_goal_distance
    if space is None or not near.any():
        return HangingThings(np.zeros((0, 3)), np.zeros((0, 3)))
    cloud = observation.cloud[near]
    cloud = cloud[one_per_voxel(cloud, params.spacing)]
    cloud = cloud[~carries_object(cloud, p_WO, params)]
    hangs = space.hanging(
        cloud,
        params.hanging_gap,
        params.hanging_above,
        params.min_points,
        params.hanging_share,
    )
    hanging = cloud[hangs]
    hidden = space.end_hidden(hanging, params.hanging_gap, params.hanging_end)
    return HangingThings(hanging, hanging[hidden])
