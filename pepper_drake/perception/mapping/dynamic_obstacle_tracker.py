"""Tracker of moving obstacles, updated with each depth image and the map."""

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
    last_seen_of_clusters,
    predict_occupancy,
)
from pepper_drake.perception.mapping.near_field_occlusion import (
    background_points,
    occluded_points,
    unexplained_holes,
)
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.projector_shadow import projector_sides
from pepper_drake.perception.mapping.solids import ExcludedSolids, Solid, near_solids
from pepper_drake.perception.mapping.voxel_map import VoxelMap, VoxelMapParameters
from pepper_drake.short_repr import short_repr, short_signature

Keys = npt.NDArray[np.int64]
Points = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DynamicObstacleTracker:
    """Immutable state of the tracker of moving obstacles.

    Attributes:
        views: Recent images from different views, the last image last.
        keys: Keys of the map's voxels after the last image.
        seen: The map's voxels hit by the last image: their keys and positions (S, 3), in W [m].
        behind: (B, 3) background points, visible unless occluded, in W [m].
        things: Tracked obstacles.
        transient_keys: Keys of the map's voxels that appeared in free space.
        hidden: (H, 3) recent positions of obstacles too near to be measured, in W [m], and their
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
        tracker: The previous state.
        voxels: The map of obstacles, updated with the image.
        view: The image.
        ignored: Solids that are no obstacles, at the image's capture time.
        parameters: Detection and memory of obstacles.
        table: Height of the table on which objects stand, in W [m].

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
        # A new obstacle does not explain a hole beside it, which may be another part of it.
        known = voxels.positions[~is_transient]
        holes, unexplained = unexplained_holes(
            holes,
            behind,
            view.depth,
            view.intrinsics,
            view.X_WC,
            table,
            baseline=parameters.projector_baseline,
            parameters=parameters.near_field,
            hole_parameters=parameters.holes,
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
            moved=_in_view(voxels.positions[is_transient & is_seen], approach),
            baseline=parameters.projector_baseline,
            sides=projector_sides(holes, parameters.holes),
            parameters=parameters.near_field,
            hole_parameters=parameters.holes,
        )
    things = tracker.things
    if tracker.views:
        last = tracker.views[-1]
        near = near_points[last.sees_free_space(near_points, memory)]
        normals = voxels.normals[is_seen][new]
        lengths = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        appeared = NewPoints(
            np.concatenate((places[new], near)),
            np.concatenate((normals / lengths, np.zeros_like(near))),
            tracker.seen[1][~np.isin(tracker.seen[0], keys, assume_unique=True)],
            last.time,
        )
        above = places[places[:, 2] > table + parameters.near_field.on_table]
        things = associate(things, appeared, view, memory, approach, above)
    voxels = _without_departed(voxels, is_transient, view.time, approach)
    hidden, times = tracker.hidden
    still = (view.time - times < parameters.near_field.retention_time) & ~view.sees_free_space(
        hidden, memory
    )
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
    """Returns the tracker state without the goal object, after it has moved.

    Until its marker is seen again, an object that is lifted or carried looks like a new obstacle.
    A cluster with most of its points at the object's poses since then is the object.

    Args:
        tracker: The previous state.
        solids: The object's shapes.
        poses: Poses X_WO of the object, from the last known to the present one.
        parameters: Margin of the object, and the fraction of a cluster's points on it.
    """

    def is_object(points: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
        near = np.zeros(len(points), dtype=bool)
        for pose in poses:
            near |= near_solids(
                points, solids, [pose] * len(solids), parameters.cloud.object_margin
            )
        return near

    most = parameters.approach.object_fraction
    things = tuple(one for one in tracker.things if np.mean(is_object(one.points)) < most)
    points, times = tracker.hidden
    other = ~is_object(points)
    return replace(tracker, things=things, hidden=(points[other], times[other]))


def reset_while_driving(
    tracker: DynamicObstacleTracker,
    view: DepthFrame,
    parameters: ObstacleParameters,
) -> DynamicObstacleTracker:
    """Returns the tracker state after an image taken while driving, when everything seems to move.

    Args:
        tracker: The previous state.
        view: The image.
        parameters: Detection and memory of obstacles.

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
        baseline=parameters.projector_baseline,
        parameters=parameters.near_field,
        hole_parameters=parameters.holes,
    )
    return DynamicObstacleTracker(behind=behind, holes=holes)


def _in_view(appeared: Points, parameters: ApproachParameters) -> Points:
    """Returns the points of what appeared and is seen now, none if so few that they are noise.

    What was seen last where now a hole is may itself be in the hole.
    """
    return appeared if len(appeared) >= parameters.min_points else appeared[:0]


def _without_departed(
    voxels: VoxelMap,
    is_transient: npt.NDArray[np.bool_],
    time: float,
    parameters: ApproachParameters,
) -> VoxelMap:
    """Returns the map without transient obstacles of which no part was seen for long."""
    transient = np.flatnonzero(is_transient)
    seen = voxels.hit_times[transient]
    if not np.any(time - seen > parameters.transient_timeout):
        return voxels
    seen = last_seen_of_clusters(voxels.positions[transient], seen, parameters)
    kept = np.ones(len(is_transient), dtype=bool)
    kept[transient] = time - seen <= parameters.transient_timeout
    return voxels.select(kept)


def _kept(
    views: Sequence[DepthFrame], view: DepthFrame, parameters: ObstacleParameters
) -> list[DepthFrame]:
    """Returns the views to keep when a new one is added.

    Old views are dropped. Of similar views only the newest that is older than the comparison
    interval is kept, to detect slow obstacles, and all after it.
    """
    memory, approach = parameters.memory, parameters.approach
    earlier = [one for one in views if view.time - one.time >= approach.comparison_interval]
    alike = [one for one in earlier if view.is_like(one, memory)]
    return [
        one
        for one in views[-approach.max_views :]
        if view.time - one.time < approach.transient_timeout
        and not any(one is other for other in alike[:-1])
    ]


def _was_empty(
    views: Sequence[DepthFrame], places: npt.NDArray[np.float32], memory: VoxelMapParameters
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) were free in the last image, or surely free in an earlier one."""
    empty = np.zeros(len(places), dtype=bool)
    for view in reversed(views):
        left = np.flatnonzero(~empty)
        surely = view is not views[-1]
        empty[left] = view.sees_free_space(places[left], memory, surely=surely)
    return empty
