"""A spring-damper to the goal, modulated by a mixture's learned velocity profile.

Appendix C.2 of "Learning By Demonstration" (SoftBank Robotics, 2018); Hersch, Guenter, Calinon,
Billard, "Learning Dynamical System Modulation for Constrained Reaching Tasks", Humanoids 2006,
and "Dynamical System Modulation for Robot Learning via Kinesthetic Demonstrations", IEEE
Transactions on Robotics 24 (2008), DOI 10.1109/TRO.2008.2006703. Their last stage, which reconciles
hand and joints, is the differential inverse kinematics of the diagram.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.probabilistic.gaussian_mixture import (
    GaussianMixture,
    fit_gaussian_mixture,
)
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ModulatedSystem:
    """The velocity y' = gamma(t) v_m(t) + (1 - gamma(t)) v_s.

    v_s is that of the spring-damper of equation C.1, v_s' = alpha (-v_s + beta (g - y)).

    v_m is the mixture's regression of the velocity on time. The modulation
    gamma'' = alpha_m (-gamma' - alpha_m gamma / 4), gamma(0) = 1, gamma'(0) = 0, fades, so that
    the spring brings the hand to any goal.

    Attributes:
        mixture: Of (t, velocity), t in [s] from the start; velocities are for `duration`.
        duration: Median duration of the demonstrations [s].
        alpha: Damping [1/s].
        beta: Stiffness divided by damping [1/s]; alpha / 4 is critical.
        alpha_m: Decay of the modulation [1/s].
    """

    mixture: GaussianMixture
    duration: float
    alpha: float
    beta: float
    alpha_m: float

    __repr__ = short_repr

    def modulation(self, times: npt.ArrayLike) -> Array:
        """Returns gamma at times [s], the solution of its equation in closed form."""
        decay = 0.5 * self.alpha_m * np.asarray(times, dtype=float)
        return np.asarray((1 + decay) * np.exp(-decay))

    def learned_velocity(self, times: npt.ArrayLike) -> Array:
        """Returns v_m (N, 3) [m/s] at times (N,) [s]; zero after the demonstrations' end."""
        clock = np.asarray(times, dtype=float)
        velocities = self.mixture.regress(np.minimum(clock, self.duration)[:, None]).means
        return np.where(clock[:, None] <= self.duration, velocities, 0.0)

    def rollout(
        self,
        start: npt.ArrayLike,
        goal: npt.ArrayLike,
        *,
        time_step: float = 0.01,
        settling: float = 1.0,
    ) -> Demonstration:
        """Runs the system by the classical Runge-Kutta method.

        Args:
            start: Position of the hand (3,) [m].
            goal: (3,) [m], or (N, 3) of each step.
            time_step: [s].
            settling: Time to continue after the demonstrated duration [s].
        """
        num_steps = max(1, round((self.duration + settling) / time_step))
        times = time_step * np.arange(num_steps + 1)
        goals = np.broadcast_to(np.asarray(goal, dtype=float), (num_steps + 1, 3))
        halves = 0.5 * time_step * np.arange(2 * num_steps + 1)
        gamma = self.modulation(halves)[:, None]
        drive = gamma * self.learned_velocity(halves)
        states = np.empty((num_steps + 1, 2, 3))  # Position and the spring's own velocity v_s.
        states[0, 0], states[0, 1] = np.asarray(start), drive[0]

        def rate(state: Array, half: int, target: Array) -> Array:
            position, spring = state
            velocity = drive[half] + (1 - gamma[half]) * spring
            return np.array([velocity, self.alpha * (self.beta * (target - position) - spring)])

        for index in range(num_steps):
            state, half, target = states[index], 2 * index, goals[index]
            k1 = rate(state, half, target)
            k2 = rate(state + 0.5 * time_step * k1, half + 1, target)
            k3 = rate(state + 0.5 * time_step * k2, half + 1, target)
            k4 = rate(state + time_step * k3, half + 2, target)
            states[index + 1] = state + time_step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        velocities = drive[::2] + (1 - gamma[::2]) * states[:, 1]
        return Demonstration.from_positions(times, states[:, 0], velocities, name="modulated")


def fit_modulated_system(
    demonstrations: Sequence[Demonstration],
    *,
    num_components: int = 10,
    alpha: float = 10.0,
    alpha_m: float | None = None,
) -> ModulatedSystem:
    """Learns the velocity profile of demonstrations.

    Args:
        demonstrations: At least one; their times are scaled to the median duration.
        num_components: Of the mixture of (time, velocity), equation 2.2.
        alpha: Damping of the spring [1/s]; damping is critical.
        alpha_m: Decay of the modulation [1/s]; when left out, 0.3 of it is left at the end of the
            motion: more keeps the demonstrated path longer and reaches the goal later.

    Raises:
        InputError: There is no demonstration.
    """
    if not demonstrations:
        raise InputError("there is no demonstration to learn from; give at least one.")
    duration = float(np.median([demo.duration for demo in demonstrations]))
    data = np.vstack(
        [
            np.column_stack(
                [
                    (demo.times - demo.times[0]) * duration / demo.duration,
                    demo.velocities * demo.duration / duration,
                ]
            )
            for demo in demonstrations
        ]
    )
    data = data[np.argsort(data[:, 0], kind="stable")]
    evenly = (np.arange(num_components) + 0.5) / max(num_components, 1) * len(data)
    mixture = fit_gaussian_mixture(data, num_components, initial_means=data[evenly.astype(int)])
    # (1 + d) exp(-d) = 0.3 at d = 2.439.
    return ModulatedSystem(mixture, duration, alpha, alpha / 4, alpha_m or 2 * 2.439 / duration)
