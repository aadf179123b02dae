"""The formats that `fuzz.py` corrupts: writers of an intact file of each, and readers."""

import dataclasses
import importlib.util
import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

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
"""Upper bound of quantities in SI units, and of times in seconds since 1970."""

_UNKNOWN = ("target", "mean_costs")
"""Fields that may be unknown (NaN) or infinite."""


@dataclass(frozen=True)
class Format:
    """A file format.

    Attributes:
        make: Writes intact files into a folder, and returns the one to corrupt.
        read: Reads the files in the folder.
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], object]


def meaningless(value: object, name: str = "it", depth: int = 0) -> str:
    """Names the first number that is not finite or too large for a robot; "" if there is none.

    Args:
        value: Anything that a format reads: dataclasses, collections, arrays, numbers.
        name: Name of the value.
        depth: Depth of nesting; values deeper than any of our files are not checked.
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
    from fuzz_formats_perception import perception_formats

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
        **_result_formats(),
        **_taught_formats(),
        **perception_formats(),
        **_recordings(),
    }


def _result_formats() -> dict[str, Format]:
    """Results of runs, as JSON."""
    from pepper_drake.benchmarking.baseline import HIGHER, LOWER, Baseline, Metric
    from pepper_drake.evaluation.fault_table import FaultCase, fault_result, load_results
    from pepper_drake.results.reach_report import ReachReport

    def baseline(folder: Path) -> Path:
        metrics = {
            "still.reached of 4": Metric(4, "1", HIGHER, 0.0),
            "clearance": Metric(0.02, "m", LOWER, 0.001),
        }
        Baseline(metrics, "the first").save(folder / "baseline.json")
        return folder / "baseline.json"

    def report(folder: Path) -> Path:
        ReachReport(outcome="reached", minimum_clearance=0.02).save(folder / "report.json")
        return folder / "report.json"

    def faults(folder: Path) -> Path:
        cases = [FaultCase(f"depth:{kind}@0", "table", 3) for kind in ("freeze", "drop")]
        rows = [dataclasses.asdict(fault_result(case, ReachReport())) for case in cases]
        (folder / "faults.json").write_text(json.dumps(rows, indent=1))
        return folder / "faults.json"

    return {
        "baseline": Format(baseline, Baseline.load),
        "reach_report": Format(report, ReachReport.load),
        "faults": Format(faults, lambda path: list(load_results(path).items())),
    }


def _taught_formats() -> dict[str, Format]:
    """Sessions, tasks, joint primitives, interrupted recordings."""
    from pepper_drake.learning import Demonstration, JointPrimitive
    from pepper_drake.learning.demonstrations.arm_chain import arm_chain
    from pepper_drake.learning.demonstrations.recording import _POSE, PARTIAL, read_partial
    from pepper_drake.live.session_file import SessionFolder
    from pepper_drake.scenario import load_tasks

    shipped = MODELS / "demonstrations" / "reach"

    def session(folder: Path) -> Path:
        shutil.copytree(shipped, folder / "demonstrations" / "01")
        _primitive().save(folder / "primitive.yaml")
        (folder / "session.yaml").write_text(
            "title: ''\nscene: teach\narm: right\ndemonstrations: ['01']\nlearned: '01'\n"
            "tasks: [Lead the hand.]\noffsets: {cup: [0.1, 0.0, -0.02]}\n"
        )
        return folder / "session.yaml"

    def tasks(folder: Path) -> Path:
        (folder / "tasks.yaml").write_text(
            "tasks:\n- {name: lift, offset: [0.0, 0.0, 0.1]}\n- {wait: 0.5}\n- {hand: 0.1}\n"
            "- {name: home, returns: true}\n"
        )
        return folder / "tasks.yaml"

    def joint_primitive(folder: Path) -> Path:
        motion = Demonstration.load(shipped)
        primitive = JointPrimitive.fit(motion.times, motion.joints, motion.joint_names, num_basis=6)
        primitive.save(folder / "joints.yaml")
        return folder / "joints.yaml"

    def partial(folder: Path) -> Path:
        motion = Demonstration.load(shipped)
        assert motion.rotations is not None
        assert motion.joints is not None
        table = np.column_stack((motion.times, motion.positions, motion.rotations, motion.joints))
        rows = [",".join(f"{value:.5g}" for value in row) for row in table[100:148:4]]
        header = ",".join((*_POSE, *arm_chain("right").joint_names))
        (folder / PARTIAL).write_text("\n".join([header, *rows, "9,0.3"]))
        return folder / PARTIAL

    def pose(folder: Path) -> Path:
        rows = "".join(f"{0.1 * k} {0.01 * k} 0 0.2 1 0 0 0\n" for k in range(8))
        (folder / "cup_pose.txt").write_text("# time, position, w x y z\n" + rows)
        return folder / "cup_pose.txt"

    def taught(path: Path) -> object:
        return SessionFolder(path.parent).taught("right")

    return {
        "session_folder": Format(session, taught),
        "tasks": Format(tasks, load_tasks),
        "joint_primitive": Format(joint_primitive, lambda path: JointPrimitive.load(path)),
        "partial": Format(partial, lambda path: read_partial(path.parent)),
        "pose": Format(pose, Demonstration.load),
    }


def _recordings() -> dict[str, Format]:
    """Recordings of other tools, as the tests write them."""
    if str(ROOT) not in sys.path:
        sys.path.append(str(ROOT))
    from scipy.io import savemat

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

    def lasa(folder: Path) -> Path:
        times = np.linspace(0.0, 1.0, 30)
        motion = {"t": times[None], "pos": np.stack((20.0 * times, 5.0 * times**2))}
        savemat(folder / "angle.mat", {"demos": np.array([motion, motion], dtype=object)})
        return folder / "angle.mat"

    def beside(form: Format, name: str, up: int) -> Format:
        def make(folder: Path) -> Path:
            return form.make(folder).parents[up] / name

        return Format(
            make, lambda path: Demonstration.load(path.parents[len(Path(name).parts) - 1])
        )

    writers = dict(TEXTS)
    for name, (library, write) in BINARIES.items():
        if importlib.util.find_spec(library):
            writers[name] = write
    found = {name: recording(write) for name, write in writers.items()}
    if "rosbag2" in found:
        found["rosbag2_metadata"] = beside(found["rosbag2"], "metadata.yaml", 0)
    if "lerobot" in found:
        found["lerobot_info"] = beside(found["lerobot"], "meta/info.json", 2)
    found["lasa"] = Format(
        lasa, lambda path: Demonstration.load(path, track="1", plane=np.zeros(6))
    )
    return {f"recording_{name}": form for name, form in found.items()}


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
