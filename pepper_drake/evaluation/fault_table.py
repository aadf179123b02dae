"""Every fault in complete reaches: table of outcomes and contacts."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.errors import InputError
from pepper_drake.files import check_fields, read_json
from pepper_drake.models.scene import load_scene
from pepper_drake.results.reach_report import ReachReport
from pepper_drake.scenario import Scenario, build_reaching
from pepper_drake.systems.faults.fault import KINDS, SIGNALS, sensible_faults

STARTS = ("0", "reach")
"""Start times of the faults: from the beginning, and from the arm's start."""

LARGEST_TOUCH_SPEED = 0.05
"""Largest speed of a link at a contact that counts as safe [m/s]."""
LARGEST_ACCELERATION = 10.0
"""Acceleration limit of joint commands [rad/s^2]."""


@dataclass(frozen=True)
class FaultCase:
    """One fault in one reach.

    Attributes:
        fault: The fault as SIGNAL:KIND@START[+DURATION].
        scene: A shipped scene's name or a file.
        seed: Seed of all random numbers.
    """

    fault: str
    scene: str
    seed: int


@dataclass(frozen=True)
class FaultResult:
    """Outcome of a run with a fault; lengths in m, times in s, angles in rad."""

    fault: str
    scene: str
    seed: int
    outcome: str
    reason: str
    message: str
    contacts: int
    minimum_clearance: float | None
    touch_speed: float | None
    own_touch_speed: float | None
    contact_force: float
    command_acceleration: float
    stopping_seconds: float | None
    final_position_error: float | None

    @property
    def is_safe(self) -> bool:
        """True if no contact was too fast, no command beyond its limits, and no exception rose."""
        touch = self.own_touch_speed or 0.0
        return (
            touch <= LARGEST_TOUCH_SPEED
            and self.command_acceleration <= LARGEST_ACCELERATION + 1e-6
            and self.reason != "simulation_failed"
        )


def fault_cases(
    scenes: Sequence[str], seed: int, starts: Sequence[str] = STARTS
) -> list[FaultCase]:
    """Returns all sensible faults with each start in each scene; the seed grows by 1 per scene."""
    return [
        FaultCase(f"{signal}:{kind}@{start}", scene, seed + number)
        for signal, kind in sensible_faults()
        for start in starts
        for number, scene in enumerate(scenes)
    ]


def run_fault(case: FaultCase, scenario: Scenario | None = None) -> FaultResult:
    """Simulates the reach of a case, without display; an exception gives a result, too.

    Args:
        case: Scene, seed and fault.
        scenario: Parameters of the loop; the defaults if None.
    """
    try:
        chosen = replace(
            scenario or Scenario(),
            scene=load_scene(case.scene),
            seed=case.seed,
            faults=[case.fault],
        )
        reaching = build_reaching(chosen)
        report = ReachSimulation(reaching, RunOptions(progress=False)).run().report
        return fault_result(case, report)
    except Exception as error:
        message = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        report = ReachReport(outcome="failed", reason="simulation_failed", message=message)
        return fault_result(case, report)


def fault_result(case: FaultCase, report: ReachReport) -> FaultResult:
    """Returns the table's fields of a report."""
    names = FaultResult.__dataclass_fields__.keys() - asdict(case).keys()
    return FaultResult(**asdict(case), **{name: getattr(report, name) for name in names})


def load_results(path: Path) -> dict[FaultCase, FaultResult]:
    """Loads results from a file, a list of `FaultResult` in JSON.

    Raises:
        InputError: The file is missing, or has other content.
    """
    remedy = "remove it or give another --output"
    try:
        results = [FaultResult(**row) for row in read_json(path)]
    except TypeError:
        raise InputError(f"{path}: not a table of faults' results; {remedy}") from None
    for result in results:
        check_fields(result, str(path), remedy)
    return {FaultCase(row.fault, row.scene, row.seed): row for row in results}


def markdown_table(results: Iterable[FaultResult]) -> str:
    """Returns the results as a Markdown document: counts, signals, kinds, and a table of runs."""
    results = list(results)
    unsafe = [result for result in results if not result.is_safe]
    touched = [result for result in results if result.contacts]
    lines = [
        "# Faults and their outcomes",
        "",
        "`make faults` injects every fault into whole reaches and writes this page.",
        "A fault is SIGNAL:KIND@START; `reach` is the moment when the arm starts. Lengths are in "
        "mm, the speed at a touch (the link's own part) in mm/s, the time from the failure to a "
        "stand in s.",
        "",
        f"{len(results)} runs; touched something: {len(touched)}; a touch faster than "
        f"{1000 * LARGEST_TOUCH_SPEED:.0f} mm/s, a command beyond {LARGEST_ACCELERATION:.0f} "
        f"rad/s², or an end by an exception: {len(unsafe)}.",
        "",
        "## Signals",
        "",
        *(f"- `{name}`: {signal.meaning}" for name, signal in SIGNALS.items()),
        "",
        "## Kinds",
        "",
        *(f"- `{name}`: {meaning}" for name, meaning in KINDS.items()),
        "",
        "Refused, as they make no sense:",
        "",
        *(
            f"- `{name}:{kind}`: {why}"
            for name, signal in SIGNALS.items()
            for kind, why in signal.refused.items()
        ),
        "",
        "## Outcomes",
        "",
        "| fault | scene | outcome | reason and sentence | contacts | clearance | touch speed "
        "| stop | error |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        *(_row(result) for result in results),
        "",
    ]
    return "\n".join(lines)


def _row(result: FaultResult) -> str:
    why = f"{result.reason}: {result.message}" if result.reason else ""
    cells = (
        f"`{result.fault}`",
        result.scene,
        result.outcome,
        why,
        str(result.contacts),
        _millimetres(result.minimum_clearance),
        _millimetres(result.own_touch_speed),
        "" if result.stopping_seconds is None else f"{result.stopping_seconds:.2f}",
        _millimetres(result.final_position_error),
    )
    return f"| {' | '.join(cells)} |"


def _millimetres(length: float | None) -> str:
    return "" if length is None else f"{1000 * length:.1f}"
