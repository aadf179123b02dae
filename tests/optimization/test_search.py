import contextlib
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import active_children, get_context

import numpy as np
import pytest

from pepper_drake.errors import InputError, PepperDrakeError
from pepper_drake.optimization import (
    METHODS,
    CostWeights,
    FastRollouts,
    History,
    all_weights,
    evaluate_all,
    make_optimizer,
    make_task,
    movement_problem,
    processes,
    search,
    smooth_bumps,
)
from tests.optimization.conftest import bowl


@pytest.fixture(scope="module")
def problem(primitive):
    """A hand that ends 10 cm off, with costs of steps and features."""
    parameters = all_weights(primitive)
    task = make_task(primitive, goal=primitive.goal + [0.06, 0.06, 0.05])
    cost = CostWeights(hand_to_goal=1.0, deviation=0.1)
    return movement_problem(parameters, FastRollouts(parameters, task, cost))


class Interrupted:
    """An evaluator that is interrupted at one of its calls."""

    def __init__(self, evaluate, calls):
        self.evaluate, self.left = evaluate, calls

    def __call__(self, samples):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        return self.evaluate(samples)


def same(one, other):
    assert one.updates == other.updates
    for a, b in zip(one.samples, other.samples, strict=True):
        assert np.array_equal(a, b)
    for a, b in zip(one.costs, other.costs, strict=True):
        assert np.array_equal(a, b)
    assert np.array_equal(one.means, other.means)
    assert np.array_equal(one.mean_costs, other.mean_costs, equal_nan=True)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_makes_the_movement_cheaper(problem, method):
    history = search(problem, make_optimizer(method, problem, seed=1), 7)
    assert history.rollouts == 70
    assert history.mean_costs[0] == pytest.approx(0.1, abs=0.002)
    assert history.mean_costs[-1] < 0.6 * history.mean_costs[0]
    assert history.best()[1] == min(*history.mean_costs, *(t.min() for t in history.totals))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("calls", [0, 1, 9, 16, 27])
def test_a_resumed_search_is_one_that_was_never_interrupted(primitive, tmp_path, method, calls):
    parameters = smooth_bumps(primitive, 3)
    task = make_task(primitive, goal=primitive.goal + [0.06, 0.06, 0.05])
    evaluate = FastRollouts(parameters, task, CostWeights(hand_to_goal=1.0), time_step=0.05)
    problem = movement_problem(parameters, evaluate, chunk=2)
    whole = search(problem, make_optimizer(method, problem, seed=3), 5)
    history = History({"method": method})
    broken = replace(problem, evaluate=Interrupted(problem.evaluate, calls))
    with pytest.raises(KeyboardInterrupt):
        search(broken, make_optimizer(method, problem, seed=3), 5, history=history)
    history.save(tmp_path / "history.npz")
    again = History.load(tmp_path / "history.npz")
    assert again.settings == {"method": method}
    counted = Interrupted(problem.evaluate, 1000)
    resumed = replace(problem, evaluate=counted)
    search(resumed, make_optimizer(method, problem, seed=3), 5, history=again)
    same(again, whole)
    assert 1000 - counted.left == 31 - calls  # 5 x 5 chunks, 6 means: nothing twice.


def test_the_same_result_with_threads_and_whatever_the_order(problem):
    problem = replace(problem, chunk=3)
    alone = search(problem, make_optimizer("algorithm3", problem, seed=5), 3)
    with ThreadPoolExecutor(3) as executor:
        optimizer = make_optimizer("algorithm3", problem, seed=5)
        together = search(problem, optimizer, 3, executor=executor)
    same(alone, together)


def test_the_same_result_with_two_processes(problem):
    problem = replace(problem, chunk=5)
    alone = search(problem, make_optimizer("cmaes", problem, seed=5), 2)
    with processes(1) as nobody, processes(2) as executor:
        assert nobody is None
        together = search(problem, make_optimizer("cmaes", problem, seed=5), 2, executor=executor)
    same(alone, together)


def test_the_same_result_on_a_dask_cluster(problem):
    distributed = pytest.importorskip("distributed")
    from pepper_drake.optimization import dask_cluster

    problem = replace(problem, chunk=5)
    alone = search(problem, make_optimizer("algorithm3", problem, seed=5), 2)
    # A real scheduler on a socket, and two worker processes.
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        assert cluster.scheduler_address.startswith("tcp://")
        with dask_cluster(cluster.scheduler_address) as executor:
            optimizer = make_optimizer("algorithm3", problem, seed=5)
            together = search(problem, optimizer, 2, executor=executor)
    same(alone, together)


def dies(samples):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_dies_is_one_sentence():
    problem = replace(bowl([0.3]), evaluate=dies)
    with pytest.raises(PepperDrakeError, match="a worker process has died"):  # noqa: SIM117
        with processes(2) as executor:
            evaluate_all(problem, np.zeros((4, 1)), executor)


def test_a_worker_of_a_cluster_that_dies_is_one_sentence():
    distributed = pytest.importorskip("distributed")
    import dask

    from pepper_drake.optimization import dask_cluster

    problem = replace(bowl([0.3]), evaluate=dies)
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
        pytest.raises(PepperDrakeError, match="a worker or the scheduler has died"),
        dask_cluster(cluster.scheduler_address) as executor,
    ):
        evaluate_all(problem, np.zeros((4, 1)), executor)


def test_functions_that_cannot_be_sent_are_for_executors_here():
    problem = replace(bowl([0.3]), evaluate=lambda x: x[:, 0] ** 2)
    with ThreadPoolExecutor(2) as executor:
        costs = evaluate_all(problem, np.arange(6.0)[:, None], executor)
    assert costs.tolist() == [0.0, 1.0, 4.0, 9.0, 16.0, 25.0]


def test_nobody_at_the_address_is_one_sentence():
    pytest.importorskip("distributed")
    from pepper_drake.optimization import dask_cluster

    with (
        pytest.raises(InputError, match=r"--dask tcp://127.0.0.1:9: no scheduler answers"),
        dask_cluster("tcp://127.0.0.1:9", timeout=0.3),
    ):
        pass


def test_a_search_ends_when_it_has_converged():
    problem = bowl([0.3])
    optimizer = make_optimizer("algorithm3", problem, decay=0.1, threshold=1e-3)
    history = search(problem, optimizer, 100)
    assert optimizer.converged
    assert history.updates == 3


def test_means_are_left_out_where_they_cannot_be_evaluated():
    problem = bowl([0.3])
    history = search(problem, make_optimizer("algorithm3", problem), 2, evaluate_means=False)
    assert np.isnan(history.mean_costs).all()
    samples, totals = history.samples, history.totals
    least = min(range(2), key=lambda k: totals[k].min())
    parameters, cost = history.best()
    assert cost == totals[least].min()
    assert np.array_equal(parameters, samples[least][totals[least].argmin()])


def test_progress_and_updates_are_told():
    problem, seen, told = bowl([0.3]), [], []
    optimizer = make_optimizer("algorithm3", problem, samples=6)
    search(problem, optimizer, 2, progress=seen.append, on_update=lambda h: told.append(h.updates))
    assert sum(seen) == 12
    assert told == [1, 2]


def test_another_search_cannot_be_resumed():
    problem = bowl([0.3])
    history = search(problem, make_optimizer("algorithm3", problem, seed=1), 2)
    with pytest.raises(InputError, match="started with other settings"):
        search(problem, make_optimizer("algorithm3", problem, seed=2), 3, history=history)
    history.settings = {"seed": 1, "goal_offset": None}
    with pytest.raises(InputError, match="--resume: seed was 1 and is 2 now"):
        history.check_settings({"seed": 2})
    history.check_settings({"seed": 1})


@pytest.mark.parametrize(
    ("evaluate", "words"),
    [
        (lambda x: np.full(len(x), np.nan), "cost is not finite"),
        (lambda x: np.zeros(3), r"shape \(3,\) for 1 samples"),
    ],
)
def test_unusable_costs(evaluate, words):
    problem = replace(bowl([0.3]), evaluate=evaluate)
    with pytest.raises(InputError, match=words):
        search(problem, make_optimizer("algorithm3", problem), 1)


def test_ctrl_c_ends_the_processes_at_once_and_no_others():
    other = get_context("spawn").Process(target=time.sleep, args=(60.0,))
    other.start()
    with contextlib.suppress(KeyboardInterrupt), processes(2) as executor:
        executor.submit(time.sleep, 60.0)
        raise KeyboardInterrupt
    assert active_children() == [other]
    other.terminate()
    other.join()


def test_bad_names_and_files(tmp_path):
    with pytest.raises(InputError, match="method: 'magic' is unknown; use one of algorithm3"):
        make_optimizer("magic", bowl([1.0]))
    with pytest.raises(InputError, match="there is nothing to resume"):
        History.load(tmp_path / "none.npz")
    (tmp_path / "bad.npz").write_text("no archive")
    with pytest.raises(InputError, match="not a history of a search"):
        History.load(tmp_path / "bad.npz")
    with pytest.raises(InputError, match="jobs: 0"), processes(0):
        pass
