"""Command-line options that choose a scenario, and checks of it."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.scenario import Scenario, load_scenario, save_scenario


def check_robot_takes(scenario: Scenario, *simulated: str) -> None:
    """Checks that no field of a simulated robot is set.

    Args:
        scenario: The scenario of a run with a robot.
        simulated: Its fields that have no effect there.

    Raises:
        InputError: One of them differs from its default.
    """
    for name in simulated:
        if attrgetter(name)(scenario) != attrgetter(name)(Scenario()):
            raise InputError(f"{name} is of the simulated robot; leave it out with --station naoqi")


def keep_scenario(scenario: Scenario, folder: Path, *, has_runs: bool) -> None:
    """Writes the scenario of a folder that collects runs.

    Args:
        scenario: Of the runs to come.
        folder: The folder.
        has_runs: True if it holds runs already; without a scenario.yaml these have the default
            numbers.

    Raises:
        InputError: The folder holds runs of another scenario, or cannot be written to.
    """
    path = folder / "scenario.yaml"
    before = load_scenario(path) if path.exists() else Scenario()
    if (path.exists() or has_runs) and before != scenario:
        raise InputError(
            f"{path}: the runs in this folder are of other numbers; give another --output"
        )
    save_scenario(scenario, path)


def add_scenario_options(parser: ArgumentParser, parts: Sequence[str] = ()) -> None:
    """Adds `--scenario` and `--set`, for `scenario_of` to read.

    Args:
        parser: To add them to.
        parts: Fields of a scenario that this app uses, such as `NUMBERS`; all if left out.
    """
    parser.set_defaults(scenario_parts=tuple(parts))
    what = f"numbers of {', '.join(parts)}" if parts else "scene, robot and every tuned number"
    example = "planner.clearance.want=0.02"
    if parts and "planner" not in parts:
        example = "station.noise=false" if "station" in parts else f"{parts[0]}=VALUE"
    parser.add_argument(
        "--scenario",
        type=Path,
        metavar="FILE",
        help=f"{what}: a YAML file such as a run's scenario.yaml; what it leaves out keeps its "
        "default, and other options overrule it",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        help=f"set one field of the scenario, as in {example}; may be given more than once",
    )


def scenario_of(options: Namespace, defaults: Scenario | None = None) -> Scenario:
    """Loads the scenario that the options of `add_scenario_options` name.

    Only the app's parts of a file are used: scene, seed, movement and task may be options of the
    app itself.

    Args:
        options: Of an app.
        defaults: Other defaults than usual.

    Raises:
        InputError: As in `load_scenario`; or a setting is not one of the app's parts.
    """
    parts = options.scenario_parts
    for setting in options.set if parts else ():
        name = setting.partition("=")[0]
        if name.partition(".")[0] not in parts:
            raise InputError(
                f"--set {name}: this app takes {', '.join(parts)} from a scenario; for all else "
                "see its own options"
            )
    scenario = load_scenario(options.scenario, options.set, defaults)
    if not parts:
        return scenario
    return replace(
        deepcopy(defaults) or Scenario(), **{name: getattr(scenario, name) for name in parts}
    )
