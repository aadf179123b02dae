"""Shared parts of the benchmarks: motion, cloud, and the ratios printed at the end of a run."""

from collections.abc import Callable

import numpy as np
import pytest

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.alignment import align
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations

MEDIANS: dict[str, float] = {}
"""Medians of this run by name [s]."""

FIGURES = [
    ("fit, of movement_primitives' time", "fit", "fit/movement_primitives", 0.5),
    ("rollout, of movement_primitives' time", "rollout", "rollout/movement_primitives", 0.01),
    ("rollout, of ProDMP's time", "rollout", "rollout/prodmp", 0.05),
    ("100 rollouts, of ProDMP's time", "batch", "batch/prodmp", 0.025),
    ("rollout among 1000 points, seconds", "among 1000", "", 0.03),
    ("among 4000 points, of 16 times that among 250", "among 4000", "among 250", 16.0),
    ("100 rollouts among 1000 points, of one", "batch among 1000", "among 1000", 50.0),
]
"""Name, numerator, denominator (empty: seconds), and largest ratio."""


@pytest.fixture(scope="session")
def demonstration() -> Demonstration:
    """A motion of 5 s, 501 samples, that starts and ends while moving."""
    return align(example_demonstrations(2)[1:], num_samples=501, duration=5.0)[0]


@pytest.fixture(scope="session")
def primitive(demonstration) -> MovementPrimitive:
    """The default approximator with 40 basis functions."""
    return MovementPrimitive.fit(demonstration)


@pytest.fixture(scope="session")
def make_cloud(demonstration) -> Callable[[int], np.ndarray]:
    """Makes clouds (P, 3): a table under the motion and a bottle beside its middle."""

    def make(count: int) -> np.ndarray:
        rng = np.random.default_rng(0)
        path = demonstration.positions
        low, high = path.min(axis=0), path.max(axis=0)
        table = rng.uniform(low - 0.1, high + 0.1, (count // 2, 3))
        table[:, 2] = low[2] - 0.1
        angle, height = rng.uniform(0, 1, (2, count - count // 2))
        bottle = 0.03 * np.column_stack((np.cos(2 * np.pi * angle), np.sin(2 * np.pi * angle)))
        middle = path[len(path) // 2] + [0.08, 0.0, 0.0]
        top = low[2] - 0.1 + height * (high[2] - low[2])
        return np.vstack((table, np.column_stack((bottle + middle[:2], top))))

    return make


@pytest.fixture
def measure(benchmark) -> Callable[..., object]:
    """Times `function` as `name` and stores the median for the ratios."""

    def run(name: str, function: Callable[[], object], **pedantic: int) -> object:
        function()  # Fills the caches.
        result = benchmark.pedantic(function, **pedantic) if pedantic else benchmark(function)
        if benchmark.stats is not None:
            MEDIANS[name] = benchmark.stats.stats.median
        return result

    return run


def pytest_terminal_summary(terminalreporter) -> None:
    """Prints the ratios of this run and their limits."""
    lines = []
    for what, numerator, denominator, figure in FIGURES:
        if numerator not in MEDIANS:
            continue
        if denominator and denominator not in MEDIANS:
            lines.append(f"{what:<50} not measured: see the skipped tests")
            continue
        ratio = MEDIANS[numerator] / MEDIANS.get(denominator, 1.0)
        status = "reached" if ratio <= figure else "MISSED"
        lines.append(f"{what:<50} {ratio:10.4g}   at most {figure:<6g} {status}")
    if lines:
        terminalreporter.section("ratios of medians in this run")
        for line in lines:
            terminalreporter.write_line(line)
