"""Figure of the reaching benchmark."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.methods import get_method
from pepper_drake.benchmarking.summary import MethodSummary, Scenes

COLORS = {
    "reached": "#59a14f",
    "refused": "#bab0ac",
    "failed": "#f1ce63",
    "error": "#b07aa1",
    "touched": "#e15759",
}
"""Colours of the outcomes."""
_PANELS = (
    ("first_motion_seconds", "time to first motion [s]", "log"),
    ("path_length", "hand path length [m]", "linear"),
    ("jerk", "jerk of the hand, rms [m/s³]", "log"),
    ("demonstration_distance", "distance to the taught path [m], equation 4.1", "linear"),
    ("clearance", "least clearance [m], cut at 0.1", "linear"),
)
_SPAN = 4.0
"""Ratio of values below which an axis is linear."""


def draw_benchmark(summaries: Sequence[MethodSummary], results: Sequence[MethodResult]) -> Figure:
    """Draws each method's outcomes, and distributions over its runs that reached.

    Args:
        summaries: Summaries from `summarise`.
        results: The summarised results.
    """
    figure = Figure(figsize=(14, 7.5), layout="constrained")
    scenes = Scenes.of(results)
    figure.suptitle(
        f"Which method reaches, and at what price? {scenes}\n(boxes: of the runs that reached)"
    )
    grid = figure.add_gridspec(2, 3)
    _draw_outcomes(figure.add_subplot(grid[0, 0]), summaries, scenes.share)
    for index, (name, label, scale) in enumerate(_PANELS, start=1):
        axes = figure.add_subplot(grid[divmod(index, 3)])
        rows = [
            [
                value
                for result in results
                if result.method == summary.method and result.outcome == "reached"
                if (value := getattr(result, name)) is not None
            ]
            for summary in summaries
        ]
        axes.boxplot(
            [values or [np.nan] for values in rows],
            orientation="horizontal",
            showfliers=False,
            medianprops={"color": "tab:orange"},
        )
        for height, values in enumerate(rows, start=1):
            axes.plot(values, np.full(len(values), height), "|", color="tab:blue", alpha=0.4)
        _label(axes, summaries)
        known = [value for values in rows for value in values if value > 0.0]
        if not known or max(known) < _SPAN * min(known):
            scale = "linear"  # No value, or nearly equal values.
        axes.set(xlabel=label, xscale=scale)
        if scale == "log":  # A short axis may have no decade, and no room for all minor ticks.
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
        else:
            axes.locator_params(axis="x", nbins=5)
        axes.grid(axis="x", alpha=0.3)
    return figure


def _draw_outcomes(axes: Axes, summaries: Sequence[MethodSummary], whole: str) -> None:
    """Draws the rates of the outcomes as bars, with the confidence interval of "reached"."""
    heights = np.arange(1, len(summaries) + 1)
    left = np.zeros(len(summaries))
    for outcome, color in COLORS.items():
        shares = np.array([np.nan_to_num(summary.rates[outcome].value) for summary in summaries])
        if shares.any():
            axes.barh(heights, shares, left=left, color=color, label=outcome)
        left += shares
    for height, summary in zip(heights, summaries, strict=True):
        axes.plot(summary.rates["reached"].interval(), (height, height), "k-", lw=1.5)
    _label(axes, summaries)
    axes.set(xlabel=f"share of {whole} (line: 95 %)", xlim=(0, 1))
    if axes.patches:  # There is at least one scene that counts.
        axes.legend(
            fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, frameon=False
        )


def _label(axes: Axes, summaries: Sequence[MethodSummary]) -> None:
    names = [get_method(summary.method).label for summary in summaries]
    axes.set_yticks(np.arange(1, len(names) + 1), names, fontsize=8)
    axes.invert_yaxis()
