"""Many runs, each in its own process, with results in files: existing ones are not run again."""

import multiprocessing
import re
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from pepper_drake import cli
from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.methods import get_method
from pepper_drake.signals import end_with_parent

LONGEST_RUN = 600.0
"""Timeout of a run [s]; a longer one is killed and counts as an error."""

_PERIOD = 0.2
"""Period of checks for the end of a run [s]."""


@dataclass(frozen=True)
class Task:
    """One method on one case."""

    method: str
    case: Case

    def file(self, folder: Path) -> Path:
        """Returns the file with the result."""
        return folder / "results" / self.case.name / f"{file_stem(self.method)}.json"


def file_stem(method: str) -> str:
    """Returns a file name's stem for a method: its letter, or FILE.py:NAME without folder."""
    return re.sub(r"[^A-Za-z0-9_]+", "_", method.rpartition("/")[2])


def run_task(task: Task) -> MethodResult:
    """Runs a task in this process; an exception becomes its result, for the table."""
    begin = time.perf_counter()
    try:
        result = get_method(task.method).run(task.case)
    except Exception as error:
        message = f"{type(error).__name__}: {error}".splitlines()[0]
        result = MethodResult(reason="broken", message=message)
    result.method, result.case = task.method, task.case.name
    result.wall_seconds = time.perf_counter() - begin
    return result


def run_tasks(
    tasks: Sequence[Task],
    folder: Path,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Callable[[MethodResult], object] = lambda result: None,
) -> list[MethodResult]:
    """Runs tasks without a result, and returns the results of all tasks in their order.

    A run that crashes or takes too long is an "error" in the results, does not affect the others,
    and is repeated the next time.

    Args:
        tasks: The tasks.
        folder: Folder of the results.
        jobs: Number of parallel runs on this machine.
        executor: Runs the tasks instead, without timeout.
        progress: Called with each result, including existing ones.

    Raises:
        InputError: A file in the folder is not a result.
    """
    results = {task: MethodResult.load(f) for task in tasks if (f := task.file(folder)).exists()}
    results = {task: result for task, result in results.items() if result.outcome != "error"}
    for result in results.values():
        progress(result)
    missing = [task for task in tasks if task not in results]
    pool = ThreadPoolExecutor(jobs) if executor is None else executor
    stop = threading.Event()
    running: dict[Future[MethodResult], Task] = {}
    try:
        for task in missing:
            if executor is None:
                running[pool.submit(_run_in_process, task, folder, stop)] = task
            else:
                running[pool.submit(run_task, task)] = task
        for future in as_completed(running):
            task = running[future]
            results[task] = future.result()
            if executor is not None:
                results[task].save(task.file(folder))
            progress(results[task])
    finally:
        stop.set()
        for future in running:
            future.cancel()
        if executor is None:
            pool.shutdown()
    return [results[task] for task in tasks]


def _run_in_process(task: Task, folder: Path, stop: threading.Event) -> MethodResult:
    """Runs a task in a new process, forked from one that has only imported the modules.

    The process is killed when the event is set; then no result is saved.
    """
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload([__name__])
    process = processes.Process(target=_in_process, args=(task, folder))
    process.start()
    end = time.monotonic() + LONGEST_RUN
    while process.is_alive() and time.monotonic() < end and not stop.is_set():
        process.join(_PERIOD)
    message = f"the run ended with exit code {process.exitcode}"
    if process.is_alive():
        process.kill()
        process.join()
        message = f"the run took longer than {LONGEST_RUN:g} s"
    if task.file(folder).exists():
        return MethodResult.load(task.file(folder))
    broken = MethodResult(task.case.name, task.method, reason="broken", message=message)
    if not stop.is_set():
        broken.save(task.file(folder))
    return broken


def _in_process(task: Task, folder: Path) -> None:
    """Runs a task and saves its result; the main function of a process."""
    end_with_parent()
    cli.limit_linear_algebra()
    cli.quiet_libraries()
    task.file(folder).unlink(missing_ok=True)
    run_task(task).save(task.file(folder))
