"""Files of a benchmark, and recordings of its failed runs."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from tqdm import tqdm

from pepper_drake.benchmarking.batch import Task, file_stem
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.methods import get_method
from pepper_drake.benchmarking.scene_file import write_scene_file
from pepper_drake.benchmarking.summary import Scenes, markdown_table, summarise
from pepper_drake.reporting.benchmark_figure import draw_benchmark
from pepper_drake.reporting.leaderboard_page import leaderboard_page
from pepper_drake.reporting.scene_picture import save_start_picture
from pepper_drake.results.folder import whole_results

_NAMES = ("benchmark.md", "benchmark.json", "benchmark.png", "benchmark.html")


def replay_folder(output: Path, task: Task) -> Path:
    """Returns the folder of a run's recording."""
    return output / "replay" / f"{task.case.name}_{file_stem(task.method)}"


def record_failures(
    tasks: Sequence[Task], results: Sequence[MethodResult], output: Path, *, hidden: bool = True
) -> None:
    """Repeats and records failed runs without a recording.

    If a planner with perfect knowledge refused, there is no motion to record.

    Args:
        tasks: All runs.
        results: Results of the tasks, in their order.
        output: Folder of the benchmark.
        hidden: Whether to hide the progress bar.
    """
    failed = []
    for task, result in zip(tasks, results, strict=True):
        moved = result.outcome != "refused" or not get_method(task.method).knows_all
        known = (replay_folder(output, task) / "recording.html").exists()
        if result.outcome not in ("reached", "error") and moved and not known:
            failed.append(task)
    for task in tqdm(failed, unit="recording", disable=hidden):
        get_method(task.method).run.replay(task.case, replay_folder(output, task))


def save_benchmark(
    tasks: Sequence[Task], results: Sequence[MethodResult], output: Path, *, hidden: bool = True
) -> str:
    """Writes page, table, numbers, figure and a file for each scene.

    Args:
        tasks: All runs.
        results: Results of the tasks, in their order.
        output: Folder of the benchmark.
        hidden: Whether to hide the progress bar.

    Returns:
        The table in Markdown, with an explanation.
    """
    scenes, summaries = Scenes.of(results), summarise(results)
    text = (
        f"{markdown_table(summaries)}\n{scenes} Rates are of {scenes.share}, with 95 % confidence; "
        "the other numbers are medians over the runs that reached.\n"
    )
    failing = {
        summary.method: {
            result.case: f"{result.outcome}: {result.message}"
            for result in results
            if result.method == summary.method and result.outcome != "reached"
        }
        for summary in summaries
    }
    content = {
        "scenes": sorted(scenes.all),
        "solvable": None if scenes.solvable is None else sorted(scenes.solvable),
        "methods": [asdict(summary) for summary in summaries],
        "not_reached": failing,
    }
    pictures = _pictures(tasks, results, output, hidden=hidden)
    recordings = {
        (task.case.name, task.method): place.relative_to(output).as_posix()
        for task in tasks
        if (place := replay_folder(output, task) / "recording.html").exists()
    }
    with whole_results(output, _NAMES) as folder:
        (folder / "benchmark.md").write_text(f"# Reaching: {scenes}\n\n{text}")
        # JSON has no NaN: unknown values are null.
        finite = json.loads(json.dumps(content), parse_constant=lambda _: None)
        (folder / "benchmark.json").write_text(json.dumps(finite, indent=2) + "\n")
        draw_benchmark(summaries, results).savefig(folder / "benchmark.png", dpi=110)
        figure = (folder / "benchmark.png").read_bytes()
        page = leaderboard_page(
            summaries, results, figure, pictures=pictures, recordings=recordings
        )
        (folder / "benchmark.html").write_text(page)
    return text


def _pictures(
    tasks: Sequence[Task], results: Sequence[MethodResult], output: Path, *, hidden: bool
) -> dict[str, bytes]:
    """Writes the scenes' files, and returns pictures of scenes with failures."""
    folder, pictures = output / "scenes", {}
    failed = {result.case for result in results if result.outcome not in ("reached", "error")}
    built = [t.case for t, r in zip(tasks, results, strict=True) if r.outcome != "error"]
    cases = {case.name: case for case in built}
    for name, case in tqdm(cases.items(), unit="scene", disable=hidden):
        file = folder / f"{name}.json"
        if not file.exists():
            write_scene_file(case.build(), file)
        if name in failed:
            if not file.with_suffix(".png").exists():
                save_start_picture(case.build(), file.with_suffix(".png"))
            pictures[name] = file.with_suffix(".png").read_bytes()
    return pictures
