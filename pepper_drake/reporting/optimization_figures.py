"""Figures of a search: the cost of each update, and the movement before and after."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pepper_drake.learning.dmp.primitive import MovementPrimitive

Array = npt.NDArray[np.float64]

_AXES = ("x", "y", "z")
_DECADE = 10.0
"""Ratio of costs above which the axis is logarithmic."""


def draw_costs(
    totals: Sequence[Array], mean_costs: Sequence[float], title: str, unit: str = ""
) -> Figure:
    """Draws the cost of each update, as in the report's figure 4.7.

    Args:
        totals: (S,) costs of each update's samples.
        mean_costs: The costs of the mean before the first update and after each; may be NaN.
        title: Title of the figure.
        unit: Unit of the cost.
    """
    figure = Figure(figsize=(8, 4.5), layout="constrained")
    axes: Axes = figure.add_subplot()
    for update, costs in enumerate(totals, start=1):
        label = "samples" if update == 1 else None
        axes.plot(np.full(len(costs), update), costs, ".", color="0.7", label=label)
    if np.isfinite(mean_costs).any():
        axes.plot(range(len(mean_costs)), mean_costs, "o-", color="tab:blue", label="movement")
    else:
        means = [costs.mean() for costs in totals]
        axes.plot(range(1, len(means) + 1), means, "o-", color="tab:blue", label="mean of samples")
    axes.set(xlabel="update", ylabel=f"cost{unit}", title=title)
    known = np.concatenate([np.ravel(mean_costs), *totals])
    known = known[np.isfinite(known)]
    if known.size and known.min() > 0.0 and known.max() > _DECADE * known.min():
        axes.set_yscale("log")
    else:
        axes.set_ylim(0, None)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


def draw_ways(
    before: MovementPrimitive,
    after: MovementPrimitive,
    goal: Array,
    obstacles: Array | None,
    clearance: float,
) -> Figure:
    """Draws the hand's path before and after a search.

    Args:
        before: Movement before the search.
        after: Movement that the search found.
        goal: (3,) goal of the hand [m].
        obstacles: (P, 3) points [m], or None.
        clearance: Desired clearance of the whole path [m].
    """
    figure = Figure(figsize=(13, 7), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.4, 1.0))
    space: Any = figure.add_subplot(grid[:, 0], projection="3d")
    old, new = before.rollout(), after.rollout()
    if obstacles is not None:
        near = obstacles[np.linalg.norm(obstacles - goal, axis=1) < 0.6]
        space.plot(
            *near[:: max(1, len(near) // 1500)].T,
            ".",
            color="tab:orange",
            ms=1.5,
            label="obstacles",
        )
    space.plot(*old.positions.T, color="0.6", lw=3, label="before")
    space.plot(*new.positions.T, color="tab:blue", lw=1.8, label="after")
    space.plot(*old.positions[:1].T, "o", color="k", mfc="w", ms=7, label="start")
    space.plot(*goal[:, None], "*", color="tab:purple", ms=13, label="goal")
    title = "How did the hand's path change?"
    if obstacles is not None:
        title += f" {1000 * clearance:g} mm of clearance wanted"
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=title)
    space.set_aspect("equal")
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.set_major_locator(MaxNLocator(5))
    space.legend(loc="upper left")
    for k, name in enumerate(_AXES):
        axes: Axes = figure.add_subplot(grid[k, 1])
        axes.plot(old.times, old.positions[:, k], color="0.6", lw=3)
        axes.plot(new.times, new.positions[:, k], color="tab:blue", lw=1.5)
        axes.axhline(goal[k], color="tab:purple", lw=1.0, ls=":")
        axes.set_ylabel(f"{name} [m]")
        axes.grid(alpha=0.3)
        if k == 2:
            axes.set_xlabel("time [s]")
    return figure


def draw_reproductions(before: MovementPrimitive, shown: Mapping[int, MovementPrimitive]) -> Figure:
    """Draws numbered variations of a movement, and the movement itself, for a tutor to rate."""
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    axes: Any = figure.add_subplot(projection="3d")
    axes.plot(*before.rollout().positions.T, color="0.75", lw=4, label="before")
    for number, primitive in shown.items():
        axes.plot(*primitive.rollout().positions.T, label=f"{number}")
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.set_title("Which reproduction of the hand's path is best?")
    axes.set_aspect("equal")
    axes.legend(loc="center left", bbox_to_anchor=(1.08, 0.5))
    return figure


def save_reproductions(
    before: MovementPrimitive, shown: Mapping[int, MovementPrimitive], path: Path
) -> None:
    """Saves the figure of `draw_reproductions` as a picture."""
    draw_reproductions(before, shown).savefig(path, dpi=100)


def draw_comparison(curves: Mapping[str, Array], rollouts: Array, title: str) -> Figure:
    """Draws the cost of several methods against the number of rollouts.

    Args:
        curves: Cost (seeds, updates + 1) of the movement after each update, by method.
        rollouts: (updates + 1,) number of rollouts until then.
        title: Title of the figure.
    """
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    axes: Axes = figure.add_subplot()
    for k, (name, costs) in enumerate(curves.items()):
        lower, middle, upper = np.quantile(costs, (0.25, 0.5, 0.75), axis=0)
        axes.plot(rollouts, middle, "o-", ms=3.5, color=f"C{k}", label=name)
        axes.fill_between(rollouts, lower, upper, color=f"C{k}", alpha=0.15)
    axes.set(xlabel="rollouts", ylabel="cost", title=title, yscale="log")
    axes.grid(alpha=0.3, which="both")
    axes.legend(title="median, and the middle half of the seeds")
    return figure
