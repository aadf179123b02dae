"""The result of a simulated reach, and its files."""

from dataclasses import dataclass
from pathlib import Path

from pepper_drake.models.scene import Scene, save_scene
from pepper_drake.results.folder import whole_results
from pepper_drake.results.reach_log import ReachLog
from pepper_drake.results.reach_report import ReachReport


@dataclass(frozen=True)
class ReachResult:
    """Result of a run: scene, report, log, and the recording as an HTML page, if any."""

    scene: Scene
    report: ReachReport
    log: ReachLog
    html: str | None


def save_result(result: ReachResult, folder: Path) -> None:
    """Writes `report.json`, `scene.yaml`, `log.npz` and, if recorded, `recording.html`."""
    folder.mkdir(parents=True, exist_ok=True)
    save_scene(result.scene, folder / "scene.yaml")
    result.log.save(folder / "log.npz")
    if result.html is not None:
        (folder / "recording.html").write_text(result.html)
    result.report.save(folder / "report.json")


def keep_result(result: ReachResult, folder: Path) -> None:
    """Writes an unfinished run atomically and fast, without recording; see `save_result`."""
    with whole_results(folder, ()) as inside:
        save_scene(result.scene, inside / "scene.yaml")
        result.log.save(inside / "log.npz", compress=False)
        result.report.save(inside / "report.json")
