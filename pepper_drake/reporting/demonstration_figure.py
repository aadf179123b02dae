"""Figure to check a demonstration before learning from it."""

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.learning.demonstrations.arm_chain import ARMS, arm_chain
from pepper_drake.learning.demonstrations.check import DemonstrationReport
from pepper_drake.learning.demonstrations.demonstration import Demonstration

_AXES = ("x", "y", "z")
_COLORS = ("tab:red", "tab:green", "tab:blue")


def draw_demonstration(demonstration: Demonstration, report: DemonstrationReport) -> Figure:
    """Draws positions, speed, distance from the shoulder and the time between samples.

    Args:
        demonstration: The demonstration.
        report: The check's report; its warnings appear below the title.
    """
    figure = Figure(figsize=(11, 8), layout="constrained")
    title = (
        "Can this recording be learned from? "
        f"{report.name}: {report.samples} samples at {report.rate:.3g} Hz, {report.duration:.2f} s"
    )
    figure.suptitle("\n".join([title, *report.warnings[:4]]), fontsize=10, parse_math=False)
    grid = figure.add_gridspec(2, 2)
    t, p = demonstration.times, demonstration.positions
    axes = figure.add_subplot(grid[0, 0])
    for k, name in enumerate(_AXES):
        axes.plot(t, p[:, k], color=_COLORS[k], label=name, marker="." if len(t) < 50 else "")
    axes.set(
        xlabel="time [s]", ylabel="position in the torso frame [m]", title="where is the hand?"
    )
    axes.legend()
    axes.grid(alpha=0.3)
    axes = figure.add_subplot(grid[0, 1])
    axes.plot(t, np.linalg.norm(demonstration.velocities, axis=1), color="tab:purple")
    axes.set(xlabel="time [s]", ylabel="speed [m/s]", title="how fast is it?")
    axes = figure.add_subplot(grid[1, 0])
    for arm in ARMS:
        distance = np.linalg.norm(p - arm_chain(arm).shoulder, axis=1)
        axes.plot(t, distance, label=f"from the {arm} shoulder")
    axes.axhline(report.arm_reach, color="black", linestyle="--", label="farthest reach of an arm")
    axes.set(xlabel="time [s]", ylabel="distance [m]", title="is it within reach?")
    axes.set_ylim(bottom=0.0)  # Room for the legend: a hand is seldom at a shoulder.
    axes.legend(loc="lower right")
    axes = figure.add_subplot(grid[1, 1])
    steps = 1000.0 * np.diff(t)
    axes.plot(t[1:], steps, color="tab:gray")
    # From zero, so rounding does not look like jitter.
    axes.set(xlabel="time [s]", ylabel="time between samples [ms]", title="are samples missing?")
    axes.set_ylim(0.0, 1.2 * float(steps.max()))
    return figure
