"""The loop of every search: ask, evaluate, tell."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.optimization.history import History
from pepper_drake.optimization.optimizer import Optimizer
from pepper_drake.optimization.parallel import costs_of, evaluate_all
from pepper_drake.optimization.problem import Problem, total_costs

Array = npt.NDArray[np.float64]
OnProgress = Callable[[int], object]
OnUpdate = Callable[[History], object]


def search(
    problem: Problem,
    optimizer: Optimizer,
    updates: int,
    *,
    history: History | None = None,
    executor: Executor | None = None,
    evaluate_means: bool = True,
    target: float = -np.inf,
    progress: OnProgress | None = None,
    on_update: OnUpdate | None = None,
) -> History:
    """Minimises a cost.

    Args:
        problem: What is minimised.
        optimizer: A new one, to which the history is replayed first.
        updates: Number of updates in all, unless the search converges before.
        history: Of an interrupted search; it is continued in place. Whenever this function is left,
            even by Ctrl-C, it holds everything evaluated.
        executor: Evaluates chunks; None evaluates them here.
        evaluate_means: Whether the cost of the mean is evaluated after each update, for the record:
            no method uses it.
        target: The search ends at a cost of this or less.
        progress: Called with the number of samples after each chunk.
        on_update: Called with the history after each update.

    Returns:
        The history.

    Raises:
        InputError: A cost is unusable, or the history is of another search.
    """
    history = History() if history is None else history
    replay(optimizer, history)
    if len(history.mean_costs) == history.updates:
        # Not begun yet, or interrupted in the evaluation of the last mean.
        _add_mean(history, problem, optimizer, evaluate_means)
    while history.updates < updates and not optimizer.converged and not history.best()[1] <= target:
        samples = optimizer.ask()
        known = history.pending.setdefault(history.updates, {})
        costs = evaluate_all(problem, samples, executor, known, progress)
        optimizer.tell(costs)
        del history.samples[history.updates :]
        history.samples.append(samples)
        history.costs.append(costs)
        history.pending.pop(history.updates - 1)
        _add_mean(history, problem, optimizer, evaluate_means)
        if on_update is not None:
            on_update(history)
    return history


def replay(optimizer: Optimizer, history: History) -> None:
    """Tells a new optimizer the costs in a history, which restores the state of the search.

    Raises:
        InputError: It asks for other samples than the history holds.
    """
    for samples, costs in zip(history.samples, history.costs, strict=False):
        asked = optimizer.ask()
        if asked.shape != samples.shape or not np.allclose(asked, samples, rtol=1e-6, atol=1e-9):
            raise InputError(
                "resume: the search was started with other settings; give the same, or start anew"
            )
        optimizer.tell(costs)


def _add_mean(history: History, problem: Problem, optimizer: Optimizer, evaluate: bool) -> None:
    mean = np.array(optimizer.mean)
    cost = float("nan")
    if evaluate:
        cost = float(total_costs(costs_of(problem.evaluate, mean[None]))[0])
    del history.means[len(history.mean_costs) :]
    history.means.append(mean)
    history.mean_costs.append(cost)
