"""Performing a learned motion that nothing disturbs: all of it at once.

See `stepwise_rollout` for motions among obstacles and to goals that move.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.approximators.registry import LinearForcingModel
from pepper_drake.learning.dmp.orientation import OrientationAttractor
from pepper_drake.learning.dmp.scaling import scaled
from pepper_drake.learning.dmp.transformation import TransformationModel, node_phases
from pepper_drake.learning.phase import PHASE_RATIO, gate, phase_at
from pepper_drake.learning.spring import (
    NODES,
    advance_all,
    forced_response,
    make_step,
    node_times,
    unforced_response,
)

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of D coordinates, or (leading axis S) of S rollouts at once.

    Attributes:
        times: (N,) [s].
        positions: (..., N, D).
        velocities: (..., N, D) by time.
        accelerations: (..., N, D) by time, coupling included.
        phases: (..., N).
        taus: (N,) duration as extended so far [s].
        coupling: (..., N, D) C_t at each sample.
        distances: (..., N) from the hand's centre to the nearest obstacle [m].
    """

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    phases: Array
    taus: Array
    coupling: Array | None = None
    distances: Array | None = None


class PathBatch:
    """S motions at once; derivatives are computed when they are first asked for.

    Attributes:
        times: (N,) [s].
        positions: (S, N, D).
        phases: (S, N).
        taus: (N,) duration [s].
        coupling: (S, N, D) C_t at each sample, where there were obstacles.
        distances: (S, N) from the hand's centre to the nearest obstacle [m], where there were.
    """

    def __init__(
        self,
        times: Array,
        positions: Array,
        phases: Array,
        taus: Array,
        derivative: Callable[[int], Array],
        coupling: Array | None = None,
        distances: Array | None = None,
    ) -> None:
        """Takes the attributes, and `derivative(order)` (S, N, D) by time."""
        self.times = times
        self.positions = positions
        self.phases = phases
        self.taus = taus
        self.coupling = coupling
        self.distances = distances
        self._derivative = derivative

    @classmethod
    def of(cls, motion: Motion) -> PathBatch:
        """Returns a motion with a leading axis as a batch."""
        return cls(
            motion.times,
            motion.positions,
            motion.phases,
            motion.taus,
            lambda order: (motion.velocities, motion.accelerations)[order - 1],
            motion.coupling,
            motion.distances,
        )

    @cached_property
    def velocities(self) -> Array:
        """(S, N, D) by time."""
        return self._derivative(1)

    @cached_property
    def accelerations(self) -> Array:
        """(S, N, D) by time, coupling included."""
        return self._derivative(2)


class Features(Hashable, Protocol):
    """Key of a linear model's features; equal keys have equal features."""

    def features(self, phases: npt.ArrayLike) -> Array:
        """Returns (N, K) features at phases (N,)."""
        ...


def number_of_steps(duration: float, time_step: float) -> int:
    """Returns the least number of steps that covers a duration."""
    return max(1, int(np.ceil(duration / time_step - 1e-6)))


def unforced_columns(steps: int, step: float, alpha_z: float) -> Array:
    """Returns (3, N, 2): y - g, y', y'' for tau = 1 after (offset, rate) at the start."""
    response = unforced_response(time_grid(steps, step), alpha_z)
    return np.concatenate((response, _curvature(response, 0.0, alpha_z)[None]))


def forced_columns(
    features: Callable[[Array], Array], steps: int, step: float, alpha_z: float
) -> Array:
    """Returns (3, N, K): y, y', y'' for tau = 1 that each feature of the forcing term causes."""
    alpha_x = alpha_z / PHASE_RATIO
    times = time_grid(steps, step)
    nodes = node_times(times)
    inputs = features(phase_at(nodes.ravel(), alpha_x)).reshape(steps, len(NODES), -1)
    response = forced_response(inputs, step, alpha_z)
    forcing = features(phase_at(times, alpha_x))
    return np.concatenate((response, _curvature(response, forcing, alpha_z)[None]))


def time_grid(steps: int, step: float) -> Array:
    """Returns (steps + 1,) multiples of a step."""
    return np.arange(steps + 1.0) * step


def _curvature(response: Array, inputs: Array | float, alpha_z: float) -> Array:
    return inputs - alpha_z * (response[1] + 0.25 * alpha_z * response[0])


@lru_cache(maxsize=32)
def _response_matrix(basis: Features, steps: int, step: float, alpha_z: float) -> Array:
    """Returns (3 N, K + 3): positions, rates, curvatures; see `response_matrix`."""
    alpha_x = alpha_z / PHASE_RATIO

    def features(phases: Array) -> Array:
        return np.column_stack((basis.features(phases), gate(phases, alpha_x)))

    forced = forced_columns(features, steps, step, alpha_z)
    columns = np.concatenate((forced, unforced_columns(steps, step, alpha_z)), axis=2)
    matrix = np.asfortranarray(columns.reshape(-1, columns.shape[2]))
    matrix.setflags(write=False)
    return matrix


def response_matrix(model: LinearForcingModel, steps: int, step: float, alpha_z: float) -> Array:
    """Returns (3 N, K + 3), cached by what the features depend on; see `forced_columns`.

    The last three columns answer the scaling's offset b, the start's offset from the goal, and
    the rate at the start.
    """
    basis: Any = getattr(model, "basis", model)
    return _response_matrix(basis, steps, step, alpha_z)


def _other_causes(attractor: TransformationModel, start: Array, goal: Array, rate: Array) -> Array:
    """Returns (3, D): what a motion has beside its weights, for the last columns."""
    offset = attractor.offset(start, goal)
    return np.stack((np.zeros(len(start)) if offset is None else offset, start - goal, rate))


def undisturbed_motion(
    attractor: TransformationModel,
    start: Array,
    goal: Array,
    start_velocity: Array,
    tau: float,
    time_step: float,
    steps: int,
) -> Motion:
    """Performs a motion to a goal at rest without coupling: a linear filter of the forcing term."""
    step = time_step / tau
    model = attractor.linear_model
    phases = phase_at(time_grid(steps, step), attractor.alpha_x)
    if model is not None:
        weights = scaled(model.weights, attractor.matrix(start, goal))
        columns = response_matrix(model, steps, step, attractor.alpha_z)
        rest = _other_causes(attractor, start, goal, start_velocity * tau)
        # Rows of coordinates: this product is a fifth faster than the one for rows of samples.
        motion = np.concatenate((weights, rest)).T @ columns.T
        motion = motion.reshape(-1, 3, steps + 1).transpose(1, 2, 0)
    else:
        motion = forced_columns(attractor.forcing(start, goal), steps, step, attractor.alpha_z)
        initial = np.stack((start - goal, start_velocity * tau))
        motion += unforced_columns(steps, step, attractor.alpha_z) @ initial
    return Motion(
        time_grid(steps, time_step),
        motion[0] + goal,
        motion[1] / tau,
        motion[2] / (tau * tau),
        phases,
        np.full(steps + 1, tau),
    )


def undisturbed_motions(
    attractor: TransformationModel,
    weights: Array,
    start: Array,
    goal: Array,
    start_velocity: Array,
    tau: float,
    time_step: float,
    steps: int,
) -> PathBatch:
    """Performs S motions with weights (S, K, D) at once; see `undisturbed_motion`.

    Goals and start velocities are (D,), or (S, D): each motion's own.
    """
    model = attractor.linear_model
    assert model is not None
    step = time_step / tau
    number, _, dimensions = weights.shape
    columns = response_matrix(model, steps, step, attractor.alpha_z)
    rate = start_velocity * tau
    if goal.ndim == 1:
        weights = scaled(weights, attractor.matrix(start, goal))
        rest = _other_causes(attractor, start, goal, rate)
        rest = np.broadcast_to(rest, (number, *rest.shape))
    else:
        own = zip(weights, goal, strict=True)
        weights = np.stack([scaled(w, attractor.matrix(start, g)) for w, g in own])
        pairs = zip(goal, rate, strict=True)
        rest = np.stack([_other_causes(attractor, start, g, v) for g, v in pairs])
    stacked = np.concatenate((weights, rest), axis=1)
    # Rows of coordinates, not of samples: the result is then a view of the product, not a copy.
    rows = np.moveaxis(stacked, 1, 2).reshape(number * dimensions, -1)

    def derivative(order: int) -> Array:
        part = columns[order * (steps + 1) : (order + 1) * (steps + 1)]
        values = (rows @ part.T).reshape(number, dimensions, steps + 1).swapaxes(1, 2)
        values /= tau**order
        return values

    positions = derivative(0)
    positions += goal[..., None, :]
    phases = phase_at(time_grid(steps, step), attractor.alpha_x)
    return PathBatch(
        time_grid(steps, time_step),
        positions,
        np.broadcast_to(phases, (number, steps + 1)),
        np.full(steps + 1, tau),
        derivative,
    )


def orientation_motion(
    orientation: OrientationAttractor,
    start: Array,
    goal: Array,
    motion: Motion,
    start_angular_velocity: Array | None = None,
) -> tuple[Array, Array]:
    """Performs an orientation (start and goal (4,)) in step with a translation.

    Args:
        orientation: The transformation system.
        start: (4,) unit quaternion.
        goal: (4,) unit quaternion.
        motion: The translation.
        start_angular_velocity: (3,) [rad/s]; that of the demonstration's start if left out.

    Returns:
        Orientations (N, 4) and angular velocities (N, 3) [rad/s] at the translation's samples.
    """
    tau = float(motion.taus[0])
    time_step = float(motion.times[1] - motion.times[0])
    state = orientation.start_state(start, goal, tau)
    if start_angular_velocity is not None:
        first = state.coordinates[0]
        rates = orientation.rates(first, start_angular_velocity)
        state = state._replace(coordinates=np.array((first, rates)))
    if motion.coupling is None:
        target = orientation.goal_coordinates(goal)
        steps = len(motion.times) - 1
        turned = undisturbed_motion(
            orientation.attractor,
            state.coordinates[0],
            target,
            state.coordinates[1],
            tau,
            time_step,
            steps,
        )
        coordinates, rates = turned.positions, turned.velocities
    else:
        decays = -np.diff(np.log(motion.phases)) / time_step
        target = orientation.goal_coordinates(goal)
        attractor = orientation.attractor
        nodes = node_phases(motion.phases[:-1], decays, time_step)
        forcing_at = attractor.forcing(state.coordinates[0], target)
        taus = motion.taus[:-1]
        inputs = forcing_at(nodes.ravel()).reshape(*nodes.shape, -1) / taus[:, None, None] ** 2
        different, which = np.unique(taus, return_inverse=True)  # Most motions have one tau.
        matrices = [make_step(one, time_step, attractor.alpha_z) for one in different.tolist()]
        states = advance_all(
            state.coordinates,
            target,
            np.ascontiguousarray(inputs),
            np.array([matrix.transition for matrix in matrices])[which],
            np.array([matrix.gain for matrix in matrices])[which],
        )
        coordinates, rates = states[:, 0], states[:, 1]
    return (
        orientation.orientation(coordinates, goal),
        orientation.angular_velocity(coordinates, rates),
    )
