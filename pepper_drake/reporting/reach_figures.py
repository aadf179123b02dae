"""Figures of one reach; each answers the question in its title."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_mode import ReachMode, last_attempt
from pepper_drake.results.movement_report import (
    ADAPTED,
    BENT,
    MovementReport,
    coupling_strength,
    is_moving,
    measure_movement,
)
from pepper_drake.results.reach_log import ReachLog

_MODE_COLORS = {
    ReachMode.LOOKING: "#e8f1fa",
    ReachMode.DRIVING: "#fdf3e1",
    ReachMode.SETTLING: "#f1ecf8",
    ReachMode.REACHING: "#e7f5ea",
    ReachMode.HOLDING: "#d3ecd9",
    ReachMode.FAILED: "#fbe3e3",
}
_ORIGIN_COLORS = {
    Origin.TAUGHT: "tab:blue",
    Origin.ADAPTED: "tab:cyan",
    Origin.DETOUR: "tab:olive",
    Origin.RETREAT: "tab:red",
    Origin.RETURN: "tab:purple",
}
TAUGHT, PRIMITIVE, HAND, GOAL, CLOUD = "k", "tab:blue", "tab:orange", "tab:green", "#d9541a"

_CUT = 0.1
"""Largest clearance in a log [m]."""
_AROUND = 0.12
"""Margin around the hand's paths within which the cloud is drawn [m]."""


def save_reach_figures(log: ReachLog, folder: Path) -> list[Path]:
    """Draws `path.png` and `timeline.png` into a folder and returns their paths."""
    mpl.use("Agg")
    paths = [folder / "path.png", folder / "timeline.png"]
    draw_path(log).savefig(paths[0], dpi=120)
    draw_timeline(log).savefig(paths[1], dpi=120)
    return paths


def movement_title(movement: MovementReport) -> str:
    """Returns a figure title that says whether the movement was performed as taught."""
    if not movement.kind:
        return "The arm did not start"
    deviation = f"up to {1000 * (movement.largest_deviation or 0.0):.0f} mm from it"
    if movement.kind == ADAPTED:
        return f"Performed as taught? No: adapted, {deviation}"
    if movement.kind == BENT:
        return f"Performed as taught? Bent by the coupling alone, {deviation}"
    return f"Performed as taught? Yes, {deviation}"


def draw_path(log: ReachLog) -> Figure:
    """Draws the hand's path in the torso frame: as taught, as performed, with goal and cloud."""
    moving = last_attempt(log.mode)
    figure = Figure(figsize=(12, 6), layout="constrained")
    figure.suptitle(movement_title(measure_movement(log)), fontsize=13)
    space = figure.add_subplot(1, 2, 1, projection="3d")
    draw_hand_paths(space, log)
    space.legend(loc="upper left", bbox_to_anchor=(-0.1, 1.06), fontsize=8)
    hand, desired = log.hand_position_torso_m[moving], log.desired_position_torso_m[moving]
    for k, name in enumerate("xyz"):
        axes = figure.add_subplot(3, 2, 2 * k + 2)
        if len(hand):
            time = log.time_s[moving] - log.time_s[moving][0]
            axes.plot(time, desired[:, k], color=PRIMITIVE, lw=2, label="primitive")
            axes.plot(time, hand[:, k], color=HAND, lw=1.2, ls="--", label="hand")
            goal = log.goal_position_torso_m[moving, k]
            axes.plot(time, goal, color=GOAL, lw=1, label="goal, as estimated")
        axes.set_ylabel(f"{name} in the torso frame [m]", fontsize=9)
        axes.grid(alpha=0.3)
        if k == 0 and len(hand):
            axes.legend(fontsize=8, ncol=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
        if k == 2:
            axes.set_xlabel("time since the arm started [s]")
    return figure


def draw_hand_paths(space: Any, log: ReachLog) -> None:
    """Draws the paths of one reach in space, with start, goal and the cloud around them."""
    moving = last_attempt(log.mode)
    hand, desired = log.hand_position_torso_m[moving], log.desired_position_torso_m[moving]
    taught = log.taught_path_torso_m
    if not len(hand):
        hand = log.hand_position_torso_m[-1:]
    draw_surroundings(space, [log])
    if len(taught):
        space.plot(*taught.T, color=TAUGHT, lw=1.4, label="as taught, neither bent nor adapted")
    if len(desired):
        space.plot(*desired.T, color=PRIMITIVE, lw=2.2, label="primitive, as performed")
        space.plot(*hand.T, color=HAND, lw=1.2, ls="--", label="hand")
    space.plot(*hand[:1].T, "o", color="k", mfc="w", ms=7, label="start")


def draw_surroundings(space: Any, logs: Sequence[ReachLog]) -> None:
    """Draws goal, cloud and axes around the hand's paths of reaches in one scene."""
    shown = np.concatenate(
        [
            points[np.isfinite(points).all(axis=1)]
            for log in logs
            for points in (
                log.hand_position_torso_m[last_attempt(log.mode)],
                log.taught_path_torso_m,
                log.hand_position_torso_m[-1:],
                log.goal_position_torso_m[-1:],
            )
        ]
    )
    lower, upper = shown.min(axis=0) - _AROUND, shown.max(axis=0) + _AROUND
    cloud = logs[0].cloud_torso_m
    near = cloud[np.all((cloud > lower) & (cloud < upper), axis=1)]
    space.scatter(*near.T, s=4, c=CLOUD, alpha=0.6, linewidths=0, label="cloud, when it started")
    goal = logs[0].goal_position_torso_m[-1:]
    space.plot(*goal.T, "*", color=GOAL, mec="k", mew=0.5, ms=15, label="goal")
    space.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), zlim=(lower[2], upper[2]))
    space.set(xlabel="x, ahead [m]", ylabel="y, left [m]", zlabel="z, up [m]")
    space.zaxis.set_rotate_label(False)  # From this view matplotlib would draw it upside down.
    space.zaxis.label.set_rotation(90)
    space.set_box_aspect(upper - lower, zoom=0.82)
    space.locator_params(nbins=4)
    space.tick_params(labelsize=8)
    space.view_init(elev=22, azim=-125)


def draw_timeline(log: ReachLog) -> Figure:
    """Draws a run over time: errors, clearance, coupling, movement and phase, with modes."""
    figure = Figure(figsize=(9, 9.5), layout="constrained")
    figure.suptitle(
        "What did the robot do when, how close did it come, and when did the coupling act?"
    )
    rows = figure.subplots(5, 1, sharex=True)
    for axes in rows:
        _shade_modes(axes, log, named=axes is rows[0])
        axes.grid(alpha=0.3)
    rows[0].plot(log.time_s, 1000 * np.maximum(log.goal_distance_m, 1e-4), color=GOAL)
    rows[0].set(ylabel="hand to true\ngoal [mm]", yscale="log")
    rows[1].plot(
        log.time_s,
        np.degrees(log.orientation_error_rad),
        color="tab:gray",
        label="whole orientation",
    )
    rows[1].plot(log.time_s, np.degrees(log.axis_error_rad), color=GOAL, label="task axis")
    rows[1].set(ylabel="hand to goal,\nrotation [degrees]")
    rows[1].set_ylim(bottom=0)
    rows[1].legend(fontsize=8, loc="upper left")
    cut = 1000 * _CUT
    rows[2].plot(log.time_s, 1000 * log.clearance_m, color="tab:red", label="true, all links")
    rows[2].plot(
        log.time_s, 1000 * log.seen_clearance_m, color="tab:gray", lw=1, label="as seen, the arm"
    )
    rows[2].axhline(0, color="k", lw=0.8)
    rows[2].axhline(cut, color="k", lw=0.8, ls=":", label=f"cut: {cut:.0f} mm or more")
    rows[2].set(ylabel="clearance [mm]")
    rows[2].legend(fontsize=8, loc="lower left")
    rows[3].plot(log.time_s, coupling_strength(log), color="tab:purple")
    rows[3].set(ylabel="coupling\n|C_t| / τ² [m/s²]")
    if not coupling_strength(log).any():
        rows[3].set_ylim(-0.1, 1.0)
        rows[3].text(
            0.01, 0.5, "zero throughout: no obstacle was near enough", transform=rows[3].transAxes
        )
    _draw_origins(rows[4], log)
    rows[4].plot(log.time_s, log.phase, color="k")
    rows[4].set(ylabel="phase x\n(1 at the start)", yscale="log", xlabel="time [s]")
    return figure


def _draw_origins(axes: Axes, log: ReachLog) -> None:
    """Shades the background by the origin of the current movement."""
    drawn = set()
    moving = is_moving(log)
    for begin, end in _runs(np.where(moving, log.movement_origin, Origin.NONE)):
        origin = Origin(int(log.movement_origin[begin])) if moving[begin] else Origin.NONE
        if origin != Origin.NONE:
            label = "" if origin in drawn else f"movement: {origin.name.lower()}"
            drawn.add(origin)
            color = _ORIGIN_COLORS[origin]
            axes.axvspan(log.time_s[begin], log.time_s[end], color=color, alpha=0.35, label=label)
    if drawn:
        axes.legend(fontsize=8, loc="lower left")


def _runs(values: np.ndarray) -> list[tuple[int, int]]:
    """Returns first and end index of each run of equal values."""
    changes = np.flatnonzero(np.diff(values)) + 1
    return list(itertools.pairwise([0, *changes.tolist(), len(values) - 1]))


def _shade_modes(axes: Axes, log: ReachLog, *, named: bool) -> None:
    whole = log.time_s[-1] - log.time_s[0]
    unnamed = {}
    for begin, end in _runs(log.mode):
        mode = ReachMode(int(log.mode[begin]))
        left, right = log.time_s[begin], log.time_s[end]
        color = _MODE_COLORS.get(mode, "white")
        axes.axvspan(left, right, color=color, zorder=0)
        # Short intervals have no room for the mode's name.
        if named and right - left > 0.0105 * whole * len(mode.name):
            axes.text(
                (left + right) / 2,
                1.02,
                mode.name.lower(),
                transform=axes.get_xaxis_transform(),
                ha="center",
                fontsize=8,
            )
        elif named and right > left:
            unnamed[mode] = Patch(facecolor=color, edgecolor="0.6", label=mode.name.lower())
    if unnamed:
        axes.legend(handles=list(unnamed.values()), fontsize=8, loc="lower left")
