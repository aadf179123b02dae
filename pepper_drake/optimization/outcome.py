"""Outcome of several movements: all that a cost may depend on."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]


class Outcome:
    """S movements of N steps each; expensive quantities are computed on first use.

    Attributes:
        times: (N,) [s].
        positions: (S, N, 3) of the hand, in T [m].
        joints: (S, N, J) of the arm [rad], where there is an arm.
        joint_limits: (2, J) lower and upper limits [rad], where there is an arm.
        end_errors: (S,) from the hand to its goal at the end [m], if the goal was estimated instead
            of the task's.
    """

    def __init__(
        self,
        times: Array,
        positions: Array,
        *,
        accelerations: Callable[[], Array] | None = None,
        joints: Array | None = None,
        joint_limits: Array | None = None,
        arm_distances: Callable[[], Array] | None = None,
        end_errors: Array | None = None,
    ) -> None:
        """Takes the attributes, and functions that compute the properties."""
        self.times = times
        self.positions = positions
        self.joints = joints
        self.joint_limits = joint_limits
        self.end_errors = end_errors
        self._accelerations = accelerations
        self._arm_distances = arm_distances

    @cached_property
    def accelerations(self) -> Array:
        """(S, N, 3) [m/s²]; finite differences of the positions unless given."""
        if self._accelerations is not None:
            return self._accelerations()
        step = self.times[1] - self.times[0]
        return np.gradient(np.gradient(self.positions, step, axis=1), step, axis=1)

    @cached_property
    def jerks(self) -> Array:
        """(S, N, 3) [m/s³]."""
        return np.gradient(self.accelerations, self.times[1] - self.times[0], axis=1)

    @cached_property
    def arm_distances(self) -> Array:
        """(S, N) from the whole arm to the nearest obstacle [m]; negative inside one.

        Raises:
            InputError: These movements have no arm.
        """
        if self._arm_distances is None:
            raise InputError(
                "cost: arm_to_obstacles needs the arm; use kinematics in place of fast rollouts"
            )
        return self._arm_distances()
