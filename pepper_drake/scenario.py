"""One file for a whole run: the scene, the robot, and every tuned parameter of the loop.

    pepper-drake reach --scenario mine.yaml --set planner.clearance.want=0.02

A file holds only what differs from the defaults. A run saves its complete scenario beside its
report as `scenario.yaml`, from which it can be repeated.
"""

import dataclasses
import typing
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from pepper_drake._former_names import FIELDS
from pepper_drake.diagrams.compliance import ComplianceConfig
from pepper_drake.diagrams.factory import (
    LearningParams,
    hand_barrier,
    make_coupling,
    make_gentle,
    make_primitive,
)
from pepper_drake.diagrams.head_perception import PerceptionConfig
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.safety_layer import SafetyParams
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling, Coupling
from pepper_drake.models.hands import RELAXED
from pepper_drake.models.robot_calibration import calibration_of
from pepper_drake.models.robot_wear import ROBOTS, RobotWear
from pepper_drake.models.scene import Scene, load_scene
from pepper_drake.models.typed_yaml import load_yaml, save_yaml, with_settings
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.planner_registry import DEFAULT_PLANNER, get_planner
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams, ReachTiming
from pepper_drake.planning.reach.task_sequence import SequenceTask
from pepper_drake.planning.safety.contact_detection import ContactParams
from pepper_drake.scenario_ranges import check_ranges
from pepper_drake.systems.faults.fault import parse_faults
from pepper_drake.systems.faults.fault_set import FaultSet
from pepper_drake.systems.guiding.external_force import ForcePulse

_PUSH_DURATION = 0.5
"""Duration of the push on the hand [s]."""
NUMBERS = (
    "station",
    "perception",
    "planner",
    "planner_class",
    "controller",
    "supervisor",
    "safety",
    "contact",
    "barrier",
)
"""Fields of a scenario with parameters of the loop, independent of scene and task."""
MOVED = FIELDS
"""Field names of the last release, which are still read, and their present names."""


def _without(schema: type, names: Sequence[str], called: str) -> Any:
    """Returns a dataclass with the fields of another one, without some, to be assigned to `called`.

    Those left out follow from other fields of a scenario.
    """
    hints = typing.get_type_hints(schema)
    kept = [f for f in fields(schema) if f.name not in names]
    columns = [
        (
            f.name,
            hints[f.name],
            field(default=f.default)
            if f.default is not dataclasses.MISSING
            else field(default_factory=typing.cast(Any, f.default_factory)),
        )
        for f in kept
    ]
    # With its module, it can be pickled.
    return dataclasses.make_dataclass(called, columns, namespace={"__module__": __name__})


StationSettings: Any = _without(
    StationConfig, ("seed", "wear", "calibration", "faults"), "StationSettings"
)
"""The fields of `StationConfig` that a scenario sets."""
ComplianceSettings: Any = _without(ComplianceConfig, ("pushes",), "ComplianceSettings")
"""The fields of `ComplianceConfig` that a scenario sets."""
BarrierSettings: Any = _without(BarrierCoupling, (), "BarrierSettings")
"""The fields of `BarrierCoupling`, which itself is frozen."""


@dataclass
class TaskSettings:
    """A task after the reach, as in a file."""

    name: str = ""
    """For reports; made from its number if empty."""
    demonstration: str = ""
    """Folder or file of the task's demonstration; that of the reach if empty."""
    wait: float = 0.0
    """Time to hold the hand's pose instead of a movement [s]."""
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Goal of the hand relative to its pre-grasp pose, x, y, z in the goal object's frame [m]."""
    hand: float | None = None
    """Opening of the hand to set instead of a movement, from 0, closed, to 1, open."""
    returns: bool = False
    """True to return to the hand's pose before the reach."""

    def check(self) -> None:
        """Raises InputError unless it is a single task with sensible values."""
        label = f"task {self.name!r}"
        if len(self.offset) != 3 or not all(abs(x) <= 0.5 for x in self.offset):
            raise InputError(f"{label}: offset {self.offset} must be three numbers, 0.5 m at most")
        if not 0.0 <= self.wait <= 60.0:
            raise InputError(f"{label}: wait {self.wait:g} must be from 0 to 60 s")
        if self.hand is not None and not 0.0 <= self.hand <= 1.0:
            raise InputError(f"{label}: hand {self.hand:g} must be from 0, closed, to 1, open")
        stays = self.wait or self.hand is not None
        if stays and (self.returns or any(self.offset) or self.demonstration):
            raise InputError(
                f"{label}: the arm waits, the hand opens or closes, or the arm moves; "
                "give a task for each"
            )


def _check_tasks(tasks: Sequence[TaskSettings]) -> None:
    """Raises InputError unless each task is valid, and the arm never moves with an open hand."""
    opening = RELAXED
    for task in tasks:
        task.check()
        if task.hand is not None:
            opening = task.hand
        elif not task.wait and opening > RELAXED:
            raise InputError(
                f"task {task.name!r}: the arm would move with its hand open to {opening:g}, whose "
                f"fingers are not kept clear of obstacles; put {{hand: {RELAXED:g}}}, or less, "
                "before it"
            )


@dataclass
class _Tasks:
    """Content of a file of tasks."""

    tasks: list[TaskSettings] = field(default_factory=list)


@dataclass
class Scenario:
    """Complete input of a reach, in the form that Drake's YAML loader reads."""

    seed: int = 0
    """Seed of all random numbers: the sensors' noise and the errors of a worn robot."""
    scene: Scene = field(default_factory=lambda: load_scene("table"))
    demonstration: str = ""
    """Folder or file of the demonstration to perform; the one shipped with the package if empty."""
    learning: LearningParams = field(default_factory=LearningParams)
    """Parameters of learning the movement from the demonstration."""
    avoid_obstacles: bool = True
    """True to use the scene's obstacle coupling."""
    robot: str = "ideal"
    """Robot model: "ideal" or "worn", the latter with errors drawn from the seed."""
    calibration: str = ""
    """File with the calibration of this robot; none if empty."""
    faults: list[str] = field(default_factory=list)
    """Faults of signals, as SIGNAL:KIND@START[+DURATION]."""
    gentle: bool = False
    """True to keep every point of the arm below 250 mm/s."""
    tasks: list[TaskSettings] = field(default_factory=list)
    """Sequence of arm tasks after the reach."""
    push: list[float] = field(default_factory=list)
    """Force on the hand during the movement, x, y, z in W [N]; none if empty."""
    push_at: float = 1.5
    """Time of the push after the arm's start [s]."""
    station: StationSettings = field(default_factory=StationSettings)
    """The simulated robot and its cameras."""
    perception: PerceptionConfig = field(default_factory=PerceptionConfig)
    planner: ReachPlannerParams = field(default_factory=ReachPlannerParams)
    planner_class: str = DEFAULT_PLANNER
    """Name of the planner: the default one, or one of your own as FILE.py:NAME."""
    controller: DifferentialIkParams = field(default_factory=DifferentialIkParams)
    """The arm's inverse kinematics."""
    supervisor: ReachTiming = field(default_factory=ReachTiming)
    """Durations, timeouts and planning latency."""
    safety: SafetyParams = field(default_factory=SafetyParams)
    """Stopping criteria of the robot, and driving and braking of the base."""
    contact: ContactParams = field(default_factory=ContactParams)
    """Contact detection at the joints."""
    barrier: BarrierSettings = field(
        default_factory=lambda: BarrierSettings(**vars(hand_barrier()))
    )
    """Constants of the coupling "barrier"."""
    compliance: ComplianceSettings = field(default_factory=ComplianceSettings)
    """Compliance of the arm under a push; without a push it is stiff."""

    def barrier_coupling(self) -> BarrierCoupling:
        """Returns the barrier with the scenario's constants."""
        return BarrierCoupling(**vars(self.barrier))

    def check(self) -> None:
        """Checks what the types do not express.

        Raises:
            InputError: A value is out of range, or clearances or tolerances are out of order.
        """
        self.scene.check()
        self.learning.check()
        planner = self.planner
        for checked in (
            planner.clearance,
            planner.tolerance,
            planner.following,
            planner.retreat,
            planner.new_obstacle,
            planner.lean,
            self.barrier_coupling(),
            self.perception.gaze,
            self.perception.marker,
            self.station.stereo_pair.matching,
        ):
            checked.check()
        check_ranges(self)
        if self.push and len(self.push) != 3:
            raise InputError(f"push has {len(self.push)} numbers; give three, or none")
        _check_tasks(self.tasks)
        if self.robot not in ROBOTS:
            raise InputError(f'robot is "{self.robot}"; it must be {" or ".join(ROBOTS)}')
        parse_faults(self.faults)

    def reaching_config(self) -> ReachingConfig:
        """Returns the configuration from which `Reaching` is built.

        Raises:
            InputError: The calibration cannot be read, or is that of another robot.
        """
        pushes: tuple[ForcePulse, ...] = ()
        if self.push:
            x, y, z = self.push
            pushes = (ForcePulse((x, y, z), self.push_at, _PUSH_DURATION),)
        return ReachingConfig(
            station=StationConfig(
                **{f.name: deepcopy(getattr(self.station, f.name)) for f in fields(self.station)},
                seed=self.seed,
                wear=RobotWear.draw(self.seed) if self.robot == "worn" else None,
                calibration=calibration_of(self.calibration, self.robot, self.seed),
                faults=FaultSet(parse_faults(self.faults), self.seed),
            ),
            ik=self.controller,
            planner=self.planner,
            planner_class=get_planner(self.planner_class),
            timing=self.supervisor,
            perception=self.perception,
            safety=self.safety,
            contact=self.contact,
            compliance=ComplianceConfig(**vars(self.compliance), pushes=pushes) if pushes else None,
        )


METHODS = ("adapted", "reactive", "report")
"""Methods of avoiding obstacles; see `use_method`."""


def use_method(scenario: Scenario, method: str) -> None:
    """Sets a scenario to one method of avoiding obstacles.

    - `adapted`: the taught movement, bent by the barrier; where that is not enough, the whole arm's
      movement is adapted to the observed scene. The default.
    - `reactive`: the barrier alone bends the taught movement; where that is not enough, the reach
      is refused.
    - `report`: the report's method. Equation 2.7 summed over the cloud; locally weighted regression
      with 40 basis functions, the forcing term scaled by g - y0 (2.5), three angles for the
      orientation; no check of the arm for collisions.

    Raises:
        InputError: There is no such method.
    """
    if method not in METHODS:
        raise InputError(f'method is "{method}"; it must be one of {", ".join(METHODS)}')
    is_report = method == "report"
    scenario.scene.coupling = "report" if is_report else "barrier"
    scenario.planner.adapt = method == "adapted"
    scenario.planner.collision_checked = not is_report
    scenario.learning = (
        LearningParams("lwr", 40, "goal", "angles") if is_report else LearningParams()
    )


def movement_and_config(
    scenario: Scenario, primitive: MovementPrimitive | None = None
) -> tuple[MovementPrimitive, ReachingConfig]:
    """Returns the movement of a scenario, and the configuration of its diagram.

    Args:
        scenario: The scenario.
        primitive: The movement; learned from the scenario's demonstration if omitted.

    Raises:
        InputError: The demonstration cannot be read.
    """
    if primitive is None:
        demonstration = Path(scenario.demonstration) if scenario.demonstration else None
        primitive = make_primitive(demonstration, scenario.scene.arm, scenario.learning)
    config = scenario.reaching_config()
    if scenario.gentle:
        primitive, config.ik = make_gentle(primitive, config.ik, config.timing)
    config.tasks = tuple(
        _task(number, task, primitive, scenario) for number, task in enumerate(scenario.tasks, 1)
    )
    return primitive, config


def _task(
    number: int, settings: TaskSettings, reach: MovementPrimitive, scenario: Scenario
) -> SequenceTask:
    primitive: MovementPrimitive | None = reach
    if settings.wait or settings.hand is not None:
        primitive = None
    elif settings.demonstration:
        shown = Path(settings.demonstration)
        primitive = make_primitive(shown, scenario.scene.arm, scenario.learning)
    x, y, z = settings.offset
    name = settings.name or f"task {number}"
    return SequenceTask(name, primitive, settings.wait, (x, y, z), settings.hand, settings.returns)


def load_tasks(path: Path) -> list[TaskSettings]:
    """Loads the tasks after the reach: a YAML file with a list `tasks`.

    Raises:
        InputError: The file does not fit, or has no task; the message names it.
    """
    loaded = load_yaml(_Tasks, path, _Tasks())
    if not loaded.tasks:
        raise InputError(f"{path}: no tasks in it; list at least one")
    try:
        _check_tasks(loaded.tasks)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return loaded.tasks


def coupling_of(scenario: Scenario) -> Coupling | None:
    """Returns the coupling with which obstacles bend a scenario's movement, or None.

    Raises:
        InputError: There is no coupling of that name.
    """
    name = scenario.scene.coupling if scenario.avoid_obstacles else "none"
    return make_coupling(name, scenario.barrier_coupling())


def build_reaching(
    scenario: Scenario,
    *,
    primitive: MovementPrimitive | None = None,
    coupling: Coupling | None = None,
) -> Reaching:
    """Builds the diagram of a scenario.

    Args:
        scenario: The scenario.
        primitive: As in `movement_and_config`.
        coupling: Used instead of the scenario's.

    Raises:
        InputError: The demonstration cannot be read.
    """
    primitive, config = movement_and_config(scenario, primitive)
    return Reaching(scenario.scene, primitive, coupling or coupling_of(scenario), config)


def load_scenario(
    path: Path | None = None, settings: Sequence[str] = (), defaults: Scenario | None = None
) -> Scenario:
    """Loads a scenario.

    Args:
        path: The YAML file; fields that it omits keep their defaults. All defaults if None.
        settings: Such as `planner.clearance.want=0.02`, on top of the file.
        defaults: Other defaults than usual.

    Raises:
        InputError: The file or a setting does not fit; the message names file, line and field.
    """
    scenario = deepcopy(defaults) or Scenario()
    if path is not None:
        scenario = load_yaml(Scenario, path, scenario, moved=MOVED)
    scenario = with_settings(scenario, settings, moved=MOVED)
    try:
        scenario.check()
    except InputError as error:
        raise InputError(f"{path or '--set'}: {error}") from None
    return scenario


def save_scenario(scenario: Scenario, path: Path) -> None:
    """Writes a complete scenario, which `load_scenario` restores."""
    save_yaml(scenario, path)
