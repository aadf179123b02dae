"""DS-GMR: virtual spring-dampers whose activations and attractors come from a mixture.

Appendix C.1 of "Learning By Demonstration" (SoftBank Robotics, 2018); Calinon, Li, Alizadeh,
Tsagarakis, Caldwell, "Statistical dynamical systems for skills acquisition in humanoids",
Humanoids 2012, DOI 10.1109/HUMANOIDS.2012.6651539.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.demonstrations.alignment import align
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.phase import ALPHA_Z
from pepper_drake.learning.probabilistic.gaussian_mixture import Regression
from pepper_drake.learning.probabilistic.tp_gmm import (
    TaskFrame,
    TaskParameterizedMixture,
    fit_points,
)
from pepper_drake.learning.spring import NODES, acceleration, advance, make_step
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

REST_END = 1.2
"""Relative time until which demonstrations are extended at rest and attractors move."""

NUM_SAMPLES, NUM_REST = 100, 20


@dataclass(frozen=True)
class DsGmr:
    """y'' = w² (a(s) - y) - 2 w y', w = alpha_z / (2 duration): a spring to a moving attractor.

    The attractor a(s) is the sum of the components' attractors, sum_k h_k(s) (mu_k + line), each a
    point in one or more frames, weighted by the precision of the demonstrations there.

    Attributes:
        attractors: The mixture of (s, a), per frame.
        duration: Median duration of the demonstrations [s].
        alpha_z: Stiffness constant of the spring (its damper is critical).
    """

    attractors: TaskParameterizedMixture
    duration: float
    alpha_z: float = ALPHA_Z

    __repr__ = short_repr

    def attractor(self, frames: Sequence[TaskFrame], relative_times: npt.ArrayLike) -> Regression:
        """Returns attractors (N, 3) [m] and their covariances at relative times s."""
        clock = np.clip(np.asarray(relative_times, dtype=float), 0.0, REST_END)
        return self.attractors.in_frames(frames).regress(clock[:, None])

    def activations(self, frames: Sequence[TaskFrame], relative_times: npt.ArrayLike) -> Array:
        """Returns the activations h (N, K) of the spring-dampers at relative times s."""
        clock = np.clip(np.asarray(relative_times, dtype=float), 0.0, REST_END)
        return self.attractors.in_frames(frames).marginal(1).responsibilities(clock[:, None])

    def rollout(
        self,
        frames: Sequence[TaskFrame],
        start: npt.ArrayLike,
        start_velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
        *,
        duration: float | None = None,
        time_step: float = 0.01,
        settling: float = 0.0,
    ) -> Demonstration:
        """Integrates the springs, exactly but for the attractor's changes within a step.

        Args:
            frames: The current frames.
            start: Position of the hand (3,) [m].
            start_velocity: Of the hand (3,) [m/s].
            duration: Of the motion [s]; as demonstrated when left out.
            time_step: [s].
            settling: Time to continue after the end [s].
        """
        tau = float(duration or self.duration)
        num_steps = max(1, round((tau + settling) / time_step))
        times = np.asarray(time_step * np.arange(num_steps + 1), dtype=float)
        stiffness = (self.alpha_z / (2 * tau)) ** 2
        nodes = times[:-1, None] + time_step * NODES
        pulls = stiffness * self.attractor(frames, nodes.ravel() / tau).means
        pulls = pulls.reshape(num_steps, len(NODES), 3)
        step = make_step(tau, time_step, self.alpha_z)
        nowhere = np.zeros((2, 3))
        states = np.empty((num_steps + 1, 2, 3))
        states[0, 0], states[0, 1] = np.asarray(start), np.asarray(start_velocity)
        for index in range(num_steps):
            states[index + 1] = advance(states[index], nowhere, pulls[index], step, time_step)
        forcing = tau**2 * stiffness * self.attractor(frames, times / tau).means
        accelerations: Array = np.asarray(acceleration(states, nowhere, forcing, tau, self.alpha_z))
        return Demonstration(
            times,
            states[:, 0],
            states[:, 1],
            np.asarray(accelerations),
            name="ds_gmr",
            derivation="exact",
        )


def fit_ds_gmr(
    demonstrations: Sequence[Demonstration],
    frames: Sequence[Sequence[TaskFrame]],
    *,
    num_components: int = 10,
    alpha_z: float = ALPHA_Z,
    warp: bool = False,
) -> DsGmr:
    """Learns attractors, activations and their frames from demonstrations.

    Each sample gives the attractor that would have caused its motion, a = y + 2 y' / w + y'' / w².
    The mixture is over (s, a), in every frame. After its end each demonstration is extended at rest
    by a fifth of its duration, so that the last attractor is its end.

    Args:
        demonstrations: At least one.
        frames: Per demonstration, its frames; `start_and_goal` gives the usual two.
        num_components: Number of spring-dampers.
        alpha_z: Stiffness constant of the springs.
        warp: As in `align`.
    """
    motions = align(demonstrations, num_samples=NUM_SAMPLES, warp=warp)
    w = alpha_z / (2 * motions[0].duration)
    clock = np.concatenate([np.linspace(0, 1, NUM_SAMPLES), np.linspace(1, REST_END, NUM_REST)])
    attractors = [
        np.vstack(
            [
                motion.positions + 2 * motion.velocities / w + motion.accelerations / w**2,
                np.tile(motion.positions[-1], (NUM_REST, 1)),
            ]
        )
        for motion in motions
    ]
    mixture = fit_points(clock, np.array(attractors), frames, num_components=num_components)
    return DsGmr(mixture, motions[0].duration, alpha_z)
