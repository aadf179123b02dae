"""Unseen space in the robot's swept volume: space that was not measured does not count as free."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.gaze.head_aiming import camera_pose
from pepper_drake.perception.gaze.view_planning import widest_view, within_possible_view
from pepper_drake.perception.mapping.seen_space import SeenSpace, describe_place
from pepper_drake.perception.mapping.voxel_map import one_per_voxel
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.collision.body_clearance import BodyClearance, at_base_poses, drive_poses

Vector = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass
class UnseenSpaceParams:
    """Criteria by which swept space counts as unseen."""

    max_age: float = 15.0
    """Age up to which an observation of free space is valid [s]: the longest that a look around, a
    drive and its settling take."""
    recent: float = 0.8
    """Age of an observation up to which the arm enters a place at full speed [s]: a person's arm at
    0.3 m/s moves by 0.24 m, the extent of what is seen around a place."""
    ahead: float = 1.5
    """Time before the arm enters a place at which the head looks there, if necessary [s]."""
    stride: float = 0.1
    """Time between the checked configurations of a path [s]."""
    cell: float = 0.03
    """Edge length of the cells in which an unseen region is measured [m]."""
    thickness: float = 0.02
    """A place is unseen if points this far from it on five of six sides are, too [m]: along edges
    of objects the projector's shadow leaves unmeasured sheets of a pixel or two."""
    min_cells: int = 8
    """Least number of cells of a region that could hold an obstacle: 216 cm³, a fist."""
    min_drive_cells: int = 37
    """The same for the volume that the whole robot sweeps on its drive: 1 litre, a bottle. A few
    cells always stay in the projector's shadow, behind the edges of the hands and the goal."""
    own_margin: float = 0.02
    """Places this close to the robot's present configuration are free: the robot is there [m]."""
    floor: float = 0.05
    """Height up to which places on a drive count as floor [m]: a depth image does not separate
    anything so low from the floor."""
    out_of_view_is_clear: bool = True
    """True if space that no head angle shows from the present base pose, close to the chest or
    behind the robot's own shoulder, counts as free: whoever starts the robot keeps it clear. The
    volume of it that the arm sweeps is reported."""
    background: float = 4.0
    """Distance of the floor behind a place up to which the place can be seen to be free [m]: with
    nothing behind it a depth camera measures nothing. Farther places are out of view, too."""
    projector_baseline: float = 0.075
    """Distance of the depth camera from its projector, whose light the arm occludes, too [m]."""
    image_border: float = 0.15
    """Border, as a fraction of half the image, in which a depth camera often measures nothing."""
    hidden_margin: float = 0.03
    """Width around an occluding body in which a depth camera measures nothing either [m]."""
    beside_movable: float = 0.3
    """Distance from an object that moves, or hangs in the air and so may move, within which space
    out of view does not count as free once the arm moves [m]: the object covers it in 1 s."""
    check_drive: bool = True
    """True if the volume swept on a drive must be known to be free, too, and objects are assumed to
    extend down to the floor where their lower part is hidden."""
    allow_motion: bool = False
    """True to move through unseen space anyway."""


class UnseenSpace(NamedTuple):
    """Swept space that was not seen.

    Attributes:
        regions: Connected regions, the largest first, each as a point of each cell (K, 3) in W [m];
            those too small to matter are left out.
        first: For each region, the index of the first configuration in it.
        out_of_view: Volume that is left out of `regions` because it cannot be seen from the present
            base pose; see `UnseenSpaceParams.out_of_view_is_clear` [m³].
    """

    regions: tuple[Vector, ...]
    first: tuple[int, ...]
    out_of_view: float

    @property
    def region(self) -> Vector:
        """The largest region; empty if all was seen."""
        return self.regions[0] if self.regions else np.zeros((0, 3))


def unseen_space(
    kinematics: ArmKinematics,
    joint_path: Vector,
    X_WT: RigidTransform,
    space: SeenSpace,
    time: float,
    params: UnseenSpaceParams,
    body: tuple[Vector, Vector] | None = None,
    *,
    stride: float = 0.0,
    movable: Vector | None = None,
) -> UnseenSpace:
    """Finds the unseen part of an arm movement's swept volume.

    The volume is swept by the centres of the arm's spheres, upper arm to hand, or by their foremost
    points if there are movable things.

    Args:
        kinematics: Kinematics of the arm.
        joint_path: (N, 5) configurations, the present one first [rad].
        X_WT: Pose of the torso.
        space: Observed space.
        time: Present time [s].
        params: Criteria of unseen space.
        body: Centres (S, 3) in T and radii (S,) of spheres on the rest of the robot, which occludes
            space behind it [m].
        stride: Time between the configurations, to demand `params.max_age` of each when the arm
            reaches it; 0 to demand it now [s].
        movable: (M, 3) points on things that may move, in W [m]; space out of view near them is not
            taken for free.
    """
    centers = kinematics.sphere_centers_at(joint_path)
    radii = np.broadcast_to(kinematics.spheres.radii, centers.shape[:2]).ravel()
    p_T = centers.reshape(-1, 3)
    if movable is not None and len(movable):
        steps = np.diff(centers, axis=0, append=centers[-1:])
        if len(steps) > 1:
            steps[-1] = steps[-2]  # Extrapolate the direction of motion at the end.
        steps = steps.reshape(-1, 3)
        lengths = np.maximum(np.linalg.norm(steps, axis=1), 1e-9)
        p_T = p_T + (radii / lengths)[:, None] * steps
    own = radii + params.own_margin
    away = PointCloudDistance(centers[0], extension=0.0).distance(p_T, float(own.max())) > own
    index = np.repeat(np.arange(len(centers)), centers.shape[1])
    p_T, index = p_T[away], index[away]
    p_W = p_T @ X_WT.rotation().matrix().T + X_WT.translation()
    spheres = (centers[0], np.broadcast_to(kinematics.spheres.radii, len(centers[0])))
    if body is not None:
        spheres = (np.concatenate((spheres[0], body[0])), np.concatenate((spheres[1], body[1])))
    oldest = np.asarray(params.max_age - stride * index, dtype=float)
    return _unseen_places(
        p_W, index, oldest, X_WT, spheres, space, time, params, params.min_cells, movable
    )


def unseen_drive_space(
    body: BodyClearance,
    base_pose: Vector,
    goal: Vector,
    joint_position: Vector,
    X_WT: RigidTransform,
    spheres: tuple[Vector, Vector],
    space: SeenSpace,
    time: float,
    params: UnseenSpaceParams,
    leaning: Iterable[Vector] = (),
) -> UnseenSpace:
    """Finds the unseen part of the volume that the robot sweeps on a straight drive.

    Args:
        body: All links of the robot.
        base_pose: Present pose of the base (3,), x, y [m], yaw [rad] in W.
        goal: Goal of the base (3,).
        joint_position: Joints during the drive (15,) [rad].
        X_WT: Present pose of the torso.
        spheres: Centres (S, 3) in T and radii (S,) of spheres on the robot, which occlude space
            behind them [m].
        space: Observed space.
        time: Present time [s].
        params: Criteria of unseen space.
        leaning: Joints (15,) [rad] of the postures through which it then leans at the goal.
    """
    solid = body.solid_points(joint_position, params.cell)
    poses = drive_poses(base_pose, goal, params.cell)
    p_W = at_base_poses(solid, poses).reshape(-1, 3)
    index = np.repeat(np.arange(len(poses)), len(solid))
    for posture in leaning:
        leant = at_base_poses(body.solid_points(posture, params.cell), goal[None])[0]
        p_W = np.concatenate((p_W, leant))
        index = np.concatenate((index, np.full(len(leant), len(poses) - 1)))
    taken = one_per_voxel(p_W, params.cell)
    taken = taken[p_W[taken, 2] > params.floor]
    p_W, index = p_W[taken], index[taken]
    own = cKDTree(at_base_poses(solid, base_pose[None])[0])
    reach = params.cell + params.own_margin
    away = ~np.isfinite(own.query(p_W, distance_upper_bound=reach)[0])
    p_W, index = p_W[away], index[away]
    oldest = np.full(len(p_W), params.max_age)
    return _unseen_places(
        p_W, index, oldest, X_WT, spheres, space, time, params, params.min_drive_cells
    )


def _unseen_places(
    p_W: Vector,
    index: npt.NDArray[np.intp],
    oldest: Vector,
    X_WT: RigidTransform,
    spheres: tuple[Vector, Vector],
    space: SeenSpace,
    time: float,
    params: UnseenSpaceParams,
    min_cells: int,
    movable: Vector | None = None,
) -> UnseenSpace:
    """Returns the regions of places (N, 3) that were not seen at most `oldest` (N,) [s] ago."""
    unseen = np.flatnonzero(space.unseen(p_W, time, oldest=oldest))
    unseen = unseen[one_per_voxel(p_W[unseen], params.cell)]
    around = p_W[unseen, None] + params.thickness * np.concatenate((np.eye(3), -np.eye(3)))
    limits = np.repeat(oldest[unseen], 6)
    sides = space.unseen(around.reshape(-1, 3), time, oldest=limits).reshape(-1, 6)
    unseen = unseen[sides.sum(axis=1) >= 5]
    out_of_view = 0.0
    if len(unseen) and params.out_of_view_is_clear:
        visible = within_possible_view(
            CAMERA_DEPTH,
            (p_W[unseen] - X_WT.translation()) @ X_WT.rotation().matrix(),
            spheres,
            params.projector_baseline,
            border=params.image_border,
            margin=params.hidden_margin,
        )
        visible &= _is_before_floor(p_W[unseen], X_WT, params.background)
        if movable is not None and len(movable):
            near = cKDTree(movable).query(p_W[unseen], distance_upper_bound=params.beside_movable)
            visible |= np.isfinite(near[0])
        out_of_view = float(np.count_nonzero(~visible)) * params.cell**3
        unseen = unseen[visible]
    regions = [unseen[cells] for cells in _large_regions(p_W[unseen], params.cell, min_cells)]
    return UnseenSpace(
        tuple(p_W[cells] for cells in regions),
        tuple(int(index[cells].min()) for cells in regions),
        out_of_view,
    )


def best_look(
    unseen: UnseenSpace,
    X_WT: RigidTransform,
    spheres: tuple[Vector, Vector],
    params: UnseenSpaceParams,
) -> Vector:
    """Returns where the head should look (3,), in W, to see most of unseen space; NaN for none [m].

    Args:
        unseen: The space.
        X_WT: Present pose of the torso.
        spheres: Centres (S, 3) in T and radii (S,) of spheres on the robot, which occlude space
            behind them [m].
        params: Criteria of unseen space.
    """
    if not unseen.regions:
        return np.full(3, np.nan)
    p_TL = widest_view(
        CAMERA_DEPTH,
        (np.concatenate(unseen.regions) - X_WT.translation()) @ X_WT.rotation().matrix(),
        spheres,
        params.projector_baseline,
        border=params.image_border,
        margin=params.hidden_margin,
    )
    return np.asarray(X_WT @ p_TL)


def _is_before_floor(p_W: Vector, X_WT: RigidTransform, farthest: float) -> Mask:
    """Tells which places (N, 3) the depth camera sees against the floor, z = 0, in a range [m]."""
    p_WC = X_WT @ camera_pose(CAMERA_DEPTH, (0.0, 0.0)).translation()
    rays = p_W - p_WC
    # The ray through a place meets the floor at this multiple of the place's distance.
    stretch = p_WC[2] / np.maximum(-rays[:, 2], 1e-9)
    return np.asarray(stretch * np.linalg.norm(rays, axis=1) <= farthest)


def _large_regions(cells: Vector, size: float, least: int) -> list[npt.NDArray[np.intp]]:
    """Returns the indices of each connected region of cells (N, 3) [m], the largest first."""
    if len(cells) < least:
        return []
    # Neighbours share a face, an edge or a corner; points may lie anywhere in their cells.
    pairs = cKDTree(cells).query_pairs(2.0 * size, output_type="ndarray")
    shape = (len(cells), len(cells))
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=shape)
    _, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels)
    largest = [k for k in np.argsort(-sizes, kind="stable") if sizes[k] >= least]
    return [np.flatnonzero(labels == k) for k in largest]


def unseen_sentence(
    region: Vector, X_WT: RigidTransform, params: UnseenSpaceParams, mover: str = "the arm"
) -> str:
    """Returns a sentence with place and size of an unseen region (K, 3) in W, and its mover."""
    p_T = X_WT.inverse() @ region.mean(axis=0)
    litres = 1000.0 * len(region) * params.cell**3
    return (
        f"{mover} would pass {litres:.1f} litres of space that the depth camera has not seen, "
        f"{describe_place(p_T)}"
    )
