"""Comparison of methods: the report's figures 2.4, 4.8 and 4.10 in one picture."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling, Coupling, ReportCoupling
from pepper_drake.planning.reach.reach_mode import last_attempt
from pepper_drake.reporting.reach_figures import draw_surroundings
from pepper_drake.results.reach_log import ReachLog
from pepper_drake.results.reach_report import ReachReport

Vector = npt.NDArray[np.float64]

_COLORS = {"adapted": "tab:blue", "reactive": "tab:orange", "report": "tab:red"}
_POINT = np.array([0.5, 0.5, 0.5])
_GOAL = np.array([1.0, 1.0, 1.0])
_STARTS = 0.12 * np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float
)
"""Starts around the origin, as in figure 2.4 [m]."""
_GAMMA = 1000.0
"""Strength of equation 2.7 for a single point; 20 is for clouds of hundreds of points."""


@dataclass(frozen=True)
class MethodRun:
    """One reach by a method."""

    log: ReachLog
    report: ReachReport


def draw_methods(
    still: Mapping[str, MethodRun], moved: Mapping[str, MethodRun], scene: str
) -> Figure:
    """Draws the coupling around one point, and reaches to a resting and to a displaced goal.

    Args:
        still: Reaches to the resting goal, by the method's name.
        moved: Reaches to the displaced goal, by the method's name.
        scene: Name of the scene.
    """
    mpl.use("Agg")
    figure = Figure(figsize=(17, 6.4), layout="constrained")
    figure.suptitle(
        "How does each method get around the obstacles?\n"
        "black: as taught, neither bent nor adapted; dots: what the robot saw",
        fontsize=12,
    )
    _draw_couplings(figure.add_subplot(1, 3, 1, projection="3d"))
    for number, (runs, title) in enumerate(
        (
            (still, f"Scene {scene} (the report's figure 4.8)"),
            (moved, "The same, the goal displaced upward (figure 4.10)"),
        ),
        start=2,
    ):
        space = figure.add_subplot(1, 3, number, projection="3d")
        _draw_reaches(space, runs)
        space.set_title(title, fontsize=10)
    return figure


def around_point(coupling: Coupling, start: Vector) -> Vector:
    """Returns a path (N, 3) from a start (3,) to figure 2.4's goal [m].

    It is a straight movement, bent by a coupling around the one point of that figure.
    """
    s = np.linspace(0.0, 1.0, 101)
    blend = 10 * s**3 - 15 * s**4 + 6 * s**5
    straight = Demonstration.from_positions(s, start + blend[:, None] * (_GOAL - start))
    primitive = MovementPrimitive.fit(straight, check=False)
    return primitive.rollout(obstacles=_POINT[None], coupling=coupling).positions


def _draw_couplings(space: Any) -> None:
    for coupling, color, name in (
        (ReportCoupling(gamma=_GAMMA), _COLORS["report"], f"equation 2.7, gamma {_GAMMA:g}"),
        (BarrierCoupling(), _COLORS["reactive"], "barrier, 60 mm kept"),
    ):
        for number, start in enumerate(_STARTS):
            path = around_point(coupling, start)
            label = name if number == 0 else ""
            space.plot(*path.T, color=color, lw=1.3, label=label)
    for number, start in enumerate(_STARTS):
        label = "without coupling" if number == 0 else ""
        ends = np.stack((start, _GOAL))
        space.plot(*ends.T, color="k", lw=0.7, label=label)
        space.plot(*start[:, None], "o", color="k", mfc="w", ms=5)
    space.plot(*_POINT[:, None], "o", color="#d9541a", ms=8, label="obstacle: one point")
    space.plot(*_GOAL[:, None], "*", color="tab:green", mec="k", mew=0.5, ms=14, label="goal")
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    space.set_title("The coupling alone (the report's figure 2.4)", fontsize=10)
    space.set_box_aspect((1, 1, 1), zoom=0.82)
    space.tick_params(labelsize=8)
    space.legend(fontsize=8, loc="upper left")


def _draw_reaches(space: Any, runs: Mapping[str, MethodRun]) -> None:
    for number, (name, run) in enumerate(runs.items()):
        log, report = run.log, run.report
        moving = last_attempt(log.mode)
        if number == 0:
            draw_surroundings(space, [each.log for each in runs.values()])
        hand = log.hand_position_torso_m[moving]
        taught = log.taught_path_torso_m
        if len(taught):
            space.plot(*taught.T, color="k", lw=0.9)
        if len(hand):
            label = f"{name}: {_verdict(report)}"
            space.plot(*hand.T, color=_COLORS.get(name, "tab:gray"), lw=2, label=label)
            space.plot(*hand[:1].T, "o", color="k", mfc="w", ms=5)
        else:
            space.plot([], [], [], color=_COLORS.get(name), label=f"{name}: {_verdict(report)}")
    space.legend(fontsize=8, loc="upper left")


def _verdict(report: ReachReport) -> str:
    """Returns the outcome in a few words."""
    if report.outcome != "reached":
        return f"failed ({report.reason})"
    clearance = report.minimum_clearance or 0.0
    return f"reached, {1000 * clearance:.0f} mm clear"
