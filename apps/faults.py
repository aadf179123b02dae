"""Inject every fault into whole reaches, and tabulate the outcomes.

It injects each sensible pair of signal and kind (see reach.py --fault), from the start on and from
the moment when the arm starts, and writes a table.

  faults.py --jobs 2                      the table of docs/faults.md: takes about an hour
  faults.py --scenes table,shelf,clutter  in three scenes
  faults.py --signals depth,cloud --starts reach
  faults.py --set safety.FIELD=VALUE --output out/mine     with other numbers of the loop

Runs whose results are in the folder are not repeated. Results: faults.json, faults.md, and
scenario.yaml with the numbers of the loop, which are the same for all runs of a folder.
Exit code 0: every outcome is safe; 1: a touch was too fast, a command outside its limits, or a run
ended by an exception; 2: bad input.
"""

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Generator, Sequence
from concurrent.futures import as_completed
from contextlib import closing
from dataclasses import asdict

from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.cli_scenario import add_scenario_options, keep_scenario, scenario_of
from pepper_drake.errors import InputError
from pepper_drake.evaluation.fault_table import (
    STARTS,
    FaultCase,
    FaultResult,
    fault_cases,
    load_results,
    markdown_table,
    run_fault,
)
from pepper_drake.files import write_atomically
from pepper_drake.models.scene import load_scene
from pepper_drake.optimization.parallel import processes
from pepper_drake.scenario import NUMBERS, Scenario
from pepper_drake.systems.faults.fault import SIGNALS, parse_fault


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("faults", __doc__)
    parser.add_argument(
        "--scenes",
        default="table",
        metavar="NAMES|FILES",
        help="scenes, with commas between (default: %(default)s)",
    )
    parser.add_argument(
        "--signals",
        default=",".join(SIGNALS),
        metavar="NAMES",
        help=f"signals that fail, with commas between: {', '.join(SIGNALS)} (default: all)",
    )
    parser.add_argument(
        "--starts",
        default=",".join(STARTS),
        metavar="TIMES",
        help='starts of the faults, with commas between: s, or "reach" (default: %(default)s)',
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="runs at a time (default: %(default)s)"
    )
    add_scenario_options(parser, NUMBERS)
    return parser


def make_cases(options: Namespace) -> list[FaultCase]:
    """Returns the requested runs.

    Raises:
        InputError: A signal, a start or a scene is unknown.
    """
    signals, scenes = options.signals.split(","), options.scenes.split(",")
    for signal in signals:
        if signal not in SIGNALS:
            raise InputError(f'--signals has "{signal}"; a signal is one of {", ".join(SIGNALS)}')
    for scene in scenes:
        load_scene(scene)
    cases = [
        case
        for case in fault_cases(scenes, options.seed, options.starts.split(","))
        if case.fault.partition(":")[0] in signals
    ]
    for case in cases:
        parse_fault(case.fault)
    return cases


def run_missing(
    cases: Sequence[FaultCase], scenario: Scenario, jobs: int
) -> Generator[FaultResult]:
    """Yields the result of each case as it finishes.

    Raises:
        InputError: The number of jobs is not positive.
    """
    with processes(jobs) as executor:
        if executor is None:
            yield from (run_fault(case, scenario) for case in cases)
        else:
            runs = [executor.submit(run_fault, case, scenario) for case in cases]
            for future in as_completed(runs):
                yield future.result()


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    cli.quiet_libraries()
    cases, scenario = make_cases(options), scenario_of(options)
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.output / "faults.json"
    keep_scenario(scenario, options.output, has_runs=path.exists())
    done = load_results(path) if path.exists() else {}
    missing = [case for case in cases if case not in done]
    hide = not cli.shows_progress(options)
    with (
        cli.stop_on_interrupt() as should_stop,
        closing(run_missing(missing, scenario, options.jobs)) as finished,
        tqdm(total=len(cases), initial=len(cases) - len(missing), disable=hide, unit=" run") as bar,
    ):
        for result in finished:
            done[FaultCase(result.fault, result.scene, result.seed)] = result
            rows = [asdict(row) for row in done.values()]
            write_atomically(path, json.dumps(rows, indent=1) + "\n")
            bar.update()
            if should_stop():
                return cli.EXIT_INTERRUPTED
    results = [done[case] for case in cases]
    write_atomically(options.output / "faults.md", markdown_table(results))
    unsafe = [result for result in results if not result.is_safe]
    if not options.quiet:
        print(f"{len(results)} runs, {len(unsafe)} of them not safe")
        for result in unsafe:
            print(f"  {result.fault} in {result.scene}: {result.reason} {result.message}")
        print(f"Results are in {options.output}")
    return cli.EXIT_FAILED if unsafe else cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
