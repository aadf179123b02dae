import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from pepper_drake.benchmarking import batch, methods
from pepper_drake.benchmarking.batch import Task, run_task, run_tasks
from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.errors import InputError
from pepper_drake.planning.reach.planner_registry import get_planner


class Fixed:
    """A method that always says the same."""

    options = None

    def __call__(self, case):
        return MethodResult(outcome="reached", clearance=0.01 * case.seed)


@pytest.fixture
def fixed(monkeypatch):
    method = methods.Method("z", "fixed", "", Fixed())
    monkeypatch.setattr(methods, "METHODS", (method,))


def test_a_result_says_whose_it_is_and_is_kept(fixed, tmp_path):
    task = Task("z", Case(4))
    result = run_task(task)
    assert (result.case, result.method, result.outcome) == ("random_4", "z", "reached")
    assert result.wall_seconds > 0.0
    assert task.file(tmp_path) == tmp_path / "results" / "random_4" / "z.json"


def test_what_is_there_is_not_run_again(fixed, tmp_path, monkeypatch):
    tasks = [Task("z", Case(seed)) for seed in (3, 1, 2)]
    for task in tasks:
        run_task(task).save(task.file(tmp_path))
    monkeypatch.setattr(batch, "_in_process", None)  # Nothing may be run.
    shown = []
    results = run_tasks(tasks, tmp_path, progress=shown.append)
    assert [result.case for result in results] == ["random_3", "random_1", "random_2"]
    assert shown == results


def test_a_run_that_breaks_down_is_an_error_with_a_sentence_and_is_tried_again(tmp_path):
    good = Task("g", Case(0, "free"))
    MethodResult(good.case.name, "g", "refused").save(good.file(tmp_path))
    bad = Task("a", Case(0, str(tmp_path / "nowhere.yaml")))
    for _ in range(2):
        results = run_tasks([bad, good], tmp_path, jobs=2)
        assert [result.outcome for result in results] == ["error", "refused"]
        assert "nowhere.yaml" in results[0].message


def test_an_interrupt_ends_the_runs_that_are_going_on_and_leaves_no_result_of_them(tmp_path):
    def interrupt(result):
        raise KeyboardInterrupt

    tasks = [Task("d", Case(0, "table")), Task("a", Case(0, str(tmp_path / "nowhere.yaml")))]
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        run_tasks(tasks, tmp_path, jobs=2, progress=interrupt)
    assert time.monotonic() - began < 20.0
    assert not tasks[0].file(tmp_path).exists()


def test_a_file_that_is_no_result_is_said_at_once(tmp_path):
    task = Task("a", Case(0))
    task.file(tmp_path).parent.mkdir(parents=True)
    task.file(tmp_path).write_text("{}garbage")
    with pytest.raises(InputError, match=r"a\.json"):
        run_tasks([task], tmp_path)


def test_an_executor_runs_them_and_what_breaks_there_is_an_error(fixed, tmp_path):
    class Broken(Fixed):
        def __call__(self, case):
            raise RuntimeError("no more\nof it")

    methods.METHODS += (methods.Method("y", "broken", "", Broken()),)
    tasks = [Task(letter, Case(seed)) for seed in (3, 1) for letter in "zy"]
    with ThreadPoolExecutor(2) as executor:
        results = run_tasks(tasks, tmp_path, executor=executor)
        assert executor.submit(int, 3).result() == 3  # It is the caller's to end.
    assert [r.outcome for r in results] == ["reached", "error"] * 2
    assert results[1].message == "RuntimeError: no more"
    assert [MethodResult.load(task.file(tmp_path)) for task in tasks] == results


OWN = """
from pepper_drake.planning import ReachPlanner

class Mine(ReachPlanner):
    pass

def still(known, base_pose, seed):
    yield known.start[None]

number = 3
"""


def test_a_planner_of_ones_own_is_a_method(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    seeing = methods.get_method(f"{tmp_path}/own.py:Mine")
    knowing = methods.get_method(f"{tmp_path}/own.py:still")
    assert (seeing.label, seeing.knows_all) == ("own.py:Mine: own cameras", False)
    assert (knowing.label, knowing.knows_all) == ("own.py:still: perfect knowledge", True)
    assert get_planner(seeing.run.planner).__name__ == "Mine"
    task = Task(f"{tmp_path}/own.py:still", Case(2))
    assert task.file(tmp_path).name == "own_py_still.json"
    with pytest.raises(InputError, match="neither a subclass of ReachPlanner nor a function"):
        methods.get_method(f"{tmp_path}/own.py:number")
    with pytest.raises(InputError, match="no such file"):
        methods.get_method(f"{tmp_path}/other.py:still")


def test_an_unknown_letter_is_answered_with_those_there_are():
    with pytest.raises(InputError, match=r'"q".*d \(ours, adapted\)'):
        methods.get_method("q")


def test_a_method_whose_package_is_missing_says_how_to_get_it():
    method = methods.Method("z", "", "", Fixed(), needs="no_such_package")
    with pytest.raises(InputError, match=r"method z needs no_such_package: run .*bench"):
        method.check()
    methods.get_method("a").check()


def test_letters_are_different_and_the_briefs_methods_are_there():
    assert [method.letter for method in methods.METHODS] == list("abcdefghi")
