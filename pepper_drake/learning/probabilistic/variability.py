"""Variability of several demonstrations along the motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.alignment import align
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.probabilistic.tp_gmm import TaskFrame, fit_points
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """Mean and covariance of several motions over a common time.

    Attributes:
        times: (N,) [s].
        means: (N, 3) [m].
        covariances: (N, 3, 3) [m²], between the demonstrations.
    """

    times: Array
    means: Array
    covariances: Array

    __repr__ = short_repr

    @property
    def standard_deviations(self) -> Array:
        """(N, 3) [m] along the axes."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))


def variability_along(
    demonstrations: Sequence[Demonstration], *, num_components: int = 15, warp: bool = False
) -> Spread:
    """Returns how demonstrations vary along the motion, by regression of position on time.

    Where the spread is small the task demands precision (Calinon, Guenter, Billard, "On Learning,
    Representing and Generalizing a Task in a Humanoid Robot", 2007). The mixture of (time,
    position) is that of `tp_gmm` in one frame; its regression is equation 2.3.

    Args:
        demonstrations: At least two.
        num_components: Of the mixture.
        warp: As in `align`.

    Raises:
        InputError: There are fewer than two demonstrations.
    """
    if len(demonstrations) < 2:
        raise InputError("the spread of demonstrations needs at least two of them.")
    motions = align(demonstrations, warp=warp)
    points = np.array([motion.positions for motion in motions])
    clock = np.linspace(0, 1, points.shape[1])
    frame = TaskFrame(np.eye(3), np.zeros(3))
    mixture = fit_points(clock, points, [[frame]] * len(motions), num_components=num_components)
    regression = mixture.in_frames([frame]).regress(clock[:, None])
    return Spread(motions[0].times, regression.means, regression.covariances)
