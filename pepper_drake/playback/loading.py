"""Loading motions: a run's folder, a demonstration or a primitive."""

from pathlib import Path
from typing import Any

import numpy as np

from pepper_drake.array_files import npz_names
from pepper_drake.errors import InputError, one_line
from pepper_drake.files import path_inside, read_json
from pepper_drake.models.objects import GOAL_OBJECT
from pepper_drake.models.pepper import ARMS, BODY_JOINTS, JOINT_GROUPS, arm_group
from pepper_drake.models.scene import Scene, load_scene
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.playback.motion import Motion, Signal, Vector
from pepper_drake.results.folder import INTERRUPTED
from pepper_drake.results.log_files import check_rows, read_arrays
from pepper_drake.results.movement_report import coupling_strength, measure_movement
from pepper_drake.results.reach_log import ReachLog

LOG, REPORT, SCENE = "log.npz", "report.json", "scene.yaml"
TRANSLATION, PRIMITIVE = "translation.txt", "primitive.yaml"

_REPRODUCTION_COLUMNS = {
    "phase": None,
    "slowdown": None,
    "hand_position_torso_m": 3,
    "desired_position_torso_m": 3,
    "joint_position_rad": 5,
}

_FIGURES = {
    "hand to goal [mm]": ("final_position_error", 1000.0),
    "orientation error [deg]": ("final_orientation_error", float(np.degrees(1.0))),
    "task axis error [deg]": ("final_axis_error", float(np.degrees(1.0))),
    "least clearance [mm]": ("minimum_clearance", 1000.0),
    "tracking error [mm]": ("tracking_error_rms", 1000.0),
}
"""Figures to compare, by name: field of the report, and scale."""

_LARGEST_FIGURE = 1e3
"""Largest length [m] or angle [rad] that is accepted in a report."""


def load_motion(path: str | Path) -> Motion:
    """Loads a motion from any kind of file that can be played back.

    Args:
        path: The folder of a run of `apps/reach.py` or `apps/reproduce.py`; a demonstration (a
            folder or a text file); or a primitive's YAML file or its folder: it is rolled out with
            the start, goal and duration that it was learned with.

    Raises:
        InputError: The file is missing or broken; the message says what to do, in one sentence.
    """
    path = Path(path)
    if path.name == LOG:
        path = path.parent
    if not (path / LOG).exists() and (path / INTERRUPTED / LOG).exists():
        path = path_inside(path, INTERRUPTED)
    if (path / LOG).exists():
        log = path_inside(path, LOG)
        try:
            is_reproduction = "slowdown" in npz_names(log)
        except InputError as error:
            why = str(error).removeprefix(f"{log}: ")
            raise InputError(f"{log}: this is not a log of a run ({why})") from None
        return _load_reproduction(path) if is_reproduction else _load_run(path)
    if path.suffix == ".txt" or (path / TRANSLATION).exists():
        return _load_demonstration(path, path.resolve().name.removesuffix(".txt"))
    if (path / "demonstration" / TRANSLATION).exists():  # From `apps/teach.py`.
        return _load_demonstration(path_inside(path, "demonstration"), path.resolve().name)
    if path.suffix in (".yaml", ".yml"):
        return _load_primitive(path)
    if (path / PRIMITIVE).exists():
        return _load_primitive(path_inside(path, PRIMITIVE))
    raise InputError(
        f"{path}: nothing to play back; give the folder of a run (with {LOG}), a demonstration "
        f"(a folder with {TRANSLATION}, or a text file) or a primitive's YAML file"
    )


def _load_run(folder: Path) -> Motion:
    report = _load_report(path_inside(folder, REPORT))
    log = ReachLog.load(path_inside(folder, LOG))
    if not (folder / SCENE).exists():
        raise InputError(f"{folder}: the run lacks {SCENE}; record the run again")
    scene = load_scene(path_inside(folder, SCENE))
    positions = {
        **dict(zip(BODY_JOINTS, log.joint_position_rad.T, strict=True)),
        **dict(zip(JOINT_GROUPS["base"], log.base_pose_m_m_rad.T, strict=True)),
        **_object_positions(folder, scene, log.object_offset_m),
    }
    _check_finite(folder / LOG, positions)
    hands = dict(zip(HANDS, log.hand_opening.T, strict=True)) if log.hand_opening.size else {}
    reaching = np.flatnonzero(log.mode == ReachMode.REACHING)
    return Motion(
        name=folder.resolve().name,
        arm=scene.arm,
        times=log.time_s,
        positions=positions,
        hands=hands,
        scene=scene,
        arm_starts=float(log.time_s[reaching[0]] if len(reaching) else log.time_s[-1]),
        shown_T=log.taught_path_torso_m if len(log.taught_path_torso_m) else log.demonstration_m,
        cloud_T=log.cloud_torso_m,
        stages=_stages(log),
        signals={
            "hand to goal": Signal("mm", 1000 * log.goal_distance_m),
            "clearance": Signal("mm", 1000 * log.clearance_m),
            "coupling": Signal("m/s²", coupling_strength(log)),
            "phase": Signal("", log.phase),
        },
        figures=_run_figures(log, report),
    )


def _load_reproduction(folder: Path) -> Motion:
    path = path_inside(folder, LOG)
    log = read_arrays(path, ("time_s", "goal_position_torso_m", *_REPRODUCTION_COLUMNS))
    check_rows(path, log, _REPRODUCTION_COLUMNS)
    report = _load_report(path_inside(folder, REPORT))
    arm = str(report.get("arm"))
    if arm not in ARMS:
        raise InputError(f"{folder / REPORT}: arm is {arm}; it must be one of {', '.join(ARMS)}")
    goal = log["goal_position_torso_m"]
    if goal.shape != (3,) or not np.all(np.abs(goal) < 1e3):
        raise InputError(f"{path}: goal_position_torso_m must be x y z; record the run again")
    positions = dict(zip(JOINT_GROUPS[arm_group(arm)], log["joint_position_rad"].T, strict=True))
    _check_finite(path, positions)
    times, hand = log["time_s"], log["hand_position_torso_m"]
    moving = np.flatnonzero(log["phase"] < 1.0)
    distance = np.linalg.norm(hand - goal, axis=1)
    return Motion(
        name=folder.resolve().name,
        arm=arm,
        times=times,
        positions=positions,
        arm_starts=float(times[moving[0]] if len(moving) else times[0]),
        shown_T=log["desired_position_torso_m"],
        signals={
            "hand to goal": Signal("mm", 1000 * distance),
            "waiting": Signal("", log["slowdown"]),
            "phase": Signal("", log["phase"]),
        },
        figures=_report_figures(report)
        | {
            "whole run takes [s]": float(times[-1]),
            "hand path length [m]": float(np.linalg.norm(np.diff(hand, axis=0), axis=1).sum()),
        },
    )


def _check_finite(path: Path, positions: dict[str, Vector]) -> None:
    for name, values in positions.items():
        if not np.all(np.abs(values) < 1e3):
            raise InputError(f"{path}: {name} is not finite; record the run again")


def _object_positions(folder: Path, scene: Scene, offsets: Vector) -> dict[str, Vector]:
    """Returns the positions of the joints that `add_scene` gives to objects with a path."""
    moving = [obstacle.name for obstacle in scene.obstacles if obstacle.path]
    moving += [GOAL_OBJECT] if scene.goal.path else []
    names = [f"{name}_{axis}" for name in moving for axis in "xyz"]
    if len(names) != offsets.shape[1]:
        raise InputError(
            f"{folder / LOG}: object_offset_m has {offsets.shape[1]} columns, but in {SCENE} "
            f"{len(moving)} objects have a path; record the run again"
        )
    return dict(zip(names, offsets.T, strict=True))


def _stages(log: ReachLog) -> tuple[tuple[float, str], ...]:
    changes = [0, *(np.flatnonzero(np.diff(log.mode)) + 1)]
    names = {int(mode): mode.name.lower() for mode in ReachMode}
    return tuple(
        (float(log.time_s[row]), names.get(int(log.mode[row]), "unknown")) for row in changes
    )


def _run_figures(log: ReachLog, report: dict[str, Any]) -> dict[str, str | float]:
    """Returns figures to compare, from the report and the hand's path."""
    moving = np.isin(log.mode, (ReachMode.REACHING, ReachMode.HOLDING))
    hand, times = log.hand_position_torso_m[moving], log.time_s[moving]
    movement = measure_movement(log)
    figures = _report_figures(report) | {"movement": movement.kind.replace("_", " ")}
    if movement.largest_deviation is not None:
        figures["from taught path, max [mm]"] = 1000 * movement.largest_deviation
    figures["whole run takes [s]"] = float(log.time_s[-1])
    if len(hand) > 1:
        figures["arm moves for [s]"] = float(times[-1] - times[0])
        figures["hand path length [m]"] = float(np.linalg.norm(np.diff(hand, axis=0), axis=1).sum())
    return figures


def _report_figures(report: dict[str, Any]) -> dict[str, str | float]:
    figures: dict[str, str | float] = {
        name: one_line(report.get(name, "")) for name in ("outcome", "reason", "scene", "coupling")
    }
    for name, (key, scale) in _FIGURES.items():
        value = report.get(key)
        if isinstance(value, int | float) and not isinstance(value, bool):
            figures[name] = scale * value
    return figures


def _load_report(path: Path) -> dict[str, Any]:
    if not path.exists():
        raise InputError(f"{path}: the report is missing; record the run again")
    try:
        report = read_json(path)
    except InputError as error:
        why = str(error).removeprefix(f"{path}: ")
        raise InputError(
            f"{path}: this is not a report of a run ({why}); record it again"
        ) from None
    if not isinstance(report, dict) or not isinstance(report.get("outcome"), str):
        raise InputError(f"{path}: the report says no outcome; record the run again")
    for key, _ in _FIGURES.values():
        value = report.get(key)
        if isinstance(value, int | float) and abs(value) > _LARGEST_FIGURE:
            raise InputError(f"{path}: {key} is {value:g}; record the run again")
    for name in ("reason", "scene", "coupling", "arm"):
        if not isinstance(report.get(name, ""), str):
            raise InputError(f"{path}: {name} is no text; record the run again")
    return report


def _load_demonstration(path: Path, name: str) -> Motion:
    # Imported here since learning imports SciPy, which a run does not need.
    from pepper_drake.learning.demonstrations.demonstration import Demonstration

    demo = Demonstration.load(path)
    joints = demo.joints if demo.joints is not None else np.zeros((len(demo.times), 0))
    return Motion(
        name=name,
        arm=_arm_of(demo.joint_names, demo.positions),
        times=demo.times,
        positions=dict(zip(demo.joint_names, joints.T, strict=True)),
        arm_starts=float(demo.times[0]),
        hand_T=demo.positions if demo.joints is None else None,
        hand_rotations_T=demo.rotations if demo.joints is None else None,
        shown_T=demo.positions,
        figures={
            "outcome": "demonstration",
            "arm moves for [s]": demo.duration,
            "hand path length [m]": demo.path_length,
        },
    )


def _load_primitive(path: Path) -> Motion:
    from pepper_drake.learning.dmp.primitive import MovementPrimitive

    primitive = MovementPrimitive.load(path)
    rollout = primitive.rollout()
    names = primitive.posture.names if primitive.posture is not None else ()
    length = np.linalg.norm(np.diff(rollout.positions, axis=0), axis=1).sum()
    return Motion(
        # All apps write primitive.yaml: only the folder's name is specific.
        name=path.stem if path.stem != "primitive" else path.resolve().parent.name,
        arm=_arm_of(names, rollout.positions),
        times=rollout.times,
        # A primitive's joints are only the nominal posture, so the commanded hand is drawn.
        hand_T=rollout.positions,
        hand_rotations_T=rollout.rotations,
        shown_T=rollout.positions,
        figures={
            "outcome": "primitive",
            "arm moves for [s]": float(rollout.times[-1]),
            "hand path length [m]": float(length),
        },
    )


def _arm_of(joint_names: tuple[str, ...], positions_T: Vector) -> str:
    """Returns the arm that moved: by its joints, or else by the hand's side of the body."""
    if joint_names:
        return "left" if any(name.startswith("L") for name in joint_names) else "right"
    return "left" if float(positions_T[:, 1].mean()) > 0.0 else "right"
