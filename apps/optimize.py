"""Improve a movement primitive by trying variations of it: the report's algorithm 3, and others.

  optimize.py my_motion/ --goal 0.30 -0.15 0.08         let the hand end at another place (in T)
  optimize.py my_motion/ --goal-offset 0.06 0.06 0.05   the same, as seen from where it ends now
  optimize.py primitive.yaml --goal-offset 0 0 0.1 --method cmaes --kernels 8 --updates 30
  optimize.py my_motion/ --obstacles cloud.txt --cost hand_to_goal=1,hand_to_obstacles=10,jerk=0.01
  optimize.py my_motion/ --obstacles cloud.txt --rollouts kinematics --method cmaes --updates 40
                                                        bend the whole arm around the points
  optimize.py my_motion/ --rollouts diagram --scene shelf --kernels 4 --jobs 2
                                                        try every variation in the simulation
  optimize.py my_motion/ --cost my_cost.py:my_function --goal-offset 0 0 0.1
  optimize.py my_motion/ --cost rating                  you rate each reproduction from 0 to 10
  optimize.py my_motion/ --goal-offset 0.06 0.06 0.05 --compare   all methods in one figure

The cost is a sum of terms with weights (as above, or in a YAML file), or a function in a Python
file. Each update tries some variations and moves towards the best. Results: primitive.yaml (the
cheapest movement found), cost.png (the cost of each update), paths.png, report.json, history.npz.
Whatever ends it, what was tried until a second before is kept; the same command with --resume goes
on, to the same result as if it had not been interrupted.
"""

import json
import math
import shutil
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.cli_scenario import add_scenario_options, scenario_of
from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.demonstrations.refusals import refuse_far_place
from pepper_drake.models.scene import load_scene
from pepper_drake.optimization.averaging import decay_over
from pepper_drake.optimization.comparison import compare_methods
from pepper_drake.optimization.cost import CostFunction, CostWeights, parse_cost
from pepper_drake.optimization.cost_terms import Task
from pepper_drake.optimization.diagram_rollouts import DiagramRollouts
from pepper_drake.optimization.history import History, HistoryKeeper
from pepper_drake.optimization.methods import METHODS, make_optimizer
from pepper_drake.optimization.movement_problem import (
    CLEARANCE,
    EXPLORATION,
    JOINT_EXPLORATION,
    load_movement,
    load_points,
    make_task,
    movement_problem,
)
from pepper_drake.optimization.movement_rollouts import (
    FREE,
    ROLLOUTS,
    MovementRollouts,
    make_parameters,
    make_rollouts,
)
from pepper_drake.optimization.parallel import dask_cluster, processes
from pepper_drake.optimization.problem import Problem
from pepper_drake.optimization.ratings import RatingCollector, rated
from pepper_drake.optimization.search import search
from pepper_drake.reporting.optimization_figures import draw_comparison, save_reproductions
from pepper_drake.reporting.optimization_report import save_search
from pepper_drake.results.folder import INTERRUPTED, whole_results
from pepper_drake.scenario import NUMBERS, Scenario, save_scenario

HISTORY = "history.npz"
RESULTS = ("report.json", "primitive.yaml", HISTORY, "cost.png", "paths.png", "scenario.yaml")
"""Output files of a search."""

DECAYING = ("algorithm3", "enac")
"""Methods with a given decay factor of the exploration."""


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("optimize", __doc__)
    add = parser.add_argument
    add("movement", type=Path, metavar="DEMO", help="a demonstration, or a primitive.yaml")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--goal", nargs=3, type=float, metavar=("X", "Y", "Z"), help="where the hand should end [m]"
    )
    where.add_argument(
        "--goal-offset",
        nargs=3,
        type=float,
        metavar=("DX", "DY", "DZ"),
        help="the same, from where it ends now [m]",
    )
    add("--obstacles", type=Path, metavar="FILE", help="points: rows of x y z, or a log.npz")
    add(
        "--clearance",
        type=float,
        default=CLEARANCE,
        metavar="M",
        help="distance to keep from obstacles [m] (default: %(default)s)",
    )
    add(
        "--cost",
        metavar="COST",
        help="TERM=WEIGHT,... or a .yaml of them, or FILE.py:FUNCTION (default: hand_to_goal; with "
        "obstacles hand_to_goal=1,hand_to_obstacles=10,deviation=0.1, or arm_to_obstacles)",
    )
    add("--ratings", type=Path, metavar="FILE", help="the scores of the term rating, one a line")
    add(
        "--method",
        default="algorithm3",
        choices=tuple(METHODS),
        help="how to search (default: %(default)s, the report's)",
    )
    add(
        "--updates",
        type=int,
        default=7,
        metavar="N",
        help="number of updates (default: %(default)s)",
    )
    add(
        "--samples",
        type=int,
        default=10,
        metavar="N",
        help="rollouts in each update (default: %(default)s)",
    )
    add(
        "--exploration",
        type=float,
        metavar="R",
        help="the exploration rate r of equation 3.2: variance of the parameters [m²] "
        f"(default: {EXPLORATION**2:g}, of joints {JOINT_EXPLORATION**2:g})",
    )
    add(
        "--decay",
        type=float,
        metavar="D",
        help="the decay d of equation 3.2, of algorithm3 and enac (default: what leaves 3 %% of "
        "the exploration after the last update)",
    )
    add(
        "--rollouts",
        default="fast",
        choices=ROLLOUTS,
        help="the equations alone; the whole arm; or the full simulation (default: %(default)s)",
    )
    add("--scene", metavar="SCENE", help="where to reach, with --rollouts diagram (default: table)")
    add_scenario_options(parser, NUMBERS)
    add(
        "--free",
        choices=FREE,
        help="search the hand's path, the joints, or both (default: joints with --rollouts "
        "kinematics, else hand)",
    )
    add(
        "--kernels",
        type=int,
        metavar="N",
        help="search N smooth changes of the path instead of every weight separately",
    )
    add("--target", type=float, default=-math.inf, metavar="COST", help="stop at this cost")
    add("--fixed-end", action="store_true", help="leave the end state as it is")
    add("--jobs", type=int, default=1, metavar="N", help="processes (default: %(default)s)")
    add("--dask", metavar="ADDRESS", help="a Dask cluster's scheduler: tcp://HOST:PORT")
    add("--compare", action="store_true", help="compare all methods on this problem instead")
    add(
        "--seeds",
        type=int,
        default=20,
        metavar="N",
        help="seeds for --compare (default: %(default)s)",
    )
    add("--resume", action="store_true", help="continue an interrupted search in --output")
    return parser


def make_evaluator(
    options: Namespace, primitive: MovementPrimitive, cost: CostWeights | CostFunction
) -> MovementRollouts:
    """Returns the rollouts, with the parameters to search and the task."""
    kinematics, diagram = options.rollouts == "kinematics", options.rollouts == "diagram"
    if options.scene is not None and not diagram:
        raise InputError("--scene: is for --rollouts diagram only")
    if (options.scenario is not None or options.set) and not diagram:
        raise InputError("--scenario, --set: are for --rollouts diagram only")
    free = options.free or ("joints" if kinematics else "hand")
    # With an unchanged goal, a search over joints keeps the end state.
    elsewhere = options.goal is not None or options.goal_offset is not None
    end_state = not options.fixed_end and (elsewhere or free == "hand") and not diagram
    parameters = make_parameters(primitive, free, options.kernels, end_state=end_state)
    task = chosen_task(options, primitive, cost)
    scenario = chosen_scenario(options) if diagram else None
    return make_rollouts(options.rollouts, parameters, task, cost, scenario)


def chosen_scenario(options: Namespace) -> Scenario:
    """Returns the scenario in which the samples are simulated."""
    scene = load_scene(options.scene or "table")
    return replace(scenario_of(options), scene=scene, seed=options.seed)


def chosen_cost(options: Namespace) -> CostWeights | CostFunction:
    """Returns the cost, given or by default."""
    if options.cost is not None:
        cost = parse_cost(options.cost)
    elif options.rollouts == "diagram" or (options.rollouts == "kinematics" and options.obstacles):
        cost = CostWeights(hand_to_goal=1.0, arm_to_obstacles=10.0, deviation=0.1)
    elif options.obstacles is not None:
        cost = CostWeights(hand_to_goal=1.0, hand_to_obstacles=10.0, deviation=0.1)
    else:
        cost = CostWeights(hand_to_goal=1.0)
    if options.ratings is not None and not (isinstance(cost, CostWeights) and cost.rating > 0.0):
        raise InputError("--ratings: the cost has no rating; give --cost rating")
    return cost


def chosen_task(
    options: Namespace, primitive: MovementPrimitive, cost: CostWeights | CostFunction
) -> Task:
    """Returns the task: goal, obstacles and clearance."""
    goal = options.goal
    if options.goal_offset is not None:
        goal = primitive.goal + options.goal_offset
    if goal is not None:
        refuse_far_place(goal, "--goal")
    only_goal = isinstance(cost, CostWeights) and not any(
        weight for name, weight in asdict(cost).items() if name != "hand_to_goal"
    )
    if goal is None and only_goal and options.rollouts != "diagram":
        x, y, z = primitive.goal
        raise InputError(
            f"--goal: the hand ends at {x:.3f} {y:.3f} {z:.3f} and nothing else is asked for; "
            "say where it should end, or what else counts (--cost, --obstacles)"
        )
    if not options.clearance >= 0.0:
        raise InputError(f"--clearance: {options.clearance} m is negative")
    obstacles = None if options.obstacles is None else load_points(options.obstacles)
    return make_task(primitive, goal=goal, obstacles=obstacles, clearance=options.clearance)


def method_settings(options: Namespace, method: str) -> dict[str, Any]:
    """Returns a method's settings other than samples and seed."""
    settings = {"rate": options.exploration}  # None: the problem's default.
    return settings | {"decay": options.decay} if method in DECAYING else settings


def started(options: Namespace) -> History:
    """Returns a new history, or with --resume the stored one."""
    history = History()
    if options.resume:
        kept = options.output / INTERRUPTED / HISTORY
        history = History.load(kept if kept.exists() else options.output / HISTORY)
        if options.decay is None:
            options.decay = history.settings.get("decay")
    if options.decay is None:
        options.decay = decay_over(options.updates)
    names = (
        "movement goal goal_offset obstacles clearance cost method samples exploration decay "
        "kernels fixed_end rollouts scene scenario free seed"
    )
    given = {name: getattr(options, name) for name in names.split()}
    settings = {k: str(value) if isinstance(value, Path) else value for k, value in given.items()}
    settings["set"] = options.set or None
    if options.resume:
        history.check_settings(settings)
    history.settings = settings
    return history


@contextmanager
def workers(options: Namespace, alone: bool) -> Iterator[Executor | None]:
    """Yields an executor of the rollouts, or None to run them in this process."""
    if alone:
        yield None
        return
    where = dask_cluster(options.dask) if options.dask is not None else processes(options.jobs)
    with where as executor:
        yield executor


def ask_tutor(
    options: Namespace,
    evaluate: MovementRollouts,
    weight: float,
    history: History,
    problem: Problem,
) -> Problem:
    """Returns the problem with a cost rated by a tutor in each update."""
    tutor = RatingCollector(
        evaluate.parameters,
        options.output / "reproductions",
        options.ratings or options.output / "ratings.txt",
        save_reproductions,
        ask=input if options.ratings is None else None,
        rated=history.rollouts,
    )
    if options.ratings is None and not options.resume:
        tutor.forget()
    return replace(problem, evaluate=rated(evaluate, tutor, weight), chunk=options.samples)


def write_results(
    options: Namespace,
    history: History,
    evaluate: MovementRollouts,
    seconds: float,
    converged: bool,
) -> None:
    """Writes the results so far, and prints a summary."""
    with whole_results(options.output, RESULTS) as folder:
        measured = save_search(folder, history, evaluate, seconds=seconds, converged=converged)
        if isinstance(evaluate, DiagramRollouts):
            save_scenario(evaluate.scenario, folder / "scenario.yaml")
    shutil.rmtree(options.output / INTERRUPTED, ignore_errors=True)
    if options.quiet:
        return
    first, cost = history.mean_costs[0], history.best()[1]
    before = f"{first:.4g}" if math.isfinite(first) else "not known"
    print(f"cost {before} before, {cost:.4g} for the best of {history.rollouts} rollouts")
    for name, value in measured.items():
        print(f"  {name:18} {value:.4g}")
    print(
        "wrote primitive.yaml, report.json, history.npz, cost.png and paths.png to"
        f" {options.output}"
    )


def run_search(options: Namespace, problem: Problem, evaluate: MovementRollouts) -> int:
    """Searches, and writes the results, also when interrupted."""
    history = started(options)
    rating = evaluate.cost.rating if isinstance(evaluate.cost, CostWeights) else 0.0
    if rating > 0.0:
        problem = ask_tutor(options, evaluate, rating, history, problem)
    optimizer = make_optimizer(
        options.method,
        problem,
        samples=options.samples,
        seed=options.seed,
        **method_settings(options, options.method),
    )
    begin = time.perf_counter()
    bar = tqdm(
        total=options.updates * options.samples,
        initial=history.rollouts,
        unit=" rollouts",
        disable=not cli.shows_progress(options) or rating > 0.0,
    )
    interrupted = False
    keeper = HistoryKeeper(options.output / INTERRUPTED / HISTORY, history)

    def progress(count: int) -> None:
        bar.update(count)
        keeper.keep()

    try:
        with workers(options, alone=rating > 0.0) as executor, bar:
            search(
                problem,
                optimizer,
                options.updates,
                history=history,
                executor=executor,
                # A mean would cost another rating, or half a minute of simulation.
                evaluate_means=rating == 0.0 and options.rollouts != "diagram",
                target=options.target,
                progress=progress,
                on_update=lambda h: bar.set_postfix_str(f"best cost {h.best()[1]:.4g}"),
            )
    except (KeyboardInterrupt, EOFError):
        interrupted = True
    except BaseException:
        keeper.keep(now=True)
        raise
    if history.means:
        seconds = time.perf_counter() - begin
        write_results(options, history, evaluate, seconds, optimizer.converged)
    if interrupted:
        print(
            f"interrupted after {history.updates} of {options.updates} updates; run the same "
            "command with --resume to continue",
            file=sys.stderr,
        )
        return cli.EXIT_INTERRUPTED
    return cli.EXIT_DONE


def run_comparison(options: Namespace, problem: Problem) -> int:
    """Compares the methods on this problem."""
    if options.decay is None:
        options.decay = decay_over(options.updates)
    methods = {name: method_settings(options, name) for name in METHODS}
    with tqdm(
        total=len(methods) * options.seeds,
        unit=" searches",
        disable=not cli.shows_progress(options),
    ) as bar:
        comparison = compare_methods(
            problem,
            methods,
            updates=options.updates,
            samples=options.samples,
            seeds=options.seeds,
            progress=bar.update,
        )
    title = (
        "Which method lowers the cost in the fewest rollouts? "
        f"{len(problem.guess)} parameters, {options.samples} samples in each update"
    )
    figure = draw_comparison(comparison.costs, comparison.rollouts, title)
    summary = comparison.summary()
    table = {
        "rollouts": comparison.rollouts.tolist(),
        "final": summary,
        "costs": {name: costs.tolist() for name, costs in comparison.costs.items()},
    }
    with whole_results(options.output, ("comparison.png", "comparison.json")) as folder:
        figure.savefig(folder / "comparison.png", dpi=110)
        (folder / "comparison.json").write_text(json.dumps(table) + "\n")
    if not options.quiet:
        for name, row in summary.items():
            print(f"{name:12} " + "  ".join(f"{word} {v:.4g}" for word, v in row.items()))
        print(f"wrote comparison.png and comparison.json to {options.output}")
    return cli.EXIT_DONE


def main() -> int:
    """Runs the app and returns its exit code."""
    options = cli.parse(make_parser())
    if options.updates < 1 or options.seeds < 1:
        raise InputError("--updates, --seeds: use at least 1")
    primitive = load_movement(options.movement)
    cost = chosen_cost(options)
    if options.rollouts == "diagram":
        cli.quiet_libraries()
    evaluate = make_evaluator(options, primitive, cost)
    problem = movement_problem(evaluate.parameters, evaluate)
    if options.compare:
        if options.rollouts == "diagram":
            raise InputError("--compare: takes too long in the diagram; use other --rollouts")
        return run_comparison(options, problem)
    return run_search(options, problem, evaluate)


if __name__ == "__main__":
    cli.run(main)
