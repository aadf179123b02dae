"""View planning: the head's next best view of an object's surroundings.

For each view point around the object, the time when it was last in the image is stored. The head
angles chosen show the most points, weighted by the time since they were last seen, per time that
the motion takes.
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
from pepper_drake.perception.cameras.projection import pixel_at
from pepper_drake.perception.gaze.gaze_params import ViewParams
from pepper_drake.perception.gaze.head_aiming import (
    HEAD_YAW_LIMIT,
    P_T_NECK,
    camera_pose,
    image_offset,
)

Vector = npt.NDArray[np.float64]

_NEAREST = 0.3
"""Distance to the depth camera below which not even a point's occlusion is detected [m]."""

VIEW_POINTS = np.array(
    [
        (ahead, left, up)
        for ahead in np.linspace(-0.15, 0.35, 5)
        for left in np.linspace(-0.4, 0.6, 11)
        for up in (-0.12, 0.0)
    ]
)
"""View points (110, 3) around a marked object, for a left arm [m]: ahead of it as seen from the
neck, left, up."""


DEFAULT_VIEW = ViewParams()
"""Default parameters."""


@functools.lru_cache(maxsize=8)
def _path_weights(params: ViewParams) -> Vector:
    """Returns weights of view points, higher near the hand's path, where obstacles come sooner."""
    flat = VIEW_POINTS[:, :2]
    coming = np.array([params.hand_ahead, params.hand_left])
    share = np.clip(flat @ coming / (coming @ coming), 0.0, 1.0)
    distances = np.linalg.norm(flat - share[:, None] * coming, axis=1)
    return np.asarray(1.0 / (1.0 + (distances / params.hand_distance) ** 2))


def surroundings(p_TP: npt.ArrayLike, side: float) -> Vector:
    """Returns the view points (N, 3) around an object's marker in the torso frame [m].

    Args:
        p_TP: The marker (3,) [m].
        side: Side of the reaching arm, 1 left or -1 right.
    """
    p_TP = np.asarray(p_TP, dtype=float)
    x, y = (p_TP - P_T_NECK)[:2] / math.hypot(*(p_TP - P_T_NECK)[:2])
    axes = np.array([[x, y, 0.0], [-side * y, side * x, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(p_TP + VIEW_POINTS @ axes)


def visible(
    camera: HeadCamera, head: npt.ArrayLike, places: Vector, border: float = 0.0
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) are in a depth camera's field of view at head angles (2,).

    Args:
        camera: The camera.
        head: Head angles [rad].
        places: Places in the torso frame [m].
        border: Width of the ignored border, as a fraction of half the image.
    """
    X_TC = camera_pose(camera, head).GetAsMatrix34()
    return _in_images(camera, X_TC[None], places, border)[0]


@functools.cache
def head_grid() -> Vector:
    """Returns head angles (N, 2) covering Pepper's limits at a third of an image's width [rad]."""
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
    """Tells which places can be seen without occlusion at any head angles within the limits.

    Args:
        camera: A depth camera.
        places: (N, 3) in the torso frame [m].
        hiding: Centres (S, 3) in the torso frame and radii (S,) of occluding spheres [m], such as
            those of the robot's own arms; none if omitted.
        baseline: Distance of the camera from its projector [m], for occlusion of its light, with
            the projector on either side; 0 without a projector.
        border: Width of the ignored border, as a fraction of half the image.
        margin: Margin by which the spheres are enlarged [m].

    Returns:
        (N,).
    """
    X_TC = _grid_poses(camera)
    in_image = _in_images(camera, X_TC, places, border)
    if hiding is None:
        return np.asarray(in_image.any(axis=0))
    return _unoccluded(X_TC, in_image, places, hiding, baseline, margin)


def widest_view(
    camera: HeadCamera,
    places: Vector,
    hiding: tuple[Vector, Vector],
    baseline: float = 0.0,
    *,
    border: float = 0.0,
    margin: float = 0.0,
) -> Vector:
    """Returns where to look to see most of some places, as a point (3,) in the torso frame [m].

    It is 1 m from the camera on its optical axis, at those angles of `head_grid` at which most
    places are in the image without occlusion; of equal ones, those that centre them best.

    Args:
        camera: A depth camera.
        places: (N, 3) in the torso frame, at least one [m].
        hiding: As in `within_possible_view`, like all that follows.
        baseline: The same.
        border: The same.
        margin: The same.
    """
    X_TC = _grid_poses(camera)
    in_images = _in_images(camera, X_TC, places, border)
    counts, middle = in_images.sum(axis=1), places.mean(axis=0)
    offsets = [image_offset(camera, head, middle) for head in head_grid()]
    order, most = np.lexsort((offsets, -counts)), -1
    best = order[0]
    for k in order:
        if counts[k] <= most:
            break
        one = slice(k, k + 1)
        seen = _unoccluded(X_TC[one], in_images[one], places, hiding, baseline, margin)
        if (count := int(np.count_nonzero(seen))) > most:
            best, most = k, count
    return np.asarray(X_TC[best, :, 3] + X_TC[best, :, 2])


def _in_images(
    camera: HeadCamera, X_TC: Vector, places: Vector, border: float
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) in T are in a camera's image (H, N) at its poses (H, 3, 4)."""
    lens = camera.intrinsics
    return np.asarray(
        _projected_inside(
            np.ascontiguousarray(X_TC),
            np.ascontiguousarray(places, dtype=float),
            (float(lens.width), float(lens.height)),
            lens.numbers,
            1.0 - border,
        )
    )


@compiled
def _projected_inside(
    X_TC: Vector,
    places: Vector,
    size: tuple[float, float],
    lens: Vector,
    within: float,
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) are in a part of the image (H, N) at H poses (H, 3, 4)."""
    inside = np.zeros((len(X_TC), len(places)), dtype=np.bool_)
    for h in range(len(X_TC)):
        X = X_TC[h]
        for n in range(len(places)):
            a, b, c = places[n, 0] - X[0, 3], places[n, 1] - X[1, 3], places[n, 2] - X[2, 3]
            z = X[0, 2] * a + X[1, 2] * b + X[2, 2] * c
            if z <= _NEAREST:
                continue
            # Scaling x and y scales the distance from the image's centre.
            x = (X[0, 0] * a + X[1, 0] * b + X[2, 0] * c) / (within * z)
            y = (X[0, 1] * a + X[1, 1] * b + X[2, 1] * c) / (within * z)
            u, v = pixel_at(x, y, lens)
            inside[h, n] = -0.5 <= u <= size[0] - 0.5 and -0.5 <= v <= size[1] - 0.5
    return inside


def _unoccluded(
    X_TC: Vector,
    in_image: npt.NDArray[np.bool_],
    places: Vector,
    hiding: tuple[Vector, Vector],
    baseline: float,
    margin: float,
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) are unoccluded in any image (H, N); see `within_possible_view`."""
    # Origins of rays: the camera, and its projector on either side.
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
    """Returns the poses X_TC of a camera (N, 3, 4) at the head angles of `head_grid`."""
    return np.array([camera_pose(camera, head).GetAsMatrix34() for head in head_grid()])


@compiled
def _shown(
    in_image: npt.NDArray[np.bool_], eyes: Vector, places: Vector, centers: Vector, squares: Vector
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) are in the image (H, N) and unoccluded at any of H gazes.

    A sphere with centre (S, 3) and squared radius (S,) occludes a place if it intersects the line
    from the place to any of the gaze's ray origins `eyes` (H, E, 3). All in one frame [m].
    """
    shown = np.zeros(len(places), dtype=np.bool_)
    last = 0  # The sphere that occludes one place often occludes the next.
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
    """Returns the head angles (2,) that bring a place closest to the image's centre [rad]."""
    offsets = [image_offset(camera, head, p_TP) for head in head_grid()]
    nearest: Vector = head_grid()[int(np.argmin(offsets))]
    return nearest


def view_weights(places: Vector, things: Vector, params: ViewParams = DEFAULT_VIEW) -> Vector:
    """Returns weights of view points (N, 3) [m]: much larger near movable points (P, 3) [m]."""
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
    """Chooses the head angles with the next best view.

    Args:
        camera: The depth camera.
        heads: Head angles (2,) to choose from.
        durations: Time that each takes [s].
        places: View points (N, 3) in the torso frame [m].
        weights: Weights of the view points (N,).
        unseen: Time since each was last seen (N,) [s].
        params: Parameters of the urgency.

    Returns:
        The index of the best.
    """
    urgency = weights * np.minimum(unseen, params.largest_age)
    gains = [
        urgency @ visible(camera, head, places) / duration
        for head, duration in zip(heads, durations, strict=True)
    ]
    return int(np.argmax(gains))
