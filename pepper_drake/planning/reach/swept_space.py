"""Space that the robot is going to sweep and that was not seen: not measured is not free."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.gaze.head_aiming import camera_pose
from pepper_drake.perception.gaze.view_planning import within_possible_view
from pepper_drake.perception.mapping.seen_space import SeenSpace, describe_place
from pepper_drake.perception.mapping.voxel_map import voxel_keys
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.collision.body_clearance import BodyClearance, at_base_poses, drive_poses

Vector = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass
class UnseenSpaceParams:
    """When a movement passes space that was not seen."""

    oldest: float = 15.0
    """Time since a place was seen to be free up to which that counts [s]: the longest that a look
    around, a drive and its settling take."""
    recent: float = 0.8
    """Time since a place was seen, when the arm passes it, up to which it goes there at full speed
    [s]: a person's arm at 0.3 m/s moves on by 0.24 m, which is what is seen around a place."""
    ahead: float = 1.5
    """Time before the arm passes a place at which the head looks there, if it need be [s]."""
    stride: float = 0.1
    """Time between the configurations of the path that are compared [s]."""
    cell: float = 0.03
    """Edge of the cells of which an unseen region is counted [m]."""
    thickness: float = 0.02
    """Unseen places are unseen this far to five of six sides, too [m]: along the edges of things
    the projector's light leaves sheets of a pixel or two in which nothing is measured."""
    least_cells: int = 8
    """Cells of a region that is large enough to hold something: 216 cm³, a fist."""
    least_drive_cells: int = 37
    """The same of the space that the whole robot passes on its drive: 1 litre, a bottle. Behind the
    edges of its own hands and of the goal a few cells always stay in the light's shadow."""
    own_margin: float = 0.02
    """Places this near to where the robot stands now are known to be free: it stands there [m]."""
    floor: float = 0.05
    """Height up to which a driving robot's places belong to the floor [m]: nothing so low is told
    from it in an image."""
    out_of_view_is_clear: bool = True
    """True if space that no head angle shows from where the robot stands, close to its chest or
    behind its own shoulder, counts as known: whoever starts the robot keeps it clear. How much the
    arm sweeps of it is reported."""
    background: float = 4.0
    """Distance of the floor behind a place up to which it can be seen to be free [m]: where nothing
    is behind, a depth camera measures nothing, walls or not. Such places are out of view, too."""
    projector_baseline: float = 0.075
    """Distance of the depth camera from its projector [m]: its light is hidden by the arm, too."""
    image_border: float = 0.15
    """Share of half the image, along its border, in which a depth camera often measures nothing."""
    hidden_margin: float = 0.03
    """Distance around what hides something at which a depth camera measures nothing either [m]."""
    beside_movable: float = 0.3
    """Distance from a thing that moves, or hangs in the air and so may, within which nothing that
    is out of view counts as known once the arm moves [m]: it covers that in 1 s."""
    drive: bool = False
    """True if what the robot passes on its drive has to be known free, too, and what is hidden
    below a thing that it saw counts as standing on the floor."""
    accept: bool = False
    """True to move through unseen space all the same."""


class UnseenSpace(NamedTuple):
    """Swept space that was not seen.

    Attributes:
        regions: (K, 3) a point of each cell of each connected region, the largest first, in W [m];
            those that are too small to matter are left out.
        first: For each region, the index of the first configuration in it.
        out_of_view: Volume of what cannot be seen from where the robot stands, and is left out of
            `regions` if the parameters say so [m³].
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
    """Finds what of an arm movement's swept space was not seen.

    The sweep is that of the centres of the arm's spheres, upper arm to hand; if something may move,
    that of their foremost points.

    Args:
        kinematics: Of the arm.
        joint_path: (N, 5) configurations, the present one first [rad].
        X_WT: The torso's pose.
        space: What was seen.
        time: Now [s].
        params: What counts as seen, and as large.
        body: Centres (S, 3) in T and radii (S,) of spheres on the rest of the robot, which hides
            what is behind it [m].
        stride: Time between the configurations, if it is to have been seen so lately when the arm
            passes [s].
        movable: (M, 3) points on things that may move, in W [m]: near them nothing is taken for
            clear because it is out of view.
    """
    centers = kinematics.sphere_centers_at(joint_path)
    radii = np.broadcast_to(kinematics.spheres.radii, centers.shape[:2]).ravel()
    p_T = centers.reshape(-1, 3)
    if movable is not None and len(movable):
        steps = np.diff(centers, axis=0, append=centers[-1:])
        if len(steps) > 1:
            steps[-1] = steps[-2]  # At its end it would have gone on as before.
        steps = steps.reshape(-1, 3)
        lengths = np.maximum(np.linalg.norm(steps, axis=1), 1e-9)
        p_T = p_T + (radii / lengths)[:, None] * steps
    distance, _ = cKDTree(centers[0]).query(p_T)
    index = np.repeat(np.arange(len(centers)), centers.shape[1])
    away = distance > radii + params.own_margin
    p_T, index = p_T[away], index[away]
    p_W = p_T @ X_WT.rotation().matrix().T + X_WT.translation()
    hiding = (centers[0], np.broadcast_to(kinematics.spheres.radii, len(centers[0])))
    if body is not None:
        hiding = (np.concatenate((hiding[0], body[0])), np.concatenate((hiding[1], body[1])))
    oldest = np.asarray(params.oldest - stride * index, dtype=float)
    return _unseen_places(
        p_W, index, oldest, X_WT, hiding, space, time, params, params.least_cells, movable
    )


def unseen_drive_space(
    body: BodyClearance,
    base_pose: Vector,
    goal: Vector,
    joint_position: Vector,
    X_WT: RigidTransform,
    hiding: tuple[Vector, Vector],
    space: SeenSpace,
    time: float,
    params: UnseenSpaceParams,
) -> UnseenSpace:
    """Finds what was not seen of the space that the body sweeps on a straight drive.

    Args:
        body: All that is carried along.
        base_pose: Where the base stands (3,), x, y [m], yaw [rad] in W.
        goal: Where it is to stand (3,).
        joint_position: The joints on the way (15,) [rad].
        X_WT: The torso's pose now.
        hiding: Centres (S, 3) in T and radii (S,) of spheres on the robot [m], which hide what is
            behind them.
        space: What was seen.
        time: Now [s].
        params: What counts as seen, and as large.
    """
    solid = body.solid_points(joint_position, params.cell)
    poses = drive_poses(base_pose, goal, params.cell)
    p_W = at_base_poses(solid, poses).reshape(-1, 3)
    index = np.repeat(np.arange(len(poses)), len(solid))
    taken = np.unique(voxel_keys(p_W, params.cell), return_index=True)[1]
    taken = taken[p_W[taken, 2] > params.floor]
    p_W, index = p_W[taken], index[taken]
    own = cKDTree(at_base_poses(solid, base_pose[None])[0])
    reach = params.cell + params.own_margin
    away = ~np.isfinite(own.query(p_W, distance_upper_bound=reach)[0])
    p_W, index = p_W[away], index[away]
    oldest = np.full(len(p_W), params.oldest)
    return _unseen_places(
        p_W, index, oldest, X_WT, hiding, space, time, params, params.least_drive_cells
    )


def _unseen_places(
    p_W: Vector,
    index: npt.NDArray[np.intp],
    oldest: Vector,
    X_WT: RigidTransform,
    hiding: tuple[Vector, Vector],
    space: SeenSpace,
    time: float,
    params: UnseenSpaceParams,
    least_cells: int,
    movable: Vector | None = None,
) -> UnseenSpace:
    """Unseen space of places (N, 3) of configurations (N,), seen at most (N,) [s] ago."""
    unseen = np.flatnonzero(space.unseen(p_W, time, oldest=oldest))
    unseen = unseen[np.unique(voxel_keys(p_W[unseen], params.cell), return_index=True)[1]]
    around = p_W[unseen, None] + params.thickness * np.concatenate((np.eye(3), -np.eye(3)))
    late = np.repeat(oldest[unseen], 6)
    sides = space.unseen(around.reshape(-1, 3), time, oldest=late).reshape(-1, 6)
    unseen = unseen[sides.sum(axis=1) >= 5]
    out_of_view = 0.0
    if len(unseen) and params.out_of_view_is_clear:
        shown = within_possible_view(
            CAMERA_DEPTH,
            (p_W[unseen] - X_WT.translation()) @ X_WT.rotation().matrix(),
            hiding,
            params.projector_baseline,
            border=params.image_border,
            margin=params.hidden_margin,
        )
        shown &= _is_before_floor(p_W[unseen], X_WT, params.background)
        if movable is not None and len(movable):
            near = cKDTree(movable).query(p_W[unseen], distance_upper_bound=params.beside_movable)
            shown |= np.isfinite(near[0])
        out_of_view = float(np.count_nonzero(~shown)) * params.cell**3
        unseen = unseen[shown]
    regions = [unseen[cells] for cells in _large_regions(p_W[unseen], params.cell, least_cells)]
    return UnseenSpace(
        tuple(p_W[cells] for cells in regions),
        tuple(int(index[cells].min()) for cells in regions),
        out_of_view,
    )


def _is_before_floor(p_W: Vector, X_WT: RigidTransform, farthest: float) -> Mask:
    """Which places (N, 3) the depth camera sees against the floor, z = 0, within a distance [m]."""
    p_WC = X_WT @ camera_pose(CAMERA_DEPTH, (0.0, 0.0)).translation()
    off = p_W - p_WC
    # The ray through a place meets the floor at this multiple of the place's distance.
    stretch = p_WC[2] / np.maximum(-off[:, 2], 1e-9)
    return np.asarray(stretch * np.linalg.norm(off, axis=1) <= farthest)


def _large_regions(cells: Vector, size: float, least: int) -> list[npt.NDArray[np.intp]]:
    """The indices of the connected regions of cells (N, 3) [m] that matter, the largest first."""
    if len(cells) < least:
        return []
    # Neighbours share a face, an edge or a corner; a point lies anywhere in its cell.
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
    """Says where an unseen region (K, 3) of W is, how large, and who would pass it."""
    p_T = X_WT.inverse() @ region.mean(axis=0)
    litres = 1000.0 * len(region) * params.cell**3
    return (
        f"{mover} would pass {litres:.1f} litres of space that the depth camera has not seen, "
        f"{describe_place(p_T)}"
    )
