"""Accuracy and speed of each approximator on demonstrations: the report's table 4.1."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline

from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.primitive import MovementPrimitive, Path3D

Array = npt.NDArray[np.float64]

REPORT_NUM_BASIS = (20, 30, 40, 50, 60)
"""The numbers of basis functions of table 4.1."""


@dataclass(frozen=True)
class ComparisonRow:
    """Results of one approximator with one number of basis functions, over all demonstrations.

    Attributes:
        approximator: Name of the approximator.
        num_basis: Requested number of basis functions (`lwpr` only starts from it).
        demonstrations: Number of demonstrations.
        position_distance: Mean of equation 4.1 [m].
        velocity_distance: The same for velocities [m/s].
        position_distance_median: Median of equation 4.1 [m].
        velocity_distance_median: The same for velocities [m/s].
        fit_seconds: Median time to fit the translation.
        rollout_seconds: Median time of a rollout after the first, which computes the basis.
    """

    approximator: str
    num_basis: int
    demonstrations: int
    position_distance: float
    velocity_distance: float
    position_distance_median: float
    velocity_distance_median: float
    fit_seconds: float
    rollout_seconds: float


def trajectory_distance(demonstrated: Array, performed: Array) -> float:
    """Returns the distance between two trajectories (N, 3), equation 4.1.

    It is the mean over the coordinates of sqrt(sum_i (demonstrated_i - performed_i)²) and grows
    with the root of the number of samples: a constant error of 1 mm over 300 samples gives 17 mm.
    """
    return float(np.sqrt(np.sum((demonstrated - performed) ** 2, axis=0)).mean())


def distances(demonstration: Demonstration, path: Path3D) -> tuple[float, float]:
    """Returns the position [m] and velocity [m/s] distance of a path, at the demonstration's times.

    The path is interpolated by cubic Hermite splines with its own derivatives.
    """
    times = demonstration.times - demonstration.times[0]
    positions = CubicHermiteSpline(path.times, path.positions, path.velocities)(times)
    velocities = CubicHermiteSpline(path.times, path.velocities, path.accelerations)(times)
    return (
        trajectory_distance(demonstration.positions, positions),
        trajectory_distance(demonstration.velocities, velocities),
    )


def translation_only(demonstration: Demonstration) -> Demonstration:
    """Returns the demonstration without orientation and joints, which table 4.1 omits."""
    return replace(demonstration, rotations=None, angles=None, joints=None, joint_names=())


def reproduce_demonstration(
    demonstration: Demonstration, approximator: str, num_basis: int
) -> tuple[Path3D, float, float]:
    """Fits a demonstration and rolls it out.

    Returns:
        The path, the time to fit and the time of a rollout with the cached basis [s].
    """
    motion = translation_only(demonstration)
    time_step = motion.duration / (len(motion.times) - 1)
    begin = time.perf_counter()
    primitive = MovementPrimitive.fit(motion, approximator=approximator, num_basis=num_basis)
    fit_seconds = time.perf_counter() - begin
    primitive.rollout(time_step=time_step)
    begin = time.perf_counter()
    path = primitive.rollout(time_step=time_step)
    return path, fit_seconds, time.perf_counter() - begin


def compare(
    demonstrations: Sequence[Demonstration],
    approximators: Sequence[str],
    nums_basis: Sequence[int] = REPORT_NUM_BASIS,
    progress: Callable[[], object] = lambda: None,
) -> list[ComparisonRow]:
    """Makes table 4.1: one row for each approximator and number of basis functions.

    Args:
        demonstrations: At least one.
        approximators: Names; see `approximator_names`.
        nums_basis: Numbers of basis functions.
        progress: Called after each fit, `len(demonstrations)` times per row.
    """
    return [
        _row(demonstrations, approximator, num_basis, progress)
        for approximator in approximators
        for num_basis in nums_basis
    ]


def _row(
    demonstrations: Sequence[Demonstration],
    approximator: str,
    num_basis: int,
    progress: Callable[[], object],
) -> ComparisonRow:
    def results() -> Iterator[tuple[float, float, float, float]]:
        for demonstration in demonstrations:
            path, fit_seconds, rollout_seconds = reproduce_demonstration(
                demonstration, approximator, num_basis
            )
            progress()
            yield *distances(demonstration, path), fit_seconds, rollout_seconds

    table = np.array(list(results()))
    means, medians = table.mean(axis=0), np.median(table, axis=0)
    return ComparisonRow(
        approximator,
        num_basis,
        len(demonstrations),
        float(means[0]),
        float(means[1]),
        float(medians[0]),
        float(medians[1]),
        float(medians[2]),
        float(medians[3]),
    )


def markdown_table(rows: Sequence[ComparisonRow]) -> str:
    """Returns the rows as a Markdown table, in m, m/s and ms."""
    count = rows[0].demonstrations if rows else 0
    lines = [
        f"# Comparison of the approximators on {count} demonstrations",
        "",
        "Distance between the demonstrations and their rollouts, equation 4.1 of the report (root "
        "of the sum over the samples, mean over the coordinates): mean and median over the "
        "demonstrations. Times are medians.",
        "",
        "| approximator | basis functions | position mean [m] | position median [m] | "
        "velocity mean [m/s] | velocity median [m/s] | fit [ms] | rollout [ms] |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    lines += [
        f"| {row.approximator} | {row.num_basis} "
        f"| {row.position_distance:.6f} | {row.position_distance_median:.6f} "
        f"| {row.velocity_distance:.5f} | {row.velocity_distance_median:.5f} "
        f"| {1000 * row.fit_seconds:.2f} | {1000 * row.rollout_seconds:.3f} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


_TRAITS = {
    "trajectory": "least squares on the motion itself, one weight each",
    "trajectory_slopes": "least squares on the motion itself, a line each",
    "lwr": "the report's: each weight fitted alone, smooth with few basis functions",
    "lwr_slopes": "as lwr with a line each, so that fewer basis functions do",
    "rbfn": "all weights fitted together to the forcing term",
    "gmr": "places its Gaussians where the data are; several demonstrations with their spread",
    "lwpr": "chooses its number of receptive fields by itself, and learns sample by sample",
}
"""Short description of each method."""


def strengths(rows: Sequence[ComparisonRow]) -> list[str]:
    """Returns a line for each approximator: its best result and its strengths.

    "most accurate", "best velocities" and "quickest to fit" follow from the medians in the rows;
    the rest describes the method.
    """
    lines = ["What each is good at (with the number of basis functions that suits it best):"]
    names = list(dict.fromkeys(row.approximator for row in rows))
    best = {
        name: min(
            (row for row in rows if row.approximator == name),
            key=lambda row: row.position_distance_median,
        )
        for name in names
    }
    awards = {
        "most accurate": min(names, key=lambda n: best[n].position_distance_median),
        "best velocities": min(names, key=lambda n: best[n].velocity_distance_median),
        "quickest to fit": min(names, key=lambda n: best[n].fit_seconds),
    }
    for name in names:
        row = best[name]
        awarded = [award for award, winner in awards.items() if winner == name]
        description = "; ".join([*awarded, *([_TRAITS[name]] if name in _TRAITS else [])])
        lines.append(
            f"  {name:17s} {1000 * row.position_distance_median:8.2g} mm (4.1),"
            f" {1000 * row.fit_seconds:7.1f} ms with {row.num_basis:2d}"
            + (f": {description}" if description else "")
        )
    return lines
