"""Puts a benchmark's numbers and picture into the repository, and the numbers into the README.

    python scripts/publish_benchmark.py still=out/benchmark moving=out/moving

Each folder is an output of `apps/benchmark.py`. Numbers go to benchmarks/results.json, the first
folder's figure to docs/benchmark.png, and the README's section between its two marks is rewritten
from the numbers; a test compares README and numbers.
"""

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from marked_section import with_section

from pepper_drake.benchmarking.methods import get_method
from pepper_drake.benchmarking.summary import Rate

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results.json"
PICTURE = ROOT / "docs" / "benchmark.png"
README = ROOT / "README.md"
BEGIN = "<!-- benchmark: written by scripts/publish_benchmark.py -->\n"
END = "<!-- benchmark: end -->\n"

_ABOUT = {
    "still": "Random tables with two to six objects on them, seeds {first} to {last}",
    "moving": "The same with a person's arm that reaches in, or a ball or bottle that rolls, seeds "
    "{first} to {last}",
}


def section(results: dict[str, Any]) -> str:
    """Returns the README's section for the content of results.json."""
    parts = [f"![{alt_text(results['still'])}](docs/benchmark.png)\n"]
    for name, content in results.items():
        seeds = sorted(int(scene.rpartition("_")[2]) for scene in content["scenes"])
        about = _ABOUT[name].format(first=seeds[0], last=seeds[-1])
        parts += [f"{about}: {_counted(content)}\n", _table(content)]
    return "\n".join(parts)


def alt_text(content: dict[str, Any]) -> str:
    """Returns the picture's alternative text."""
    shares = "; ".join(
        f"{get_method(method['method']).name} {100 * _rate(method, 'reached').value:.0f} %"
        for method in content["methods"]
    )
    count, of = _basis(content)
    return f"Share of {count} {of} that each method reached: {shares}"


def _basis(content: dict[str, Any]) -> tuple[int, str]:
    """Returns the number of scenes of the rates, and a name for them."""
    if content["solvable"] is None:
        return len(content["scenes"]), "scenes"
    return len(content["solvable"]), "scenes that can be solved"


def _counted(content: dict[str, Any]) -> str:
    total = len(content["scenes"])
    if content["solvable"] is None:
        return f"{total} scenes, of which it was not asked whether they can be solved."
    return (
        f"{len(content['solvable'])} of {total} scenes can be solved, as some method did; rates "
        "are of these, with Wilson's 95 % interval."
    )


def _rate(method: dict[str, Any], outcome: str) -> Rate:
    return Rate(**method["rates"][outcome])


def _table(content: dict[str, Any]) -> str:
    lines = [
        "| method | reached | touched | first motion [ms] | jerk [m/s³] | to the taught path [m] |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for method in content["methods"]:
        medians = method["medians"]
        cells = (
            get_method(method["method"]).label,
            str(_rate(method, "reached")),
            str(_rate(method, "touched")),
            _number(medians["first_motion_seconds"], 1000, 0),
            _number(medians["jerk"], 1, 1),
            _number(medians["demonstration_distance"], 1, 2),
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _number(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else f"{factor * value:.{digits}f}"


def main(arguments: list[str]) -> None:
    """Publishes the given folders."""
    folders = dict(argument.split("=", 1) for argument in arguments if "=" in argument)
    if "still" not in folders or not folders.keys() <= _ABOUT.keys():
        raise SystemExit("give still=FOLDER, and moving=FOLDER if there is one")
    results = {
        name: json.loads((Path(folder) / "benchmark.json").read_text())
        for name, folder in folders.items()
    }
    for content in results.values():
        del content["not_reached"]
    RESULTS.write_text(json.dumps(results, indent=1) + "\n")
    shutil.copy(Path(folders["still"]) / "benchmark.png", PICTURE)
    README.write_text(with_section(README.read_text(), BEGIN, END, section(results)))


if __name__ == "__main__":
    main(sys.argv[1:])
