"""Compare methods of reaching on many scenes: success rate, time, clearance.

  benchmark.py --scenes 20                    random scenes 0 to 19, all methods
  benchmark.py --scenes 300 --seed 1000 --methods d,f --jobs 2
  benchmark.py --scenes 50 --moving           with an obstacle that moves during the reach
  benchmark.py --scenes 50 --family bin,pickets    50 scenes of each family; or: all
  benchmark.py --methods d,own.py:plan        a planner of your own beside ours
  benchmark.py --scene table --scenes 20      one scene, twenty seeds of the noise
  benchmark.py --replay d:17                  one run again, to look at: recording.html
  benchmark.py --set planner.clearance.want=0.02 --output out/want    other numbers of the loop
  benchmark.py --gate                         is anything worse than benchmarks/baseline.json?

A run that is in the output folder is not repeated: interrupt it and continue later, or add scenes
and methods. Give another folder after changing the code. Results: benchmark.html, the page to open,
with --recordings also a recording of each failure; benchmark.md, benchmark.json, benchmark.png; one
file for each run in results/, and for each scene in scenes/, which others can read: docs/arena.md.
"""

import contextlib
import sys
from argparse import ArgumentParser, Namespace
from operator import attrgetter
from pathlib import Path

from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.benchmarking.baseline import Baseline
from pepper_drake.benchmarking.batch import Task, run_tasks
from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.diagram_reach import DiagramReach
from pepper_drake.benchmarking.gate import gate_tasks, measure_gate
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.methods import METHODS, get_method
from pepper_drake.cli_robot import add_robot_options
from pepper_drake.cli_scenario import add_scenario_options, keep_scenario, scenario_of
from pepper_drake.errors import InputError
from pepper_drake.models.robot_calibration import calibration_of
from pepper_drake.models.scene_families import FAMILIES
from pepper_drake.optimization.parallel import dask_cluster
from pepper_drake.reporting.benchmark_report import record_failures, replay_folder, save_benchmark
from pepper_drake.scenario import NUMBERS, Scenario
from pepper_drake.systems.faults.fault import parse_faults

_BASELINE = Path(__file__).resolve().parents[1] / "benchmarks" / "baseline.json"
_TABLE = "table"
"""Family of the default random scenes."""


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("benchmark", __doc__)
    parser.epilog = "methods:\n" + "".join(
        f"  {method.letter}  {method.name}: {method.description}\n" for method in METHODS
    )
    parser.add_argument(
        "--scenes",
        type=_count,
        default=20,
        metavar="N",
        help="number of scenes (default: %(default)s)",
    )
    parser.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help="one scene with many seeds of the noise, and not random scenes",
    )
    parser.add_argument(
        "--family",
        type=_families,
        metavar="NAME,...",
        help="random scenes of these families, --scenes of each: "
        f"{', '.join(FAMILIES)}; {_TABLE}, the default, is a table with loose objects; or all",
    )
    parser.add_argument(
        "--methods",
        default=",".join(method.letter for method in METHODS),
        metavar="a,b,...",
        help="methods to compare, as listed below (default: %(default)s)",
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
        "--sensors",
        choices=("real", "ideal"),
        default="real",
        help="cameras with noise and latency, or without (default: %(default)s)",
    )
    parser.add_argument(
        "--jobs", type=_count, default=1, metavar="N", help="runs at a time (default: %(default)s)"
    )
    parser.add_argument(
        "--dask", metavar="ADDRESS", help="runs on a Dask cluster; its scheduler: tcp://HOST:PORT"
    )
    parser.add_argument(
        "--recordings", action="store_true", help="record each run that failed, for the page"
    )
    parser.add_argument(
        "--gate",
        action="store_true",
        help="run our methods on fixed seeds, some minutes, and fail if anything is worse than the "
        "baseline",
    )
    parser.add_argument(
        "--baseline",
        type=Path,
        default=_BASELINE,
        metavar="FILE",
        help="file for --gate (default: benchmarks/baseline.json of the repository)",
    )
    parser.add_argument(
        "--update-baseline",
        metavar="REASON",
        help="run --gate and write what it measures to the baseline, with the reason",
    )
    add_scenario_options(parser, NUMBERS)
    parser.add_argument(
        "--replay", metavar="METHOD:SEED", help="run one again and record it, as in d:17"
    )
    return parser


def _families(text: str) -> tuple[str, ...]:
    """Parses a list of families."""
    if text == "all":
        return (_TABLE, *FAMILIES)
    names = tuple(text.split(","))
    for name in names:
        if name not in (_TABLE, *FAMILIES):
            raise InputError(
                f'"{name}" is not a family; there are {_TABLE}, {", ".join(FAMILIES)}, and all'
            )
    return names


def _count(text: str) -> int:
    """Parses a positive integer."""
    number = cli.seed(text)
    if number == 0:
        raise InputError("0 is too few; give at least 1")
    return number


def has_numbers(options: Namespace) -> bool:
    """Returns whether the options change the scenario."""
    return options.scenario is not None or bool(options.set)


def chosen_numbers(options: Namespace) -> Scenario:
    """Returns the scenario of the options --scenario and --set.

    Raises:
        InputError: A value is invalid, or one in which the methods differ.
    """
    scenario, usual = scenario_of(options), Scenario()
    for name in ("planner.adapt", "planner.collision_checked", "planner_class"):
        if attrgetter(name)(scenario) != attrgetter(name)(usual):
            raise InputError(f"{name}: the methods differ in it; leave it as it is")
    return scenario


def make_cases(options: Namespace, seed: int) -> list[Case]:
    """Returns the cases of a seed, one for each family."""
    if options.moving and options.scene is not None:
        raise InputError("--moving is for random scenes; leave --scene out")
    if options.family is not None and options.scene is not None:
        raise InputError("--family has its own scenes; leave --scene out")
    families = options.family or (_TABLE,)
    if options.moving and "compartment" in families:
        if len(families) == 1:
            raise InputError("nothing can move in a compartment; leave --moving out")
        families = [family for family in families if family != "compartment"]
    return [
        Case(
            seed,
            options.scene,
            options.moving,
            options.arm,
            options.goal_motion,
            options.robot,
            tuple(map(str, parse_faults(options.fault))),
            options.calibration,
            None if family == _TABLE else family,
            options.sensors,
            str(options.output / "scenario.yaml") if has_numbers(options) else None,
        )
        for family in families
    ]


def make_tasks(options: Namespace) -> list[Task]:
    """Returns all requested runs, scene by scene."""
    methods = [get_method(letter) for letter in options.methods.split(",")]
    seeds = range(options.seed, options.seed + options.scenes)
    cases = [case for seed in seeds for case in make_cases(options, seed)]
    for case in cases:  # Checks the files before the first run.
        calibration_of(case.calibration, case.robot, case.seed)
    cases[0].build()
    for method in methods:
        method.check()
        if isinstance(method.run, DiagramReach):
            continue
        if options.robot != "ideal" or options.fault:
            raise InputError(
                f"method {method.letter} has no robot that could be worn or fail; leave it out of "
                "--methods"
            )
        if has_numbers(options):
            raise InputError(
                f"method {method.letter} is none of ours and takes no scenario; leave it out of "
                "--methods"
            )
    return [Task(method.letter, case) for case in cases for method in methods]


def replay(options: Namespace, scenario: Scenario) -> int:
    """Repeats one method on one scene, with a recording."""
    letter, _, seed = options.replay.partition(":")
    method = get_method(letter)
    method.check()
    if not seed.isdigit():
        raise InputError(f'--replay is "{options.replay}"; give a method and a seed, as d:17')
    case, *others = make_cases(options, int(seed))
    if others:
        raise InputError("--replay is of one run; give --family one name")
    keep_scenario(scenario, options.output, has_runs=(options.output / "results").exists())
    folder = replay_folder(options.output, Task(letter, case))
    if method.run.options is not None:
        words = " ".join([*case.reach_options, *method.run.options])
        print(cli.as_run(f"The same as: reach.py {words}"))
    result = method.run.replay(case, folder)
    print(f"{result.outcome}" + (f": {result.message}" if result.message else ""))
    print(f"Results are in {folder}; open recording.html in a browser")
    return cli.EXIT_DONE if result.outcome == "reached" else cli.EXIT_FAILED


def gate(options: Namespace) -> int:
    """Runs the gate, and compares the metrics with the baseline or replaces it."""
    reason = options.update_baseline
    if reason is not None and not reason.strip():
        raise InputError("--update-baseline has no reason; say in a sentence why numbers change")
    baseline = Baseline.load(options.baseline) if reason is None else None
    options.output.mkdir(parents=True, exist_ok=True)
    hidden = not cli.shows_progress(options)
    with tqdm(total=len(gate_tasks()), unit="run", disable=hidden) as bar:
        measured = measure_gate(options.output, jobs=options.jobs, progress=lambda _: bar.update())
    if not options.quiet:
        for name, metric in measured.items():
            print(f"{name}: {metric.value:.4g} {metric.unit}")
    if baseline is None:
        Baseline(measured, reason).save(options.baseline)
        print(f"{options.baseline} is written anew")
        return cli.EXIT_DONE
    failures = baseline.failures(measured)
    for line in failures:
        print(f"worse: {line}", file=sys.stderr)
    return cli.EXIT_FAILED if failures else cli.EXIT_DONE


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    cli.quiet_libraries()
    if options.gate or options.update_baseline is not None:
        if has_numbers(options):
            raise InputError("--gate is of the usual numbers; leave --scenario and --set out")
        return gate(options)
    scenario = chosen_numbers(options)
    if options.replay is not None:
        return replay(options, scenario)
    tasks = make_tasks(options)
    keep_scenario(scenario, options.output, has_runs=(options.output / "results").exists())
    cluster = dask_cluster(options.dask) if options.dask else contextlib.nullcontext()
    hidden = not cli.shows_progress(options)
    with cluster as executor, tqdm(total=len(tasks), unit="run", disable=hidden) as bar:

        def show(result: MethodResult) -> None:
            bar.set_description(f"{result.case} {result.method}: {result.outcome}")
            bar.update()

        results = run_tasks(
            tasks, options.output, jobs=options.jobs, executor=executor, progress=show
        )
    if options.recordings:
        record_failures(tasks, results, options.output, hidden=hidden)
    text = save_benchmark(tasks, results, options.output, hidden=hidden)
    if not options.quiet:
        print(text)
        print(f"Results are in {options.output}; open benchmark.html in a browser")
    for result in results:
        if result.outcome == "error":
            print(f"{result.case} {result.method}: {result.message}", file=sys.stderr)
    return cli.EXIT_FAILED if any(r.outcome == "error" for r in results) else cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
