"""Many scenes, several ways to reach, side by side: how often, how soon, how near.

  benchmark.py --scenes 20                    random scenes 0 to 19, all methods
  benchmark.py --scenes 300 --seed 1000 --methods d,f --jobs 2
  benchmark.py --scenes 50 --moving           with an obstacle that moves during the reach
  benchmark.py --scenes 50 --family bin       the goal stands in an open bin; see --help
  benchmark.py --scene table --scenes 20      one scene, twenty seeds of the noise
  benchmark.py --replay d:17                  one run again, to look at: recording.html

A run that is in the output folder is not run again: interrupt it and go on later, or add scenes and
methods. Give another folder after changing the code. Results: benchmark.md, benchmark.json,
benchmark.png, and one file for each run in results/.
"""

import json
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from dataclasses import asdict

from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.benchmarking.batch import Task, run_tasks
from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.diagram_reach import DiagramReach
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.methods import METHODS, get_method
from pepper_drake.benchmarking.summary import MethodSummary, Scenes, markdown_table, summarise
from pepper_drake.cli_robot import add_robot_options
from pepper_drake.errors import InputError
from pepper_drake.models.robot_calibration import calibration_of
from pepper_drake.models.scene_families import FAMILIES
from pepper_drake.reporting.benchmark_figure import draw_benchmark
from pepper_drake.results.folder import whole_results
from pepper_drake.systems.faults.fault import parse_faults


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("benchmark", __doc__)
    parser.epilog = "methods:\n" + "".join(
        f"  {method.letter}  {method.name}: {method.description}\n" for method in METHODS
    )
    parser.add_argument(
        "--scenes", type=_count, default=20, metavar="N", help="how many (default: %(default)s)"
    )
    parser.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help="one scene with many seeds of the noise, and not random scenes",
    )
    parser.add_argument(
        "--family",
        choices=FAMILIES,
        metavar="NAME",
        help=f"random scenes of a family: {', '.join(FAMILIES)}",
    )
    parser.add_argument(
        "--methods",
        default=",".join(method.letter for method in METHODS),
        metavar="a,b,...",
        help="which methods (default: %(default)s)",
    )
    parser.add_argument(
        "--moving", action="store_true", help="one obstacle moves while the arm is on its way"
    )
    parser.add_argument("--arm", choices=("left", "right"), help="default: the scene's")
    parser.add_argument(
        "--goal-motion", metavar="MOTION", help="move the goal, too; see reach.py --help"
    )
    add_robot_options(parser)
    parser.add_argument(
        "--jobs", type=_count, default=1, metavar="N", help="runs at a time (default: %(default)s)"
    )
    parser.add_argument(
        "--replay", metavar="METHOD:SEED", help="run one again and record it, as d:17"
    )
    return parser


def _count(text: str) -> int:
    """Reads a number of things from the command line."""
    number = cli.seed(text)
    if number == 0:
        raise InputError("0 is too few; give at least 1")
    return number


def make_case(options: Namespace, seed: int) -> Case:
    """The case of a seed."""
    if options.moving and options.scene is not None:
        raise InputError("--moving is for random scenes; leave --scene out")
    if options.family is not None and (options.scene is not None or options.moving):
        raise InputError("--family has its own scenes; leave --scene and --moving out")
    return Case(
        seed,
        options.scene,
        options.moving,
        options.arm,
        options.goal_motion,
        options.robot,
        tuple(map(str, parse_faults(options.fault))),
        options.calibration,
        options.family,
    )


def make_tasks(options: Namespace) -> list[Task]:
    """All runs that the options ask for, scene by scene."""
    methods = [get_method(letter) for letter in options.methods.split(",")]
    cases = [make_case(options, options.seed + k) for k in range(options.scenes)]
    for case in cases:  # What is wrong with a file is said before anything runs.
        calibration_of(case.calibration, case.robot, case.seed)
    cases[0].build()
    for method in methods:
        method.check()
        if (options.robot != "ideal" or options.fault) and not isinstance(method.run, DiagramReach):
            raise InputError(
                f"method {method.letter} has no robot that could be worn or fail; leave it out of "
                "--methods"
            )
    return [Task(method.letter, case) for case in cases for method in methods]


def replay(options: Namespace) -> int:
    """Runs one method on one scene again, with recording."""
    letter, _, seed = options.replay.partition(":")
    method = get_method(letter)
    method.check()
    if not seed.isdigit():
        raise InputError(f'--replay is "{options.replay}"; give a method and a seed, as d:17')
    case = make_case(options, int(seed))
    folder = options.output / "replay" / f"{case.name}_{letter}"
    if method.run.options is not None:
        words = " ".join([*case.reach_options, *method.run.options])
        print(f"The same as: reach.py {words}")
    result = method.run.replay(case, folder)
    print(f"{result.outcome}" + (f": {result.message}" if result.message else ""))
    print(f"Results are in {folder}; open recording.html in a browser")
    return cli.EXIT_DONE if result.outcome == "reached" else cli.EXIT_FAILED


def save(
    options: Namespace, results: Sequence[MethodResult], summaries: Sequence[MethodSummary]
) -> str:
    """Writes table, figure and numbers, and returns the table with what is to be said of it."""
    scenes = Scenes.of(results)
    text = (
        f"{markdown_table(summaries)}\n{scenes} Rates are of {scenes.share}, with 95 % confidence; "
        "the other numbers are medians over the runs that reached.\n"
    )
    failing = {
        summary.method: {
            result.case: f"{result.outcome}: {result.message}"
            for result in results
            if result.method == summary.method and result.outcome != "reached"
        }
        for summary in summaries
    }
    content = {
        "scenes": sorted(scenes.all),
        "solvable": None if scenes.solvable is None else sorted(scenes.solvable),
        "methods": [asdict(summary) for summary in summaries],
        "not_reached": failing,
    }
    names = ("benchmark.md", "benchmark.json", "benchmark.png")
    with whole_results(options.output, names) as folder:
        (folder / "benchmark.md").write_text(f"# Reaching: {scenes}\n\n{text}")
        (folder / "benchmark.json").write_text(json.dumps(content, indent=2) + "\n")
        draw_benchmark(summaries, results).savefig(folder / "benchmark.png", dpi=110)
    return text


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    cli.quiet_libraries()
    if options.replay is not None:
        return replay(options)
    tasks = make_tasks(options)
    options.output.mkdir(parents=True, exist_ok=True)
    with tqdm(
        total=len(tasks), unit="run", disable=options.quiet or not sys.stderr.isatty()
    ) as bar:

        def show(result: MethodResult) -> None:
            bar.set_description(f"{result.case} {result.method}: {result.outcome}")
            bar.update()

        results = run_tasks(tasks, options.output, jobs=options.jobs, progress=show)
    summaries = summarise(results)
    text = save(options, results, summaries)
    if not options.quiet:
        print(text)
        print(f"Results are in {options.output}")
    for result in results:
        if result.outcome == "error":
            print(f"{result.case} {result.method}: {result.message}", file=sys.stderr)
    return cli.EXIT_FAILED if any(r.outcome == "error" for r in results) else cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
