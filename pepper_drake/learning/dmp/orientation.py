"""Orientation primitives: an attractor in three coordinates, of the log map or of angles.

`log_map`: the state is e = 2 log(q * conj(g)), the rotation vector from the goal g to the hand's
orientation q, in the frame T. It goes to zero, and the transformation system of the translation
applies to it unchanged, exact solution included (Koutras and Doulgeris 2020, a correct formulation
for the orientation dynamic movement primitives, proceedings.mlr.press/v100/koutras20a). The
angular velocity is omega = J(e) e', J the left Jacobian of the exponential map. e is tracked
continuously, so that a motion may turn by more than half a turn.

`angles`: as in the report. Roll, pitch and yaw are three independent coordinates and their goal
are those of the goal's orientation; near a pitch of 90 degrees they are singular.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.cached_times import spline_derivatives
from pepper_drake.learning.dmp.transformation import (
    DelayedGoal,
    MotionSample,
    TransformationModel,
    learn_attractor,
    node_phases,
)
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

ORIENTATIONS = ("log_map", "angles")

TURN_THRESHOLD = 1e-3
"""The spring's goal turns while it is further than this from the given goal [rad]."""
_SAME_GOAL = math.cos(0.5 * TURN_THRESHOLD)
"""Dot product of unit quaternions that are this far apart."""


class OrientationState(NamedTuple):
    """The state of an orientation.

    Attributes:
        coordinates: (2, 3) coordinates and their rates.
        start: (3,) coordinates at the start of the motion.
        goal: (4,) unit quaternion, the current goal of the spring.
    """

    coordinates: Array
    start: Array
    goal: Array


@dataclass(frozen=True, eq=False)
class OrientationAttractor:
    """A learned change of orientation.

    Attributes:
        attractor: The transformation system of the three coordinates.
        mode: `log_map` or `angles`.
        start: (4,) the demonstration's first orientation, w, x, y, z.
        goal: (4,) its last.
    """

    __repr__ = short_repr

    attractor: TransformationModel
    mode: str
    start: Array
    goal: Array

    def goal_coordinates(self, goal: Array) -> Array:
        """Returns the goal (3,) of the coordinates: zero, or the angles nearest the taught ones."""
        if self.mode == "log_map":
            return np.zeros(3)
        return _nearest_angles(so3.to_angles(goal), self.attractor.frame.goal)

    def coordinates(self, orientation: Array, goal: Array, near: Array | None = None) -> Array:
        """Returns the coordinates (3,) of an orientation (4,) for a goal (4,).

        Args:
            orientation: Unit quaternion.
            goal: Unit quaternion.
            near: (3,) coordinates to stay close to; None means the demonstration's start.
        """
        if near is None:
            near = self.attractor.frame.start
        if self.mode == "log_map":
            return so3.nearest_log(so3.multiply(orientation, so3.conjugate(goal)), near)
        return _nearest_angles(so3.to_angles(orientation), near)

    def orientation(self, coordinates: Array, goal: Array) -> Array:
        """Returns the orientations (..., 4) of coordinates (..., 3) for goals (..., 4)."""
        if self.mode == "log_map":
            return so3.multiply(so3.exp_map(coordinates), goal)
        return so3.from_angles(coordinates)

    def angular_velocity(self, coordinates: Array, rates: Array) -> Array:
        """Returns the angular velocity (..., 3) [rad/s] of coordinates and their rates."""
        if self.mode == "log_map":
            return so3.angular_velocity(coordinates, rates)
        return so3.angle_rates_to_angular_velocity(coordinates, rates)

    def rates(self, coordinates: Array, angular_velocity: Array) -> Array:
        """Returns the rates (3,) of coordinates (3,) at an angular velocity (3,) [rad/s]."""
        if self.mode == "log_map":
            return so3.inverse_left_jacobian(coordinates) @ angular_velocity
        columns = so3.angle_rates_to_angular_velocity(coordinates, np.eye(3)).T
        return np.asarray(np.linalg.solve(columns, angular_velocity), dtype=np.float64)

    def start_state(self, start: Array, goal: Array, tau: float | None) -> OrientationState:
        """Returns the state of a motion that starts now.

        Args:
            start: (4,) unit quaternion.
            goal: (4,) unit quaternion.
            tau: [s] to start with the demonstration's velocity; None to start from rest.
        """
        start, goal = so3.normalize(start), so3.normalize(goal)
        coordinates = self.coordinates(start, goal)
        rates = np.zeros(3)
        if tau is not None:
            target = self.goal_coordinates(goal)
            rates = self.attractor.start_velocity(coordinates, target, tau)
        return OrientationState(np.array((coordinates, rates)), coordinates, goal)

    def started_anew(
        self, state: OrientationState, goal: Array, slowed: float = 1.0
    ) -> OrientationState:
        """Returns the state of a motion to a goal (4,) that starts from the state of another one.

        It runs `slowed` times as fast as that; the angular velocity is continuous. It turns the
        way of its own demonstration, as after `start_state`: the other motion's coordinates may
        have been those of less than half a turn where its own are of more.
        """
        position, rates = state.coordinates
        velocity = self.angular_velocity(position, rates) / slowed
        begun = self.start_state(self.orientation(position, state.goal), goal, None)
        coordinates = np.array((begun.start, self.rates(begun.start, velocity)))
        return begun._replace(coordinates=coordinates)

    def pose(self, state: OrientationState) -> tuple[Array, Array]:
        """Returns the orientation (4,) and the angular velocity (3,) [rad/s] of a state."""
        return self.orientation_of(state), self.angular_velocity_of(state)

    def orientation_of(self, state: OrientationState) -> Array:
        """Returns the orientation (4,) of a state."""
        return self.orientation(state.coordinates[0], state.goal)

    def angular_velocity_of(self, state: OrientationState) -> Array:
        """Returns the angular velocity (3,) [rad/s] of a state."""
        return self.angular_velocity(*state.coordinates)

    def advance(
        self,
        state: OrientationState,
        goal: Array,
        phase: float,
        decay: float,
        tau: float,
        time_step: float,
    ) -> OrientationState:
        """Returns the state one step later; see `TransformationModel.advance`.

        The goal of the spring turns towards `goal` (4,) at the attractor's `goal_rate`,
        until it is within `TURN_THRESHOLD` of it.
        """
        goal = so3.normalize(goal)
        target = self.goal_coordinates(state.goal)
        forcing = self.attractor.forcing(state.start, target)
        moved = self.attractor.advance(
            state.coordinates,
            DelayedGoal.at(target),
            forcing(node_phases(phase, decay, time_step)),
            tau,
            time_step,
        )
        if abs(goal @ state.goal) >= _SAME_GOAL:
            return OrientationState(moved, state.start, state.goal)
        turn = so3.log_map(so3.multiply(goal, so3.conjugate(state.goal)))
        share = 1.0 - np.exp(-self.attractor.goal_rate(tau) * time_step)
        seen = so3.normalize(so3.multiply(so3.exp_map(share * turn), state.goal))
        return OrientationState(
            self._retargeted(moved, state.goal, seen),
            self._coordinates_for(state.start, state.goal, seen),
            seen,
        )

    def _retargeted(self, coordinates: Array, old_goal: Array, new_goal: Array) -> Array:
        """Returns coordinates and rates (2, 3) of the same motion for another goal."""
        if self.mode == "angles":
            return coordinates
        position, rates = coordinates
        moved = self._coordinates_for(position, old_goal, new_goal)
        return np.array((moved, self.rates(moved, self.angular_velocity(position, rates))))

    def _coordinates_for(self, coordinates: Array, old_goal: Array, new_goal: Array) -> Array:
        """Returns the coordinates (3,) of the same orientation for another goal."""
        if self.mode == "angles":
            return coordinates
        orientation = self.orientation(coordinates, old_goal)
        return self.coordinates(orientation, new_goal, near=coordinates)


def learn_orientation(
    times: list[Array],
    orientations: list[Array],
    mode: str,
    approximator: str,
    num_basis: int,
    alpha_z: float,
    seed: int,
) -> OrientationAttractor:
    """Learns from orientations (N, 4) at relative times (N,), of one or several motions.

    Derivatives are those of the quintic spline through the coordinates.

    Raises:
        InputError: The mode is unknown.
    """
    if mode not in ORIENTATIONS:
        raise InputError(f"orientation: '{mode}' is unknown; use one of {', '.join(ORIENTATIONS)}")
    samples: list[MotionSample] = []
    for s, q in zip(times, orientations, strict=True):
        if mode == "log_map":
            coordinates = so3.unwrapped_log(so3.multiply(q, so3.conjugate(q[-1])))
        else:
            coordinates = np.unwrap(so3.to_angles(q), axis=0)
            if samples:
                turns = np.round((samples[0].positions[-1] - coordinates[-1]) / (2.0 * np.pi))
                coordinates = coordinates + 2.0 * np.pi * turns
        samples.append(MotionSample(s, coordinates, *spline_derivatives(s, coordinates)))
    return OrientationAttractor(
        learn_attractor(samples, approximator, num_basis, "gradual", alpha_z, seed),
        mode,
        _mean_orientation([q[0] for q in orientations]),
        _mean_orientation([q[-1] for q in orientations]),
    )


def _mean_orientation(orientations: list[Array]) -> Array:
    """Returns the mean (4,) of unit quaternions near each other: the chordal mean."""
    first = orientations[0]
    if len(orientations) == 1:
        return first
    return so3.normalize(np.sum([q if q @ first >= 0.0 else -q for q in orientations], axis=0))


def _nearest_angles(angles: Array, reference: Array) -> Array:
    """Returns the roll, pitch, yaw (3,) of the same orientation that are nearest to a reference."""
    flipped = np.array([angles[0] + np.pi, np.pi - angles[1], angles[2] + np.pi])
    turns = 2.0 * np.pi
    nearest: list[Array] = [
        a + turns * np.round((reference - a) / turns) for a in (angles, flipped)
    ]
    return min(nearest, key=lambda a: float(np.linalg.norm(a - reference)))
