"""The transformation system's linear part, solved exactly.

tau z' = alpha_z (beta_z (g - y) + tau g' - z) + u, tau y' = z, beta_z = alpha_z / 4 (equations 2.4
to 2.6 of the report; tau g' is zero unless the goal's velocity is known). With the state (y, v),
v = y', it reads, with w = alpha_z / (2 tau),

    y'' = w² (g - y) + 2 w (g' - y') + u / tau²,

critically damped: both eigenvalues are -w. v and not z is the state, so that tau may change while
the motion runs without a jump of the velocity.

Over a step of time the homogeneous part is multiplied by its matrix exponential. The input u
enters through its convolution with the impulse response t exp(-w t), by Gauss-Lobatto quadrature
with four nodes: exact in the linear part, of sixth order in the input.
A step of 20 ms and one of 1 ms therefore give the same motion. The first node is the step's start
and the last its end, so that a forcing term is evaluated three times a step.
"""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled

Array = npt.NDArray[np.float64]
Scalar = Any  # A float, or an AutoDiffXd for gradients.

NODES: Array = np.array([0.0, 0.5 - np.sqrt(0.05), 0.5 + np.sqrt(0.05), 1.0])
"""Gauss-Lobatto nodes in a step of length one, where inputs are evaluated."""

_NODE_WEIGHTS = np.array([1.0, 5.0, 5.0, 1.0]) / 12.0


class Step(NamedTuple):
    """One step's matrices, for states stacked as rows (y, v).

    Attributes:
        transition: (2, 2) of the state relative to the goal.
        gain: (2, 4) of the input u / tau² at the nodes.
    """

    transition: Array
    gain: Array


def make_step(tau: Scalar, time_step: float, alpha_z: float) -> Step:
    """Returns the matrices of a step of `time_step` [s]; tau [s] may be an AutoDiffXd."""
    if isinstance(tau, float):  # Including numpy's.
        return _cached_step(tau, time_step, alpha_z)
    return _make_step(tau, time_step, alpha_z)


def _make_step(tau: Scalar, time_step: float, alpha_z: float) -> Step:
    w = alpha_z / (2.0 * tau)
    h = time_step
    decay = np.exp(-w * h)
    transition = np.array([[1.0 + w * h, h], [-w * w * h, 1.0 - w * h]]) * decay
    rest = h * (1.0 - NODES)
    weights = h * _NODE_WEIGHTS * np.exp(rest * -w)
    return Step(transition, np.stack((weights * rest, weights * (1.0 - rest * w))))


@lru_cache(maxsize=256)
def _cached_step(tau: float, time_step: float, alpha_z: float) -> Step:
    step = _make_step(tau, time_step, alpha_z)
    for matrix in step:
        matrix.setflags(write=False)
    return step


def advance(state: Array, goal: Array, inputs: Array, step: Step, time_step: float) -> Array:
    """Returns the state after one step.

    Args:
        state: (..., 2, D) position and velocity.
        goal: (2, D) position and velocity of the goal at the step's start; it moves at that
            velocity.
        inputs: (..., 4, D) u / tau² at the step's nodes.
        step: From `make_step`.
        time_step: The step's length [s].
    """
    moved = step.transition @ (state - goal) + step.gain @ inputs + goal
    moved[..., 0, :] += goal[1] * time_step
    return moved


@compiled
def advance_one(
    state: Array,
    goal: Array,
    lag: Array,
    forcing: Array,
    coupling: Array,
    tau: float,
    time_step: float,
    alpha_z: float,
) -> Array:
    """Returns one state (2, D) after one step: `make_step` and `advance` as a scalar loop.

    Args:
        state: (2, D) position and velocity.
        goal: (2, D) position and velocity of the goal.
        lag: (D,) of the delayed goal from the goal, decaying at the rate w.
        forcing: (4, D) u at the step's nodes, without coupling.
        coupling: (D,) held over the step.
        tau: [s].
        time_step: [s].
        alpha_z: The spring's constant.
    """
    w, h = alpha_z / (2.0 * tau), time_step
    decay = math.exp(-w * h)
    moved = np.empty_like(state)
    for d in range(state.shape[1]):
        offset, rate = state[0, d] - goal[0, d], state[1, d] - goal[1, d]
        moved[0, d] = decay * ((1.0 + w * h) * offset + h * rate) + goal[0, d] + goal[1, d] * h
        moved[1, d] = decay * ((1.0 - w * h) * rate - w * w * h * offset) + goal[1, d]
    for m in range(len(NODES)):
        rest, fading = h * (1.0 - NODES[m]), math.exp(-w * h * NODES[m])
        weight = h * _NODE_WEIGHTS[m] * math.exp(-w * rest)
        for d in range(state.shape[1]):
            pull = (forcing[m, d] + coupling[d]) / (tau * tau) + fading * lag[d] * w * w
            moved[0, d] += weight * rest * pull
            moved[1, d] += weight * (1.0 - w * rest) * pull
    return moved


@compiled
def advance_all(
    state: Array,
    goal: Array,
    inputs: Array,
    transitions: Array,
    gains: Array,
) -> Array:
    """Returns the states (N + 1, 2, D) of N steps of `advance` to a goal at rest.

    Args:
        state: (2, D) position and velocity at the start.
        goal: (D,).
        inputs: (N, 4, D) u / tau² at each step's nodes.
        transitions: (N, 2, 2) of each step; see `Step`.
        gains: (N, 2, 4) likewise.
    """
    count, nodes, size = inputs.shape
    states = np.empty((count + 1, 2, size))
    states[0] = state
    for n in range(count):
        for d in range(size):
            offset, rate = states[n, 0, d] - goal[d], states[n, 1, d]
            for i in range(2):
                driven = 0.0
                for m in range(nodes):
                    driven += gains[n, i, m] * inputs[n, m, d]
                free = transitions[n, i, 0] * offset + transitions[n, i, 1] * rate
                states[n + 1, i, d] = free + driven
            states[n + 1, 0, d] += goal[d]
    return states


def acceleration(state: Array, goal: Array, forcing: Array, tau: Scalar, alpha_z: float) -> Array:
    """Returns y'' (..., D) for a state (..., 2, D), goal (2, D) and u (..., D) [m/s²]."""
    w = alpha_z / (2.0 * tau)
    offset = goal - state
    return offset[..., 0, :] * (w * w) + offset[..., 1, :] * (2.0 * w) + forcing / (tau * tau)


def unforced_response(relative_times: Array, alpha_z: float) -> Array:
    """Returns (2, N, 2): (y - g) and its rate after (offset, rate) at time zero, for tau = 1."""
    w = 0.5 * alpha_z
    s = relative_times
    decay = np.exp(-w * s)
    return np.array(
        [
            np.stack((decay * (1.0 + w * s), decay * s), axis=-1),
            np.stack((-decay * w * w * s, decay * (1.0 - w * s)), axis=-1),
        ]
    )


def forced_response(inputs: Array, step: float, alpha_z: float) -> Array:
    """Returns the motion that inputs cause from rest at zero, for tau = 1.

    The recursion of `advance` is a linear filter of second order; this applies it to all steps
    and columns at once.

    Args:
        inputs: (M, 4, K) u at the nodes of M equal steps.
        step: Length of a step in relative time.
        alpha_z: The spring's constant.

    Returns:
        (2, M + 1, K) positions and velocities.
    """
    transition, gain = make_step(1.0, step, alpha_z)
    added = np.tensordot(gain, inputs, axes=(1, 1))
    # x[k+1] = A x[k] + b[k] obeys x[k+1] = tr(A) x[k] - det(A) x[k-1] + b[k] - adj(A) b[k-1].
    ((a, b), (c, d)) = transition
    driven = np.zeros((2, inputs.shape[0] + 1, inputs.shape[2]))
    driven[:, 1:] = added
    driven[0, 2:] += b * added[1, :-1] - d * added[0, :-1]
    driven[1, 2:] += c * added[0, :-1] - a * added[1, :-1]
    # Imported here: it loads scipy.stats, which would delay the start of every app by half a
    # second.
    from scipy.signal import lfilter

    return lfilter([1.0], [1.0, -(a + d), a * d - b * c], driven, axis=1)


def node_times(relative_times: Array) -> Array:
    """Returns (M, 4): the nodes of the M intervals between relative times (M + 1,)."""
    return relative_times[:-1, None] + np.diff(relative_times)[:, None] * NODES


def forced_response_at(inputs: Array, relative_times: Array, alpha_z: float) -> Array:
    """Returns the `forced_response` for steps of different lengths.

    Args:
        inputs: (M, 4, K) u at `node_times(relative_times)`.
        relative_times: (M + 1,) increasing.
        alpha_z: The spring's constant.

    Returns:
        (2, M + 1, K) positions and velocities.
    """
    lengths = np.diff(relative_times)
    if np.ptp(lengths) <= 1e-6 * lengths.mean():
        return forced_response(inputs, float(lengths.mean()), alpha_z)
    response = np.zeros((len(relative_times), 2, inputs.shape[2]))
    rest = np.zeros((2, inputs.shape[2]))
    for k, length in enumerate(lengths):
        step = _make_step(1.0, length, alpha_z)
        response[k + 1] = advance(response[k], rest, inputs[k], step, length)
    return np.moveaxis(response, 1, 0)
