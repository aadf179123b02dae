"""Bags of ROS 1 and ROS 2 and MCAP files: topics with poses or joints.

`rosbags` reads ROS messages in any container; `mcap` reads files with JSON messages. Both
are an extra: pip install "pepper-drake[formats]".
"""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside
from pepper_drake.learning.demonstrations.importers.table import LARGEST_NUMBER, check_file
from pepper_drake.learning.demonstrations.importers.track import Track

SUFFIXES = (".bag", ".db3", ".mcap")

_MOST_MESSAGES = 2_000_000

EXTRA = 'pip install "pepper-drake[formats]"'


_REPAIR = "rosbag reindex, ros2 bag reindex or mcap recover"
"""Commands that repair a bag that was not closed: of ROS 1, ROS 2, MCAP."""


def is_bag(path: Path) -> bool:
    """Tells whether a path is a bag: a file by its suffix, a folder by its metadata.yaml."""
    return path.suffix in SUFFIXES or (path.is_dir() and (path / "metadata.yaml").is_file())


def read_bag(path: Path) -> list[Track]:
    """Reads the topics with poses or joints; each is a track, each frame of /tf one of its own.

    Raises:
        InputError: A library is missing, the bag is broken, or has no such topic.
    """
    if path.is_dir():
        for file in path.iterdir():
            check_file(path_inside(path, file.name))
    messages = _mcap_messages(path) if _is_json_mcap(path) else _ros_messages(path)
    series: dict[str, _Series] = {}
    count = 0
    try:
        for topic, kind, log_time, message in messages:
            for name, sample in _samples(kind, message, log_time):
                key = f"{topic}{f' {name}' if name else ''}"
                series.setdefault(key, _Series(kind)).add(sample)
            count += 1
            if count > _MOST_MESSAGES:
                raise InputError(f"{path}: more than {_MOST_MESSAGES} messages; cut the motion out")
    except InputError:
        raise
    except Exception as error:  # On a broken bag the reader may raise anything.
        raise InputError(
            f"{path}: a broken bag after {count} messages ({_short(error)}); record it again"
        ) from None
    tracks = [track for key, found in series.items() if (track := found.track(path, key))]
    if not tracks:
        raise InputError(
            f"{path}: no topic with poses, transforms or joint states of Pepper among {count}"
            " messages"
        )
    return tracks


class _Series:
    """The samples of one topic, or of one frame of it."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._times: list[float] = []
        self._poses: list[list[float]] = []
        self._joints: list[list[float]] = []
        self._names: tuple[str, ...] = ()
        self._frame = ""

    def add(self, sample: dict[str, Any]) -> None:
        """Adds one sample: a pose, or joints by name."""
        if "names" in sample:
            names = tuple(sample["names"])
            if self._names and names != self._names:
                if set(names) != set(self._names):
                    return  # Another part of the robot on the same topic.
                order = [names.index(name) for name in self._names]
                sample["joints"] = [sample["joints"][i] for i in order]
            else:
                self._names = names
            self._joints.append(sample["joints"])
        else:
            self._poses.append(sample["pose"])
            self._frame = self._frame or sample["frame"]
        self._times.append(sample["time"])

    def track(self, path: Path, key: str) -> Track | None:
        """Returns the samples as a track, None where there are too few."""
        if len(self._times) < 4:
            return None
        name = key.strip("/").replace("/", "_").replace(" ", "_")
        times = np.array(self._times) * 1e-9
        base: dict[str, Any] = {
            "path": path,
            "name": name,
            "kind": f"{self._kind} on {key}",
            "time_unit": "s",
        }
        if self._joints:
            widths = {len(row) for row in self._joints}
            if widths != {len(self._names)}:
                raise InputError(f"{path}: {key} has more names than positions of joints")
            values = np.array(self._joints, dtype=float)
            _check(values, path, key)
            return Track(
                times=times, joints=values, joint_names=self._names, joint_unit="rad", **base
            )
        poses = np.array(self._poses, dtype=float)
        _check(poses, path, key)
        turned = poses.shape[1] == 7
        return Track(
            times=times,
            positions=poses[:, :3],
            rotations=poses[:, 3:] if turned else None,
            quaternion="xyzw" if turned else None,
            unit="m",
            frame=self._frame.strip("/") or None,
            **base,
        )


def _check(values: Any, path: Path, key: str) -> None:
    wrong = ~(np.isfinite(values) & (np.abs(values) < LARGEST_NUMBER)).all(axis=1)
    if wrong.any():
        raise InputError(
            f"{path}: message {int(np.argmax(wrong)) + 1} of {key} holds a value that is not finite"
        )


def _samples(kind: str, message: Any, log_time: float) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields (name of the frame, sample) of a message of a known type."""
    name = kind.rpartition("/")[2]
    if name in ("TFMessage",):
        for transform in _get(message, "transforms"):
            yield from _samples("TransformStamped", transform, log_time)
        return
    if name == "Pose":
        place, turn = _get(message, "position"), _get(message, "orientation")
        yield "", {"time": log_time, "frame": "", "pose": _xyz(place) + _xyzw(turn)}
        return
    time = _stamp(message, log_time)
    frame = _frame_of(message)
    if name in ("PoseStamped", "PoseWithCovarianceStamped", "Odometry"):
        pose = _get(message, "pose")
        if name != "PoseStamped":
            pose = _get(pose, "pose")
        place, turn = _get(pose, "position"), _get(pose, "orientation")
        yield "", {"time": time, "frame": frame, "pose": _xyz(place) + _xyzw(turn)}
    elif name == "TransformStamped":
        transform = _get(message, "transform")
        place, turn = _get(transform, "translation"), _get(transform, "rotation")
        child = str(_get(message, "child_frame_id")).strip("/")
        yield child, {"time": time, "frame": frame, "pose": _xyz(place) + _xyzw(turn)}
    elif name == "PointStamped":
        yield "", {"time": time, "frame": frame, "pose": _xyz(_get(message, "point"))}
    elif name == "JointState":
        names = [str(n) for n in _get(message, "name")]
        joints = [float(v) for v in _get(message, "position")]
        if names and len(names) == len(joints) and len(names) < 1000:
            yield "", {"time": time, "names": names, "joints": joints}


def _get(message: Any, field: str) -> Any:
    """Returns a field of a decoded ROS message or of a JSON object."""
    return message[field] if isinstance(message, dict) else getattr(message, field)


def _stamp(message: Any, log_time: float) -> float:
    stamp = _get(_get(message, "header"), "stamp")
    seconds = float(_get(stamp, "sec"))
    parts = ("nanosec", "nsec")
    present = [p for p in parts if (p in stamp if isinstance(stamp, dict) else hasattr(stamp, p))]
    nanoseconds = float(_get(stamp, present[0])) if present else 0.0
    time = seconds * 1e9 + nanoseconds
    return time if time > 0.0 and math.isfinite(time) else log_time


def _frame_of(message: Any) -> str:
    return str(_get(_get(message, "header"), "frame_id"))


def _xyz(value: Any) -> list[float]:
    return [float(_get(value, axis)) for axis in "xyz"]


def _xyzw(value: Any) -> list[float]:
    return [float(_get(value, axis)) for axis in "xyzw"]


def _ros_messages(path: Path) -> Iterator[tuple[str, str, float, Any]]:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(f"{path}: reading a bag needs the library rosbags; {EXTRA}") from None
    kinds = (
        "PoseStamped", "PoseWithCovarianceStamped", "Odometry", "Pose", "TransformStamped",
        "TFMessage", "PointStamped", "JointState",
    )  # fmt: skip
    store = get_typestore(Stores.ROS2_HUMBLE)
    try:
        with AnyReader([path], default_typestore=store) as reader:
            wanted = [c for c in reader.connections if c.msgtype.rpartition("/")[2] in kinds]
            if wanted:
                for connection, log_time, data in reader.messages(connections=wanted):
                    message = reader.deserialize(data, connection.msgtype)
                    yield connection.topic, connection.msgtype, float(log_time), message
    except Exception as error:  # rosbags may raise anything.
        raise InputError(
            f"{path}: not a bag that can be read ({_short(error)}); was its recording broken off?"
            f" Repair it with {_REPAIR}"
        ) from None


def _is_json_mcap(path: Path) -> bool:
    """Tells whether an MCAP file's messages are JSON; ROS's are not."""
    if path.suffix != ".mcap" or not path.is_file():
        return False
    try:
        from mcap.reader import make_reader
    except ImportError:
        return False
    try:
        with path.open("rb") as stream:
            summary = make_reader(stream, validate_crcs=False).get_summary()
            channels = summary.channels.values() if summary else ()
            return any(channel.message_encoding == "json" for channel in channels)
    except Exception:  # A broken file: reading it reports the error.
        return False


def _mcap_messages(path: Path) -> Iterator[tuple[str, str, float, Any]]:
    from mcap.reader import make_reader

    try:
        with path.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                if channel.message_encoding == "json" and schema is not None:
                    content = json.loads(message.data)
                    yield channel.topic, _ros_name(schema.name), float(message.log_time), content
    except Exception as error:  # mcap and json may raise anything.
        raise InputError(f"{path}: not an MCAP file that can be read ({_short(error)})") from None


def _ros_name(schema: str) -> str:
    """Returns a schema's name with ROS's slashes: foxglove.PoseInFrame is foxglove/PoseInFrame."""
    return schema.replace(".", "/")


def _short(error: BaseException) -> str:
    text = " ".join(str(error).split())[:120]
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
