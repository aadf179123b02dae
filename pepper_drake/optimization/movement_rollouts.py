"""Rollouts of movements for their cost: the common interface and its factory."""

from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.optimization.cost import Cost
from pepper_drake.optimization.cost_terms import Task
from pepper_drake.optimization.fast_rollouts import FastRollouts
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.optimization.parameters import (
    MovementParameters,
    all_weights,
    joint_bumps,
    smooth_bumps,
)

if TYPE_CHECKING:
    from pepper_drake.scenario import Scenario

Array = npt.NDArray[np.float64]

ROLLOUTS = ("fast", "kinematics", "diagram")
"""The primitive alone; the whole arm without dynamics; Pepper, its cameras and the scene."""

FREE = ("hand", "joints", "arm")
"""The hand's path; the joints, which move the hand; the hand's path and the redundant joints."""

KERNELS = 6
"""Default number of bumps in a search over joints."""


class MovementRollouts(Protocol):
    """An evaluator of movements."""

    @property
    def parameters(self) -> MovementParameters:
        """The searched parameters."""
        ...

    @property
    def task(self) -> Task:
        """The task."""
        ...

    @property
    def cost(self) -> Cost:
        """Cost of an outcome."""
        ...

    def __call__(self, samples: Array) -> Array:
        """Returns the costs (S,) or (S, N) of parameters (S, n)."""
        ...

    def outcome(self, samples: Array) -> Outcome:
        """Returns the outcome of parameters (S, n)."""
        ...

    def primitive_at(self, parameters: Array) -> MovementPrimitive:
        """Returns the primitive of parameters (n,)."""
        ...

    def measure(self, parameters: Array) -> dict[str, float]:
        """Returns quantities by name that are cheap to compute for parameters (n,)."""
        ...


def make_parameters(
    primitive: MovementPrimitive, free: str, kernels: int | None, *, end_state: bool
) -> MovementParameters:
    """Makes the parameters of a search.

    Args:
        primitive: Where the search starts.
        free: One of `FREE`.
        kernels: Number of bumps; left out, all weights of the hand's path, or `KERNELS` of joints.
        end_state: Whether the movement may end elsewhere.

    Raises:
        InputError: `free` is unknown, or the primitive lacks what it names.
    """
    if free == "hand":
        if kernels is None:
            return all_weights(primitive, end_state=end_state)
        return smooth_bumps(primitive, kernels, end_state=end_state)
    count = KERNELS if kernels is None else kernels
    if free == "joints":
        return joint_bumps(primitive, count, end_state=end_state)
    if free == "arm":
        return smooth_bumps(primitive, count, end_state=end_state, posture=True)
    raise InputError(f"free: '{free}' is unknown; use one of {', '.join(FREE)}")


def make_rollouts(
    name: str,
    parameters: MovementParameters,
    task: Task,
    cost: Cost,
    scenario: "Scenario | None" = None,
) -> MovementRollouts:
    """Makes an evaluator.

    Args:
        name: One of `ROLLOUTS`.
        parameters: The searched parameters.
        task: Of the movement.
        cost: Of an outcome.
        scenario: Scene and settings of Pepper's reach, for `diagram`.

    Raises:
        InputError: The arguments do not fit together.
    """
    led_by_joints = parameters.directions.shape[1] == 0
    if name != "kinematics" and parameters.posture is not None:
        raise InputError("free: joints are searched on kinematics only; give --rollouts kinematics")
    if name == "fast":
        return FastRollouts(parameters, task, cost)
    if name == "kinematics":
        from pepper_drake.optimization.kinematic_rollouts import KinematicRollouts

        led_by = "joints" if led_by_joints else "hand"
        return KinematicRollouts(parameters, task, cost, led_by=led_by)
    if name == "diagram":
        from pepper_drake.optimization.diagram_rollouts import DiagramRollouts

        if scenario is None:
            raise InputError("rollouts: diagram needs a scenario to reach in")
        return DiagramRollouts(parameters, task, cost, scenario)
    raise InputError(f"rollouts: '{name}' is unknown; use one of {', '.join(ROLLOUTS)}")
