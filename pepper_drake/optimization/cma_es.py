"""CMA-ES: Hansen's own implementation, the PyPI package `cma`, behind this room's interface."""

import warnings

import numpy as np
import numpy.typing as npt

from pepper_drake.optimization.optimizer import check_positive, check_samples
from pepper_drake.optimization.problem import Problem, total_costs

Array = npt.NDArray[np.float64]


class CmaEs:
    """Covariance matrix adaptation evolution strategy (Hansen and Ostermeier 2001).

    It draws its random numbers in order from its own generator: told the same costs, it repeats
    itself.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        samples: int = 10,
        seed: int = 0,
        rate: float | None = None,
    ) -> None:
        """Starts at the problem's guess.

        Args:
            problem: What is minimised.
            samples: Of each update.
            seed: Of the samples.
            rate: r, the variance of the exploration; the problem's if left out.

        Raises:
            InputError: A setting is out of range.
        """
        rate = problem.exploration**2 if rate is None else rate
        check_samples(samples, least=3)
        check_positive(rate=rate)
        random = np.random.default_rng(seed)
        with warnings.catch_warnings():
            # On import it looks for plotting tools, and warns.
            warnings.simplefilter("ignore")
            import cma

        self._strategy = cma.CMAEvolutionStrategy(
            np.array(problem.guess, dtype=float),
            float(np.sqrt(rate)),
            {
                "popsize": samples,
                "randn": lambda *shape: random.standard_normal(shape),
                "seed": np.nan,
                "verbose": -9,
                "verb_log": 0,
            },
        )
        self._samples: list[Array] | None = None

    @property
    def mean(self) -> Array:
        """(n,) the distribution's mean."""
        return np.array(self._strategy.mean)

    @property
    def deviations(self) -> Array:
        """(n,) standard deviations of the exploration."""
        return np.array(self._strategy.stds)

    @property
    def converged(self) -> bool:
        """True if one of CMA-ES' own termination criteria holds."""
        return bool(self._strategy.stop())

    def ask(self) -> Array:
        """Returns samples (S, n)."""
        if self._samples is None:
            self._samples = self._strategy.ask()
        return np.array(self._samples)

    def tell(self, costs: Array) -> None:
        """Updates mean, step size and covariance."""
        self.ask()
        self._strategy.tell(self._samples, total_costs(np.asarray(costs, dtype=float)).tolist())
        self._samples = None
