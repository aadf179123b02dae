"""Figures of one reach, for people who would rather look than read."""

import itertools
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.results.reach_log import ReachLog

_MODE_COLORS = {
    ReachMode.LOOKING: "#e8f1fa",
    ReachMode.DRIVING: "#fdf3e1",
    ReachMode.SETTLING: "#f1ecf8",
    ReachMode.REACHING: "#e7f5ea",
    ReachMode.HOLDING: "#d3ecd9",
    ReachMode.FAILED: "#fbe3e3",
}


def save_reach_figures(log: ReachLog, folder: Path) -> list[Path]:
    """Draws `path.png` and `timeline.png` into a folder and returns their paths."""
    mpl.use("Agg")
    paths = [folder / "path.png", folder / "timeline.png"]
    draw_path(log).savefig(paths[0], dpi=120)
    draw_timeline(log).savefig(paths[1], dpi=120)
    return paths


def _moving(log: ReachLog) -> np.ndarray:
    return np.isin(log.mode, (ReachMode.REACHING, ReachMode.HOLDING))


def draw_path(log: ReachLog) -> Figure:
    """The hand's path in the torso frame: demonstration, primitive, hand, goal and cloud."""
    moving = _moving(log)
    figure = Figure(figsize=(11, 5), layout="constrained")
    space = figure.add_subplot(1, 2, 1, projection="3d")
    cloud = log.cloud_torso_m
    if len(cloud):
        near = cloud[np.linalg.norm(cloud, axis=1) < 0.75]
        space.scatter(*near.T, s=1.5, c=near[:, 2], cmap="Greys", alpha=0.5, linewidths=0)
    hand, wish = log.hand_position_torso_m[moving], log.desired_position_torso_m[moving]
    start = hand[0] if len(hand) else log.hand_position_torso_m[-1]
    demonstration = log.demonstration_m - log.demonstration_m[0] + start
    space.plot(*demonstration.T, "k-", lw=1.2, label="demonstration, from this start")
    if len(hand):
        space.plot(*wish.T, color="tab:blue", lw=2.0, label="primitive")
        space.plot(*hand.T, color="tab:orange", lw=1.2, ls="--", label="hand")
    space.plot(*log.goal_position_torso_m[-1:].T, "*", color="tab:green", ms=14, label="goal")
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="In the torso frame")
    space.set_aspect("equal")
    space.legend(loc="upper left", fontsize=8)

    for k, name in enumerate("xyz"):
        axes = figure.add_subplot(3, 2, 2 * k + 2)
        if len(hand):
            time = log.time_s[moving] - log.time_s[moving][0]
            axes.plot(time, wish[:, k], color="tab:blue", lw=2, label="primitive")
            axes.plot(time, hand[:, k], color="tab:orange", lw=1.2, ls="--", label="hand")
            axes.plot(
                time, log.goal_position_torso_m[moving, k], color="tab:green", lw=1, label="goal"
            )
        axes.set_ylabel(f"{name} [m]")
        axes.grid(alpha=0.3)
        if k == 0 and len(hand):
            axes.legend(fontsize=8, ncol=3, loc="best")
        if k == 2:
            axes.set_xlabel("time since the arm started [s]")
    return figure


def draw_timeline(log: ReachLog) -> Figure:
    """The run in time: distance to the goal, clearance, coupling and phase, by mode."""
    figure = Figure(figsize=(9, 7.5), layout="constrained")
    rows = figure.subplots(4, 1, sharex=True)
    for axes in rows:
        _shade_modes(axes, log)
        axes.grid(alpha=0.3)
    rows[0].plot(log.time_s, 1000 * log.goal_distance_m, color="tab:green")
    rows[0].set(ylabel="hand to true\ngoal [mm]", yscale="symlog")
    rows[0].set_ylim(bottom=0)
    rows[1].plot(log.time_s, 1000 * log.clearance_m, color="tab:red", label="true, all links")
    rows[1].plot(
        log.time_s, 1000 * log.seen_clearance_m, color="tab:gray", lw=1, label="as seen, the arm"
    )
    rows[1].axhline(0, color="k", lw=0.8)
    rows[1].set(ylabel="clearance [mm]")
    rows[1].legend(fontsize=8)
    rows[2].plot(log.time_s, np.linalg.norm(log.coupling_m_per_s2, axis=1), color="tab:purple")
    rows[2].set(ylabel="coupling\n[m/s²]")
    rows[3].plot(log.time_s, log.phase, color="tab:blue")
    rows[3].set(ylabel="phase", xlabel="time [s]")
    return figure


def _shade_modes(axes: Axes, log: ReachLog) -> None:
    changes = np.flatnonzero(np.diff(log.mode)) + 1
    edges = [0, *changes, len(log.mode) - 1]
    top = axes.get_subplotspec()
    for begin, end in itertools.pairwise(edges):
        mode = ReachMode(int(log.mode[begin]))
        left, right = log.time_s[begin], log.time_s[end]
        axes.axvspan(left, right, color=_MODE_COLORS.get(mode, "white"), zorder=0)
        if top is not None and top.is_first_row() and right - left > 0.3:
            axes.text(
                (left + right) / 2,
                1.02,
                mode.name.lower(),
                transform=axes.get_xaxis_transform(),
                ha="center",
                fontsize=8,
            )
