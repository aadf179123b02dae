"""Figures of perception: images as in figures 4.2 to 4.4 of the report, and clouds."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud

from pepper_drake.evaluation.perception_evaluation import CloudStudy, GoalSample
from pepper_drake.perception.cloud_evaluation import COVERED_WITHIN

Points = npt.NDArray[np.floating]

_IMAGE_TITLES = {
    "body": "Pepper's own body, in white",
    "disparity": "disparity of the stereo pair",
    "segmentation": "segments of the stereo cloud",
}
"""Titles of images whose names need explanation."""
_SIDE_BY_SIDE = 1.6
"""Distance between clouds shown side by side [m]."""


def save_images_figure(studies: Mapping[str, CloudStudy], folder: Path) -> Path:
    """Draws `images.png`: colour, depth, disparity, segmentation, body mask.

    Args:
        studies: Studies by the sensor's name.
        folder: Folder for the file.
    """
    images: dict[str, npt.NDArray] = {}
    for study in studies.values():
        images |= study.images
    figure = Figure(figsize=(5 * len(images) / 2 + 0.5, 6), layout="constrained")
    figure.suptitle("What do the cameras see, and what is made of it?")
    axes = figure.subplots(2, (len(images) + 1) // 2, squeeze=False).ravel()
    for each in axes:
        each.set_axis_off()
    for each, (name, image) in zip(axes, images.items(), strict=False):
        each.set_title(_IMAGE_TITLES.get(name, name.replace("_", " ")))
        if image.ndim == 3:
            each.imshow(image)
        elif name == "segmentation":
            each.imshow(np.ma.masked_equal(image, 0), cmap="tab20", interpolation="nearest")
        elif name == "depth":
            shown = each.imshow(np.ma.masked_equal(image, 0) / 1000, cmap="viridis_r", vmax=3)
            figure.colorbar(shown, ax=each, label="depth [m], cut at 3", shrink=0.7)
        elif name == "disparity":
            shown = each.imshow(np.ma.masked_equal(image, 0), cmap="turbo")
            figure.colorbar(shown, ax=each, label="disparity [pixels]", shrink=0.7)
        else:
            each.imshow(image, cmap="gray")
            if name == "body" and not image.any():
                each.text(
                    0.5, 0.5, "none of it in view", color="w", ha="center", transform=each.transAxes
                )
    return _save(figure, folder / "images.png")


def save_clouds_figure(studies: Mapping[str, CloudStudy], folder: Path) -> Path:
    """Draws `clouds.png`: each cloud from above and from the side, over the true surfaces."""
    figure = Figure(figsize=(5.5 * len(studies), 8), layout="constrained")
    figure.suptitle(
        "How close do the clouds lie to the true surfaces? From above, and from the side"
    )
    axes = figure.subplots(2, len(studies), squeeze=False)
    for column, (name, study) in enumerate(studies.items()):
        points, report = study.surface.positions, study.report
        _plot_points(axes[:, column], study.visible, color="0.8", ms=1, label="truth")
        _plot_points(axes[:, column], points, color="tab:blue", ms=1.2, label=name)
        axes[0, column].set_title(
            f"{name}: {report.points} points, rms {1000 * report.rms_error:.1f} mm,\n"
            f"{100 * report.coverage:.1f} % of the visible surface within "
            f"{1000 * COVERED_WITHIN:.0f} mm"
        )
        axes[0, column].legend(loc="upper left", markerscale=6)
    return _save(figure, folder / "clouds.png")


def draw_points(points: Points, title: str) -> Figure:
    """Draws points (N, 3) [m] from above and from the side."""
    figure = Figure(figsize=(11, 5), layout="constrained")
    figure.suptitle(title)
    _plot_points(figure.subplots(1, 2), points, color="tab:blue", ms=1.2)
    return figure


def _plot_points(pair: npt.NDArray[np.object_], points: Points, **style: Any) -> None:
    """Plots points into axes (2,): from above, and from the side."""
    for axes, (across, up) in zip(pair, ((0, 1), (0, 2)), strict=True):
        axes.plot(points[:, across], points[:, up], ".", **style)
        axes.set(xlabel=f"{'xyz'[across]} [m]", ylabel=f"{'xyz'[up]} [m]", aspect="equal")


def save_goal_figure(samples: Sequence[GoalSample], folder: Path) -> Path:
    """Draws `goal.png`: errors of the goal by distance and camera."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    figure.suptitle("How well is the goal found, and from how far?")
    position, orientation = figure.subplots(1, 2)
    for camera in dict.fromkeys(sample.camera for sample in samples):
        found = [s for s in samples if s.camera == camera and s.found]
        distances = np.array([s.distance for s in found])
        position.plot(distances, [1000 * s.position_error for s in found], ".", label=camera)
        orientation.plot(
            distances, np.degrees([s.orientation_error for s in found]), ".", label=camera
        )
    position.set(xlabel="distance [m]", ylabel="error of the hand's goal [mm]", yscale="log")
    orientation.set(
        xlabel="distance [m]", ylabel="error of its orientation [degrees]", yscale="log"
    )
    position.legend()
    return _save(figure, folder / "goal.png")


def draw_clouds(meshcat: Meshcat, studies: Mapping[str, CloudStudy]) -> None:
    """Shows each cloud over the true surfaces, side by side."""
    colors = (Rgba(0.1, 0.4, 0.9), Rgba(0.9, 0.45, 0.1), Rgba(0.2, 0.7, 0.3))
    truth = next(iter(studies.values())).visible
    shown = {"truth": truth} | {name: study.surface.positions for name, study in studies.items()}
    for place, (name, points) in enumerate(shown.items()):
        color = Rgba(0.6, 0.6, 0.6) if place == 0 else colors[(place - 1) % len(colors)]
        X = RigidTransform([0, _SIDE_BY_SIDE * (place - (len(shown) - 1) / 2), 0])
        path = f"clouds/{name}"
        meshcat.SetObject(path, _cloud(points), 0.006, color)
        meshcat.SetTransform(path, X)


def _cloud(points: npt.NDArray[np.floating]) -> PointCloud:
    cloud = PointCloud(len(points))
    if len(points):
        cloud.mutable_xyzs()[:] = np.asarray(points, np.float32).T
    return cloud


def _save(figure: Figure, path: Path) -> Path:
    mpl.use("Agg")
    figure.savefig(path, dpi=110)
    return path
