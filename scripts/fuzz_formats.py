"""The formats that `fuzz.py` corrupts: how a good file of each is made, and how one is read."""

import importlib.util
import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).parents[1]
MODELS = ROOT / "pepper_drake" / "models"


_CALIBRATION = """robot: worn, seed 3
date: '2026-11-28T23:15:00+00:00'
reason: routine
joints:
  RElbowRoll: {offset: 0.004, offset_sigma: 0.0001, slack: 0.017, slack_sigma: 0.0002}
cameras:
  camera_top: {position: [0.001, 0.0, -0.002], rotation: [0.01, 0.0, 0.002], focal: 1.004}
residuals: {position_before: 0.008, position_after: 0.0003, postures: 20, images: 21}
held: [RWristYaw offset]
"""


_LARGEST = 1e12
"""Nothing in SI units is larger, nor a time in seconds since 1970."""

_UNKNOWN = ("target", "mean_costs")
"""Numbers that may be unknown or without bound."""


@dataclass(frozen=True)
class Format:
    """A format: how a good file is made, and how one is read.

    Attributes:
        make: Writes good files into a folder, and returns which one is corrupted.
        read: Reads what is in the folder.
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], object]


def meaningless(value: object, name: str = "it", depth: int = 0) -> str:
    """Returns which number of what was read is none that a robot's world has; "" if all are.

    Args:
        value: Anything that a format reads: dataclasses, collections, arrays, numbers.
        name: Where it comes from.
        depth: How far inside; what is deeper than any of our files is left alone.
    """
    if depth > 8 or isinstance(value, str | bytes | bool | Path):
        return ""
    if isinstance(value, int | float | np.ndarray | np.generic):
        numbers = np.asarray(value)
        if numbers.dtype.kind in "SUmM" or (numbers.dtype.kind in "fiub" and _is_sane(numbers)):
            return ""
        return f"{name} is {numbers.ravel()[:3]} ({numbers.dtype})"
    if isinstance(value, dict):
        inside = {f"{name}[{key!r}]": item for key, item in value.items()}
    elif isinstance(value, list | tuple | set | frozenset):
        inside = {f"{name}[{index}]": item for index, item in enumerate(value)}
    else:
        fields = vars(value) if hasattr(value, "__dict__") else {}
        inside = {f"{name}.{key}": item for key, item in fields.items() if key not in _UNKNOWN}
    found = (meaningless(item, where, depth + 1) for where, item in inside.items())
    return next(filter(None, found), "")


def _is_sane(numbers: np.ndarray) -> bool:
    return bool(np.all(np.isfinite(numbers)) and np.all(np.abs(numbers.astype(float)) < _LARGEST))


def formats() -> dict[str, Format]:
    """Returns the formats by name."""
    from pepper_drake.benchmarking.method_result import MethodResult
    from pepper_drake.learning import Demonstration, MovementPrimitive
    from pepper_drake.learning.dmp.bimanual import BimanualPrimitive
    from pepper_drake.learning.dmp.rhythmic import RhythmicPrimitive
    from pepper_drake.live.script import load_script
    from pepper_drake.models.guide import load_guide
    from pepper_drake.models.joint_script import load_joint_script
    from pepper_drake.models.marker_script import load_marker_script
    from pepper_drake.models.motion import load_path, path_trajectory
    from pepper_drake.models.obj_files import check_obj
    from pepper_drake.models.pad_script import load_pad_script
    from pepper_drake.models.robot_calibration import load_calibration
    from pepper_drake.models.scene import load_scene
    from pepper_drake.optimization.cost import load_cost
    from pepper_drake.optimization.history import History
    from pepper_drake.optimization.movement_problem import load_points
    from pepper_drake.optimization.ratings import load_scores
    from pepper_drake.playback.loading import load_motion

    demonstration = MODELS / "demonstrations" / "reach"

    def text(name: str, content: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            (folder / name).write_text(content)
            return folder / name

        return make

    def copy(source: Path) -> Callable[[Path], Path]:
        return text(source.name, source.read_text())

    def part(name: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            for file in demonstration.iterdir():
                lines = file.read_text().splitlines(keepends=True)
                (folder / file.name).write_text("".join(lines[:40]))
            return folder / name

        return make

    def primitive(folder: Path) -> Path:
        _primitive().save(folder / "primitive.yaml")
        return folder / "primitive.yaml"

    def rhythmic(folder: Path) -> Path:
        weights = np.arange(15.0).reshape(5, 3)
        RhythmicPrimitive(weights, 3.0, np.zeros(3), 2.0).save(folder / "circle.yaml")
        return folder / "circle.yaml"

    def bimanual(folder: Path) -> Path:
        for name in ("absolute", "relative"):
            _primitive().save(folder / f"{name}.yaml")
        return text("pair.yaml", "hold_rate: 60.0\n")(folder)

    def history(folder: Path) -> Path:
        samples = [np.ones((4, 3)), np.zeros((4, 3))]
        costs = [np.arange(4.0), np.ones((4, 5))]
        means = [np.zeros(3)] * 3
        History({"seed": 1}, samples, costs, means, [1.0, float("nan"), 3.0]).save(
            folder / "history.npz"
        )
        return folder / "history.npz"

    def run(name: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            _write_run(folder)
            return folder / name

        return make

    def reproduction(folder: Path) -> Path:
        _write_reproduction(folder)
        return folder / "log.npz"

    def mesh_scene(folder: Path) -> Path:
        shutil.copy(MODELS / "meshes" / "mug.obj", folder / "mug.obj")
        scene = (MODELS / "scenes" / "free.yaml").read_text().partition("obstacles:")[0]
        (folder / "scene.yaml").write_text(
            scene + "obstacles:\n- {name: mug, shape: mesh, mesh: mug.obj, size: [1.0],"
            " position: [2.0, 1.0, 0.5]}\n"
        )
        return folder / "mug.obj"

    result = MethodResult("scene_1", "d", "reached", clearance=0.02, wall_seconds=3.0)

    def method_result(folder: Path) -> Path:
        result.save(folder / "d.json")
        return folder / "d.json"

    return {
        "scene": Format(copy(MODELS / "scenes" / "clutter.yaml"), load_scene),
        "moving_scene": Format(
            text("scene.yaml", _moving_scene()), lambda path: load_scene(path).mirrored()
        ),
        "guide": Format(copy(MODELS / "guides" / "reach.yaml"), load_guide),
        "joints": Format(copy(MODELS / "guides" / "joints.yaml"), load_joint_script),
        "pad": Format(copy(MODELS / "guides" / "pad.yaml"), load_pad_script),
        "marker": Format(copy(MODELS / "guides" / "marker.yaml"), load_marker_script),
        "session": Format(
            copy(MODELS / "sessions" / "story.yaml"), lambda path: load_script(str(path))
        ),
        "calibration": Format(text("calibration.yaml", _CALIBRATION), load_calibration),
        "cost": Format(text("cost.yaml", "hand_to_goal: 1.0\njerk: 1e-3\nrating: 0\n"), load_cost),
        "primitive": Format(primitive, lambda path: MovementPrimitive.load(path).rollout()),
        "rhythmic": Format(rhythmic, RhythmicPrimitive.load),
        "bimanual": Format(bimanual, lambda path: BimanualPrimitive.load(path.parent)),
        "mesh": Format(mesh_scene, lambda path: load_scene(path.parent / "scene.yaml")),
        "mesh_alone": Format(copy(MODELS / "meshes" / "bottle.obj"), check_obj),
        "log": Format(run("log.npz"), lambda path: load_motion(path.parent)),
        "report": Format(run("report.json"), lambda path: load_motion(path.parent)),
        "run_scene": Format(run("scene.yaml"), lambda path: load_motion(path.parent)),
        "reproduction": Format(reproduction, lambda path: load_motion(path.parent)),
        "history": Format(history, lambda path: History.load(path).best()),
        "points_npz": Format(run("log.npz"), load_points),
        "points": Format(text("cloud.txt", "# m\n0.3 0.1 0.2\n0.4 -0.1 0.25\n"), load_points),
        "ratings": Format(text("scores.txt", "3\n7.5 # better\n10\n"), load_scores),
        "path": Format(
            text("path.txt", "0 0 0 0\n1 0 0 0.1\n2.5 0 0.1 0.1\n"),
            lambda path: path_trajectory(load_path(path)),
        ),
        "method_result": Format(method_result, MethodResult.load),
        "translation": Format(part("translation.txt"), lambda p: Demonstration.load(p.parent)),
        "rotation": Format(part("rotation.txt"), lambda p: Demonstration.load(p.parent)),
        "joints_csv": Format(part("joints.csv"), lambda p: Demonstration.load(p.parent)),
        **_perception_formats(),
        **_recordings(),
    }


def _perception_formats() -> dict[str, Format]:
    """Files of cameras, images and clouds, and the scenario."""
    from pepper_drake.perception.cameras.camera_files import load_intrinsics
    from pepper_drake.perception.cameras.image_files import read_depth, read_image
    from pepper_drake.perception.mapping.cloud_files import load_cloud
    from pepper_drake.scenario import Scenario, load_scenario, save_scenario

    matrix = [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0]
    distortion = [0.1, -0.2, 0.001, 0.0, 0.0]

    def scenario(folder: Path) -> Path:
        save_scenario(Scenario(), folder / "scenario.yaml")
        return folder / "scenario.yaml"

    def camera_info(folder: Path) -> Path:
        (folder / "camera.yaml").write_text(
            "image_width: 640\nimage_height: 480\ncamera_name: head\n"
            f"camera_matrix: {{rows: 3, cols: 3, data: {matrix}}}\n"
            "distortion_model: plumb_bob\n"
            f"distortion_coefficients: {{rows: 1, cols: 5, data: {distortion}}}\n"
        )
        return folder / "camera.yaml"

    def file_storage(name: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            storage = cv2.FileStorage(str(folder / name), cv2.FILE_STORAGE_WRITE)
            storage.write("image_width", 640)
            storage.write("image_height", 480)
            storage.write("camera_matrix", np.array(matrix).reshape(3, 3))
            storage.write("distortion_coefficients", np.array(distortion))
            storage.release()
            return folder / name

        return make

    def image(name: str, dtype: type) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            pixels = np.arange(24 * 32, dtype=dtype).reshape(24, 32)
            cv2.imwrite(str(folder / name), pixels)
            return folder / name

        return make

    def cloud(name: str, head: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            rows = "".join(f"{0.1 * k} {-0.2 * k} 0.75\n" for k in range(10))
            (folder / name).write_text(head + rows)
            return folder / name

        return make

    pcd = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        "WIDTH 10\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 10\nDATA ascii\n"
    )
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 10\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n"
    )
    return {
        "scenario": Format(scenario, load_scenario),
        "camera_info": Format(camera_info, load_intrinsics),
        "camera_yml": Format(file_storage("camera.yml"), load_intrinsics),
        "camera_json": Format(file_storage("camera.json"), load_intrinsics),
        "camera_xml": Format(file_storage("camera.xml"), load_intrinsics),
        "image": Format(image("photo.png", np.uint8), read_image),
        "depth_image": Format(image("depth.png", np.uint16), read_depth),
        "pcd": Format(cloud("cloud.pcd", pcd), load_cloud),
        "ply": Format(cloud("cloud.ply", ply), load_cloud),
    }


def _recordings() -> dict[str, Format]:
    """Recordings of other tools, as the tests write them."""
    if str(ROOT) not in sys.path:
        sys.path.append(str(ROOT))
    from pepper_drake.learning import Demonstration
    from tests.learning.demonstrations.importers.recordings import (
        BINARIES,
        TEXTS,
        main_file,
        make_motion,
    )

    def recording(write: Callable[..., Path]) -> Format:
        def make(folder: Path) -> Path:
            return main_file(write(folder, make_motion(rate=25.0)))

        def read(path: Path) -> object:
            if path.suffix == ".parquet":
                return Demonstration.load(path.parents[2])
            is_bag = (path.parent / "metadata.yaml").exists()
            return Demonstration.load(path.parent if is_bag else path)

        return Format(make, read)

    writers = dict(TEXTS)
    for name, (library, write) in BINARIES.items():
        if importlib.util.find_spec(library):
            writers[name] = write
    return {f"recording_{name}": recording(write) for name, write in writers.items()}


def _primitive():  # noqa: ANN202
    from pepper_drake.learning import Demonstration, MovementPrimitive

    demo = Demonstration.load(MODELS / "demonstrations" / "reach")
    return MovementPrimitive.fit(demo, num_basis=8)


def _moving_scene() -> str:
    text = (MODELS / "scenes" / "free.yaml").read_text().partition("obstacles:")[0]
    return (
        text
        + """obstacles:
- name: ball
  shape: sphere
  size: [0.05]
  position: [0.9, 1.0, 1.2]
  path: [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, -0.3, 0.0], [2.5, 0.1, -0.3, 0.1]]
"""
    )


def _write_run(folder: Path) -> None:
    from pepper_drake.models.scene import load_scene, save_scene
    from pepper_drake.results.reach_log import _COLUMNS

    rows = 30
    arrays = {
        name: np.zeros(rows if columns is None else (rows, columns))
        for name, columns in _COLUMNS.items()
    }
    arrays |= {
        "time_s": 0.01 * np.arange(rows),
        "object_offset_m": np.zeros((rows, 0)),
        "cloud_torso_m": np.ones((20, 3)),
        "demonstration_m": np.ones((20, 3)),
        "taught_path_torso_m": np.ones((20, 3)),
    }
    np.savez_compressed(folder / "log.npz", **arrays)
    save_scene(load_scene("free"), folder / "scene.yaml")
    report = {"outcome": "reached", "reason": "", "scene": "free", "minimum_clearance": 0.02}
    (folder / "report.json").write_text(json.dumps(report, indent=2))


def _write_reproduction(folder: Path) -> None:
    rows = 30
    np.savez_compressed(
        folder / "log.npz",
        time_s=0.01 * np.arange(rows),
        phase=np.linspace(1, 0.1, rows),
        slowdown=np.zeros(rows),
        hand_position_torso_m=np.zeros((rows, 3)),
        desired_position_torso_m=np.zeros((rows, 3)),
        joint_position_rad=np.zeros((rows, 5)),
        goal_position_torso_m=np.zeros(3),
    )
    (folder / "report.json").write_text('{"outcome": "reached", "arm": "right"}')
