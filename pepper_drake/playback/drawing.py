"""Motions as commands to meshcat's viewer: shapes, hand paths, clouds, animation, control bar."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import meshcat.geometry as mg
import numpy as np
import numpy.typing as npt
import umsgpack
from meshcat.animation import Animation, AnimationClip, AnimationTrack
from meshcat.commands import Delete, SetAnimation, SetObject, SetProperty, SetTransform
from meshcat.path import Path as MeshcatPath
from meshcat.transformations import quaternion_matrix

from pepper_drake.playback.bodies import FRAME_RATE, Frames, MovingBody
from pepper_drake.playback.comparison import compare
from pepper_drake.playback.meshcat_shapes import Tube, material, meshcat_object
from pepper_drake.playback.motion import Vector

ROOT = "/pepper_drake"
"""Root path of all drawn objects."""

RUN_COLORS = ("#1668b0", "#d9601a", "#2f8f46", "#8a4fb0", "#c23a4b", "#0f8f96", "#8a6a3a")
"""Colours of the motions, repeated if there are more."""

_GHOST_OPACITY = 0.38
_GHOST_TINT = 0.6  # Fraction of the run's colour in a ghost's.
_PATH_RADIUS, _SHOWN_RADIUS, _CLOUD_POINT = 0.003, 0.002, 0.008  # [m]
_PATH_STEP = 0.002  # Smallest distance between a path's points [m].
_SHOWN_COLOR, _CLOUD_COLOR = (0.05, 0.05, 0.05), (0.85, 0.33, 0.10)
_SKY, _GROUND = (0.97, 0.98, 0.99), (0.80, 0.84, 0.88)
_KEY_TOLERANCE = 2e-4  # Of positions [m] and of quaternions.
_HALVINGS = 8
_CONTROL = "show / hide figures"


@dataclass(frozen=True)
class Command:
    """One message to the viewer: its type, its path and the msgpack data."""

    kind: str
    path: str
    data: bytes


def draw(runs: Sequence[Frames]) -> list[Command]:
    """Draws motions on top of one another.

    The first has its own colours; further ones are ghosts in the colour of their hand path.
    Objects that are identical in the first scene are not drawn again.

    Args:
        runs: The motions' frames.
    """
    commands = [_message(Delete(MeshcatPath(()).append(ROOT))), *_background(runs[0])]
    animation = Animation(default_framerate=int(FRAME_RATE))
    for index, run in enumerate(runs):
        color = run_color(index)
        prefix = f"{ROOT}/{index + 1}"
        for body in run.bodies:
            if index > 0 and any(_same(body, other) for other in runs[0].bodies):
                continue
            commands += _body(body, f"{prefix}/{body.name}", color if index > 0 else None)
            _animate(animation, f"{prefix}/{body.name}", body)
        commands += _hand_paths(run, prefix, color, first=index == 0)
    commands.append(_message(SetAnimation(animation, play=True, repetitions=1)))
    commands.append(_control_bar(runs))
    return commands


def run_color(index: int) -> tuple[float, float, float]:
    """Returns the colour (RGB, 0 to 1) of the motion with this index."""
    code = RUN_COLORS[index % len(RUN_COLORS)]
    red, green, blue = (int(code[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def _message(command: Any) -> Command:
    lowered = command.lower()
    return Command(lowered["type"], lowered["path"], umsgpack.packb(lowered))


def _path(path: str) -> MeshcatPath:
    return MeshcatPath(()).append(path)


def _background(run: Frames) -> list[Command]:
    commands = [
        SetProperty("visible", run.motion.scene is None, _path("/Grid")),
        SetProperty("visible", False, _path("/Axes")),
        SetProperty("top_color", list(_SKY), _path("/Background")),
        SetProperty("bottom_color", list(_GROUND), _path("/Background")),
    ]
    return [_message(command) for command in commands]


def _view(run: Frames) -> dict[str, list[float]]:
    """Returns camera position and target in W: from the arm's side, past the hand to the robot."""
    side = 1.0 if run.motion.arm == "left" else -1.0
    cos, sin = np.cos(run.yaw), np.sin(run.yaw)
    R_WP = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    target = run.hand_W.mean(axis=0) + R_WP @ [-0.15, 0.0, -0.12]
    eye = target + R_WP @ [0.85, 1.9 * side, 0.75]
    return {"eye": eye.tolist(), "target": target.tolist()}


def _body(body: MovingBody, path: str, ghost: tuple[float, float, float] | None) -> list[Command]:
    X_WB = quaternion_matrix(body.quaternions[0])
    X_WB[:3, 3] = body.translations[0]
    commands = [SetTransform(X_WB, _path(path))]
    for part in body.parts:
        color = part.color
        if ghost is not None:
            mixed = (1 - _GHOST_TINT) * np.array(color[:3]) + _GHOST_TINT * np.array(ghost)
            color = (*mixed.tolist(), _GHOST_OPACITY)
        shape, X = meshcat_object(part.shape, color)
        where = _path(f"{path}/{part.name}")
        commands += [SetObject(shape, path=where), SetTransform(part.X_BS @ X, where)]
    return [_message(command) for command in commands]


def _same(one: MovingBody, other: MovingBody) -> bool:
    """True if two objects of a scene look the same and have the same pose at all times."""
    if one.is_robot or one.name != other.name or len(one.parts) != len(other.parts):
        return False
    count = min(len(one.translations), len(other.translations))
    return (
        all(
            repr(p.shape) == repr(q.shape) and p.color == q.color and np.allclose(p.X_BS, q.X_BS)
            for p, q in zip(one.parts, other.parts, strict=True)
        )
        and np.allclose(one.translations[:count], other.translations[:count], atol=1e-4)
        and np.allclose(one.quaternions[:count], other.quaternions[:count], atol=1e-4)
    )


def _animate(animation: Animation, path: str, body: MovingBody) -> None:
    """Adds a body's motion to the animation, with as few key frames as possible."""
    tracks = {}
    for name, kind, values in (
        ("position", "vector3", body.translations),
        ("quaternion", "quaternion", np.roll(body.quaternions, -1, axis=1)),
    ):
        keys = key_frames(values)
        if len(keys) > 2 or not np.allclose(values[0], values[-1], rtol=0.0, atol=_KEY_TOLERANCE):
            tracks[name] = AnimationTrack(name, kind, keys.tolist(), values[keys].tolist())
    if tracks:
        animation.clips[_path(path)] = AnimationClip(tracks, fps=int(FRAME_RATE))


def key_frames(values: Vector, tolerance: float = _KEY_TOLERANCE) -> npt.NDArray[np.intp]:
    """Returns key frames from which linear interpolation reproduces the others.

    Every second frame is removed if its neighbours interpolate it within `tolerance`, then every
    second of the rest, and so on, with half the tolerance each time: errors stay below twice it.

    Args:
        values: (F, n) a track's values, F of at least 2.
        tolerance: Tolerance in the values' units.

    Returns:
        Increasing indices, including the first and the last frame.
    """
    keys = np.arange(len(values))
    for halvings in range(_HALVINGS):
        middle = keys[1:-1:2]
        before, after = keys[0:-2:2], keys[2::2]
        fraction = ((middle - before) / (after - before))[:, None]
        interpolated = (1 - fraction) * values[before] + fraction * values[after]
        error = np.max(np.abs(interpolated - values[middle]), axis=1, initial=0.0)
        keys = np.setdiff1d(keys, middle[error < tolerance / 2**halvings])
    return keys


def _hand_paths(
    run: Frames, prefix: str, color: tuple[float, float, float], *, first: bool
) -> list[Command]:
    commands = _tube(run.hand_W, f"{prefix}/hand path", color, _PATH_RADIUS)
    if first and run.motion.hand_T is None:
        commands += _tube(run.shown_W, f"{prefix}/demonstration", _SHOWN_COLOR, _SHOWN_RADIUS)
    if first and len(run.cloud_W):
        colors = np.tile(np.array(_CLOUD_COLOR)[:, None], len(run.cloud_W))
        cloud = mg.PointCloud(
            run.cloud_W.T.astype(np.float32), colors.astype(np.float32), size=_CLOUD_POINT
        )
        commands.append(_message(SetObject(cloud, path=_path(f"{prefix}/cloud"))))
    return commands


def _tube(
    points: Vector, path: str, color: tuple[float, float, float], radius: float
) -> list[Command]:
    """Draws a path as a tube; returns no command if the path is too short."""
    distinct = points[:1]
    for point in points:
        # A curve has no tangent at coincident points.
        if np.linalg.norm(point - distinct[-1]) > _PATH_STEP:
            distinct = np.vstack((distinct, point))
    if len(distinct) < 2:
        return []
    return [_message(SetObject(Tube(distinct, radius), material((*color, 1.0)), path=_path(path)))]


def _control_bar(runs: Sequence[Frames]) -> Command:
    """Returns meshcat's panel control with the table and the bar with play, step, speed and time.

    Its callback is the script `player.js`, which the viewer runs once, on receiving the control.
    """
    rows = compare(runs)
    data = {
        "frameRate": FRAME_RATE,
        "view": _view(runs[0]),
        "runs": [
            {
                "name": run.motion.name,
                "color": RUN_COLORS[index % len(RUN_COLORS)],
                "frames": len(run.times),
                "stages": _stages(run),
                "signals": {
                    name: {
                        "unit": signal.unit,
                        "values": np.round(run.at_frames(signal.values), 3).tolist(),
                    }
                    for name, signal in run.motion.signals.items()
                },
                "figures": {name: texts[index] for name, texts in rows.items()},
            }
            for index, run in enumerate(runs)
        ],
    }
    script = files("pepper_drake.playback").joinpath("player.js").read_text(encoding="utf-8")
    function = script[script.index("function") :].rstrip()
    callback = f"({function})(this, {json.dumps(data)})"
    control = {"type": "set_control", "name": _CONTROL, "callback": callback}
    return Command("set_control", f"{ROOT}/control", umsgpack.packb(control))


def _stages(run: Frames) -> list[tuple[int, str, int]]:
    """Returns for each stage the first frame, the name, and the number of that name."""
    names = list(dict.fromkeys(name for _, name in run.motion.stages))
    begins = [int(np.searchsorted(run.clock, time)) for time, _ in run.motion.stages]
    return [
        (begin, name, names.index(name))
        for begin, (_, name) in zip(begins, run.motion.stages, strict=True)
    ]
