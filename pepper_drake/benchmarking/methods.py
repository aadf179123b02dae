"""The compared methods, by letter."""

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.diagram_reach import DiagramReach
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.package_coupling import PackageCoupling
from pepper_drake.benchmarking.planned_reach import (
    PlannedReach,
    barrier_motions,
    optimized_motions,
    roboplan_motions,
    rrt_motions,
)
from pepper_drake.benchmarking.roboplan_rrt import roboplan_model
from pepper_drake.errors import InputError
from pepper_drake.planning import ReachPlanner
from pepper_drake.user_code import load_object, names_code, register_code


class Run(Protocol):
    """Protocol of a method."""

    @property
    def options(self) -> tuple[str, ...] | None:
        """Equivalent options of `reach.py`; None if there are none."""
        ...

    def __call__(self, case: Case) -> MethodResult:
        """Runs the method, without display."""
        ...

    def replay(self, case: Case, folder: Path) -> MethodResult:
        """Runs the method again and writes `recording.html` and other files into a folder."""
        ...


@dataclass(frozen=True)
class Method:
    """A reaching method.

    Attributes:
        letter: Name on the command line: a letter, or FILE.py:NAME.
        name: Name in tables.
        description: Short description.
        run: Runs the method.
        needs: Required package of the `bench` extra, if any.
        knows_all: Whether it has perfect knowledge of the scene, not only perception.
    """

    letter: str
    name: str
    description: str
    run: Run
    needs: str = ""
    knows_all: bool = False

    @property
    def label(self) -> str:
        """Label in tables and figures."""
        return f"{self.letter.rpartition('/')[2]}: {self.name}"

    def check(self) -> None:
        """Raises InputError if a required package is not installed."""
        if self.needs and find_spec(self.needs) is None:
            raise InputError(
                f"method {self.letter} needs {self.needs}: run `.venv/bin/pip install '.[bench]'`, "
                "or leave it out of --methods"
            )


METHODS: tuple[Method, ...] = (
    Method(
        "a",
        "demonstration as it is",
        "the primitive without obstacle coupling, and nothing that stops it",
        DiagramReach(coupling="none", options=("--no-avoidance",)),
    ),
    Method(
        "b",
        "the report's method",
        "the hand pushed by the cloud's points, equation 2.7; nothing that stops it",
        DiagramReach(
            coupling="report",
            collision_checked=False,
            options=("--coupling", "report", "--unvetted"),
        ),
    ),
    Method(
        "c",
        "ours, reactive",
        "the barrier around the cloud, no adaptation",
        DiagramReach(options=None),
    ),
    Method(
        "d",
        "ours, adapted",
        "the movement adapted to the cloud as a whole arm, then the barrier",
        DiagramReach(adapt=True),
    ),
    Method(
        "e",
        "movement_primitives' coupling",
        "the hand pushed by the cloud's nearest point, by that package's function; nothing that "
        "stops it",
        DiagramReach(coupling=PackageCoupling(), collision_checked=False, options=None),
        needs="movement_primitives",
    ),
    Method(
        "f",
        "RRT-Connect, smoothed",
        "OMPL over Drake's collision checker; perfect knowledge, no dynamics",
        PlannedReach(rrt_motions),
        needs="ompl",
        knows_all=True,
    ),
    Method(
        "g",
        "trajectory optimisation",
        "Drake's KinematicTrajectoryOptimization; perfect knowledge, no dynamics",
        PlannedReach(optimized_motions),
        knows_all=True,
    ),
    Method(
        "h",
        "RoboPlan, shortcut",
        "RoboPlan's RRT-Connect and shortcutting over its own collision model; perfect knowledge, "
        "no dynamics",
        PlannedReach(roboplan_motions, prepare=roboplan_model),
        needs="roboplan",
        knows_all=True,
    ),
    Method(
        "i",
        "Pink's barriers",
        "Pink's differential inverse kinematics with barriers to all collision pairs, reactive; "
        "perfect knowledge, no dynamics",
        PlannedReach(barrier_motions, reactive=True),
        needs="pink",
        knows_all=True,
    ),
)


def get_method(letter: str) -> Method:
    """Returns the method of a letter, or a user's own: FILE.py:NAME, whose code is run.

    A subclass of `ReachPlanner` gets perception: the cameras' cloud, measured joints and the
    estimated goal. A function has perfect knowledge; see `planned_reach.Motions`.

    Raises:
        InputError: The method does not exist.
    """
    if names_code(letter):
        return _own_method(letter, load_object(letter))
    for method in METHODS:
        if method.letter == letter:
            return method
    known = ", ".join(f"{m.letter} ({m.name})" for m in METHODS)
    raise InputError(
        f'method "{letter}" is unknown; there are {known}, or FILE.py:NAME of your own'
    )


def _own_method(text: str, part: Any) -> Method:
    name = text.rpartition(":")[2]
    if isinstance(part, type) and issubclass(part, ReachPlanner):
        run = DiagramReach(adapt=True, planner=register_code(text), options=("--planner", text))
        return Method(text, "own cameras", f"the planner {name} on what the cameras see", run)
    if callable(part) and not isinstance(part, type):
        run_known = PlannedReach(part)
        return Method(
            text, "perfect knowledge", f"{name}, without dynamics", run_known, knows_all=True
        )
    raise InputError(
        f"{text} is neither a subclass of ReachPlanner nor a function of (known, base_pose, seed)"
    )
