"""Rollouts integrated step by step, as by the LeafSystems: with obstacles or a moving goal."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.dmp.arithmetic import arithmetic
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.learning.dmp.rollout import Motion, number_of_steps, time_grid
from pepper_drake.learning.dmp.transformation import (
    DelayedGoal,
    Forcing,
    TransformationModel,
    node_phases,
)
from pepper_drake.learning.phase import extended_tau, phase_at
from pepper_drake.learning.spring import NODES, forced_response, unforced_response

Array = npt.NDArray[np.float64]
GoalFunction = Callable[[float], tuple[Array, Array]]

LONGEST = 10.0
"""A rollout that obstacles delay ends after this many nominal durations."""

_WHOLE, _FIRST_BLOCK = 1_000_000, 16
"""Steps that are tried at once without coupling: all of them first; few after a push, then more."""


def integrate(
    attractor: TransformationModel,
    state: Array,
    goal_at: GoalFunction | Array,
    tau: float,
    time_step: float,
    settle: float,
    coupling: Coupling | None,
    field: PointCloudDistance | None,
    extension: float,
    weights: Array | None = None,
) -> Motion:
    """Integrates a motion step by step.

    Args:
        attractor: The transformation system.
        state: (..., 2, D) position and velocity at the start.
        goal_at: The goal (D,), or a function that gives its position and velocity at a time [s].
        tau: Nominal duration [s].
        time_step: [s].
        settle: Time to continue after the motion's end, in tau.
        coupling: Coupling term of the obstacles.
        field: The obstacles' distance field, or None.
        extension: Extension of tau per displacement of the goal [s/m].
        weights: (S, K, D) for S motions at once; the state is then (S, 2, D).
    """
    shape = state.shape[:-2]
    start = state[..., 0, :].reshape(-1, state.shape[-1])[0]
    end = float(phase_at(1.0 + settle, attractor.alpha_x)) * np.exp(1e-6)
    nominal = tau
    longest = number_of_steps(LONGEST * tau * (1.0 + settle), time_step)
    moving = callable(goal_at)
    known = seen = goal_at(0.0)[0] if callable(goal_at) else goal_at
    goal = DelayedGoal.at(known)
    obstacles = None if coupling is None or field is None else _Obstacles(coupling, field, shape)
    forcing = attractor.forcing(start, known, weights)
    phase = np.ones(shape)
    value = forcing(phase[..., None])[..., 0, :]
    record = _Record()
    block = _WHOLE
    while True:
        if callable(goal_at):
            seen, velocity = goal_at(record.count * time_step)
            goal = goal.seen(seen, velocity)
            if attractor.scaling not in ("none", "amplitude"):
                forcing = attractor.forcing(start, goal.delayed, weights)
                value = forcing(phase[..., None])[..., 0, :]
        total = attractor.acceleration(state, goal, value, tau)
        push, slowdown = None, 0.0
        if obstacles is not None:
            push, slowdown = obstacles.push(state, total, goal, tau)
            if push is None and not moving and not shape:
                run = _undisturbed(
                    attractor, forcing, state, goal, phase, tau, time_step, block, end
                )
                steps = obstacles.undisturbed_steps(run, goal, tau)
                block = 2 * block if steps == run.steps else _FIRST_BLOCK
                record.extend(run, steps, tau)
                state, phase, value = run.states[steps], run.phases[steps], run.values[steps]
                if phase <= end:
                    record.append(state, run.totals[steps], phase, tau, None)
                    break
                continue
            if push is not None:
                total = total + push / (tau * tau)
        record.append(state, total, phase, tau, push)
        over = (phase <= end).all() if shape else phase <= end
        if over or record.count > longest:
            break
        decay = attractor.alpha_x / (tau * (1.0 + slowdown))
        phases = node_phases(phase, decay, time_step)
        values = np.empty((*shape, len(NODES), state.shape[-1]))
        values[..., 0, :] = value
        values[..., 1:, :] = forcing(phases[..., 1:])
        state = attractor.advance(state, goal, values, tau, time_step, push)
        phase, value = phases[..., -1], values[..., -1, :]
        if moving:
            goal = goal.later(time_step, attractor.goal_rate(tau))
            tau = extended_tau(tau, nominal, known, seen, extension)
    return record.motion(time_step, field)


class _Run:
    """Some steps of an undisturbed motion: states, accelerations, phases, forcing."""

    def __init__(self, states: Array, totals: Array, phases: Array, values: Array) -> None:
        self.states = states
        self.totals = totals
        self.phases = phases
        self.values = values
        self.steps = len(phases) - 1


def _undisturbed(
    attractor: TransformationModel,
    forcing: Forcing,
    state: Array,
    goal: DelayedGoal,
    phase: Array,
    tau: float,
    time_step: float,
    steps: int,
    end: float,
) -> _Run:
    """Returns at most `steps` steps from a state (2, D) to a fixed goal, not beyond the end."""
    step = time_step / tau
    left = float(np.log(phase / end)) / (attractor.alpha_x * step)
    steps = max(1, min(steps, int(np.ceil(left))))
    nodes = (np.arange(float(steps))[:, None] + NODES[1:]).ravel() * step
    phases = phase * np.concatenate(([1.0], phase_at(nodes, attractor.alpha_x)))
    values = forcing(phases)
    inputs = values[3 * np.arange(steps)[:, None] + np.arange(len(NODES))]
    initial = np.stack((state[0] - goal.position, state[1] * tau))
    response = forced_response(inputs, step, attractor.alpha_z)
    response += unforced_response(time_grid(steps, step), attractor.alpha_z) @ initial
    states = np.stack((response[0] + goal.position, response[1] / tau), axis=1)
    totals = attractor.acceleration(states, goal, values[::3], tau)
    return _Run(states, totals, phases[::3], values[::3])


class _Obstacles:
    """Coupling along a motion, evaluated only where it can be non-zero."""

    def __init__(
        self, coupling: Coupling, field: PointCloudDistance, shape: tuple[int, ...]
    ) -> None:
        self._coupling = coupling
        self._field = field
        self._goal_line: Array | None = None
        self._clearance = 0.0
        self._pushed = False
        self._distance: Any = np.zeros(shape) if shape else 0.0
        self._position: Any = np.zeros((*shape, 3))

    def push(
        self, state: Array, acceleration: Array, goal: DelayedGoal, tau: float
    ) -> tuple[Array | None, Any]:
        """Returns C_t (..., 3), None where it is zero, and the slowdown (...)."""
        if not self._pushed and not self._may_push(state, acceleration):
            return None, 0.0
        self._find_clearance(goal)
        push = self._coupling.push(
            self._field, state, acceleration, goal.position, self._clearance, tau
        )
        self._distance, self._position = push.distance, state[..., 0, :]
        self._pushed = bool(np.vdot(push.coupling, push.coupling))
        return (push.coupling, push.slowdown) if self._pushed else (None, 0.0)

    def _may_push(self, state: Array, acceleration: Array) -> bool:
        xp, vector, _, dot, plus, _, anything = arithmetic(state)
        moved = plus(vector(state[..., 0, :]), self._position, -1.0)
        nearest = self._distance - xp.sqrt(dot(moved, moved))
        return anything(nearest <= self._coupling.zero_beyond(state, acceleration))

    def undisturbed_steps(self, run: _Run, goal: DelayedGoal, tau: float) -> int:
        """Returns the number of steps of a run before obstacles push for the first time.

        The first state of the run counts as not pushed.
        """
        moved = run.states[:, 0] - self._position
        nearest = self._distance - np.sqrt(np.einsum("ij,ij->i", moved, moved))
        silent = self._coupling.zero_beyond(run.states, run.totals)
        near = np.flatnonzero(nearest <= silent)
        near = near[near > 0]
        if not len(near):
            return run.steps
        silent = silent[near]
        within = float(silent.max())
        near = near[self._field.distance(run.states[near, 0], within=within) <= silent]
        steps = run.steps
        if len(near):
            self._find_clearance(goal)
            push = self._coupling.push(
                self._field, run.states[near], run.totals[near], goal.position, self._clearance, tau
            )
            pushed = near[push.coupling.any(axis=-1)]
            steps = int(pushed[0]) if len(pushed) else run.steps
        self._position = run.states[steps, 0]
        self._distance = float(self._field.distance(self._position))
        return steps

    def _find_clearance(self, goal: DelayedGoal) -> None:
        if self._goal_line is not goal.line:
            self._goal_line = goal.line
            self._clearance = self._coupling.clearance(self._field, goal.position)


class _Record:
    """Collects the samples of a motion."""

    def __init__(self) -> None:
        self.count = 0
        self._states: list[Array] = []
        self._totals: list[Array] = []
        self._phases: list[Array] = []
        self._pushes: list[Array] = []
        self._taus: list[float] = []

    def append(
        self, state: Array, total: Array, phase: Array, tau: float, push: Array | None
    ) -> None:
        """Adds one sample."""
        push = np.zeros(total.shape) if push is None else push
        self._add(state[None], total[None], np.asarray(phase)[None], push[None], tau)

    def extend(self, run: _Run, steps: int, tau: float) -> None:
        """Adds the first samples of a run."""
        totals = run.totals[:steps]
        self._add(run.states[:steps], totals, run.phases[:steps], np.zeros(totals.shape), tau)

    def _add(self, states: Array, totals: Array, phases: Array, pushes: Array, tau: float) -> None:
        self.count += len(states)
        self._states.append(states)
        self._totals.append(totals)
        self._phases.append(phases)
        self._pushes.append(pushes)
        self._taus.extend([tau] * len(states))

    def motion(self, time_step: float, field: PointCloudDistance | None) -> Motion:
        """Returns all samples."""
        axis = self._totals[0].ndim - 2

        def samples(values: list[Array]) -> Array:
            return np.moveaxis(np.concatenate(values), 0, axis)

        path = samples(self._states)
        return Motion(
            time_grid(self.count - 1, time_step),
            path[..., 0, :],
            path[..., 1, :],
            samples(self._totals),
            samples(self._phases),
            np.array(self._taus),
            samples(self._pushes),
            None if field is None else field.distance(path[..., 0, :]),
        )
