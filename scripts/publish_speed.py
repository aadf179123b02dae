"""Writes the tables of docs/performance.md from benchmarks/speed.json.

    python benchmarks/loop_speed.py tick planner diagram --save
    python scripts/publish_speed.py

A test compares both.
"""

import json
from pathlib import Path
from typing import Any

from marked_section import with_section

ROOT = Path(__file__).resolve().parents[1]
SPEED = ROOT / "benchmarks" / "speed.json"
PERFORMANCE = ROOT / "docs" / "performance.md"
BEGIN = "<!-- speed: written by scripts/publish_speed.py -->\n"
END = "<!-- speed: end -->\n"

_GOALS_MS = {"control tick": 0.3, "replan": 20.0}
"""Goals: a control tick's median and a replan's 99th percentile [ms]."""
_GOALS_OF_PHYSICS = {"without cameras": 0.5, "with cameras": 0.25}
"""Goals for the speed of the whole diagram, as a share of that of the physics alone."""


def section(speed: dict[str, Any]) -> str:
    """Returns the part of docs/performance.md for the content of speed.json."""
    return "\n".join([_answers(speed), _diagrams(speed["diagram"])])


def _answers(speed: dict[str, Any]) -> str:
    tick, planner = speed["tick"], speed["planner"]
    lines = [
        f"A control tick among 2,000 points, and the planner's answers in {planner['scenes']}"
        f" moving scenes, in ms of a processor ({tick['processors']} processors; load before"
        f" {tick['load_before']:.1f} and {planner['load_before']:.1f}):\n",
        "| answer | number | median | 90 % | 99 % | longest | goal |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, times in {"control tick": tick["control tick"], **planner["answers"]}.items():
        row = [f"{times[key]:.2f}" for key in ("median_ms", "p90_ms", "p99_ms", "longest_ms")]
        goal = f"{_GOALS_MS[name]:g}" if name in _GOALS_MS else ""
        lines.append(
            f"| {name.replace('_', ' ')} | {times['count']} | {' | '.join(row)} | {goal} |"
        )
    return "\n".join(lines) + "\n"


def _diagrams(diagram: dict[str, Any]) -> str:
    lines = [
        f"The whole diagram, {diagram['until_s']:g} s of {diagram['scene']}, by turns with its"
        f" physics alone (load before {diagram['load_before']:.1f}):\n",
        "| | x real time of a processor | of physics | x by the clock | of physics | goal |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, run in diagram["runs"].items():
        goal = f"{_GOALS_OF_PHYSICS[name]:g}" if name in _GOALS_OF_PHYSICS else ""
        lines.append(
            f"| {name} | {run['by_processor']:.2f} | {run['share_by_processor']:.3f} |"
            f" {run['by_clock']:.2f} | {run['share_by_clock']:.3f} | {goal} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Writes the tables."""
    text = section(json.loads(SPEED.read_text()))
    PERFORMANCE.write_text(with_section(PERFORMANCE.read_text(), BEGIN, END, text))


if __name__ == "__main__":
    main()
