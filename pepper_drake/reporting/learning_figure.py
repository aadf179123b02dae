"""Figure of a learned primitive, its demonstrations and its rollout."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.spatial.transform import Rotation

from pepper_drake.learning.approximators.gaussian_forcing import GaussianForcing
from pepper_drake.learning.approximators.local_lines import LocalLines
from pepper_drake.learning.approximators.registry import ForcingModel
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.primitive import MovementPrimitive, Path3D, motion_sample
from pepper_drake.learning.dmp.transformation import forcing_target
from pepper_drake.learning.phase import phase_at

Array = npt.NDArray[np.float64]

AXES = ("x", "y", "z")
_COLORS = ("tab:red", "tab:green", "tab:blue")


def draw_learning(
    primitive: MovementPrimitive, demonstrations: Sequence[Demonstration], path: Path3D
) -> Figure:
    """Draws demonstrations, the primitive learned from them, and its rollout.

    Args:
        primitive: The learned primitive.
        demonstrations: The demonstrations; drawn faint, only the first with a label.
        path: A rollout of the primitive with its own start, goal and duration.
    """
    figure = Figure(figsize=(18, 9), layout="constrained")
    figure.suptitle(
        f"Is {primitive.name} reproduced, and how does it adapt to other goals?"
        f" ({primitive.approximator} with {primitive.num_basis} basis functions,"
        f" scaling '{primitive.translation.scaling}')",
        parse_math=False,
    )
    grid = figure.add_gridspec(3, 5)
    _draw_space(figure.add_subplot(grid[:2, :2], projection="3d"), primitive, demonstrations, path)
    for k, name in enumerate(AXES):
        _draw_axis(figure.add_subplot(grid[k, 2]), k, name, primitive, demonstrations, path)
    _draw_phase(figure.add_subplot(grid[0, 3]), path)
    _draw_activations(figure.add_subplot(grid[1, 3]), primitive)
    _draw_forcing(figure.add_subplot(grid[2, 3]), primitive, demonstrations)
    _draw_speed(figure.add_subplot(grid[2, 0]), primitive, demonstrations, path)
    _draw_other_goals(figure.add_subplot(grid[2, 1]), primitive)
    _draw_orientation(figure.add_subplot(grid[0, 4]), primitive, demonstrations, path)
    _draw_joints(figure.add_subplot(grid[1:, 4]), primitive, demonstrations, path)
    return figure


def draw_primitive(primitive: MovementPrimitive) -> Figure:
    """Draws the path that a primitive performs with its own start, goal and duration."""
    path = primitive.rollout()
    figure = Figure(figsize=(11, 6), layout="constrained")
    figure.suptitle(
        f"{primitive.name}: {primitive.approximator} with {primitive.num_basis} basis functions,"
        f" {primitive.duration:.2f} s",
        parse_math=False,
    )
    grid = figure.add_gridspec(3, 2, width_ratios=(3, 2), wspace=0.2)
    _draw_space(figure.add_subplot(grid[:, 0], projection="3d"), primitive, (), path)
    for k, name in enumerate(AXES):
        _draw_axis(figure.add_subplot(grid[k, 1]), k, name, primitive, (), path)
    return figure


def _draw_space(
    axes: Any,
    primitive: MovementPrimitive,
    demonstrations: Sequence[Demonstration],
    path: Path3D,
) -> None:
    for k, demo in enumerate(demonstrations):
        label = "demonstration" if k == 0 else None
        axes.plot(*demo.positions.T, color="0.7", lw=5, label=label)
    axes.plot(*path.positions.T, color="k", lw=1.5, label="performed")
    axes.plot(*primitive.start[:, None], "o", color="tab:orange", label="start")
    axes.plot(*primitive.goal[:, None], "*", color="tab:purple", ms=12, label="goal")
    axes.set(
        xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=_title("hand path", demonstrations)
    )
    axes.set_aspect("equal")
    # Few ticks on short axes, where they would overlap.
    extent = np.ptp(path.positions, axis=0)
    for axis, share in zip(
        (axes.xaxis, axes.yaxis, axes.zaxis), extent / extent.max(), strict=True
    ):
        axis.set_major_locator(MaxNLocator(max(1, round(6 * float(share)))))
        axis.labelpad = 10
    axes.legend(loc="upper left", fontsize=9)


def _title(name: str, demonstrations: Sequence[Demonstration], mark: str = "") -> str:
    return f"{name}: taught{mark} and performed" if demonstrations else f"{name}: performed"


def _draw_axis(
    axes: Axes,
    k: int,
    name: str,
    primitive: MovementPrimitive,
    demonstrations: Sequence[Demonstration],
    path: Path3D,
) -> None:
    for demo in demonstrations:
        axes.plot(_times(demo, primitive), demo.positions[:, k], color="0.7", lw=4)
    axes.plot(path.times, path.positions[:, k], color=_COLORS[k], lw=1.2)
    axes.set(xlabel="time [s]", ylabel=f"{name} [m]")
    if k == 0:
        axes.set_title(_title("position", demonstrations, mark=" (gray)"), fontsize=10)
    axes.grid(alpha=0.3)


def _draw_orientation(
    axes: Axes, primitive: MovementPrimitive, demonstrations: Sequence[Demonstration], path: Path3D
) -> None:
    axes.set_title("orientation: taught (gray) and performed", fontsize=10)
    axes.set(xlabel="time [s]", ylabel="roll, pitch, yaw [degrees]")
    if path.rotations is None:
        axes.text(0.5, 0.5, "none was demonstrated", ha="center", transform=axes.transAxes)
        return
    for demo in demonstrations:
        if demo.rotations is not None:
            axes.plot(_times(demo, primitive), _roll_pitch_yaw(demo.rotations), color="0.7", lw=4)
    angles = _roll_pitch_yaw(path.rotations)
    for k, name in enumerate(("roll", "pitch", "yaw")):
        axes.plot(path.times, angles[:, k], color=_COLORS[k], lw=1.2, label=name)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)


def _draw_joints(
    axes: Axes, primitive: MovementPrimitive, demonstrations: Sequence[Demonstration], path: Path3D
) -> None:
    axes.set_title("joints: taught (gray) and nominal", fontsize=10)
    axes.set(xlabel="time [s]", ylabel="joint position [degrees]")
    if path.joints is None or primitive.posture is None:
        axes.text(0.5, 0.5, "none were demonstrated", ha="center", transform=axes.transAxes)
        return
    for demo in demonstrations:
        if demo.joints is not None:
            axes.plot(_times(demo, primitive), np.degrees(demo.joints), color="0.7", lw=4)
    for name, joint in zip(primitive.posture.names, np.degrees(path.joints.T), strict=True):
        axes.plot(path.times, joint, lw=1.2, label=name)
    axes.legend(fontsize=8, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.13))
    axes.grid(alpha=0.3)


def _roll_pitch_yaw(quaternions: Array) -> Array:
    """Returns continuous roll, pitch, yaw (N, 3) [degrees] of unit quaternions (N, 4)."""
    rotations = Rotation.from_quat(quaternions, scalar_first=True)
    angles = np.unwrap(rotations.as_euler("xyz"), axis=0)
    return np.asarray(np.degrees(angles))


def _draw_phase(axes: Axes, path: Path3D) -> None:
    axes.plot(path.times, path.phases, color="k")
    axes.set(xlabel="time [s]", ylabel="phase x", yscale="log")
    axes.set_title("phase: decays exponentially from 1", fontsize=10)
    axes.grid(alpha=0.3)


def _draw_activations(axes: Axes, primitive: MovementPrimitive) -> None:
    relative = np.linspace(0.0, 1.0, 600)
    model = primitive.translation.model
    phases = phase_at(relative, primitive.translation.alpha_x)
    axes.plot(relative * primitive.duration, _activations(model, phases), lw=0.9)
    axes.set(xlabel="time [s]", ylabel="activation")
    axes.set_title(f"{model.num_basis} basis functions take turns", fontsize=10)
    axes.grid(alpha=0.3)


def _draw_forcing(
    axes: Axes, primitive: MovementPrimitive, demonstrations: Sequence[Demonstration]
) -> None:
    attractor = primitive.translation
    relative = np.linspace(0.0, 1.0, 400)
    forcing = attractor.forcing(primitive.start, primitive.goal)
    learned = forcing(phase_at(relative, attractor.alpha_x))
    for demo in demonstrations:
        sample = motion_sample(demo)
        target = forcing_target(sample, attractor.alpha_z)
        axes.plot(sample.times * primitive.duration, target, color="0.75", lw=4)
    for k, name in enumerate(AXES):
        axes.plot(
            relative * primitive.duration, learned[:, k], color=_COLORS[k], lw=1.2, label=name
        )
    axes.set(xlabel="time [s]", ylabel="forcing term [m]")
    axes.set_title("forcing term: target (gray) and learned", fontsize=10)
    axes.legend(fontsize=8, ncols=3)
    axes.grid(alpha=0.3)


def _draw_speed(
    axes: Axes, primitive: MovementPrimitive, demonstrations: Sequence[Demonstration], path: Path3D
) -> None:
    for demo in demonstrations:
        speed = np.linalg.norm(demo.velocities, axis=1) * demo.duration / primitive.duration
        axes.plot(_times(demo, primitive), speed, color="0.7", lw=4)
    axes.plot(path.times, np.linalg.norm(path.velocities, axis=1), color="k", lw=1.2)
    axes.set(xlabel="time [s]", ylabel="speed [m/s]", ylim=(0, None))
    axes.set_title("speed: taught (gray) and performed", fontsize=10)
    axes.grid(alpha=0.3)


def _draw_other_goals(axes: Axes, primitive: MovementPrimitive) -> None:
    """Draws the motion to other goals, in the plane of its largest extent."""
    path = primitive.rollout(settle=0.5)
    across, up = np.sort(np.argsort(np.ptp(path.positions, axis=0))[1:])
    reach = 0.3 * np.ptp(path.positions, axis=0).max()
    for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        goal = primitive.goal.copy()
        goal[[across, up]] += reach * np.array([np.cos(angle), np.sin(angle)])
        other = primitive.rollout(goal=goal, settle=0.5).positions
        axes.plot(other[:, across], other[:, up], color="tab:blue", lw=0.8)
        axes.plot(goal[across], goal[up], "*", color="tab:purple", ms=7)
    axes.plot(path.positions[:, across], path.positions[:, up], color="k", lw=1.5)
    axes.plot(primitive.start[across], primitive.start[up], "o", color="tab:orange")
    axes.set(xlabel=f"{AXES[across]} [m]", ylabel=f"{AXES[up]} [m]")
    axes.set_title("the same movement to other goals", fontsize=10)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)


def _activations(model: ForcingModel, phases: Array) -> Array:
    if isinstance(model, GaussianForcing):
        return model.basis.activations(phases)
    assert isinstance(model, LocalLines)
    return model.basis.activations(phases)[0]


def _times(demo: Demonstration, primitive: MovementPrimitive) -> Array:
    """Returns the demonstration's times, stretched to the primitive's duration [s]."""
    return (demo.times - demo.times[0]) * primitive.duration / demo.duration
