"""Costs of many parameters, on one core, several, or a cluster, with the same results."""

from __future__ import annotations

import pickle
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    ProcessPoolExecutor,
    as_completed,
)
from contextlib import contextmanager
from functools import lru_cache
from multiprocessing import active_children, get_context
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.cli import limit_linear_algebra, quiet_libraries
from pepper_drake.errors import InputError, PepperDrakeError
from pepper_drake.optimization.problem import Evaluate, Problem
from pepper_drake.signals import end_with_parent, undisturbed

Array = npt.NDArray[np.float64]


def evaluate_all(
    problem: Problem,
    samples: Array,
    executor: Executor | None = None,
    known: dict[int, Array] | None = None,
    progress: Callable[[int], object] | None = None,
) -> Array:
    """Returns the costs (S,) or (S, T) of samples (S, n).

    Args:
        problem: Its costs and chunk size.
        samples: (S, n).
        executor: Evaluates chunks; None evaluates them here.
        known: Costs by the first sample of their chunk. Chunks in it are not computed again, and
            computed ones are added, so that an interruption loses little.
        progress: Called with the number of samples after each chunk.

    Raises:
        InputError: A cost is not finite.
    """
    known = {} if known is None else known
    chunks = {k: samples[k : k + problem.chunk] for k in range(0, len(samples), problem.chunk)}
    missing = {k: chunk for k, chunk in chunks.items() if k not in known}
    if progress is not None:
        progress(sum(len(chunks[k]) for k in known))
    for k, costs in _results(problem.evaluate, missing, executor):
        known[k] = costs
        if progress is not None:
            progress(len(chunks[k]))
    return np.concatenate([known[k] for k in chunks])


def _results(
    evaluate: Evaluate, missing: dict[int, Array], executor: Executor | None
) -> Iterator[tuple[int, Array]]:
    if executor is None:
        for k, chunk in missing.items():
            yield k, costs_of(evaluate, chunk)
        return
    work: Callable[[Any, Array], Array]
    what: Any
    try:
        # A worker caches the evaluator it receives, with its preparations, for later chunks.
        work, what = _costs_of_sent, pickle.dumps(evaluate)
    except (pickle.PicklingError, AttributeError, TypeError):
        work, what = costs_of, evaluate  # For executors within this process.
    futures = {executor.submit(work, what, chunk): k for k, chunk in missing.items()}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    except ModuleNotFoundError as error:
        raise InputError(
            f"a worker has no {error.name}; install pepper-drake where the workers run"
        ) from None
    finally:
        for future in futures:
            future.cancel()


@lru_cache(maxsize=2)
def _received(sent: bytes) -> Evaluate:
    evaluate: Evaluate = pickle.loads(sent)
    return evaluate


def _costs_of_sent(sent: bytes, samples: Array) -> Array:
    return costs_of(_received(sent), samples)


def costs_of(evaluate: Evaluate, samples: Array) -> Array:
    """Returns the checked costs of one call: finite, one or a row for each sample."""
    costs = np.asarray(evaluate(samples), dtype=float)
    if costs.ndim not in (1, 2) or len(costs) != len(samples):
        raise InputError(
            f"cost: shape {costs.shape} for {len(samples)} samples; give one or a row for each"
        )
    if not np.isfinite(costs).all():
        raise InputError("cost: a sample's cost is not finite; a cost must be a number")
    return costs


@contextmanager
def processes(jobs: int) -> Iterator[Executor | None]:
    """Provides worker processes, and ends them; None for one job.

    They are spawned: Drake, VTK and Python's threads do not survive a fork. They ignore Ctrl-C; the
    caller ends them.

    Raises:
        InputError: The number of jobs is not positive.
        PepperDrakeError: One of them has died, as when the machine's memory is full.
    """
    if jobs < 1:
        raise InputError(f"jobs: {jobs}; use at least 1")
    if jobs == 1:
        yield None
        return
    others = active_children()
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_prepare_worker)
    try:
        yield pool
    except BaseException as error:
        # A process still starting while its pool shuts down would end with a traceback.
        with undisturbed():
            for worker in set(active_children()) - set(others):
                worker.terminate()
            pool.shutdown(wait=True, cancel_futures=True)
        if isinstance(error, BrokenExecutor):
            raise PepperDrakeError(
                "a worker process has died; what was finished is kept, use fewer jobs"
            ) from None
        raise
    pool.shutdown()


def _prepare_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    limit_linear_algebra()
    quiet_libraries()


@contextmanager
def dask_cluster(address: str, timeout: float = 5.0) -> Iterator[Executor]:
    """Provides the workers of a Dask cluster.

    Args:
        address: Of its scheduler, such as tcp://10.0.0.1:8786.
        timeout: Of its answer [s].

    Raises:
        InputError: Dask is not installed, or no scheduler answers at the address.
        PepperDrakeError: A worker or the scheduler has died.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm import CommClosedError
    except ImportError:
        raise InputError(
            "--dask: Dask is not installed; install it with pip install pepper-drake[dask]"
        ) from None
    try:
        client = Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"--dask {address}: no scheduler answers ({error})") from None
    try:
        with client:
            yield client.get_executor(pure=False)
    except (KilledWorker, CommClosedError, CancelledError):
        raise PepperDrakeError(
            f"--dask {address}: a worker or the scheduler has died; what was finished is kept"
        ) from None
