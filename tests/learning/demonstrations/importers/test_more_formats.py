"""Variants of the formats beside the plain case."""

import numpy as np
import pytest
from scipy.io import savemat

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.demonstration_files import read_demonstrations
from pepper_drake.learning.demonstrations.importers import read_tracks

from .recordings import NAMES, format_table, make_motion, table, write

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
