"""False detections of the goal in images without its marker, with another, or half of it."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.evaluation.perception_evaluation import PerceptionEvaluation, camera_before_marker
from pepper_drake.perception.cameras.camera import CAMERA_TOP, CameraIntrinsics
from pepper_drake.perception.cameras.noise import apply_color_noise
from pepper_drake.perception.goal.detection import detect_goal
from pepper_drake.perception.goal.imm_filter import GoalState, update_goal

Image = npt.NDArray[np.uint8]

KINDS = ("no marker", "wrong marker", "half hidden")

_FRAMES_A_VIEW = 20
"""Consecutive frames from one view: a repeated false detection can pass the goal filter."""

_WRONG_BEYOND = 0.02
"""Distance to the true goal from which a published goal is wrong [m]."""


@dataclass(frozen=True)
class WrongGoals:
    """Counts of false detections in images without the goal.

    Attributes:
        frames: Number of images.
        measured: Images with a detection; with a half hidden marker it may be correct.
        wrong: Number of wrong published goals.
    """

    frames: int
    measured: int
    wrong: int


def count_false_positives(study: PerceptionEvaluation, frames: int, seed: int = 0) -> WrongGoals:
    """Counts detections in a scene whose marker is removed, replaced by another, or half hidden.

    Args:
        study: Evaluation of the scene.
        frames: Number of images, with noise and the real lens.
        seed: Seed of views, markers and noise.
    """
    rng = np.random.default_rng([seed, 5])
    config, camera = study.config.perception, CAMERA_TOP.intrinsics
    marked, X_WO = study.marked, study.scene.goal.pose()
    measured = wrong = 0
    state, image, X_WC = GoalState(), np.zeros((0, 0, 4), np.uint8), RigidTransform()
    for frame in range(frames):
        if frame % _FRAMES_A_VIEW == 0:
            state = GoalState()
            X_WC = camera_before_marker(
                X_WO @ marked.X_OM, rng.uniform(0.3, 1.2), rng.uniform(0, 0.87), camera, rng
            )
            kind = KINDS[frame // _FRAMES_A_VIEW % len(KINDS)]
            image = _alter(study.rig.color_from(camera.ideal(), X_WC), kind, X_WC, study, rng)
        noisy = apply_color_noise(image, camera, study.color_noise, seed=seed, frame=frame)
        detection = detect_goal(noisy, 0.2 * frame, X_WC, camera, marked, params=config.marker)
        if detection is None:
            continue
        measured += 1
        before = state.published
        state = update_goal(state, detection, marked.X_OM.translation(), config.goal)
        if state.published is not None and state.published is not before:
            error = state.published.translation() - X_WO.translation()
            wrong += bool(np.linalg.norm(error) > _WRONG_BEYOND)
    return WrongGoals(frames, measured, wrong)


def _alter(
    image: Image,
    kind: str,
    X_WC: RigidTransform,
    study: PerceptionEvaluation,
    rng: np.random.Generator,
) -> Image:
    """Removes the marker from a rendered image, replaces it by another, or hides half of it."""
    marked, camera = study.marked, CAMERA_TOP.intrinsics.ideal()
    X_CM = X_WC.InvertAndCompose(study.scene.goal.pose() @ marked.X_OM)
    if kind == "no marker":
        picture = rng.integers(0, 255, (6, 6), dtype=np.uint8)
        picture[:] = picture.mean() if rng.random() < 0.5 else picture
        return _draw(image, picture, X_CM, marked.marker_size, camera)
    if kind == "wrong marker":
        book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, marked.dictionary))
        others = [k for k in range(len(book.bytesList)) if k != marked.marker_id]
        picture = cv2.aruco.generateImageMarker(book, int(rng.choice(others)), 240)
        return _draw(image, picture, X_CM, marked.marker_size, camera)
    shift = marked.marker_size * rng.uniform(0.3, 0.7)
    angle = rng.uniform(0, 2 * np.pi)
    cover = RigidTransform([shift * np.cos(angle), shift * np.sin(angle), 0.001])
    patch = np.full((6, 6), rng.integers(0, 255), np.uint8)
    return _draw(image, patch, X_CM @ cover, marked.marker_size, camera)


def _draw(
    image: Image, picture: Image, X_CM: RigidTransform, size: float, camera: CameraIntrinsics
) -> Image:
    """Draws a square picture with side `size` at a pose into an image without lens distortion."""
    h = size / 2
    corners = camera.project((X_CM @ np.array([[-h, h, h, -h], [h, h, -h, -h], [0.0] * 4])).T)
    rows, columns = picture.shape
    frame = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], np.float32) - 0.5
    warp = cv2.getPerspectiveTransform(frame, corners.astype(np.float32))
    shape = (camera.width, camera.height)
    drawn = cv2.warpPerspective(picture, warp, shape, flags=cv2.INTER_AREA)
    covered = cv2.warpPerspective(np.full_like(picture, 255), warp, shape) > 127
    result = image.copy()
    result[covered, :3] = drawn[covered][:, None]
    return result
