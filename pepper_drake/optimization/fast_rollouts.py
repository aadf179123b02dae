"""Rollouts of the primitive alone: thousands per second, the hand as a point or a sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.rollout import PathBatch, number_of_steps, undisturbed_motions
from pepper_drake.optimization.cost import Cost, terms_of
from pepper_drake.optimization.cost_terms import Task
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.optimization.parameters import MovementParameters
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FastRollouts:
    """Costs of parameters, by rollouts of the primitive without robot and coupling.

    Attributes:
        parameters: Meaning of the numbers.
        task: Of the movement.
        cost: Of an outcome.
        time_step: Between samples [s].
    """

    parameters: MovementParameters
    task: Task
    cost: Cost
    time_step: float = 0.01

    __repr__ = short_repr

    @property
    def at_once(self) -> int:
        """Suitable number of samples for one call."""
        return 64

    def __call__(self, samples: Array) -> Array:
        """Returns the costs (S,) or (S, N) of parameters (S, n)."""
        return self.cost(self.outcome(samples), self.task)

    def outcome(self, samples: Array) -> Outcome:
        """Returns the outcome of parameters (S, n)."""
        paths = roll_out(self.parameters, samples, self.time_step)
        return Outcome(paths.times, paths.positions, accelerations=lambda: paths.accelerations)

    def primitive_at(self, parameters: Array) -> MovementPrimitive:
        """Returns the primitive with parameters (n,)."""
        return self.parameters.primitive_at(parameters)

    def measure(self, parameters: Array) -> dict[str, float]:
        """Returns the terms of the cost of parameters (n,), before the weights."""
        return terms_of(self.cost, self.outcome(parameters[None]), self.task)


def roll_out(parameters: MovementParameters, samples: Array, time_step: float) -> PathBatch:
    """Returns rollouts, positions (S, N, 3), of parameters (S, n), from the start to each goal."""
    weights, goals = parameters.weights_and_goals(samples)
    primitive = parameters.primitive
    attractor, tau, start = primitive.translation, primitive.duration, primitive.start
    velocities = np.stack([attractor.start_velocity(start, goal, tau) for goal in goals])
    steps = number_of_steps(tau, time_step)
    return undisturbed_motions(attractor, weights, start, goals, velocities, tau, time_step, steps)
