"""Variants of the formats beside the plain case."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.io import savemat

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.demonstration_files import read_demonstrations
from pepper_drake.learning.demonstrations.importers import read_tracks

from .recordings import NAMES, format_table, make_motion, table, write, write_lerobot

MOTION = make_motion()
T, P = MOTION.times, MOTION.positions


def test_lasa_motions_lie_on_a_plane(tmp_path):
    path = tmp_path / "Angle.mat"
    shapes = [1e3 * (P[:, :2] - P[0, :2]).T * size for size in (1.0, 0.9, 1.1)]
    demos = np.empty((1, 3), dtype=object)
    for k, shape in enumerate(shapes):
        demos[0, k] = {"pos": shape, "t": T[None], "vel": shape, "acc": shape, "dt": 0.02}
    savemat(path, {"demos": demos, "dt": 0.02})
    with pytest.raises(InputError, match=r"3 motions in it \(Angle_1, Angle_2, Angle_3\)"):
        Demonstration.load(path)
    with pytest.raises(InputError, match=r"two dimensions.*--plane"):
        Demonstration.load(path, track="2")
    found = read_demonstrations(path, _plane())
    np.testing.assert_allclose(found[1].positions[:, :2], 1e-3 * shapes[1].T + [0.2, -0.2])
    np.testing.assert_allclose(found[1].positions[:, 2], 0.05)
    savemat(path, {"other": demos})
    with pytest.raises(InputError, match="without `demos`"):
        Demonstration.load(path)


def test_the_order_of_a_tum_file_is_known_by_its_name(tmp_path):
    q = np.tile([0.5, 0.1, -0.7, 0.5], (len(T), 1)) + np.linspace(0, 0.1, len(T))[:, None]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    text = format_table(np.column_stack((T, P, q)))
    demo = Demonstration.load(write(tmp_path / "take.tum", text))
    np.testing.assert_allclose(demo.rotations, q[:, [3, 0, 1, 2]], atol=1e-9)
    with pytest.raises(InputError, match="order of the quaternion"):
        Demonstration.load(write(tmp_path / "take.txt", text))


def _plane():
    from pepper_drake.learning.demonstrations.importers import ImportOptions

    return ImportOptions(plane=(0.2, -0.2, 0.05, 0.0, 0.0, 0.0))


def test_rows_in_which_motion_capture_saw_nothing_are_a_gap(tmp_path):
    head = (
        "Format Version,1.23,Length Units,Meters,Rotation Type,Quaternion\n\n,Type"
        + ",Rigid Body" * 8
        + ",Marker" * 3
        + "\n,Name"
        + ",Hand" * 8
        + ",Hand:M1" * 3
        + "\n,ID"
        + ",1" * 11
        + "\n,"
        + ",Rotation" * 4
        + ",Position" * 3
        + ",Mean Marker Error"
        + ",Position" * 3
        + "\nFrame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z\n"
    )
    q = MOTION.rotations[:, [1, 2, 3, 0]]
    body = table(np.arange(len(T)), T, q, P, 0 * T, P + 0.02).splitlines()
    for k in range(40, 60):
        body[k] = ",".join(body[k].split(",")[:2] + [""] * 11)
    demo = Demonstration.load(write(tmp_path / "take.csv", head + "\n".join(body) + "\n"))
    assert len(demo.times) == len(T) - 20
    assert any("was not seen in 20 rows, first in line 48" in note for note in demo.notes)
    np.testing.assert_allclose(demo.positions[:40], P[:40], atol=1e-12)


def test_vicon_markers_are_motions_of_their_own(tmp_path):
    head = (
        "Trajectories\n50\n,,Pepper:hand,,,Pepper:elbow,,\n"
        "Frame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
    )
    text = table(np.arange(1, len(T) + 1), 0 * T, 1e3 * P, 1e3 * P + 50.0)
    path = write(tmp_path / "take.csv", head + text)
    demos = read_demonstrations(path)
    assert [demo.name for demo in demos] == ["take_Pepper_hand", "take_Pepper_elbow"]
    np.testing.assert_allclose(demos[0].positions, P, atol=1e-9)
    np.testing.assert_allclose(demos[0].times, T, atol=1e-9)


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4, 6])
def test_trajectories_of_any_dimension_are_told_by_their_derivatives(tmp_path, dimensions):
    """The layout of dmpbbo: time, values, rates, curvatures."""
    frequencies = np.linspace(1.0, 2.0, dimensions)
    waves = np.sin(np.outer(T, frequencies))
    rates = frequencies * np.cos(np.outer(T, frequencies))
    text = format_table(np.column_stack((T, waves, rates, -(frequencies**2) * waves)))
    (track,) = read_tracks(write(tmp_path / "trajectory.txt", text))
    assert track.positions.shape == (len(T), dimensions)
    np.testing.assert_allclose(track.velocities, rates)


def test_bezier_keys_of_a_timeline_are_followed(tmp_path):
    """With handles of a third of the distance and these ordinates, Bezier is this cubic."""
    keys = (
        '<Key frame="0" value="0"><Tangent side="right" abscissaParam="25" ordinateParam="10"'
        ' interpType="bezier"/></Key><Key frame="75" value="60"><Tangent side="left"'
        ' abscissaParam="-25" ordinateParam="0" interpType="bezier"/></Key>'
    )
    still = '<Key frame="0" value="{0}"/><Key frame="75" value="{0}"/>'
    curves = f'<ActuatorCurve actuator="{NAMES[0]}">{keys}</ActuatorCurve>' + "".join(
        f'<ActuatorCurve actuator="{name}">{still.format(value)}</ActuatorCurve>'
        for name, value in zip(NAMES[1:], (-10, 60, 30, 0), strict=True)
    )
    text = f'<P><Timeline fps="25">{curves}</Timeline></P>'
    demo = Demonstration.load(write(tmp_path / "behavior.xar", text))
    u = demo.times / 3.0
    expected = 3 * u * (1 - u) ** 2 * 10 + 3 * u**2 * (1 - u) * 60 + u**3 * 60
    np.testing.assert_allclose(demo.joints[:, 0], np.radians(expected), atol=1e-9)
    np.testing.assert_allclose(demo.joints[:, 1], np.radians(-10.0))


def test_a_timeline_in_a_box_of_another_one_is_read_once_at_its_own_rate(tmp_path):
    """As Choregraphe's Timeline box has it: the root's timeline holds the box, and no keys."""
    keys = '<Key frame="0" value="{0}"/><Key frame="50" value="{1}"/>'
    curves = "".join(
        f'<ActuatorCurve actuator="{name}" unit="0">{keys.format(*values)}</ActuatorCurve>'
        for name, values in zip(
            NAMES, ((60, 30), (-10, -20), (60, 60), (30, 50), (0, 0)), strict=True
        )
    )
    text = (
        '<P><Box name="root"><Timeline enable="0"><BehaviorLayer><Box name="wave">'
        f'<Timeline fps="50"><ActuatorList>{curves}</ActuatorList></Timeline>'
        "</Box></BehaviorLayer></Timeline></Box></P>"
    )
    demo = Demonstration.load(write(tmp_path / "behavior.xar", text))
    assert demo.duration == pytest.approx(1.0)
    np.testing.assert_allclose(demo.joints[[0, -1], 0], np.radians([60, 30]), atol=1e-9)


def _python(
    *joints, times=(0.4, 2.4), values=((1.0, 0.4), (-0.2, -0.3), (1, 1), (0.5, 0.9), (0, 0))
):
    return "".join(
        f'names.append("{name}")\ntimes.append({list(times)})\nkeys.append({list(value)})\n'
        for name, value in zip(joints or NAMES, values, strict=True)
    )


def test_each_function_of_exported_python_is_a_motion_of_its_own(tmp_path):
    start = "  names = list()\n  times = list()\n  keys = list()\n"
    other = ((0.8, 0.2), (-0.1, -0.4), (0.7, 1), (0.6, 0.4), (0, 0))
    text = (
        f"def wave(robot):\n{start}{_python()}"
        + f'def nod(robot):\n{start}"""names.append("HeadYaw")\ntimes.append([1])\n'
        + f'keys.append([0.1])"""\n{_python(times=(0.2, 1.2), values=other)}'
    )
    path = write(tmp_path / "moves.py", text)
    with pytest.raises(InputError, match=r"2 motions in it \(moves_wave, moves_nod\)"):
        Demonstration.load(path)
    wave, nod = read_demonstrations(path)
    np.testing.assert_allclose(wave.joints[[0, -1], 0], [1.0, 0.4], atol=1e-9)
    np.testing.assert_allclose(nod.joints[[0, -1], 0], [0.8, 0.2], atol=1e-9)
    assert (wave.duration, nod.duration) == (pytest.approx(2.0), pytest.approx(1.0))


def test_two_motions_in_one_list_are_refused(tmp_path):
    path = write(tmp_path / "moves.py", _python() + _python())
    with pytest.raises(InputError, match="RShoulderPitch is appended twice"):
        Demonstration.load(path)
    for name in ("walk.py", "main.cpp"):
        with pytest.raises(InputError, match=r"program code.*Export motion to clipboard"):
            Demonstration.load(write(tmp_path / name, "import time\ntime.sleep(1)\n"))


def _timeline(curves, **attributes):
    said = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    text = "".join(
        f'<ActuatorCurve actuator="{name}" {extra}>'
        + "".join(f'<Key frame="{frame}" value="{value}"/>' for frame, value in keys)
        + "</ActuatorCurve>"
        for name, extra, keys in curves
    )
    text = f'<ActuatorList model="nao">{text}</ActuatorList>'
    return f'<P><Timeline fps="25" {said}>{text}</Timeline></P>'


def test_a_timeline_is_played_as_far_as_it_is_played(tmp_path):
    """To its last frame, without mute curves; a late joint does not cut off the others."""
    keys = [(0, 60), (50, 30), (75, 0)]
    curves = [(NAMES[0], "", keys), (NAMES[1], 'mute="0"', [(0, -10), (75, -20)])]
    curves += [(NAMES[2], "", [(0, 60), (75, 60)]), (NAMES[3], "", [(0, 30), (75, 50)])]
    curves += [(NAMES[4], "", [(25, 0), (75, 10)]), (NAMES[0], 'mute="1"', [(0, 90), (75, 90)])]
    path = write(tmp_path / "behavior.xar", _timeline(curves, end_frame=50))
    demo = Demonstration.load(path)
    assert demo.duration == pytest.approx(2.0)
    np.testing.assert_allclose(demo.joints[[0, -1], 0], np.radians([60, 30]), atol=1e-9)
    np.testing.assert_allclose(demo.joints[[0, 50], 4], 0.0, atol=1e-9)
    assert any(f"held at the first key, which comes later: {NAMES[4]}" in n for n in demo.notes)
    assert any("made for NAO" in note for note in demo.notes)


def test_joints_a_little_beyond_a_limit_may_stop_there(tmp_path):
    """A roll of 18 degrees is in NAO's limits, not in Pepper's."""
    keys = [(0, 60), (50, 30)]
    curves = [(NAMES[0], "", keys), (NAMES[1], "", [(0, -10), (50, 18)])]
    curves += [(name, "", [(0, 30), (50, 40)]) for name in NAMES[2:]]
    path = write(tmp_path / "behavior.xar", _timeline(curves))
    with pytest.raises(InputError, match=rf"{NAMES[1]} at 0.31.* rad.*--clip-joints"):
        Demonstration.load(path)
    demo = Demonstration.load(path, clip_joints=True)
    assert demo.joints[-1, 1] == pytest.approx(-0.00872665)
    assert any(f"limits, by 0.32 rad at most: {NAMES[1]}" in note for note in demo.notes)
    path = write(
        tmp_path / "behavior.xar", _timeline([*curves[:1], (NAMES[1], "", [(0, 60)]), *curves[2:]])
    )
    with pytest.raises(InputError, match=r"beyond its limits.*; correct it$"):
        Demonstration.load(path, clip_joints=True)


def test_exported_python_is_read_not_run(tmp_path):
    text = "names = list()\n__import__('os').mkdir('ran')\n"
    for name, values in zip(
        NAMES, ([1.0, 0.4], [-0.2, -0.3], [1, 1], [0.5, 0.9], [0, 0.2]), strict=True
    ):
        keys = [[v, [3, -0.3, 0.0], [3, 0.3, 0.0]] for v in values]
        text += f'names.append("{name}")\ntimes.append([0.4, 2.4])\nkeys.append({keys})\n'
    demo = Demonstration.load(write(tmp_path / "export.py", text))
    assert not (tmp_path / "ran").exists()
    np.testing.assert_allclose(demo.joints[[0, -1], 0], [1.0, 0.4], atol=1e-9)
    assert demo.duration == pytest.approx(2.0)


def test_a_topic_or_a_frame_of_a_bag_is_asked_for(tmp_path):
    rosbags = pytest.importorskip("rosbags", reason="rosbags is not installed: .[formats] has it")
    assert rosbags
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    kind = "tf2_msgs/msg/TFMessage"
    path = tmp_path / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/tf", kind, typestore=store)
        for time, place in zip(T, P, strict=True):
            stamp = round((1.6e9 + time) * 1e9)
            header = types["std_msgs/msg/Header"](
                types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9),
                "base_footprint",
            )
            transforms = [
                types["geometry_msgs/msg/TransformStamped"](
                    header,
                    frame,
                    types["geometry_msgs/msg/Transform"](
                        types["geometry_msgs/msg/Vector3"](*(place + [0, 0, 0.82 + up])),
                        types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
                    ),
                )
                for frame, up in (("r_gripper", 0.0), ("Head", 0.2))
            ]
            message = types[kind](transforms)
            writer.write(connection, stamp, store.serialize_cdr(message, kind))
    with pytest.raises(InputError, match=r"2 motions in it.*tf_r_gripper.*--track"):
        Demonstration.load(path)
    demo = Demonstration.load(path, track="tf_r_gripper")
    np.testing.assert_allclose(demo.positions, P, atol=1e-9)
    assert any("from above the floor" in note for note in demo.notes)


def test_a_dataset_may_group_the_names_of_its_columns(tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed: .[formats] has it")
    root = write_lerobot(tmp_path, MOTION)
    info = root / "meta" / "info.json"
    data = json.loads(info.read_text())
    for groups in ([list(NAMES)], {"arm": list(NAMES[:3]), "wrist": list(NAMES[3:])}):
        data["features"]["observation.state"]["names"] = groups
        info.write_text(json.dumps(data))
        [track] = read_tracks(root)
        assert track.joint_names == tuple(NAMES)
        np.testing.assert_allclose(track.joints, MOTION.joints)


def test_a_state_of_poses_has_its_angles_and_names_what_is_not_read(tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed: .[formats] has it")
    root = write_lerobot(tmp_path, MOTION)
    info = root / "meta" / "info.json"
    data = json.loads(info.read_text())
    data["features"]["observation.state"]["names"] = ["x", "y", "z", "roll", "grasp"]
    info.write_text(json.dumps(data))
    [track] = read_tracks(root)
    assert track.angles is None
    assert any("2 columns were not read" in note for note in track.notes)
    data["features"]["observation.state"]["names"] = ["x", "y", "roll", "pitch", "yaw"]
    info.write_text(json.dumps(data))
    [track] = read_tracks(root)
    np.testing.assert_allclose(track.positions, MOTION.joints[:, :2])
    np.testing.assert_allclose(track.angles, MOTION.joints[:, 2:])


@pytest.mark.parametrize("name", ["motion.csv", "motion.mcap", "motion.db3", "motion.mat"])
def test_a_pointer_of_git_lfs_is_told_as_one(tmp_path, name):
    path = write(
        tmp_path / name, "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"
    )
    with pytest.raises(InputError, match=f"{name}: a pointer of Git LFS.*git lfs pull"):
        read_tracks(path)


def test_a_damaged_lasa_file_that_ends_its_reader_is_refused(tmp_path):
    path = tmp_path / "motion.mat"
    demo = {"t": np.arange(30.0), "pos": np.zeros((2, 30))}
    savemat(path, {"demos": [demo]})
    content = bytearray(path.read_bytes())
    # The kind of the numbers of pos: scipy looks up what is no kind beyond its table's end.
    place = content.rindex(b"\x09\x00\x00\x00\xe0\x01\x00\x00")
    content[place] = 145
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"motion\.mat: damaged, or no LASA motion"):
        read_tracks(path)


@pytest.mark.parametrize("bracket", ["[{}]", "({})"])
@pytest.mark.parametrize("sign", ["", "# "])
def test_units_after_a_blank_belong_to_the_name_before(tmp_path, sign, bracket):
    path = tmp_path / "motion.txt"
    times = np.arange(0, 2000, 20)
    position = [0.2, -0.1, 0.0] + np.outer(np.sin(times / 1000), [0.1, 0.05, 0.1])
    names = [f"{n} {bracket.format(u)}" for n, u in [("time", "ms"), *((a, "mm") for a in "xyz")]]
    np.savetxt(
        path, np.c_[times, 1000 * position], header=" ".join(names), comments=sign, fmt="%.9g"
    )
    loaded = Demonstration.load(path)
    assert loaded.duration == pytest.approx(1.98)
    assert_allclose(loaded.positions, position, atol=1e-8)


def test_units_at_the_end_of_joint_names_are_read(tmp_path):
    path = tmp_path / "motion.csv"
    angles = np.linspace([60, -20, 60, 40, 10], [30, -30, 70, 60, 40], 100)
    names = ["RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll", "RWristYaw"]
    header = ",".join(["time_ms", *(f"{name}_deg" for name in names)])
    np.savetxt(path, np.c_[20 * np.arange(100), angles], delimiter=",", header=header, comments="")
    assert_allclose(Demonstration.load(path).joints, np.radians(angles), atol=1e-9)
