"""The report's figure 4.5: comparison of the approximators on one demonstration."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicHermiteSpline

from pepper_drake.evaluation.approximator_comparison import ComparisonRow
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.primitive import Path3D


def draw_comparison(
    demonstration: Demonstration, paths: Mapping[str, Path3D], rows: Sequence[ComparisonRow]
) -> Figure:
    """Draws one demonstration with the paths of each approximator, and the table's medians.

    Args:
        demonstration: The demonstrated motion.
        paths: Reproductions of that motion, by approximator.
        rows: Rows from `compare`.
    """
    figure = Figure(figsize=(13, 8), layout="constrained")
    figure.suptitle("Which approximator reproduces a demonstration best, and how fast?")
    grid = figure.add_gridspec(2, 6)
    colors = {name: f"C{index}" for index, name in enumerate(paths)}
    space = figure.add_subplot(grid[0, :3], projection="3d")
    space.plot(*demonstration.positions.T, color="k", lw=4, alpha=0.25, label="demonstration")
    space.plot(*demonstration.positions[:1].T, "o", color="k", mfc="w", ms=7, label="start")
    space.plot(*demonstration.positions[-1:].T, "*", color="k", ms=11, label="goal")
    for name, path in paths.items():
        space.plot(*path.positions.T, color=colors[name], lw=1.2, label=name)
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    space.set_title(
        f"{demonstration.name}: demonstrated and reproduced", fontsize=10, parse_math=False
    )
    space.set_aspect("equal")
    space.locator_params(nbins=4)
    space.legend(fontsize=8, loc="center left", bbox_to_anchor=(-0.45, 0.5))

    times = demonstration.times - demonstration.times[0]
    error = figure.add_subplot(grid[0, 3:])
    for name, path in paths.items():
        positions = CubicHermiteSpline(path.times, path.positions, path.velocities)(times)
        distance = 1000 * np.linalg.norm(positions - demonstration.positions, axis=1)
        error.semilogy(times, np.maximum(distance, 1e-6), color=colors[name], lw=1.2)
    error.set(xlabel="time [s]", ylabel="distance to the demonstration [mm]")
    error.set_title("the error along the motion, too small to see on the left", fontsize=10)
    error.grid(alpha=0.3)

    count = rows[0].demonstrations if rows else 0
    values = (
        ("how close?", "position_distance_median", "position distance, equation 4.1 [m]", 1.0),
        ("as fast as shown?", "velocity_distance_median", "velocity distance [m/s]", 1.0),
        ("how quickly learned?", "fit_seconds", "time to fit [ms]", 1000.0),
    )
    for index, (question, key, label, unit) in enumerate(values):
        axes = figure.add_subplot(grid[1, 2 * index : 2 * index + 2])
        for name in paths:
            selected = [row for row in rows if row.approximator == name]
            axes.semilogy(
                [row.num_basis for row in selected],
                [unit * getattr(row, key) for row in selected],
                "o-",
                color=colors[name],
                ms=4,
            )
        axes.set(xlabel="basis functions", ylabel=label)
        suffix = "" if count == 1 else f", median of {count} demonstrations"
        axes.set_title(question + suffix, fontsize=10)
        axes.grid(alpha=0.3, which="both")
    return figure
