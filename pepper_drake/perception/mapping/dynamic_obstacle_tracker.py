"""Tracker of moving obstacles: one step for each depth image and the map made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.perception.mapping.depth_holes import HoleMemory
from pepper_drake.perception.mapping.dynamic_obstacles import (
    ApproachParameters,
    DepthFrame,
    NewPoints,
    TrackedObstacle,
    associate,
    last_seen_of_things,
    predict_occupancy,
)
from pepper_drake.perception.mapping.near_field_occlusion import (
    background_points,
    occluded_points,
    unexplained_holes,
)
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.solids import ExcludedSolids, Solid, near_solids
from pepper_drake.perception.mapping.voxel_map import VoxelMap, VoxelMapParameters
from pepper_drake.short_repr import short_repr, short_signature

Keys = npt.NDArray[np.int64]
Points = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DynamicObstacleTracker:
    """State of the tracker of moving obstacles. Never changed once made.

    Attributes:
        views: Recent images that each show something else, the last image last.
        keys: Of the map's voxels, after the last image.
        seen: The map's voxels that the last image showed: their keys and places (S, 3), in W [m].
        behind: (B, 3) background points: what would be seen if nothing hid it, in W [m].
        things: Tracked obstacles.
        transient_keys: Keys of the map's voxels that appeared in free space.
        hidden: (H, 3) recent positions of something too near to be measured, in W [m], and their
            times (H,) [s].
        expected: (Q, 3) predicted positions of moving obstacles, in W [m].
        holes: Memory of holes in earlier images.
    """

    views: tuple[DepthFrame, ...] = ()
    keys: Keys = field(default_factory=lambda: np.zeros(0, np.int64))
    seen: tuple[Keys, npt.NDArray[np.float32]] = field(
        default_factory=lambda: (np.zeros(0, np.int64), np.zeros((0, 3), np.float32))
    )
    behind: Points = field(default_factory=lambda: np.zeros((0, 3)))
    things: tuple[TrackedObstacle, ...] = ()
    transient_keys: Keys = field(default_factory=lambda: np.zeros(0, np.int64))
    hidden: tuple[Points, Points] = field(default_factory=lambda: (np.zeros((0, 3)), np.zeros(0)))
    expected: Points = field(default_factory=lambda: np.zeros((0, 3)))
    holes: HoleMemory = field(default_factory=HoleMemory.empty)

    __repr__ = short_repr
    __signature__ = short_signature


def update_tracker(
    tracker: DynamicObstacleTracker,
    voxels: VoxelMap,
    view: DepthFrame,
    ignored: Sequence[ExcludedSolids],
    parameters: ObstacleParameters,
    table: float = -np.inf,
) -> tuple[DynamicObstacleTracker, VoxelMap]:
    """Returns the tracker and the map after one depth image.

    Args:
        tracker: Before the image.
        voxels: The map of obstacles, with the image taken in.
        view: The image.
        ignored: What is no obstacle, where it was at that time.
        parameters: How obstacles are seen and remembered.
        table: Height of what things stand on, in W [m].

    Returns:
        The tracker, and the map without transient voxels that were not seen for long.
    """
    memory, approach = parameters.memory, parameters.approach
    is_seen = voxels.hit_times == view.time
    keys, places = seen = voxels.keys[is_seen], voxels.positions[is_seen]
    # Only voxels that were not there before are new.
    fresh = np.flatnonzero(~np.isin(keys, tracker.keys, assume_unique=True))
    new = fresh[_was_empty(tracker.views, places[fresh], memory)]
    transient_keys = np.union1d(tracker.transient_keys, keys[new])
    is_transient = np.isin(voxels.keys, transient_keys)
    behind, near_points, holes = tracker.behind, tracker.behind[:0], tracker.holes
    if parameters.treat_holes_as_near and view.depth.size:
        behind = background_points(
            behind, view.depth, view.intrinsics, view.X_WC, parameters.near_field
        )
        # A new obstacle does not explain a hole beside it, which may be more of the obstacle.
        known = voxels.positions[~is_transient]
        holes, unexplained = unexplained_holes(
            holes,
            behind,
            view.depth,
            view.intrinsics,
            view.X_WC,
            table,
            parameters.near_field,
            parameters.holes,
        )
        near_points = occluded_points(
            behind,
            known,
            view.depth,
            view.intrinsics,
            view.X_WC,
            ignored,
            table,
            holes=unexplained,
            baseline=parameters.projector_baseline,
            parameters=parameters.near_field,
            hole_parameters=parameters.holes,
        )
    things = tracker.things
    if tracker.views:
        last = tracker.views[-1]
        near = near_points[last.sees_free_space(near_points, memory)]
        normals = voxels.normals[is_seen][new]
        lengths = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        come = NewPoints(
            np.concatenate((places[new], near)),
            np.concatenate((normals / lengths, np.zeros_like(near))),
            tracker.seen[1][~np.isin(tracker.seen[0], keys, assume_unique=True)],
            last.time,
        )
        above = places[places[:, 2] > table + parameters.near_field.on_table]
        things = associate(things, come, view, memory, approach, above)
    voxels = _without_departed(voxels, is_transient, view.time, approach)
    hidden, times = tracker.hidden
    still = (view.time - times < parameters.near_field.kept) & ~view.sees_free_space(hidden, memory)
    hidden = np.concatenate((hidden[still], near_points))
    times = np.concatenate((times[still], np.full(len(near_points), view.time)))
    views = _kept(tracker.views, view, parameters)
    return DynamicObstacleTracker(
        (*views, view),
        voxels.keys,
        seen,
        behind,
        things,
        np.intersect1d(transient_keys, voxels.keys),
        (hidden, times),
        predict_occupancy(things, hidden, view, memory, approach),
        holes,
    ), voxels


def without_object(
    tracker: DynamicObstacleTracker,
    solids: Sequence[Solid],
    poses: Sequence[RigidTransform],
    parameters: ObstacleParameters,
) -> DynamicObstacleTracker:
    """Tracker state without the goal object, which moved before it was known where to.

    Until its marker is seen again, an object that is lifted or carried looks like a new obstacle.
    A cluster with most of its points where the object was since is the object.

    Args:
        tracker: Before the image.
        solids: The object's shapes.
        poses: Poses X_WO of the object, from the last one known to the one of now.
        parameters: Margin of the object, and the share of points that makes a thing the object.
    """

    def is_object(points: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
        near = np.zeros(len(points), dtype=bool)
        for pose in poses:
            near |= near_solids(
                points, solids, [pose] * len(solids), parameters.cloud.object_margin
            )
        return near

    most = parameters.approach.object_share
    things = tuple(one for one in tracker.things if np.mean(is_object(one.points)) < most)
    points, times = tracker.hidden
    other = ~is_object(points)
    return replace(tracker, things=things, hidden=(points[other], times[other]))


def reset_while_driving(
    tracker: DynamicObstacleTracker,
    view: DepthFrame,
    parameters: ObstacleParameters,
) -> DynamicObstacleTracker:
    """Tracker state after an image that was taken while driving, when everything seems to move.

    Args:
        tracker: Before the image.
        view: The image.
        parameters: How obstacles are seen and remembered.

    Returns:
        A new tracker that keeps the background and the sensor's own holes.
    """
    if not parameters.treat_holes_as_near or not view.depth.size:
        return DynamicObstacleTracker(holes=tracker.holes)
    behind = background_points(
        tracker.behind, view.depth, view.intrinsics, view.X_WC, parameters.near_field
    )
    holes, _ = unexplained_holes(
        tracker.holes,
        behind,
        view.depth,
        view.intrinsics,
        view.X_WC,
        parameters=parameters.near_field,
        hole_parameters=parameters.holes,
    )
    return DynamicObstacleTracker(behind=behind, holes=holes)


def _without_departed(
    voxels: VoxelMap,
    is_transient: npt.NDArray[np.bool_],
    time: float,
    parameters: ApproachParameters,
) -> VoxelMap:
    """The map without transient obstacles of which no part was seen for long."""
    transient = np.flatnonzero(is_transient)
    seen = voxels.hit_times[transient]
    if not np.any(time - seen > parameters.transient_timeout):
        return voxels
    seen = last_seen_of_things(voxels.positions[transient], seen, parameters)
    kept = np.ones(len(is_transient), dtype=bool)
    kept[transient] = time - seen <= parameters.transient_timeout
    return voxels.select(kept)


def _kept(
    views: Sequence[DepthFrame], view: DepthFrame, parameters: ObstacleParameters
) -> list[DepthFrame]:
    """The views that a new one is added to.

    None is too old, and of those that show the same one from before a slow obstacle entered is
    kept, and those after it.
    """
    memory, approach = parameters.memory, parameters.approach
    earlier = [one for one in views if view.time - one.time >= approach.comparison_interval]
    alike = [one for one in earlier if view.is_like(one, memory)]
    return [
        one
        for one in views[-approach.most_views :]
        if view.time - one.time < approach.transient_timeout
        and not any(one is other for other in alike[:-1])
    ]


def _was_empty(
    views: Sequence[DepthFrame], places: npt.NDArray[np.float32], memory: VoxelMapParameters
) -> npt.NDArray[np.bool_]:
    """Which places (N, 3) were looked through: in the last image, or surely in one before."""
    empty = np.zeros(len(places), dtype=bool)
    for view in reversed(views):
        left = np.flatnonzero(~empty)
        surely = view is not views[-1]
        empty[left] = view.sees_free_space(places[left], memory, surely=surely)
    return empty
