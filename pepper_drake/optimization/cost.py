"""Costs: weighted sums of named terms, or a user's own function."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.models.typed_yaml import line_of_field, load_yaml
from pepper_drake.optimization.cost_terms import TERMS, Task
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.short_repr import short_repr
from pepper_drake.user_code import load_object

Array = npt.NDArray[np.float64]

Cost = Callable[[Outcome, Task], Array]
"""Returns costs (S,), or (S, N) of each step."""


def terms_of(cost: Cost, outcome: Outcome, task: Task) -> dict[str, float]:
    """Returns the unweighted terms by name for the first movement of an outcome.

    Empty for a cost without terms.
    """
    if not isinstance(cost, CostWeights):
        return {}
    return {
        name: float(term(outcome, task)[0].sum())
        for name, term in TERMS.items()
        if getattr(cost, name) > 0.0
    }


@dataclass
class CostWeights:
    """Weights of the cost's terms, as in a cost file. Zero leaves a term out."""

    hand_to_goal: float = 0.0
    """For each metre between hand and goal at the end."""
    hand_to_obstacles: float = 0.0
    """For each metre by which the hand violates the clearance."""
    arm_to_obstacles: float = 0.0
    """The same for the whole arm."""
    deviation: float = 0.0
    """For each metre of the mean distance to the demonstrated path."""
    jerk: float = 0.0
    """For the jerk before the search."""
    joint_limits: float = 0.0
    """For one joint at its limit all the time."""
    rating: float = 0.0
    """For a tutor's worst rating."""

    def check(self) -> None:
        """Raises InputError unless some weight is positive and none is negative."""
        for name, weight in asdict(self).items():
            if weight < 0.0 or not np.isfinite(weight):
                raise InputError(f"{name}: {weight} is negative or not finite")
        if not any(asdict(self).values()):
            raise InputError("every term has weight 0; give one that counts")

    def __call__(self, outcome: Outcome, task: Task) -> Array:
        """Returns the costs (S, N) of each step; without the tutor's rating."""
        costs = np.zeros(outcome.positions.shape[:2])
        for name, term in TERMS.items():
            weight = getattr(self, name)
            if weight > 0.0:
                costs += weight * term(outcome, task)
        return costs


@dataclass(frozen=True)
class CostFunction:
    """A user's function of an outcome and a task, in a file; it can be sent to other processes.

    Attributes:
        path: A Python file.
        name: Of the function in it.
    """

    path: Path
    name: str

    __repr__ = short_repr

    def __call__(self, outcome: Outcome, task: Task) -> Array:
        """Returns what the function gives: (S,), or (S, N) of each step."""
        costs = np.asarray(_function(self.path, self.name)(outcome, task), dtype=float)
        count, steps = outcome.positions.shape[:2]
        if costs.shape not in ((count,), (count, steps)):
            raise InputError(
                f"{self.path}: {self.name} gave costs of shape {costs.shape};"
                f" it must give ({count},) or ({count}, {steps})"
            )
        return costs


def _function(path: Path, name: str) -> Any:
    function = load_object(f"{path}:{name}")
    if not callable(function):
        raise InputError(f"{path} defines no function {name}; write FILE.py:FUNCTION")
    return function


def parse_cost(text: str) -> CostWeights | CostFunction:
    """Reads a cost from the command line.

    Args:
        text: `term=weight,term=weight`, where a term without a weight counts 1; or a YAML file of
            weights; or `file.py:function`.

    Raises:
        InputError: It is none of these.
    """
    if text.endswith((".yaml", ".yml")):
        return load_cost(Path(text))
    file, _, name = text.rpartition(":")
    if file.endswith(".py"):
        path = Path(file).resolve()
        if not path.is_file():
            raise InputError(f"--cost {file}: no such file; check the path")
        function = CostFunction(path, name)
        _function(path, name)
        return function
    weights = CostWeights()
    known = [field.name for field in fields(CostWeights)]
    for part in text.split(","):
        term, _, number = (word.strip() for word in part.partition("="))
        if term not in known:
            raise InputError(f"--cost: '{term}' is not a term; use some of {', '.join(known)}")
        try:
            setattr(weights, term, float(number) if number else 1.0)
        except ValueError:
            raise InputError(f"--cost: {term}={number} is not a number") from None
    try:
        weights.check()
    except InputError as error:
        raise InputError(f"--cost: {error}") from None
    return weights


def load_cost(path: Path) -> CostWeights:
    """Loads the weights of a cost from a YAML file.

    Raises:
        InputError: With file, line and field.
    """
    weights = load_yaml(CostWeights, path)
    try:
        weights.check()
    except InputError as error:
        field = str(error).partition(":")[0]
        raise InputError(f"{path} line {line_of_field(path, field)}: {error}") from None
    return weights
