"""Runs a fixed set of reaches and compares their outcomes with those of an earlier commit.

    python benchmarks/golden_runs.py --write benchmarks/golden_runs.json
    python benchmarks/golden_runs.py --compare benchmarks/golden_runs.json

Five shipped scenes, 20 random and 20 moving ones: outcome, reason, least clearance, final error,
simulated time, and a hash of all joint commands. A refactoring changes none of them; each
difference is printed. The hash depends on the processor: a difference of it alone does not fail
the comparison.
"""

import argparse
import hashlib
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.benchmarking.case import Case
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.optimization.parallel import processes
from pepper_drake.scenario import build_reaching

SCENES = ("table", "shelf", "clutter", "free", "teach")
SEEDS = range(20)
TOLERANCES = {"minimum_clearance": 1e-3, "final_position_error": 1e-3, "simulated_seconds": 0.5}
"""Tolerances of clearances and errors [m], and of times [s]."""


@dataclass(frozen=True)
class GoldenRun:
    """One reach: clearance and error in [m], time in [s], the hash of the joint commands."""

    outcome: str
    reason: str | None
    minimum_clearance: float
    final_position_error: float
    simulated_seconds: float
    command_hash: str

    def differences(self, other: "GoldenRun") -> list[str]:
        """Names the fields in which the other run differs by more than their tolerance."""
        changed = []
        for name, mine in asdict(self).items():
            theirs = getattr(other, name)
            limit = TOLERANCES.get(name)
            same = mine == theirs if limit is None else abs(mine - theirs) < limit
            if not same:
                changed.append(f"{name}: {mine} -> {theirs}")
        return changed


def cases() -> dict[str, Case]:
    """Returns all cases by name."""
    chosen = [Case(0, scene=scene) for scene in SCENES]
    chosen += [Case(seed) for seed in SEEDS] + [Case(seed, moving=True) for seed in SEEDS]
    return {case.name: case for case in chosen}


def run(case: Case) -> GoldenRun:
    """Runs one reach in the full diagram, cameras on."""
    result = ReachSimulation(build_reaching(case.scenario()), RunOptions(progress=False)).run()
    report = result.report
    commands = np.ascontiguousarray(result.log.joint_command_rad)
    return GoldenRun(
        outcome=report.outcome,
        reason=report.reason,
        minimum_clearance=float(report.minimum_clearance or 0.0),
        final_position_error=float(report.final_position_error or 0.0),
        simulated_seconds=float(report.simulated_seconds),
        command_hash=hashlib.sha256(commands.tobytes()).hexdigest()[:16],
    )


def main() -> int:
    """Writes or compares the golden runs; exits 1 where an outcome differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--write", type=Path, metavar="FILE")
    action.add_argument("--compare", type=Path, metavar="FILE")
    parser.add_argument("--only", default="", help="run the cases whose name holds this")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    chosen = {name: case for name, case in cases().items() if options.only in name}
    cli.limit_linear_algebra()  # With more threads the last bits depend on what else runs.
    with processes(options.jobs) as pool:
        found = (map if pool is None else pool.map)(run, chosen.values())
        results = dict(zip(chosen, tqdm(found, total=len(chosen)), strict=True))
    if options.write:
        rows = {name: asdict(result) for name, result in results.items()}
        options.write.write_text(json.dumps(rows, indent=1) + "\n")
        return 0
    before = {k: GoldenRun(**v) for k, v in json.loads(options.compare.read_text()).items()}
    changed = {name: before[name].differences(new) for name, new in results.items()}
    for name, lines in changed.items():
        if lines:
            print(f"{name}: " + "; ".join(lines))
    outcomes = sum(any(not line.startswith("command_hash") for line in c) for c in changed.values())
    print(f"{len(results)} runs, {outcomes} with another outcome, clearance, error or time")
    return int(outcomes > 0)


if __name__ == "__main__":
    sys.exit(main())
