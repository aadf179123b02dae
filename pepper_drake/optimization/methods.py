"""The search methods by name."""

from collections.abc import Callable, Mapping
from typing import Any

from pepper_drake.errors import InputError
from pepper_drake.optimization.averaging import RewardWeightedAveraging
from pepper_drake.optimization.cma_es import CmaEs
from pepper_drake.optimization.natural_actor_critic import EpisodicNaturalActorCritic
from pepper_drake.optimization.optimizer import Optimizer
from pepper_drake.optimization.pi2_cma import Pi2Cma
from pepper_drake.optimization.power import Power
from pepper_drake.optimization.problem import Problem

METHODS: Mapping[str, Callable[..., Optimizer]] = {
    "algorithm3": RewardWeightedAveraging,
    "pi2cma": Pi2Cma,
    "cmaes": CmaEs,
    "power": Power,
    "enac": EpisodicNaturalActorCritic,
}


def make_optimizer(
    name: str, problem: Problem, *, samples: int = 10, seed: int = 0, **settings: Any
) -> Optimizer:
    """Makes a search method that starts at a problem's guess.

    Args:
        name: Of the method.
        problem: What is minimised.
        samples: Of each update.
        seed: Of all randomness.
        settings: Of the method.

    Raises:
        InputError: There is no such method, or a setting is out of range.
    """
    if name not in METHODS:
        raise InputError(f"method: '{name}' is unknown; use one of {', '.join(METHODS)}")
    return METHODS[name](problem, samples=samples, seed=seed, **settings)
