"""Base of searches that sample around a mean."""

import numpy as np
import numpy.typing as npt

from pepper_drake.optimization.optimizer import check_positive, check_samples
from pepper_drake.optimization.problem import Problem

Array = npt.NDArray[np.float64]


class GaussianSearch:
    """A mean, and samples of a Gaussian around it.

    The random numbers of an update depend only on the seed and the number of the update.
    """

    def __init__(
        self, problem: Problem, *, samples: int, seed: int, rate: float | None, least: int = 2
    ) -> None:
        """Starts at the problem's guess.

        Args:
            problem: What is minimised.
            samples: Of each update.
            seed: Of the samples.
            rate: Initial variance of the exploration; the problem's if left out.
            least: Number of samples that an update needs.

        Raises:
            InputError: A setting is out of range.
        """
        self._rate = problem.exploration**2 if rate is None else rate
        check_samples(samples, least)
        check_positive(rate=self._rate)
        self._mean = np.array(problem.guess, dtype=float)
        self._samples, self._seed, self._update = samples, seed, 0

    @property
    def mean(self) -> Array:
        """(n,) theta."""
        return self._mean

    @property
    def deviations(self) -> Array:
        """(n,) standard deviations of the exploration."""
        return np.full(len(self._mean), np.sqrt(self._rate))

    def ask(self) -> Array:
        """Returns samples (S, n) of the Gaussian; the same until `tell` is called."""
        return self._mean + self._spread(self._noise())

    def _noise(self) -> Array:
        """Returns (S, n) standard normal numbers of this update."""
        random = np.random.default_rng([self._seed, self._update])
        return random.standard_normal((self._samples, len(self._mean)))

    def _spread(self, noise: Array) -> Array:
        """Returns standard normal noise (S, n) scaled to the exploration."""
        return self.deviations * noise
