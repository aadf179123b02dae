"""Summary of many runs: rates with confidence intervals, and a table."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.stats import binomtest

from pepper_drake.benchmarking.method_result import OUTCOMES, MethodResult
from pepper_drake.benchmarking.methods import get_method


@dataclass(frozen=True)
class Rate:
    """A rate with its counts."""

    count: int
    total: int

    @property
    def value(self) -> float:
        """Rate from 0 to 1; NaN if the total is 0."""
        return self.count / self.total if self.total else float("nan")

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Returns Wilson's confidence interval of the rate."""
        if not self.total:
            return 0.0, 1.0
        found = binomtest(self.count, self.total).proportion_ci(confidence, method="wilson")
        return float(found.low), float(found.high)

    def __str__(self) -> str:
        if not self.total:
            return "-"
        low, high = self.interval()
        return f"{100 * self.value:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


@dataclass(frozen=True)
class Scenes:
    """The scenes of a benchmark, and those that count for rates.

    Attributes:
        all: Names of all scenes.
        solvable: Names of scenes that some method solved; None if no method with perfect knowledge
            was run, as the others may be solvable then.
    """

    all: frozenset[str]
    solvable: frozenset[str] | None

    @classmethod
    def of(cls, results: Sequence[MethodResult]) -> Self:
        """Returns the scenes of some results."""
        is_known = any(get_method(result.method).knows_all for result in results)
        return cls(
            frozenset(result.case for result in results),
            frozenset(solvable(results)) if is_known else None,
        )

    @property
    def counted(self) -> frozenset[str]:
        """Names of the scenes that count for rates."""
        return self.all if self.solvable is None else self.solvable

    @property
    def share(self) -> str:
        """Description of the scenes that count for rates."""
        return "all scenes" if self.solvable is None else "the scenes that can be solved"

    def __str__(self) -> str:
        if self.solvable is None:
            return (
                f"Of {len(self.all)} scenes; solvability was not asked of a method with perfect "
                "knowledge."
            )
        return f"{len(self.solvable)} of {len(self.all)} scenes can be solved: some method did."


@dataclass(frozen=True)
class MethodSummary:
    """Summary of one method over all scenes that count; see `Scenes`.

    Attributes:
        method: The method's letter.
        rates: Rates of the outcomes, over the scenes that count.
        touched_elsewhere: Rate of contacts in the other scenes, which no method solved.
        medians: Medians of fields of `MethodResult` over the runs that reached; NaN if none did.
        first_motion_90: 90th percentile of the time to first motion [s], likewise.
        largest_touch_speed: Largest relative speed of link and obstacle at a contact [m/s], over
            all scenes; NaN without contacts.
    """

    method: str
    rates: dict[str, Rate]
    touched_elsewhere: Rate
    medians: dict[str, float]
    first_motion_90: float
    largest_touch_speed: float


_MEDIANS = (
    "first_motion_seconds",
    "planning_seconds",
    "planning_latency",
    "replan_seconds_99",
    "duration",
    "path_length",
    "jerk",
    "demonstration_distance",
    "clearance",
    "position_error",
    "orientation_error",
    "goal_estimate_error",
    "realtime_factor",
)


def solvable(results: Iterable[MethodResult]) -> set[str]:
    """Returns the solvable cases: those in which some method reached without contact."""
    return {result.case for result in results if result.outcome == "reached"}


def summarise(results: Sequence[MethodResult]) -> list[MethodSummary]:
    """Summarises the runs of each method, in the order of the letters."""
    possible = Scenes.of(results).counted
    summaries = []
    for letter in sorted({result.method for result in results}):
        runs = [result for result in results if result.method == letter]
        counted = [result for result in runs if result.case in possible]
        others = [result for result in runs if result.case not in possible]
        reached = [result for result in counted if result.outcome == "reached"]
        waits = _numbers(reached, "first_motion_seconds")
        summaries.append(
            MethodSummary(
                method=letter,
                rates={
                    outcome: Rate(sum(r.outcome == outcome for r in counted), len(counted))
                    for outcome in OUTCOMES
                },
                touched_elsewhere=Rate(sum(r.outcome == "touched" for r in others), len(others)),
                medians={name: _median(_numbers(reached, name)) for name in _MEDIANS},
                first_motion_90=float(np.percentile(waits, 90)) if waits else float("nan"),
                largest_touch_speed=max(_numbers(runs, "touch_speed"), default=float("nan")),
            )
        )
    return summaries


def _numbers(results: Iterable[MethodResult], name: str) -> list[float]:
    """Returns the finite values of a field."""
    values = (getattr(result, name) for result in results)
    return [value for value in values if value is not None and np.isfinite(value)]


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")


HEADER = (
    *("method", "scenes", "reached", "touched", "refused", "failed"),
    "largest speed at touch [mm/s]",
    "first motion (90 %) [ms]",
    "planning latency: simulated / measured 99 % [ms]",
    *("path length [m]", "jerk [m/s³]", "to the taught path, eq. 4.1 [m]", "clearance [mm]"),
)
"""Titles of the columns of `table_rows`."""


def table_rows(summaries: Sequence[MethodSummary]) -> list[list[str]]:
    """Returns a row of texts for each method, in the order of `HEADER`."""
    return [
        [
            get_method(summary.method).label,
            str(summary.rates["reached"].total),
            *(str(summary.rates[name]) for name in ("reached", "touched", "refused", "failed")),
            _number(summary.largest_touch_speed, 1000, 0),
            f"{_number(summary.medians['first_motion_seconds'], 1000, 0)}"
            f" ({_number(summary.first_motion_90, 1000, 0)})",
            f"{_number(summary.medians['planning_latency'], 1000, 0)}"
            f" / {_number(summary.medians['replan_seconds_99'], 1000, 0)}",
            _number(summary.medians["path_length"], 1, 2),
            _number(summary.medians["jerk"], 1, 1),
            _number(summary.medians["demonstration_distance"], 1, 3),
            _number(summary.medians["clearance"], 1000, 0),
        ]
        for summary in summaries
    ]


def markdown_table(summaries: Sequence[MethodSummary]) -> str:
    """Returns the summaries as a Markdown table that is also readable in a terminal."""
    rows = table_rows(summaries)
    widths = [max(len(row[k]) for row in (HEADER, *rows)) for k in range(len(HEADER))]
    lines = [
        " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        for row in (HEADER, ["-" * width for width in widths], *rows)
    ]
    return "".join(f"| {line} |\n" for line in lines)


def _number(value: float, factor: float, digits: int) -> str:
    return f"{factor * value:.{digits}f}" if np.isfinite(value) else "-"
