"""Regression baseline: a committed file of metrics with directions and tolerances."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pepper_drake.errors import InputError
from pepper_drake.files import LARGEST_NUMBER, check_fields, read_json, write_atomically

HIGHER, LOWER = "higher", "lower"


@dataclass(frozen=True)
class Metric:
    """A measured value and its tolerance.

    Attributes:
        value: The measured value.
        unit: Unit such as "m", or "1" for counts and ratios.
        direction: The better direction, "higher" or "lower".
        tolerance: Allowed deterioration, in the unit.
    """

    value: float
    unit: str
    direction: str
    tolerance: float

    @property
    def limit(self) -> float:
        """Worst value that passes."""
        return self.value + self.tolerance * (1.0 if self.direction == LOWER else -1.0)

    def passes(self, value: float) -> bool:
        """True if a value is no worse than the limit; NaN never passes."""
        return value <= self.limit if self.direction == LOWER else value >= self.limit


@dataclass(frozen=True)
class Baseline:
    """Metrics by name.

    Attributes:
        metrics: The metrics.
        reason: Reason of the last update.
    """

    metrics: dict[str, Metric]
    reason: str

    def failures(self, measured: Mapping[str, Metric]) -> list[str]:
        """Returns a sentence for each metric that fails, is missing, or is not in the baseline."""
        lines = []
        for name, metric in self.metrics.items():
            if name not in measured:
                lines.append(f"{name}: was not measured; it was {metric.value:g} {metric.unit}")
            elif not metric.passes(measured[name].value):
                bound = "at most" if metric.direction == LOWER else "at least"
                lines.append(
                    f"{name}: {measured[name].value:g} {metric.unit}; the baseline "
                    f"{metric.value:g} allows {bound} {metric.limit:g}"
                )
        new = [name for name in measured if name not in self.metrics]
        lines += [f"{name}: is not in the baseline; renew it" for name in new]
        return lines

    def save(self, path: Path) -> None:
        """Writes the baseline as JSON.

        Raises:
            InputError: A metric is invalid, such as a value that cannot be compared.
        """
        for name, metric in self.metrics.items():
            _check(metric, name)
        write_atomically(path, json.dumps(asdict(self), indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> "Baseline":
        """Reads a file that `save` wrote.

        Raises:
            InputError: The file is missing or is not a baseline.
        """
        mend = "make it with --update-baseline REASON"
        if not path.exists():
            raise InputError(f"{path}: there is no baseline; {mend}")
        content: Any = read_json(path)
        try:
            metrics = {name: Metric(**fields) for name, fields in content["metrics"].items()}
            baseline = cls(metrics, content["reason"])
        except (AttributeError, KeyError, TypeError):
            raise InputError(f"{path}: this is not a baseline; {mend}") from None
        for name, metric in metrics.items():
            _check(metric, f"{path}: {name}")
            check_fields(metric, f"{path}: {name}", mend)
        return baseline


def _check(metric: Metric, where: str) -> None:
    for name in ("value", "tolerance"):
        number = getattr(metric, name)
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise InputError(f"{where}.{name} is not a number; give one")
        if not abs(number) <= LARGEST_NUMBER:
            raise InputError(f"{where}.{name} is {number:g}; give a number that can be compared")
    if metric.tolerance < 0.0:
        raise InputError(f"{where}.tolerance is {metric.tolerance:g}; give 0 or more")
    if metric.direction not in (HIGHER, LOWER):
        raise InputError(f'{where}.direction is "{metric.direction}"; give {HIGHER} or {LOWER}')
