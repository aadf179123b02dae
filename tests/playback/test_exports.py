import csv
import json
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.playback.exports import EXPORTS, export
from pepper_drake.playback.loading import load_motion
from tests.learning.demonstrations.importers.recordings import NAMES, make_motion, turn


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    motion = make_motion()
    folder = tmp_path_factory.mktemp("runs") / "reach"
    motion.save(folder)
    return motion, load_motion(folder)


@pytest.mark.parametrize("form", EXPORTS)
def test_what_is_exported_is_imported_as_it_was(form, shown, tmp_path):
    library = {"lerobot": "pyarrow", "mcap": "mcap", "rosbag2": "rosbags"}.get(form, "json")
    pytest.importorskip(library, reason=f"{library} is not installed: .[formats] has it")
    demonstration, motion = shown
    path = export(motion, form, tmp_path)
    track = {"mcap": "hand_pose", "rosbag2": "hand_pose"}.get(form)
    back = Demonstration.load(path, track=track)
    at = [np.interp(back.times, demonstration.times, p) for p in demonstration.positions.T]
    np.testing.assert_allclose(back.positions, np.column_stack(at), atol=1e-3)
    if back.joints is not None:
        assert back.joint_names == NAMES


def test_tum_has_the_quaternions_w_last(shown, tmp_path):
    demonstration, motion = shown
    table = np.loadtxt(export(motion, "tum", tmp_path))
    assert turn(table[:, [7, 4, 5, 6]], demonstration.rotations).max() < 1e-5


def test_csv_is_read_by_the_library(shown, tmp_path):
    demonstration, motion = shown
    with export(motion, "csv", tmp_path).open() as file:
        rows = list(csv.DictReader(file))
    joint = [float(row["RElbowYaw [rad]"]) for row in rows]
    np.testing.assert_allclose(joint, demonstration.joints[:, 2], atol=1e-12)


def test_a_timeline_has_degrees_at_its_frames(shown, tmp_path):
    demonstration, motion = shown
    root = ElementTree.parse(export(motion, "choregraphe", tmp_path)).getroot()
    curves = [e for e in root.iter() if e.tag.endswith("ActuatorCurve")]
    assert [curve.get("actuator") for curve in curves] == list(NAMES)
    key = curves[0][10]
    k = int(np.searchsorted(demonstration.times, int(key.get("frame")) / 25 - 1e-9))
    assert float(key.get("value")) == pytest.approx(np.degrees(demonstration.joints[k, 0]), abs=0.1)


def test_hands_are_exported_as_naoqi_has_them(runs, tmp_path):
    motion = load_motion(runs[0])
    root = ElementTree.parse(export(motion, "choregraphe", tmp_path)).getroot()
    curves = {e.get("actuator"): e for e in root.iter() if e.tag.endswith("ActuatorCurve")}
    # Of the format: unit 0 is degrees, unit 1 a share.
    assert (curves["RHand"].get("unit"), curves["RElbowYaw"].get("unit")) == ("1", "0")
    values = [float(key.get("value")) for key in curves["RHand"]]
    assert values == pytest.approx([1.0, *values[1:-1], 0.0])
    assert values == sorted(values, reverse=True)
    with export(motion, "csv", tmp_path).open() as file:
        rows = list(csv.DictReader(file))
    assert [float(rows[k]["RHand"]) for k in (0, -1)] == pytest.approx([1.0, 0.0])
    assert {row["LHand"] for row in rows} == {"0.5"}


def test_a_bag_is_read_by_rosbags(shown, tmp_path):
    reading = pytest.importorskip("rosbags.highlevel", reason="rosbags: .[formats] has it")
    demonstration, motion = shown
    with reading.AnyReader([export(motion, "rosbag2", tmp_path)]) as reader:
        topics = {c.topic: c.msgtype for c in reader.connections}
        assert topics["/joint_states"] == "sensor_msgs/msg/JointState"
        connection = next(c for c in reader.connections if c.topic == "/joint_states")
        messages = [
            reader.deserialize(data, c.msgtype) for c, _, data in reader.messages([connection])
        ]
    assert messages[0].name == list(NAMES)
    np.testing.assert_allclose(
        [message.position for message in messages], demonstration.joints, atol=1e-12
    )


def test_mcap_is_read_by_mcap(shown, tmp_path):
    reader = pytest.importorskip("mcap.reader", reason="mcap: .[formats] has it")
    pytest.importorskip("rosbags", reason="rosbags: .[formats] has it")
    demonstration, motion = shown
    with export(motion, "mcap", tmp_path).open("rb") as stream:
        read = reader.make_reader(stream)
        assert read.get_header().profile == "ros2"
        found = [(schema.name, channel.topic) for schema, channel, _ in read.iter_messages()]
    assert found.count(("sensor_msgs/msg/JointState", "/joint_states")) == len(demonstration.times)
    assert found.count(("geometry_msgs/msg/PoseStamped", "/hand_pose")) == len(demonstration.times)


def test_lerobot_has_what_its_info_says(shown, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow: .[formats] has it")
    demonstration, motion = shown
    root = export(motion, "lerobot", tmp_path)
    info = json.loads((root / "meta" / "info.json").read_text())
    table = parquet.read_table(root / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(table.column_names) == set(info["features"])
    assert info["features"]["observation.state"]["names"] == list(NAMES)
    states = np.array(table["observation.state"].to_pylist())
    np.testing.assert_allclose(states, demonstration.joints, atol=1e-6)
    assert info["fps"] == pytest.approx(50.0)


def test_refuses_what_cannot_be_written(shown, tmp_path):
    _, motion = shown
    with pytest.raises(InputError, match="use one of tum"):
        export(motion, "bvh", tmp_path)
    make_motion().save(tmp_path / "hand.txt")
    bare = load_motion(tmp_path / "hand.txt")
    with pytest.raises(InputError, match="the joints are not known"):
        export(bare, "choregraphe", tmp_path)
