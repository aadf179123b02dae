"""One step of watching for what moves: a depth image and the map that it left."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pepper_drake.perception.approach import Approaching, DepthView, expected, follow
from pepper_drake.perception.camera import CameraIntrinsics
from pepper_drake.perception.obstacles import NoObstacle, ObstacleParameters
from pepper_drake.perception.veil import backdrop, veiled
from pepper_drake.perception.voxel_map import VoxelMap, looks_through


@dataclass(frozen=True, eq=False)
class Watch:
    """What is known of things that move. Never changed once made.

    Attributes:
        view: The last image; None before the first.
        behind: (B, 3) what would be seen if nothing hid it, in W, m.
        things: What moves.
        visitors: Keys of the map's voxels that came where nothing had been.
        expected: (Q, 3) where what moves may be soon, in W, m.
    """

    view: DepthView | None = None
    behind: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    things: tuple[Approaching, ...] = ()
    visitors: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    expected: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))


def keep_watch(
    watch: Watch,
    voxels: VoxelMap,
    view: DepthView,
    intrinsics: CameraIntrinsics,
    ignored: Sequence[NoObstacle],
    parameters: ObstacleParameters,
) -> tuple[Watch, VoxelMap]:
    """Takes one depth image into what is known of things that move.

    Args:
        watch: What was known before.
        voxels: The map of obstacles, with the image taken in.
        view: The image.
        intrinsics: The camera.
        ignored: What is no obstacle, where it was at that time.
        parameters: How obstacles are seen and remembered.

    Returns:
        What is known now, and the map without what came, was not seen for long, and has most likely
        gone again.
    """
    memory, approach = parameters.memory, parameters.approach
    is_seen = voxels.hit_times == view.time
    things, visitors = watch.things, watch.visitors
    come = np.zeros((0, 3), np.float32)
    if watch.view is not None:
        places, before = voxels.positions[is_seen], watch.view
        is_new = looks_through(places, before.depth, intrinsics, before.X_WC, memory)
        visitors = np.union1d(visitors, voxels.keys[is_seen][is_new])
        come = places[is_new]
    is_visitor = np.isin(voxels.keys, visitors)
    voxels = voxels.select(~(is_visitor & (view.time - voxels.hit_times > approach.visit)))
    behind, veil = watch.behind, watch.behind[:0]
    if parameters.holes_are_near:
        behind = backdrop(behind, view.depth, intrinsics, view.X_WC)
        veil = veiled(behind, voxels.positions, view.depth, intrinsics, view.X_WC, ignored)
    if watch.view is not None:
        before = watch.view
        new = veil[looks_through(veil, before.depth, intrinsics, before.X_WC, memory)]
        come = np.concatenate((come, new))
        things = follow(things, come, view, intrinsics, memory, approach)
    soon = expected(things, veil, view, intrinsics, memory, approach)
    return Watch(view, behind, things, np.intersect1d(visitors, voxels.keys), soon), voxels
