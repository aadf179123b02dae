"""View planning: the head's next best view of the surroundings of an object.

Each point around the object has the time at which it was last in the image. Of the possible head
angles those are chosen that show the most points, weighted by the time since they were last seen,
for the time that the motion takes.
"""

import functools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.compiled import compiled
from pepper_drake.models.pepper import head_pitch_limits
from pepper_drake.perception.cameras.camera import HeadCamera
from pepper_drake.perception.gaze.gaze_params import ViewParams
from pepper_drake.perception.gaze.head_aiming import (
    HEAD_YAW_LIMIT,
    P_T_NECK,
    camera_pose,
    image_offset,
)

Vector = npt.NDArray[np.float64]

_NEAREST = 0.3
"""Distance [m] to the depth camera below which a point does not even show by what it occludes."""

VIEW_POINTS = np.array(
    [
        (ahead, left, up)
        for ahead in np.linspace(-0.15, 0.35, 5)
        for left in np.linspace(-0.4, 0.6, 11)
        for up in (-0.12, 0.0)
    ]
)
"""(110, 3) the places around a marked object that count [m]: ahead of it as seen from the neck, to
its left, and up, for a left arm."""


DEFAULT_VIEW = ViewParams()
"""Parameters of functions that are given none."""


@functools.lru_cache(maxsize=8)
def _path_weights(params: ViewParams) -> Vector:
    """Weights of view points: the nearer to the hand's path, the sooner an obstacle arrives."""
    flat = VIEW_POINTS[:, :2]
    coming = np.array([params.hand_ahead, params.hand_left])
    share = np.clip(flat @ coming / (coming @ coming), 0.0, 1.0)
    distances = np.linalg.norm(flat - share[:, None] * coming, axis=1)
    return np.asarray(1.0 / (1.0 + (distances / params.hand_distance) ** 2))


def surroundings(p_TP: npt.ArrayLike, side: float) -> Vector:
    """The places (N, 3) around an object's marker that count, in the torso frame [m].

    Args:
        p_TP: The marker (3,) [m].
        side: Of the arm that reaches for it, 1 left or -1 right.
    """
    p_TP = np.asarray(p_TP, dtype=float)
    x, y = (p_TP - P_T_NECK)[:2] / math.hypot(*(p_TP - P_T_NECK)[:2])
    axes = np.array([[x, y, 0.0], [-side * y, side * x, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(p_TP + VIEW_POINTS @ axes)


def visible(
    camera: HeadCamera, head: npt.ArrayLike, places: Vector, border: float = 0.0
) -> npt.NDArray[np.bool_]:
    """Which places (N, 3) of the torso frame are in a depth camera's image at head angles (2,).

    Args:
        camera: The camera.
        head: Head angles [rad].
        places: In the torso frame [m].
        border: Share of half the image along its border that does not count.
    """
    X_TC = camera_pose(camera, head)
    p_C = (places - X_TC.translation()) @ X_TC.rotation().matrix()
    return _in_image(camera, p_C, border)


def _in_image(camera: HeadCamera, p_C: Vector, border: float) -> npt.NDArray[np.bool_]:
    """Tells which places (..., 3) of the camera's frame are in its image; changes `p_C`."""
    # What is nearer to the axis by this is that much nearer to the middle of the image.
    p_C[..., :2] /= 1.0 - border
    return np.asarray((p_C[..., 2] > _NEAREST) & camera.intrinsics.sees(p_C))


@functools.cache
def head_grid() -> Vector:
    """Returns head angles (N, 2) all over Pepper's limits, by a third of an image's width [rad]."""
    yaws = np.linspace(-HEAD_YAW_LIMIT, HEAD_YAW_LIMIT, 13)
    return np.array(
        [(yaw, pitch) for yaw in yaws for pitch in np.linspace(*head_pitch_limits(yaw), 4)]
    )


def within_possible_view(
    camera: HeadCamera,
    places: Vector,
    hiding: tuple[Vector, Vector] | None = None,
    baseline: float = 0.0,
    *,
    border: float = 0.0,
    margin: float = 0.0,
) -> npt.NDArray[np.bool_]:
    """Which places some head angles bring into a camera's image, off its border and not hidden.

    Args:
        camera: A depth camera.
        places: (N, 3) in the torso frame [m].
        hiding: Centres (S, 3) in the torso frame and radii (S,) of spheres that hide what is behind
            them [m], such as the robot's own arms; none if left out.
        baseline: Distance of the camera from its projector [m]: what hides a place from the light
            hides it as well, on whichever side that is; 0 if it needs none.
        border: Share of half the image along its border that does not count.
        margin: Distance around the spheres at which they hide a place, too [m].

    Returns:
        (N,).
    """
    X_TC = _grid_poses(camera)
    p_C = (places - X_TC[:, None, :, 3]) @ X_TC[:, :, :3]
    in_image = _in_image(camera, p_C, border)
    if hiding is None:
        return np.asarray(in_image.any(axis=0))
    # From the camera itself, and from its projector on either side.
    along = np.array([0.0, baseline, -baseline] if baseline else [0.0])
    eyes = X_TC[:, None, :, 3] + along[:, None] * X_TC[:, None, :, 0]
    centers, radii = hiding
    return np.asarray(
        _shown(
            in_image,
            eyes,
            np.ascontiguousarray(places, dtype=float),
            np.ascontiguousarray(centers, dtype=float),
            (np.asarray(radii, dtype=float) + margin) ** 2,
        )
    )


@functools.lru_cache(maxsize=8)
def _grid_poses(camera: HeadCamera) -> Vector:
    """Poses X_TC of a camera (N, 3, 4) at the head angles of `head_grid`."""
    return np.array([camera_pose(camera, head).GetAsMatrix34() for head in head_grid()])


@compiled
def _shown(
    in_image: npt.NDArray[np.bool_], eyes: Vector, places: Vector, centers: Vector, squares: Vector
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) some gaze shows (H, N), with no sphere before any of its eyes.

    A place is hidden from an eye (of H, E, 3) by a sphere that the line between them meets, of a
    centre (S, 3) and a squared radius (S,). All in one frame [m].
    """
    shown = np.zeros(len(places), dtype=np.bool_)
    last = 0  # What hid one place often hides the next.
    for n in range(len(places)):
        for h in range(len(eyes)):
            if not in_image[h, n]:
                continue
            hidden = False
            for e in range(eyes.shape[1]):
                ray = places[n] - eyes[h, e]
                length = ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]
                for k in range(len(centers)):
                    s = (last + k) % len(centers)
                    x = centers[s, 0] - eyes[h, e, 0]
                    y = centers[s, 1] - eyes[h, e, 1]
                    z = centers[s, 2] - eyes[h, e, 2]
                    along = min(max((x * ray[0] + y * ray[1] + z * ray[2]) / length, 0.0), 1.0)
                    x, y, z = x - along * ray[0], y - along * ray[1], z - along * ray[2]
                    if x * x + y * y + z * z < squares[s]:
                        hidden, last = True, s
                        break
                if hidden:
                    break
            if not hidden:
                shown[n] = True
                break
    return shown


def best_view(camera: HeadCamera, p_TP: Vector) -> Vector:
    """Returns the head angles (2,) that bring a place nearest to the middle of the image [rad]."""
    offsets = [image_offset(camera, head, p_TP) for head in head_grid()]
    nearest: Vector = head_grid()[int(np.argmin(offsets))]
    return nearest


def view_weights(places: Vector, things: Vector, params: ViewParams = DEFAULT_VIEW) -> Vector:
    """Weights of view points (N, 3) [m]: much larger near points (P, 3) [m] that may move."""
    weights = _path_weights(params)
    if not len(things):
        return weights
    far = cKDTree(things).query(places, distance_upper_bound=params.movable_radius)[0]
    return np.asarray(weights * np.where(np.isfinite(far), 1.0, params.empty_weight))


def next_best_view(
    camera: HeadCamera,
    heads: Sequence[Vector],
    durations: Sequence[float],
    places: Vector,
    weights: Vector,
    unseen: Vector,
    params: ViewParams = DEFAULT_VIEW,
) -> int:
    """Chooses the head angles that show most of what was not seen for longest.

    Args:
        camera: The depth camera.
        heads: Head angles (2,) to choose from.
        durations: What each takes [s].
        places: (N, 3) in the torso frame [m].
        weights: (N,) how much they count.
        unseen: (N,) for how long each was not seen [s].
        params: How urgency grows.

    Returns:
        The index of the best.
    """
    urgency = weights * np.minimum(unseen, params.largest_age)
    gains = [
        urgency @ visible(camera, head, places) / duration
        for head, duration in zip(heads, durations, strict=True)
    ]
    return int(np.argmax(gains))
