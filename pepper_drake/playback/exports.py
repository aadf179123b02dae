"""Export of motions to the file formats of other tools, with NAOqi's joint and ROS' frame names.

The hand's pose is that of its control frame (`r_hand_effector`, `l_hand_effector`) in `torso`, by
forward kinematics if the arm's joints are known.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import write_atomically
from pepper_drake.learning.demonstrations.arm_chain import arm_chain
from pepper_drake.learning.demonstrations.text_files import format_table
from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.playback.motion import Motion

Array = npt.NDArray[np.float64]

FRAME = "torso"
TIMELINE_RATE = 25
"""Frames per second of a timeline: Choregraphe's default."""

EXTRA = 'pip install "pepper-drake[formats]"'


@dataclass(frozen=True, eq=False)
class Recording:
    """The exportable content of a motion.

    Attributes:
        name: Name of the motion.
        hand_frame: Name of the hand's frame.
        times: (N,) [s], from 0.
        joint_names: J names.
        joints: (N, J) [rad]; the hands come last, from 0, closed, to 1, open.
        positions: (N, 3) of the hand in T [m], or None.
        rotations: (N, 4) unit quaternions w, x, y, z of the hand, or None.
    """

    name: str
    hand_frame: str
    times: Array
    joint_names: tuple[str, ...]
    joints: Array
    positions: Array | None
    rotations: Array | None


def recording_of(motion: Motion) -> Recording:
    """Returns the exportable content of a motion."""
    names = tuple(name for name in BODY_JOINTS if name in motion.positions)
    count = len(motion.times)
    hands = tuple(name for name in HANDS if name in motion.hands)
    columns = [motion.positions[name] for name in names] + [motion.hands[name] for name in hands]
    joints = np.column_stack(columns) if columns else np.zeros((count, 0))
    chain = arm_chain(motion.arm)
    positions, rotations = motion.hand_T, motion.hand_rotations_T
    if set(chain.joint_names) <= set(names):
        arm = joints[:, [names.index(name) for name in chain.joint_names]]
        positions, rotations = chain.hand(arm)
    return Recording(
        motion.name,
        f"{motion.arm[0]}_hand_effector",
        np.asarray(motion.times - motion.times[0], dtype=float),
        names + hands,
        joints,
        positions,
        rotations,
    )


def export(motion: Motion, form: str, folder: Path) -> Path:
    """Writes a motion into a folder, in a format of `EXPORTS`.

    Returns:
        The file, or the folder for formats that use one.

    Raises:
        InputError: The format is unknown, or a library or data for it are missing.
    """
    if form not in EXPORTS:
        raise InputError(f"--export {form}: use one of {', '.join(EXPORTS)}")
    ending, write = EXPORTS[form]
    path = folder / f"{motion.name}{ending}"
    if path.is_dir() and any(path.iterdir()):
        raise InputError(f"{path}: there is one already; remove it, or choose another --output")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(recording_of(motion), path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    return path


def write_tum(recording: Recording, path: Path) -> None:
    """Writes time, position and quaternion x, y, z, w, for TUM's tools and evo."""
    positions, rotations = _poses(recording, path)
    table = np.column_stack((recording.times, positions, rotations[:, [1, 2, 3, 0]]))
    write_atomically(path, "# timestamp tx ty tz qx qy qz qw\n" + format_table(table))


def write_csv(recording: Recording, path: Path) -> None:
    """Writes named columns: time, the hand's pose if known, and joints."""
    header, columns = ["time [s]"], [recording.times[:, None]]
    if recording.positions is not None:
        header += ["x [m]", "y [m]", "z [m]"]
        columns.append(recording.positions)
    if recording.rotations is not None:
        header += ["qw", "qx", "qy", "qz"]
        columns.append(recording.rotations)
    header += [n if n in HANDS else f"{n} [rad]" for n in recording.joint_names]
    columns.append(recording.joints)
    write_atomically(path, ",".join(header) + "\n" + format_table(np.hstack(columns), ","))


def write_choregraphe(recording: Recording, path: Path) -> None:
    """Writes a behavior with one timeline: 25 keys per second in degrees, hands from 0 to 1."""
    joints = _joints(recording, path)
    count = int(np.floor(recording.times[-1] * TIMELINE_RATE + 1e-9)) + 1
    at = np.arange(count) / TIMELINE_RATE
    curves = []
    for name, column in zip(recording.joint_names, joints.T, strict=True):
        values = np.interp(at, recording.times, column)
        values = (values if name in HANDS else np.degrees(values)).tolist()
        unit = 1 if name in HANDS else 0  # 1: fraction, 0: degrees.
        keys = "".join(f'<Key frame="{k}" value="{v!r}"/>' for k, v in enumerate(values))
        curves.append(
            f'<ActuatorCurve name="value" actuator="{name}" mute="0" unit="{unit}">{keys}'
            "</ActuatorCurve>\n"
        )
    write_atomically(
        path,
        '<?xml version="1.0" encoding="UTF-8" ?>\n'
        '<ChoregrapheProject xmlns="http://www.aldebaran-robotics.com/schema/choregraphe/'
        'project.xsd" xar_version="3">\n<Box name="root" id="-1" localization="8" x="0" y="0">\n'
        f'<Timeline enable="1" fps="{TIMELINE_RATE}" start_frame="0" end_frame="-1"'
        f' size="{count}">\n<ActuatorList model="juliette">\n{"".join(curves)}</ActuatorList>\n'
        "</Timeline>\n</Box>\n</ChoregrapheProject>\n",
    )


def write_lerobot(recording: Recording, path: Path) -> None:
    """Writes a data set of one episode in the layout of LeRobot v3."""
    joints = _joints(recording, path)
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise InputError(f"--export lerobot needs pyarrow; {EXTRA}") from None
    count = len(recording.times)
    rate = (count - 1) / float(recording.times[-1])
    feature = {
        "dtype": "float32",
        "shape": [len(recording.joint_names)],
        "names": list(recording.joint_names),
    }
    scalar = {"dtype": "int64", "shape": [1], "names": None}
    info = {
        "codebase_version": "v3.0",
        "robot_type": "pepper",
        "total_episodes": 1,
        "total_frames": count,
        "total_tasks": 1,
        "chunks_size": 1000,
        "fps": round(rate, 6),
        "splits": {"train": "0:1"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": {
            "observation.state": feature,
            "action": feature,
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
            "frame_index": scalar,
            "episode_index": scalar,
            "index": scalar,
            "task_index": scalar,
        },
    }
    write_atomically(path / "meta" / "info.json", json.dumps(info, indent=2) + "\n")
    numbers = pyarrow.array(range(count), pyarrow.int64())
    zeros = pyarrow.array([0] * count, pyarrow.int64())
    rows = pyarrow.list_(pyarrow.float32())
    # The action is the next state.
    actions = np.concatenate((joints[1:], joints[-1:]))
    table = pyarrow.table(
        {
            "observation.state": pyarrow.array(joints.tolist(), rows),
            "action": pyarrow.array(actions.tolist(), rows),
            "timestamp": pyarrow.array(recording.times.tolist(), pyarrow.float32()),
            "frame_index": numbers,
            "episode_index": zeros,
            "index": numbers,
            "task_index": zeros,
        }
    )
    data = path / "data" / "chunk-000" / "file-000.parquet"
    data.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table, data)
    parquet.write_table(
        pyarrow.table({"task_index": [0], "task": [recording.name]}),
        path / "meta" / "tasks.parquet",
    )
    episodes = path / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    episodes.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(
        pyarrow.table(
            {
                "episode_index": [0],
                "tasks": [[recording.name]],
                "length": [count],
                "dataset_from_index": [0],
                "dataset_to_index": [count],
                "data/chunk_index": [0],
                "data/file_index": [0],
            }
        ),
        episodes,
    )


def write_rosbag2(recording: Recording, path: Path) -> None:
    """Writes a bag with /joint_states and the hand's /hand_pose."""
    store, _ = _ros()
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections: dict[str, Any] = {}
        for topic, kind, stamp, message in _messages(recording, store, path):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], stamp, store.serialize_cdr(message, kind))


def write_mcap(recording: Recording, path: Path) -> None:
    """Writes an MCAP file of ROS 2 messages, /joint_states and /hand_pose."""
    store, version = _ros()
    try:
        from mcap.writer import Writer
    except ImportError:
        raise InputError(f"--export mcap needs the library mcap; {EXTRA}") from None
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="pepper_drake")
        channels: dict[str, int] = {}
        for topic, kind, stamp, message in _messages(recording, store, path):
            if topic not in channels:
                text, _ = store.generate_msgdef(kind, ros_version=version)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()


def _ros() -> tuple[Any, int]:
    """Returns the ROS 2 message types, and the ROS version."""
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(f"writing ROS messages needs the library rosbags; {EXTRA}") from None
    return get_typestore(Stores.ROS2_HUMBLE), 2


def _messages(recording: Recording, store: Any, path: Path) -> list[tuple[str, str, int, Any]]:
    """Returns topic, type, time stamp [ns] and message, in order of time."""
    types = store.types
    stamp_of, header_of = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    joint_kind, pose_kind = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"
    nothing = np.zeros(0)
    messages: list[tuple[str, str, int, Any]] = []
    if not recording.joint_names and recording.positions is None:
        raise InputError(f"{path}: neither joints nor a hand's pose to write")
    for k, time in enumerate(recording.times):
        stamp = round(float(time) * 1e9)
        header = header_of(
            stamp=stamp_of(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id=FRAME
        )
        if recording.joint_names:
            message = types[joint_kind](
                header, list(recording.joint_names), recording.joints[k], nothing, nothing
            )
            messages.append(("/joint_states", joint_kind, stamp, message))
        if recording.positions is not None and recording.rotations is not None:
            w, x, y, z = recording.rotations[k].tolist()
            pose = types["geometry_msgs/msg/Pose"](
                types["geometry_msgs/msg/Point"](*recording.positions[k].tolist()),
                types["geometry_msgs/msg/Quaternion"](x, y, z, w),
            )
            messages.append(("/hand_pose", pose_kind, stamp, types[pose_kind](header, pose)))
    return messages


def _poses(recording: Recording, path: Path) -> tuple[Array, Array]:
    if recording.positions is None or recording.rotations is None:
        raise InputError(f"{path}: the hand's orientation is not known; export csv instead")
    return recording.positions, recording.rotations


def _joints(recording: Recording, path: Path) -> Array:
    if not recording.joint_names:
        raise InputError(f"{path}: the joints are not known; export tum or csv instead")
    return recording.joints


EXPORTS: dict[str, tuple[str, Callable[[Recording, Path], None]]] = {
    "tum": (".tum", write_tum),
    "csv": (".csv", write_csv),
    "choregraphe": (".xar", write_choregraphe),
    "lerobot": ("_lerobot", write_lerobot),
    "mcap": (".mcap", write_mcap),
    "rosbag2": ("_rosbag2", write_rosbag2),
}
"""File extension and writer of each format."""
