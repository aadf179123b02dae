"""State of a translation in progress and its integration step, for the TransformationSystem."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pepper_drake.learning.dmp.transformation import (
    DelayedGoal,
    Forcing,
    TransformationModel,
    node_phases,
)

POSITION, VELOCITY, GOAL, DELAYED, START = (slice(3 * k, 3 * k + 3) for k in range(5))
"""Parts of the state (15,): position [m], velocity [m/s], goal, delayed goal, start [m]."""

NUM_VALUES = 15
"""Number of values of the state."""


def start_state(start: Any, goal: Any, velocity: Any = None) -> Any:
    """Returns the state (15,) of a motion that starts now.

    Args:
        start: (3,) initial position [m].
        goal: (3,) goal position [m].
        velocity: (3,) initial velocity [m/s]; None means at rest.
    """
    velocity = np.zeros(3) if velocity is None else velocity
    return np.concatenate((start, velocity, goal, goal, start))


def state_started_anew(state: Any, goal: Any, slowed: Any = 1.0) -> Any:
    """Returns the state (15,) of a motion that starts during another one.

    Args:
        state: (15,) of the motion so far.
        goal: (3,) of the new motion [m].
        slowed: Speed factor of the new motion; the velocity is divided by it, so that the hand's
            velocity is continuous.
    """
    return np.concatenate((state[POSITION], state[VELOCITY] / slowed, goal, goal, state[POSITION]))


@dataclass(frozen=True)
class MotionNow:
    """A motion at one time. Its values are floats or a Drake scalar type.

    Attributes:
        attractor: The primitive's transformation system.
        state: (15,) see `POSITION`.
        goal: The current goal.
        forcing: The forcing term.
        phase: Of the canonical system.
        tau: [s].
    """

    attractor: TransformationModel
    state: Any
    goal: DelayedGoal
    forcing: Forcing
    phase: Any
    tau: Any

    def acceleration(self) -> Any:
        """Returns the acceleration (3,) without coupling [m/s²]."""
        forcing = self.forcing(np.array([self.phase]))[0]
        return self.attractor.acceleration(
            self.state[:6].reshape(2, 3), self.goal, forcing, self.tau
        )

    def later(self, time_step: Any, phase_velocity: Any, coupling: Any, speed: Any = 1.0) -> Any:
        """Returns the state (15,) one step later.

        Args:
            time_step: [s].
            phase_velocity: x' [1/s], held over the step.
            coupling: (3,) C_t [m], held over the step.
            speed: Speed factor from 0 to 1: the motion's own time passes that much more slowly,
                along the same path.
        """
        time_step = speed * time_step
        decay = -phase_velocity / (speed * self.phase) if speed * self.phase > 0.0 else 0.0
        moved = self.attractor.advance(
            self.state[:6].reshape(2, 3),
            self.goal,
            self.forcing(node_phases(self.phase, decay, time_step)),
            self.tau,
            time_step,
            coupling,
        )
        goal = self.goal.later(time_step, self.attractor.goal_rate(self.tau))
        return np.concatenate((moved.ravel(), goal.position, goal.delayed, self.state[START]))

    def rates(self, coupling: Any) -> Any:
        """Returns the time derivatives (9,) of position, velocity and delayed goal.

        Args:
            coupling: (3,) C_t [m].
        """
        following = (self.goal.position - self.goal.delayed) * self.attractor.goal_rate(self.tau)
        push = coupling / (self.tau * self.tau)
        return np.concatenate(
            (self.state[VELOCITY], self.acceleration() + push, following + self.goal.line[1])
        )
