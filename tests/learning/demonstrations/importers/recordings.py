"""One movement of the right arm, written as each tool would have recorded it."""

import json
from pathlib import Path

import numpy as np

from pepper_drake.learning import Demonstration
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.arm_chain import arm_chain
from pepper_drake.learning.demonstrations.text_files import format_table

NAMES = arm_chain("right").joint_names
RATE = 50.0


def make_motion(rate=RATE, duration=2.0):
    """A reach in joint space, at rest at both ends; the hand by forward kinematics."""
    times = np.arange(round(duration * rate) + 1) / rate
    s = times / duration
    gate = (s**3 * (10 - 15 * s + 6 * s**2))[:, None]
    joints = np.array([1.4, -0.2, 1.2, 0.6, 0.1]) + gate * np.array([-1.2, -0.2, -0.4, 0.5, 0.3])
    positions, rotations = arm_chain("right").hand(joints)
    return Demonstration.from_positions(
        times, positions, rotations=rotations, joints=joints, joint_names=NAMES, name="reach"
    )


def table(*columns, separator=",", header=""):
    text = format_table(np.column_stack(columns), separator)
    return header + ("\n" if header else "") + text


def xyzw(motion):
    return motion.rotations[:, [1, 2, 3, 0]]


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def write_csv(folder, motion):
    header = "time,x,y,z,qw,qx,qy,qz"
    return write(
        folder / "named.csv",
        table(motion.times, motion.positions, motion.rotations, header=header),
    )


def write_shuffled(folder, motion):
    p, q = motion.positions, motion.rotations
    header = "pose.position.z;q_x;pose.position.x [mm];q_w;clock [ms];q_z;q_y;pose.position.y [mm]"
    header = header.replace("z;", "z [mm];", 1).replace("clock", "time")
    columns = (p[:, 2] * 1e3, q[:, 1], p[:, 0] * 1e3, q[:, 0], motion.times * 1e3)
    text = table(*columns, q[:, 3], q[:, 2], p[:, 1] * 1e3, separator=";", header=header)
    head, _, body = text.partition("\n")
    return write(folder / "shuffled.csv", head + "\n" + body.replace(".", ","))


def write_tum(folder, motion):
    header = "# timestamp tx ty tz qx qy qz qw"
    columns = (motion.times + 1.6e9, motion.positions, xyzw(motion))
    return write(folder / "tum.txt", table(*columns, separator=" ", header=header))


def write_bare_tum(folder, motion):
    columns = (motion.times + 1.6e9, motion.positions, xyzw(motion))
    return write(folder / "bare.txt", table(*columns, separator=" "))


def write_euroc(folder, motion):
    header = (
        "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
        "q_RS_z [],v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],"
        "b_w_RS_S_y [rad s^-1],b_w_RS_S_z [rad s^-1]"
    )
    clock = 1_403_636_580_838_555_648 + np.round(motion.times * 1e9).astype(np.int64)
    columns = (motion.positions, motion.rotations, motion.velocities, 0 * motion.positions)
    rows = format_table(np.column_stack(columns), ",").splitlines()
    lines = [f"{stamp},{row}" for stamp, row in zip(clock, rows, strict=True)]
    return write(folder / "euroc.csv", "\n".join([header, *lines, ""]))


def write_rostopic(folder, motion):
    header = (
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,"
        "field.pose.position.y,field.pose.position.z,field.pose.orientation.x,"
        "field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w"
    )
    rows = format_table(np.column_stack((motion.positions, xyzw(motion))), ",").splitlines()
    lines = [header]
    for k, (time, row) in enumerate(zip(motion.times, rows, strict=True)):
        stamp = 1_600_000_000_000_000_000 + round(time * 1e9)
        lines.append(f"{stamp},{k},{stamp},torso,{row}")
    return write(folder / "rostopic.csv", "\n".join(lines) + "\n")


def write_joint_echo(folder, motion):
    count = range(5)
    header = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    for field in ("name", "position", "velocity"):
        header += [f"field.{field}{k}" for k in count]
    lines = [",".join(header)]
    for k, (time, q) in enumerate(zip(motion.times, motion.joints, strict=True)):
        stamp = 1_600_000_000_000_000_000 + round(time * 1e9)
        row = [str(stamp), str(k), str(stamp), "", *NAMES, *map(repr, q.tolist()), *"00000"]
        lines.append(",".join(row))
    return write(folder / "joint_echo.csv", "\n".join(lines) + "\n")


def write_motive(folder, motion):
    head = (
        "Format Version,1.23,Take Name,take,Export Frame Rate,50.000000,Rotation Type,Quaternion,"
        "Length Units,Millimeters,Coordinate Space,Global\n\n"
        + ",Type"
        + ",Rigid Body" * 7
        + "\n,Name"
        + ",Hand" * 7
        + "\n,ID"
        + ",1" * 7
        + "\n,"
        + ",Rotation" * 4
        + ",Position" * 3
        + "\nFrame,Time (Seconds),X,Y,Z,W,X,Y,Z\n"
    )
    columns = (np.arange(len(motion.times)), motion.times, xyzw(motion), motion.positions * 1e3)
    return write(folder / "motive.csv", head + table(*columns))


def write_vicon(folder, motion):
    head = "Objects\n50\n,,Hand:Hand,,,,,,\nFrame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ\n,,,,,,mm,mm,mm\n"
    count = np.arange(1, len(motion.times) + 1)
    columns = (count, 0 * count, xyzw(motion), motion.positions * 1e3)
    return write(folder / "vicon.csv", head + table(*columns))


def write_joint_log(folder, motion):
    left = np.tile([1.55, 0.14, -1.22, -0.52, 0.0], (len(motion.times), 1))
    header = ",".join(
        ["time", "HeadYaw", "HeadPitch", *arm_chain("left").joint_names, "LHand", *NAMES[::-1]]
    )
    zero = np.zeros((len(motion.times), 2))
    columns = (motion.times, zero, left, zero[:, :1] + 0.5, motion.joints[:, ::-1])
    return write(folder / "body.csv", table(*columns, header=header))


def write_degrees(folder, motion):
    header = ",".join(["time (s)", *(f"{name} (deg)" for name in NAMES)])
    return write(
        folder / "degrees.csv", table(motion.times, np.degrees(motion.joints), header=header)
    )


def write_timeline(folder, motion):
    """Keys at every second sample, as Choregraphe's behavior.xar has them."""
    curves = []
    frames = np.round(motion.times * 25).astype(int)
    for name, column in zip(NAMES, np.degrees(motion.joints).T, strict=True):
        keys = (
            "".join(
                f'<Key frame="{frames[k]}" value="{column[k]!r}"/>'
                for k in range(0, len(frames), 4)
                if frames[k] == motion.times[k] * 25
            )
            .replace("np.float64(", "")
            .replace(")", "")
        )
        curves.append(
            f'<ActuatorCurve name="value" actuator="{name}" mute="0">{keys}</ActuatorCurve>'
        )
    text = (
        '<?xml version="1.0" encoding="UTF-8" ?><ChoregrapheProject xmlns="http://x/project.xsd">'
        '<Box><Timeline enable="1" fps="25" start_frame="1" end_frame="-1" size="60">'
        f'<ActuatorList model="juju">{"".join(curves)}</ActuatorList></Timeline></Box>'
        "</ChoregrapheProject>"
    )
    return write(folder / "behavior.xar", text)


def write_exported_python(folder, motion):
    lines = ["names = list()", "times = list()", "keys = list()"]
    for name, column in zip(NAMES, motion.joints.T, strict=True):
        lines.append(f'names.append("{name}")')
        lines.append(f"times.append({motion.times[::4].tolist()})")
        lines.append(f"keys.append({column[::4].tolist()})")
    return write(folder / "exported.py", "\n".join(lines) + "\n")


def write_rosbag(folder, motion, storage="sqlite3", joints=False):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    time_type, header_type = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    path = folder / f"bag_{storage}{'_joints' if joints else ''}"
    plugin = StoragePlugin.SQLITE3 if storage == "sqlite3" else StoragePlugin.MCAP
    kind = "sensor_msgs/msg/JointState" if joints else "geometry_msgs/msg/PoseStamped"
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/motion", kind, typestore=store)
        for k, time in enumerate(motion.times):
            stamp = 1_600_000_000_000_000_000 + round(time * 1e9)
            header = header_type(
                stamp=time_type(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="torso"
            )
            if joints:
                empty = np.array([], dtype=np.float64)
                message = types[kind](header, list(NAMES), motion.joints[k], empty, empty)
            else:
                w, x, y, z = motion.rotations[k]
                pose = types["geometry_msgs/msg/Pose"](
                    types["geometry_msgs/msg/Point"](*motion.positions[k]),
                    types["geometry_msgs/msg/Quaternion"](x, y, z, w),
                )
                message = types[kind](header, pose)
            writer.write(connection, stamp, store.serialize_cdr(message, kind))
    return path


def write_json_mcap(folder, motion):
    from mcap.writer import Writer

    path = folder / "json.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "jsonschema", b"{}")
        channel = writer.register_channel("/joint_states", "json", schema)
        for time, q in zip(motion.times, motion.joints, strict=True):
            stamp = 1_600_000_000_000_000_000 + round(time * 1e9)
            message = {
                "header": {
                    "stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9},
                    "frame_id": "",
                },
                "name": list(NAMES),
                "position": q.tolist(),
            }
            writer.add_message(channel, stamp, json.dumps(message).encode(), stamp)
        writer.finish()
    return path


def write_lerobot(folder, motion):
    import pyarrow
    import pyarrow.parquet

    root = folder / "dataset"
    info = {
        "codebase_version": "v3.0",
        "fps": RATE,
        "features": {
            "observation.state": {
                "dtype": "float32",
                "shape": [5],
                "names": {"motors": [f"{name}.pos" for name in NAMES]},
            }
        },
    }
    write(root / "meta" / "info.json", json.dumps(info))
    file = root / "data" / "chunk-000" / "file-000.parquet"
    file.parent.mkdir(parents=True)
    count = len(motion.times)
    columns = {
        "observation.state": [row.tolist() for row in motion.joints],
        "timestamp": motion.times.tolist(),
        "frame_index": list(range(count)),
        "episode_index": [0] * count,
        "index": list(range(count)),
        "task_index": [0] * count,
    }
    pyarrow.parquet.write_table(pyarrow.table(columns), file)
    return root


TEXTS = {
    "csv": write_csv,
    "shuffled": write_shuffled,
    "tum": write_tum,
    "bare_tum": write_bare_tum,
    "euroc": write_euroc,
    "rostopic": write_rostopic,
    "joint_echo": write_joint_echo,
    "motive": write_motive,
    "vicon": write_vicon,
    "joint_log": write_joint_log,
    "degrees": write_degrees,
    "timeline": write_timeline,
    "exported_python": write_exported_python,
}
"""Formats that need no library."""

BINARIES = {
    "rosbag2": ("rosbags", write_rosbag),
    "rosbag2_mcap": ("rosbags", lambda folder, motion: write_rosbag(folder, motion, "mcap")),
    "rosbag2_joints": ("rosbags", lambda f, m: write_rosbag(f, m, joints=True)),
    "json_mcap": ("mcap", write_json_mcap),
    "lerobot": ("pyarrow", write_lerobot),
}
"""Formats with the library that writes them."""


def turn(one, other):
    """The angle between orientations (N, 4) [rad]."""
    return np.linalg.norm(so3.log_map(so3.multiply(one, so3.conjugate(other))), axis=1)


def main_file(path: Path) -> Path:
    """The file with the samples of a recording that may be a folder."""
    if path.is_file():
        return path
    kinds = ("*.db3", "*.mcap", "*.parquet")
    return next(file for kind in kinds for file in path.rglob(kind))
