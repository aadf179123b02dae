"""The transformation system: a spring-damper to the goal and a learned forcing term."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.approximators.gaussian_forcing import GaussianForcing
from pepper_drake.learning.approximators.registry import (
    ForcingData,
    ForcingModel,
    LinearForcingModel,
    get_approximator,
)
from pepper_drake.learning.dmp.num_basis import check_num_basis
from pepper_drake.learning.dmp.scaling import (
    MotionFrame,
    check_scaling,
    scaled,
    scaling_matrix,
    scaling_offset,
    unscaled,
)
from pepper_drake.learning.phase import ALPHA_Z, GOAL_THRESHOLD, PHASE_RATIO, gate, phase_at
from pepper_drake.learning.spring import (
    NODES,
    acceleration,
    advance,
    advance_one,
    forced_response_at,
    make_step,
    node_times,
    unforced_response,
)
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]
Scalar = Any  # A float, or an AutoDiffXd for gradients.

Forcing = Callable[[Array], Array]
"""A forcing term with its scaling: phases (..., M) to (..., M, D)."""

_NODES = NODES.tolist()

_is_linear: dict[type, bool] = {}
"""For each class of forcing models, whether they are linear in their weights."""


@dataclass(frozen=True, eq=False)
class MotionSample:
    """A demonstrated motion in D coordinates, in relative time (0 to 1; tau = 1).

    Attributes:
        times: (N,) relative times from 0 to 1.
        positions: (N, D).
        rates: (N, D) derivatives by relative time.
        curvatures: (N, D) second derivatives by relative time.
    """

    times: Array
    positions: Array
    rates: Array
    curvatures: Array


class DelayedGoal(NamedTuple):
    """The goal of the attractor at one time.

    The spring pulls towards a delayed goal d that follows the goal g smoothly:
    tau d' = alpha_z / 2 (g - d) + tau g'.

    Attributes:
        line: (2, D) position of the goal and its known velocity, zero if unknown.
        lag: (D,) d - g; None without delay.
    """

    line: Array
    lag: Array | None = None

    @classmethod
    def at(cls, position: Array) -> "DelayedGoal":
        """Returns a goal at rest, without delay."""
        return cls(np.array((position, np.zeros(len(position)))))

    @property
    def position(self) -> Array:
        """(D,) position of the goal."""
        return self.line[0]

    @property
    def delayed(self) -> Array:
        """(D,) the delayed goal, to which the spring pulls."""
        return self.line[0] if self.lag is None else self.line[0] + self.lag

    def seen(self, position: Array, velocity: Array | None = None) -> "DelayedGoal":
        """Returns the goal after an observation; moves under `GOAL_THRESHOLD` are ignored.

        Args:
            position: (D,).
            velocity: (D,); None means as it is known.
        """
        displacement = position - self.position
        moved = displacement @ displacement > GOAL_THRESHOLD**2
        if not moved and velocity is None:
            return self
        velocity = self.line[1] if velocity is None else velocity
        if not moved:
            return DelayedGoal(np.array((self.position, velocity)), self.lag)
        return DelayedGoal(np.array((position, velocity)), self.delayed - position)

    def later(self, time_step: float, rate: Scalar) -> "DelayedGoal":
        """Returns the goal `time_step` later; `rate` is the attractor's `goal_rate`."""
        position = self.line[0] + self.line[1] * time_step
        lag = None if self.lag is None else self.lag * np.exp(-rate * time_step)
        return DelayedGoal(np.array((position, self.line[1])), lag)


@dataclass(frozen=True, eq=False)
class TransformationModel:
    """A transformation system in D coordinates (equations 2.4 to 2.6 of the report).

    Attributes:
        model: The forcing term as a function of the phase.
        scaling: How the motion adapts to start and goal; see `scaling`.
        frame: Start, goal and extent of the demonstration.
        start_rate: (D,) velocity of the demonstration's start, by relative time.
        alpha_z: Constant of the spring; its damper is critical.
    """

    __repr__ = short_repr

    model: ForcingModel
    scaling: str
    frame: MotionFrame
    start_rate: Array
    alpha_z: float = ALPHA_Z

    @property
    def alpha_x(self) -> float:
        """Decay rate of the phase."""
        return self.alpha_z / PHASE_RATIO

    @cached_property
    def linear_model(self) -> LinearForcingModel | None:
        """The forcing term if it is linear in its weights, else None."""
        # isinstance of a protocol takes longer than ten steps: once for each class.
        kind, model = type(self.model), self.model
        if kind not in _is_linear:
            _is_linear[kind] = isinstance(model, LinearForcingModel)
        return cast(LinearForcingModel, model) if _is_linear[kind] else None

    @cached_property
    def _gaussian(self) -> GaussianForcing | None:
        """The forcing term if its basis functions have the offset's gate, else None."""
        model = self.model
        gated = isinstance(model, GaussianForcing) and model.basis.alpha_x == self.alpha_x
        return cast(GaussianForcing, model) if gated else None

    def matrix(self, start: Array, goal: Array) -> Array | None:
        """Returns the scaling's matrix S for a start and a goal."""
        return scaling_matrix(self.scaling, self.frame, start, goal)

    def offset(self, start: Array, goal: Array) -> Array | None:
        """Returns the scaling's offset b for a start and a goal."""
        return scaling_offset(self.scaling, self.frame, start, goal, self.alpha_z)

    def forcing(self, start: Array, goal: Array, weights: Array | None = None) -> Forcing:
        """Returns the forcing term between a start (D,) and a goal (D,).

        Args:
            start: (D,) start of the motion.
            goal: (D,) the spring's goal.
            weights: (K, D) instead of the model's; or (S, K, D) for S forcing terms with the
                model's features, the function then takes phases (S, M).
        """
        matrix, offset = self.matrix(start, goal), self.offset(start, goal)
        model, linear = self.model, self.linear_model
        one = weights is None or weights.ndim == 2
        gaussian = self._gaussian if matrix is None and one else None
        given = None
        if gaussian is None:
            if offset is not None and (offset == 0.0).all():
                offset = None
            if weights is not None and linear is not None and one:
                given = linear.with_weights(weights)

        def forcing(phases: Array) -> Array:
            if gaussian is not None and phases.ndim == 1:
                own = gaussian.weights if weights is None else weights
                return gaussian.basis.combine(phases, own, offset)
            if weights is None or linear is None:
                values = model(phases)
            elif given is not None and phases.ndim == 1:
                values = given(phases)  # Without building the features.
            else:
                values = linear.features(phases.ravel()).reshape(*phases.shape, -1) @ weights
            values = scaled(values, matrix)
            if offset is None:
                return values
            return values + gate(phases, self.alpha_x)[..., None] * offset

        return forcing

    def start_velocity(self, start: Array, goal: Array, tau: Scalar) -> Array:
        """Returns the velocity (D,) of the demonstration's start, scaled like the forcing term."""
        demonstrated = scaling_matrix(self.scaling, self.frame, self.frame.start, self.frame.goal)
        if demonstrated is None or self.scaling == "amplitude":
            return self.start_rate / tau
        rate = unscaled(self.start_rate[None], demonstrated, self.scaling)
        return scaled(rate, self.matrix(start, goal))[0] / tau

    def with_model(self, model: ForcingModel) -> "TransformationModel":
        """Returns the same attractor with another forcing term."""
        return replace(self, model=model)

    def acceleration(self, state: Array, goal: DelayedGoal, forcing: Array, tau: Scalar) -> Array:
        """Returns the acceleration without coupling, (..., D).

        Args:
            state: (..., 2, D) position and velocity.
            goal: The spring's goal.
            forcing: (..., D) the forcing term.
            tau: [s].
        """
        undelayed = acceleration(state, goal.line, forcing, tau, self.alpha_z)
        if goal.lag is None:
            return undelayed
        w = self.alpha_z / (2.0 * tau)
        return undelayed + (w * w) * goal.lag

    def advance(
        self,
        state: Array,
        goal: DelayedGoal,
        forcing: Array,
        tau: Scalar,
        time_step: float,
        coupling: Array | None = None,
    ) -> Array:
        """Returns the state one step later, exactly but for the quadrature of `spring`.

        Args:
            state: (..., 2, D) position and velocity.
            goal: The spring's goal at the step's start.
            forcing: (..., 4, D) the forcing term at the step's `node_phases`.
            tau: [s].
            time_step: [s].
            coupling: (..., D) C_t, held over the step; None means zero.
        """
        parts = (state, *goal, forcing, coupling)
        if state.ndim == 2 and isinstance(tau, float) and not any(map(_is_other, parts)):
            # Copies: read-only or strided arrays would trigger another compilation.
            rest = np.zeros(state.shape[1])
            one: Array = advance_one(
                np.array(state),
                np.array(goal.line),
                rest if goal.lag is None else np.array(goal.lag),
                np.array(forcing),
                rest if coupling is None else np.array(coupling),
                tau,
                time_step,
                self.alpha_z,
            )
            return one
        inputs = forcing if coupling is None else forcing + coupling[..., None, :]
        inputs = inputs / (tau * tau)
        if goal.lag is not None:
            w = self.alpha_z / (2.0 * tau)
            fading = np.exp(NODES * (-self.goal_rate(tau) * time_step))
            inputs = inputs + np.multiply.outer(fading, goal.lag) * (w * w)
        step = make_step(tau, time_step, self.alpha_z)
        return advance(state, goal.line, inputs, step, time_step)

    def goal_rate(self, tau: Scalar) -> Scalar:
        """Returns the rate at which the delayed goal follows the goal [1/s]."""
        return self.alpha_z / (2.0 * tau)


def _is_other(part: Array | None) -> bool:
    """Tells whether an array holds anything but floats."""
    return part is not None and part.dtype != np.float64


def node_phases(phase: Scalar, decay: Scalar, time_step: float) -> Array:
    """Returns the phases (..., 4) at a step's nodes.

    Args:
        phase: (...) at the step's start.
        decay: (...) -x' / x [1/s], constant over the step.
        time_step: [s].
    """
    if isinstance(phase, float) and isinstance(decay, float):
        return np.array([phase * math.exp(-decay * time_step * node) for node in _NODES])
    exponents = np.asarray(decay)[..., None] * (-time_step * NODES)
    return np.asarray(phase)[..., None] * np.exp(exponents)


def forcing_target(sample: MotionSample, alpha_z: float) -> Array:
    """Returns the forcing term (N, D) that produces a motion: equation 2.8.

    f = y'' - alpha_z (beta_z (g - y) - y'), derivatives by relative time, g the last position.
    """
    offset = sample.positions[-1] - sample.positions
    return sample.curvatures - alpha_z * (alpha_z / 4.0 * offset - sample.rates)


def learn_attractor(
    samples: list[MotionSample],
    approximator: str,
    num_basis: int,
    scaling: str,
    alpha_z: float = ALPHA_Z,
    seed: int = 0,
) -> TransformationModel:
    """Learns one attractor from one or several motions.

    Of several motions, start, goal, extent and start velocity are the means.

    Raises:
        InputError: An unknown name, too few or too many basis functions, or a motion that the
            scaling cannot express.
    """
    check_scaling(scaling)
    check_num_basis(num_basis)
    fit = get_approximator(approximator).fit
    frame = MotionFrame(
        start=np.mean([s.positions[0] for s in samples], axis=0),
        goal=np.mean([s.positions[-1] for s in samples], axis=0),
        extent=np.mean([_extent(s.positions) for s in samples], axis=0),
    )
    alpha_x = alpha_z / PHASE_RATIO
    targets, responses, scales = [], [], []
    for sample in samples:
        start, goal = sample.positions[0], sample.positions[-1]
        offset = goal - sample.positions
        matrix = scaling_matrix(scaling, frame, start, goal)
        unforced = unforced_response(sample.times, alpha_z)[0]
        response = -offset - unforced @ np.stack((-offset[0], sample.rates[0]))
        target = forcing_target(sample, alpha_z)
        shift = scaling_offset(scaling, frame, start, goal, alpha_z)
        if shift is not None and len(samples) > 1:
            nodes = node_times(sample.times)
            gates = gate(phase_at(nodes, alpha_x), alpha_x)[..., None]
            path = forced_response_at(gates, sample.times, alpha_z)[0]
            response = response - path * shift
            target = target - gate(phase_at(sample.times, alpha_x), alpha_x)[:, None] * shift
        targets.append(unscaled(target, matrix, scaling))
        responses.append(unscaled(response, matrix, scaling))
        sizes = np.ones(len(start)) if matrix is None else np.linalg.norm(matrix, axis=1)
        scales.append(np.broadcast_to(sizes, offset.shape))
    times = np.concatenate([s.times for s in samples])
    data = ForcingData(
        phases=phase_at(times, alpha_x),
        times=times,
        targets=np.concatenate(targets),
        responses=np.concatenate(responses),
        scales=np.concatenate(scales),
        lengths=tuple(len(s.times) for s in samples),
        alpha_x=alpha_x,
        alpha_z=alpha_z,
    )
    return TransformationModel(
        model=fit(data, num_basis, seed),
        scaling=scaling,
        frame=frame,
        start_rate=np.mean([s.rates[0] for s in samples], axis=0),
        alpha_z=alpha_z,
    )


def _extent(positions: Array) -> Array:
    extent = np.ptp(positions, axis=0)
    return np.where(extent > 0.0, extent, 1.0)
