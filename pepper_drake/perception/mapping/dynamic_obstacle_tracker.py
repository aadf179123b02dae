"""One step of watching for what moves: a depth image and the map that it left."""

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
from pepper_drake.short_repr import short_repr

Keys = npt.NDArray[np.int64]
Points = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DynamicObstacleTracker:
    """State of the tracker of moving obstacles. Never changed once made.

    Attributes:
        views: Images of late in which something else was to be seen each, the last image last.
        keys: Of the map's voxels, after the last image.
        seen: The map's voxels that the last image showed: their keys and places (S, 3), in W [m].
        behind: (B, 3) what would be seen if nothing hid it, in W [m].
        things: What moves.
        transient_keys: Keys of the map's voxels that came where nothing had been.
        hidden: (H, 3) where something too near to be measured was lately, in W, m, and when (H,),
            s.
        expected: (Q, 3) where what moves may be soon, in W [m].
        holes: What earlier images told of holes.
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


def update_tracker(
    watch: DynamicObstacleTracker,
    voxels: VoxelMap,
    view: DepthFrame,
    ignored: Sequence[ExcludedSolids],
    parameters: ObstacleParameters,
    table: float = -np.inf,
) -> tuple[DynamicObstacleTracker, VoxelMap]:
    """Takes one depth image into what is known of things that move.

    Args:
        watch: What was known before.
        voxels: The map of obstacles, with the image taken in.
        view: The image.
        ignored: What is no obstacle, where it was at that time.
        parameters: How obstacles are seen and remembered.
        table: Height of what things stand on, in W [m].

    Returns:
        What is known now, and the map without what came, was not seen for long, and has most likely
        gone again.
    """
    memory, approach = parameters.memory, parameters.approach
    is_seen = voxels.hit_times == view.time
    keys, places = seen = voxels.keys[is_seen], voxels.positions[is_seen]
    # What was there before did not come.
    fresh = np.flatnonzero(~np.isin(keys, watch.keys, assume_unique=True))
    new = fresh[_was_empty(watch.views, places[fresh], memory)]
    transient_keys = np.union1d(watch.transient_keys, keys[new])
    is_visitor = np.isin(voxels.keys, transient_keys)
    behind, veil, holes = watch.behind, watch.behind[:0], watch.holes
    if parameters.treat_holes_as_near and view.depth.size:
        behind = background_points(
            behind, view.depth, view.intrinsics, view.X_WC, parameters.near_field
        )
        # What came does not explain a hole beside it: that may be more of it.
        known = voxels.positions[~is_visitor]
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
        veil = occluded_points(
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
    things = watch.things
    if watch.views:
        last = watch.views[-1]
        near = veil[last.sees_free_space(veil, memory)]
        normals = voxels.normals[is_seen][new]
        lengths = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        come = NewPoints(
            np.concatenate((places[new], near)),
            np.concatenate((normals / lengths, np.zeros_like(near))),
            watch.seen[1][~np.isin(watch.seen[0], keys, assume_unique=True)],
            last.time,
        )
        above = places[places[:, 2] > table + parameters.near_field.on_table]
        things = associate(things, come, view, memory, approach, above)
    voxels = _without_departed(voxels, is_visitor, view.time, approach)
    hidden, times = watch.hidden
    still = (view.time - times < parameters.near_field.kept) & ~view.sees_free_space(hidden, memory)
    hidden = np.concatenate((hidden[still], veil))
    times = np.concatenate((times[still], np.full(len(veil), view.time)))
    views = _kept(watch.views, view, parameters)
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
    watch: DynamicObstacleTracker,
    solids: Sequence[Solid],
    poses: Sequence[RigidTransform],
    parameters: ObstacleParameters,
) -> DynamicObstacleTracker:
    """Tracker state without the goal object, which moved before it was known where to.

    Until its marker is seen again, an object that is lifted or carried looks like something that
    came. What has most of its points where the object was since is the object.

    Args:
        watch: What was known before.
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
    things = tuple(one for one in watch.things if np.mean(is_object(one.points)) < most)
    points, times = watch.hidden
    other = ~is_object(points)
    return replace(watch, things=things, hidden=(points[other], times[other]))


def reset_while_driving(
    watch: DynamicObstacleTracker,
    view: DepthFrame,
    parameters: ObstacleParameters,
) -> DynamicObstacleTracker:
    """Tracker state after an image that was taken while driving, when everything seems to move.

    Args:
        watch: What was known before.
        view: The image.
        parameters: How obstacles are seen and remembered.

    Returns:
        A watch that begins anew, but for what will be seen if nothing hides it and what is known of
        the sensor's own holes.
    """
    if not parameters.treat_holes_as_near or not view.depth.size:
        return DynamicObstacleTracker(holes=watch.holes)
    behind = background_points(
        watch.behind, view.depth, view.intrinsics, view.X_WC, parameters.near_field
    )
    holes, _ = unexplained_holes(
        watch.holes,
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
    is_visitor: npt.NDArray[np.bool_],
    time: float,
    parameters: ApproachParameters,
) -> VoxelMap:
    """The map without what came, of which no part was seen for long: most likely it has gone."""
    visitors = np.flatnonzero(is_visitor)
    seen = voxels.hit_times[visitors]
    if not np.any(time - seen > parameters.visit):
        return voxels
    seen = last_seen_of_things(voxels.positions[visitors], seen, parameters)
    kept = np.ones(len(is_visitor), dtype=bool)
    kept[visitors] = time - seen <= parameters.visit
    return voxels.select(kept)


def _kept(
    views: Sequence[DepthFrame], view: DepthFrame, parameters: ObstacleParameters
) -> list[DepthFrame]:
    """The views that a new one is added to.

    None is too old, and of those that show the same there is one from before what moves slowly came
    in, and those after it.
    """
    memory, approach = parameters.memory, parameters.approach
    earlier = [one for one in views if view.time - one.time >= approach.apart]
    alike = [one for one in earlier if view.is_like(one, memory)]
    return [
        one
        for one in views[-approach.most_views :]
        if view.time - one.time < approach.visit and not any(one is other for other in alike[:-1])
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
