"""Regression gate: short, seeded runs for the metrics of the baseline; see `baseline`."""

import hashlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import Simulator

import pepper_drake
from pepper_drake.benchmarking.baseline import HIGHER, LOWER, Metric
from pepper_drake.benchmarking.batch import Task, run_tasks
from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.physics_alone import make_physics
from pepper_drake.evaluation.approximator_comparison import compare
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.scenario import Scenario, build_reaching

GROUPS: dict[str, tuple[Case, ...]] = {
    "shipped": tuple(Case(0, scene) for scene in ("table", "shelf", "clutter")),
    "still": tuple(Case(seed) for seed in (1001, 1002, 1003, 1004)),
    "moving": tuple(Case(seed, moving=True) for seed in (1, 2, 3)),
    "families": (Case(2, family="pickets"), Case(1, family="high_table")),
}
"""Cases of each group, all run with our method."""
_METHOD = "d"
_APPROXIMATORS = ("trajectory", "lwr", "rbfn", "gmr", "lwpr")
_ROUND, _ROUNDS = 1.0, 5
"""Simulated time [s] and number of the turns of the physics and the whole diagram."""


def gate_tasks() -> list[Task]:
    """Returns all runs."""
    return [Task(_METHOD, case) for cases in GROUPS.values() for case in cases]


def measure_gate(
    output: Path, *, jobs: int = 1, progress: Callable[[MethodResult], object] = lambda _: None
) -> dict[str, Metric]:
    """Runs tasks without a result of the present code, and returns the metrics by name.

    Args:
        output: Folder for results, with a subfolder for each version of the code.
        jobs: Number of parallel runs.
        progress: Called with each result.
    """
    folder = output / f"gate-{source_digest()}"
    tasks = gate_tasks()
    results = dict(zip(tasks, run_tasks(tasks, folder, jobs=jobs, progress=progress), strict=True))
    metrics: dict[str, Metric] = {}
    for group, cases in GROUPS.items():
        metrics |= _outcomes(group, [results[Task(_METHOD, case)] for case in cases])
    metrics |= _quality([result for result in results.values() if result.outcome == "reached"])
    metrics |= _learning()
    share = physics_time_ratio()  # A wide tolerance: processors differ.
    metrics["time.physics alone, of the whole diagram"] = Metric(share, "1", HIGHER, 0.4 * share)
    return metrics


def source_digest() -> str:
    """Returns a hash of the package's code, models and scenes."""
    digest = hashlib.sha256()
    root = Path(pepper_drake.__file__).parent
    for file in sorted([*root.rglob("*.py"), *root.rglob("*.urdf"), *root.rglob("*.yaml")]):
        digest.update(str(file.relative_to(root)).encode() + file.read_bytes())
    return digest.hexdigest()[:12]


def _outcomes(group: str, results: Sequence[MethodResult]) -> dict[str, Metric]:
    """Returns counts of outcomes, without tolerance, since the runs are seeded."""
    counts = {o: sum(result.outcome == o for result in results) for o in ("reached", "touched")}
    return {
        f"{group}.reached of {len(results)}": Metric(counts["reached"], "1", HIGHER, 0.0),
        f"{group}.touched of {len(results)}": Metric(counts["touched"], "1", LOWER, 0.0),
    }


def _quality(reached: Sequence[MethodResult]) -> dict[str, Metric]:
    """Returns statistics over the runs that reached; NaN, which never passes, if none did."""

    def all_of(name: str) -> np.ndarray:
        values = [getattr(result, name) for result in reached]
        return np.array([value for value in values if value is not None] or [np.nan])

    return {
        "reach.largest position error": Metric(
            float(all_of("position_error").max()), "m", LOWER, 0.001
        ),
        "reach.least clearance": Metric(float(all_of("clearance").min()), "m", HIGHER, 0.002),
        "reach.median time to first motion": Metric(
            float(np.median(all_of("first_motion_seconds"))), "s", LOWER, 0.02
        ),
        "reach.median jerk": Metric(float(np.median(all_of("jerk"))), "m/s³", LOWER, 1.0),
        "reach.median distance to the taught path": Metric(
            float(np.median(all_of("demonstration_distance"))), "m", LOWER, 0.05
        ),
    }


def _learning() -> dict[str, Metric]:
    """Returns equation 4.1 of each approximator on the synthetic demonstrations."""
    rows = compare(example_demonstrations(3), _APPROXIMATORS, (40,))
    return {
        f"learning.{row.approximator}, 40 basis functions": Metric(
            row.position_distance, "m", LOWER, 0.02 * row.position_distance
        )
        for row in rows
    }


def physics_time_ratio() -> float:
    """Returns the time of the physics alone over that of the diagram without cameras, at best 1.

    Both simulate the same scene with the same time step, alternating in this process. The result is
    the median over some rounds.
    """
    scenario = Scenario()
    scenario.station.cameras = False
    reaching = build_reaching(scenario)
    whole, physics = Simulator(reaching), make_physics(scenario.scene, reaching.station)
    shares = []
    for number in range(_ROUNDS + 1):  # The first round compiles and fills caches.
        until, times = (number + 1) * _ROUND, [time.process_time()]
        for simulator in (whole, physics):
            simulator.AdvanceTo(until)
            times.append(time.process_time())
        in_whole, alone = np.diff(times)
        shares.append(alone / in_whole)
    return float(np.median(shares[1:]))
