"""Runs apps/reach.py many times and adds up what came of it.

  reach_runs.py --scene table --seeds 20              one scene, twenty seeds of the noise
  reach_runs.py --random-scenes 100                   random scenes 0 to 99
  reach_runs.py --scene shelf --seeds 1 -- --arm left everything after -- goes to reach.py

Each run leaves its folder; `runs.json` and a table tell outcome, errors, clearance and speed.
"""

import json
import statistics
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.models.scene import SCENES

REACH = Path(__file__).parent.parent / "apps" / "reach.py"


def run_one(folder: Path, arguments: list[str]) -> dict[str, Any]:
    """Runs one reach in a process of its own and returns its report."""
    process = subprocess.run(
        [sys.executable, REACH, "--quiet", "--no-recording", "--output", folder, *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    report = folder / "report.json"
    if process.returncode not in (cli.EXIT_DONE, cli.EXIT_FAILED) or not report.exists():
        return {"outcome": "error", "reason": (process.stderr.strip() or "no report")[-200:]}
    return json.loads(report.read_text())


def row(name: str, report: dict[str, Any]) -> str:
    """One line of the table."""

    def millimetres(key: str) -> str:
        value = report.get(key)
        return "-" if value is None else f"{1000 * value:.1f}"

    return (
        f"{name:>16}  {report['outcome']:8} {report['reason']:14}"
        f" {millimetres('final_position_error'):>7} {millimetres('goal_estimate_error'):>7}"
        f" {millimetres('minimum_clearance'):>7} {report.get('contacts', 0):4d}"
        f" {report.get('realtime_factor', 0):5.2f}"
    )


def main() -> int:
    """Runs the benchmark."""
    parser = cli.make_parser("reach_runs", __doc__)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--scene", default="table", help=f"one of {', '.join(SCENES)}, or a file")
    which.add_argument("--random-scenes", type=int, metavar="N", help="random scenes 0 to N-1")
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="seeds 0 to N-1")
    parser.add_argument("--jobs", type=int, default=1, help="runs at the same time")
    parser.add_argument("rest", nargs="*", help="options for reach.py, after --")
    options = parser.parse_args()
    if options.random_scenes is not None:
        runs = {
            f"random {k}": ["--random-scene", str(k), *options.rest]
            for k in range(options.random_scenes)
        }
    else:
        runs = {
            f"{options.scene} {k}": ["--scene", options.scene, "--seed", str(k), *options.rest]
            for k in range(options.seeds)
        }
    options.output.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(options.jobs) as pool:
        futures = {
            name: pool.submit(run_one, options.output / name.replace(" ", "_"), arguments)
            for name, arguments in runs.items()
        }
        reports = {
            name: future.result()
            for name, future in tqdm(futures.items(), disable=options.quiet, unit="run")
        }
    (options.output / "runs.json").write_text(json.dumps(reports, indent=2) + "\n")

    print(f"{'run':>16}  outcome  reason          error  goal mm  clear hits  RTF")
    for name, report in reports.items():
        print(row(name, report))
    outcomes = Counter(
        report["outcome"] if report["outcome"] == "reached" else report["reason"]
        for report in reports.values()
    )
    touched = sum(report.get("contacts", 0) > 0 for report in reports.values())
    speed = statistics.median(report.get("realtime_factor", 0.0) for report in reports.values())
    print(f"{dict(outcomes)}, touched: {touched}, median real-time factor {speed:.2f}")
    return cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
