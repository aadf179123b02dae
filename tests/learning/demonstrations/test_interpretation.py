"""Meaning of the numbers of a file: read rightly, or refused with the mend."""

from datetime import datetime, timedelta

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.arm_chain import arm_chain
from pepper_drake.learning.demonstrations.demonstration_files import (
    read_demonstrations,
    read_joint_recording,
)
from pepper_drake.learning.demonstrations.demonstration_folder import load_all

from .importers.recordings import NAMES, make_motion, table, turn, write, xyzw

MOTION = make_motion()
T, P, Q, J = MOTION.times, MOTION.positions, MOTION.rotations, MOTION.joints
V, A = MOTION.velocities, MOTION.accelerations
LEFT = arm_chain("left").joint_names
REST = np.tile([1.55, 0.14, -1.22, -0.52, 0.0], (len(T), 1))
XYZ, JOINTS = "time,x,y,z", ",".join(["time", *NAMES])


def hurt(values, sample, new):
    changed = np.array(values)
    changed[sample] = new
    return changed


def rows(*columns):
    return table(*columns, separator=" ")


def recoded(text, code):
    return text.encode(code)


def stamps(pattern):
    start = datetime(2024, 5, 3, 14, 2, 11)
    return [(start + timedelta(seconds=float(t))).strftime(pattern) for t in T]


def lined(first, *columns, header=""):
    body = table(*columns).splitlines()
    lines = [f"{word},{row}" for word, row in zip(first, body, strict=True)]
    return "\n".join([*([header] * bool(header)), *lines]) + "\n"


CSV = table(T, P, header=XYZ)
ANGLES = np.unwrap(so3.to_angles(Q), axis=0)
MATRICES = Rotation.from_quat(xyzw(MOTION)).as_matrix()
LOST = so3.multiply(so3.exp_map(np.array([[0.0, 0.5, 0.0]])), Q[30:31])
"""An orientation half a radian away: 25 rad/s, which a hand can turn at, but not from rest."""
POSES = np.tile(np.eye(4), (len(T), 1, 1))
POSES[:, :3, :3], POSES[:, :3, 3] = MATRICES, P

READ = {
    "UTF-16": (recoded(CSV, "utf-16"), {}),
    "another code": (recoded("# für Zürich\n" + CSV, "latin-1"), {}),
    "carriage returns alone": (CSV.replace("\n", "\r"), {}),
    "bars": (CSV.replace(",", "|"), {}),
    "decimal commas and spaces": (rows(T, P).replace(".", ","), {}),
    "a line for Excel": ("sep=;\n" + CSV.replace(",", ";"), {}),
    "titles above the names": ("My recording\nby Ann, in May\n" + CSV, {}),
    "a title above numbers": ("My recording of Wednesday in May\n" + rows(T, P), {}),
    "comments with slashes": ("// t in seconds\n" + rows(T, P), {}),
    "a row of units": (table(T, 1e3 * P, header=f"{XYZ}\ns,mm,mm,mm"), {}),
    "names twice": (CSV.replace("\n", f"\n{XYZ}\n", 1), {}),
    "Fortran's exponents": (rows(T, P).replace("e", "D"), {}),
    "dates": (lined(stamps("%Y-%m-%dT%H:%M:%S.%fZ"), P, header=XYZ), {}),
    "times of day": (lined(stamps("%H:%M:%S.%f"), P), {}),
    "seconds and nanoseconds": (
        table(1.7e9 + T // 1, np.round(T % 1 * 1e9), P, header="stamp.sec,stamp.nanosec,x,y,z"),
        {},
    ),
    "units in a comment": ("# positions in mm\n" + rows(T, 1e3 * P), {}),
    "a frame in a comment": ("# frame: base_footprint\n" + rows(T, P + [0, 0, 0.82]), {}),
    "inches in the names": (table(T, P / 0.0254, header="time,x [in],y [in],z [in]"), {}),
    "matrices of KITTI": (
        rows(np.concatenate((MATRICES, P[:, :, None]), axis=2).reshape(len(T), 12)),
        {"rate": 50.0},
    ),
    "matrices column by column, as Franka's O_T_EE": (
        rows(T, POSES.swapaxes(1, 2).reshape(len(T), 16)),
        {},
    ),
    "an accelerometer beside positions": (
        table(T, A + [0, 0, 9.81], P, header="time,accel_x,accel_y,accel_z,x,y,z"),
        {},
    ),
    "times of a trajectory": (table(T, J, header=JOINTS.replace("time", "time_from_start")), {}),
    "numbers for what was not measured, to be left out": (
        rows(T, hurt(P, slice(50, 53), 9999.0)),
        {"drop_outliers": True},
    ),
    "what was commanded beside what was measured": (
        table(
            T,
            J + 0.1,
            J,
            header="time,"
            + ",".join(f"{kind}_{n}" for kind in ("desired", "actual") for n in NAMES),
        ),
        {},
    ),
    "several trials, one told": (
        lined(
            ["a"] * len(T) + ["b"] * len(T),
            np.r_[T, T + 4],
            np.r_[P, P + 0.1],
            header=f"trial,{XYZ}",
        ),
        {"track": "1"},
    ),
    "millimetres, told": (rows(T, 1e3 * P), {"unit": "mm"}),
    "centimetres, told": (rows(T, 1e2 * P), {"unit": "cm"}),
    "milliseconds, told": (rows(1e3 * T, P), {"time": "ms"}),
    "a row that repeats the one before": (
        table(np.insert(T, 9, T[9]), np.insert(P, 9, P[9], axis=0), header=XYZ),
        {},
    ),
    "names as a program has them": (
        table(1e3 * T, P, header="timeMs,xPos,yPos,zPos"),
        {"time": "ms"},
    ),
    "a day and a time of day between blanks": (
        "\n".join(
            f"2024-05-01 10:59:{50 + t:06.3f} " + " ".join(map(repr, map(float, p)))
            for t, p in zip(T, P, strict=True)
        )
        + "\n",
        {},
    ),
    "units in the names": (table(1e3 * T, 1e3 * P, header="time_ms,x_mm,y_mm,z_mm"), {}),
    "a clock in nanoseconds": (rows(1.7e18 + 1e9 * T, P), {}),
    "no times, a rate": (table(P, header="x,y,z"), {"rate": 50.0}),
    "above the floor, told": (rows(T, P + [0, 0, 0.82]), {"frame": "base_footprint"}),
    "y is up, told": (table(T, P[:, [0, 2, 1]] * [1, 1, -1], header=XYZ), {"up": "y"}),
    "another place, told": (rows(T, P + [3.0, 1.0, 0.5]), {"start": tuple(P[0])}),
    "velocities in other units left out": (
        table(T, P, 1e3 * V, header=f"{XYZ},vx [mm/s],vy [mm/s],vz [mm/s]"),
        {},
    ),
    "joints alone": (table(T, J, header=JOINTS), {}),
    "joints in degrees, told": (table(T, np.degrees(J), header=JOINTS), {"angle": "deg"}),
    "the arm that moves": (table(T, REST, J, header=",".join(["time", *LEFT, *NAMES])), {}),
    "an outlier, to be left out": (rows(T, hurt(P, 50, P[50] + 0.1)), {"drop_outliers": True}),
    "names of ALMemory": (
        table(
            T,
            np.repeat(J, 2, axis=1) + np.tile([0.3, 0.0], 5),
            header=",".join(
                [
                    "time",
                    *(
                        f"Device/SubDeviceList/{name}/Position/{kind}/Value"
                        for name in NAMES
                        for kind in ("Actuator", "Sensor")
                    ),
                ]
            ),
        ),
        {},
    ),
}


@pytest.mark.parametrize("name", READ)
def test_read_rightly(name, tmp_path):
    text, said = READ[name]
    demo = Demonstration.load(write(tmp_path / "motion.csv", text), **said)
    at = np.linspace(0.0, 1.0, 20)
    own = [np.interp(at * demo.duration, demo.times - demo.times[0], p) for p in demo.positions.T]
    shown = [np.interp(at * T[-1], T, p) for p in P.T]
    np.testing.assert_allclose(own, shown, atol=1e-3)
    assert demo.duration == pytest.approx(T[-1], rel=1e-3)
    if demo.joints is not None:
        assert demo.joint_names == NAMES
        np.testing.assert_allclose(demo.joints, J, atol=1e-9)


REFUSED = {
    "feet": (table(T, P / 0.3048, header=XYZ), r"no position is within.*--unit ft"),
    "above the floor": (rows(T, P + [0, 0, 0.82]), r"no position is within.*base_footprint"),
    "a unit that is not read": (
        table(T, P, header="time,x [px],y [px],z [px]"),
        "unit of 'x .px.'",
    ),
    "turns of joints": (
        table(T, J / 6.283, header="time," + ",".join(f"{n} [turns]" for n in NAMES)),
        "unit of .*turns.* is not read",
    ),
    "small degrees": (
        table(T, J, header="time," + ",".join(f"{n} [deg]" for n in NAMES)),
        "none is beyond 3.1; say --angle rad",
    ),
    "a clock that begins late": (rows(np.r_[0.0, 1.7e9 + T[1:]], P), "line 2: 1.7e.09 s without"),
    "half a minute without samples": (rows(np.where(T > 1, T + 30, T), P), "s without a sample"),
    "a body at rest": (table(T, 1e-4 * P + P[0], header=XYZ), "moves by .* mm in all"),
    "commas twice": (
        "\n".join([XYZ, *(row.replace(".", ",") for row in CSV.splitlines()[1:])]) + "\n",
        "columns where 4 are named.*decimal point",
    ),
    "x twice": (table(T, P, P + 0.1, header=f"{XYZ},x,y,z"), "both are the position's x"),
    "a joint twice": (table(T, J, J[:, 0], header=f"{JOINTS},RShoulderPitch"), "both are RShould"),
    "several trials": (
        lined(
            ["a"] * len(T) + ["b"] * len(T),
            np.r_[T, T + 4],
            np.r_[P, P + 0.1],
            header=f"trial,{XYZ}",
        ),
        "2 motions in it .*_a, .*_b",
    ),
    "turns of the torso about the hand": (
        table(T, P, so3.conjugate(Q), header=f"{XYZ},qw,qx,qy,qz"),
        "cannot be turned so.*inverse rotation",
    ),
    "yaw, pitch, roll as roll, pitch, yaw": (
        table(T, P, ANGLES[:, ::-1], header=f"{XYZ},roll,pitch,yaw"),
        "cannot be turned so.*yaw, pitch, roll",
    ),
    "a topic without names": (
        lined([f"{int(t)},{round(t % 1 * 1e9)},torso" for t in T], P),
        "column 3 holds words.*name the columns",
    ),
    "millimetres": (rows(T, 1e3 * P), r"line \d+: .*--unit mm"),
    "centimetres": (rows(T, 1e2 * P), r"line \d+: .*--unit cm"),
    "milliseconds": (rows(1e3 * T, P), r"line \d+: .*--time ms"),
    "samples counted": (rows(np.arange(len(T)), P), "counts the samples.*--rate"),
    "no times": (rows(P), "no times in it.*--rate"),
    "a path of two dimensions": (rows(T, P[:, :2]), "two dimensions.*--plane"),
    "two dimensions that pass for three": (
        rows(T, P[:, :2], V[:, :2], A[:, :2]),
        "two dimensions.*--plane",
    ),
    "one dimension": (rows(T, P[:, :1], V[:, :1], A[:, :1]), "one dimension.*derivatives"),
    "four dimensions": (
        rows(T, P, P[:, :1], V, V[:, :1], A, A[:, :1]),
        "4 dimensions without names",
    ),
    "velocities in mm/s": (rows(T, P, 1e3 * V), "velocities are not the derivatives"),
    "velocities of zero": (rows(T, P, 0 * V), "velocities are not the derivatives"),
    "accelerations that are velocities": (rows(T, P, V, V), "accelerations are not the deriv"),
    "a sample lost to zero": (rows(T, hurt(P, 50, 0.0)), "line 51: a jump to 0 0 0"),
    "a first sample of zero": (rows(T, hurt(P, 0, 0.0)), "line 1: a jump to 0 0 0"),
    "four samples lost": (rows(T, hurt(P, slice(50, 54), 0.0)), r"line 51: .*\(4 such\)"),
    "an outlier": (rows(T, hurt(P, 50, P[50] + 0.1)), "line 51: an outlier.*--drop-outliers"),
    "a jump": (rows(T, hurt(P, slice(50, None), P[50:] + 0.2)), "line 51: a jump of 35 cm"),
    "zeros until the tracker found it": (
        rows(T, hurt(P, slice(12), 0.0)),
        "line 1: .*0 0 0.*12 such",
    ),
    "a number for what was not measured": (
        rows(T, hurt(P, slice(50, 54), 9999.0)),
        "line 51: .* all but 4 samples are within 2 m.*--drop-outliers",
    ),
    "a first sample of the last take": (rows(T, hurt(P, 0, P[0] + 0.04)), "line 2: a jump of 7 cm"),
    "two samples of the last take": (
        rows(T, hurt(P, slice(2), P[:2] + 0.04)),
        "line 3: a jump of 7 cm",
    ),
    "a last number that is cut off": (
        rows(T, hurt(P, (-1, 2), P[-1, 2] + 0.04)),
        "line 101: a jump of 4 cm",
    ),
    "orientations of another take": (
        table(T, P, hurt(Q, slice(30, 33), LOST), header=f"{XYZ},qw,qx,qy,qz"),
        "line 32: the hand turns by .* tracker lost",
    ),
    "a name for the time that is not known": (CSV.replace("time", "Zeit"), "name their column"),
    "a page in place of the file": ("\n\n<!doctype html>\n<html>", "a web page in place"),
    "an order that is not said": (
        table(T, P + [0.3, 0.5, 0.2], xyzw(MOTION), separator=" "),
        "--quaternion wxyz or --quaternion xyzw",
    ),
    "angles in degrees": (
        table(T, P, np.degrees(so3.to_angles(Q)), header=f"{XYZ},roll,pitch,yaw"),
        r"line \d+: an angle of .*--angle deg",
    ),
    "joints in degrees": (
        table(T, np.degrees(J), header=JOINTS),
        r"line \d+: joint RShoulderPitch .*--angle deg",
    ),
    "four joints": (table(T, J[:, :4], header=JOINTS.rpartition(",")[0]), "all five joints"),
    "joints of another robot": (
        table(T, J, header="time," + ",".join(f"panda_joint{k}" for k in range(1, 6))),
        "no motion among the columns",
    ),
    "two arms that move": (
        table(T, J * [1, -1, -1, -1, -1], J, header=",".join(["time", *LEFT, *NAMES])),
        "both arms' joints move.*--arm",
    ),
    "an arm that rests beside half of one that moves": (
        table(T, REST, J[:, :4], header=",".join(["time", *LEFT, *NAMES[:4]])),
        "the right arm moves, but RWristYaw",
    ),
    "nanoseconds that nobody said": (
        rows(np.round(1e9 * T), P),
        r"are they nanoseconds \(--time ns\)",
    ),
    "part of an arm above the floor": (
        table(T, P + [0, 0, 0.82], J[:, :4], header=",".join([XYZ, *NAMES[:4]])),
        "--frame base_footprint",
    ),
    "the same time twice": (
        table(np.insert(T, 9, T[9]), np.insert(P, 9, P[9] + 1e-4, axis=0), header=XYZ),
        "line 12: time .* each time once",
    ),
    "two takes in one file": (
        table(np.r_[T, T], np.r_[P, P], header=XYZ),
        "line 103: time 0 s does not come after 2 s.*two recordings in it. Cut it there",
    ),
    "x in m and y in mm": (
        table(T, P * [1, 1e3, 1], header="time,x [m],y [mm],z [m]"),
        "different units",
    ),
    "three columns of a quaternion": (
        table(T, P, Q[:, 1:], header=f"{XYZ},qx,qy,qz"),
        "line 2: a quaternion with 3 columns",
    ),
    "two bodies": (
        table(T, P, P + 0.1, header="time,hand_x,hand_y,hand_z,head_x,head_y,head_z"),
        "2 motions in it.*motion_hand, motion_head.*--track",
    ),
    "a header alone": (XYZ + "\n", "a header without rows"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_the_mend(name, tmp_path):
    text, words = REFUSED[name]
    path = write(tmp_path / "motion.csv", text)
    with pytest.raises(InputError, match=words) as caught:
        Demonstration.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def folder(path, positions=P, angles=None, joints=J):
    write(path / "translation.txt", rows(T, positions))
    if angles is not None:
        write(path / "rotation.txt", rows(T, angles))
    if joints is not None:
        write(path / "joints.csv", table(T, joints, header=JOINTS))
    return path


def test_a_folder_with_other_separators_is_told_which_it_takes(tmp_path):
    for separator in (",", ";"):
        write(tmp_path / "translation.txt", table(T, P, separator=separator))
        with pytest.raises(InputError, match=r"line 1: 1 columns .*separate them by spaces"):
            Demonstration.load(tmp_path)


def test_a_folder_without_permission_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("os.access", lambda path, mode: False)  # Root may read any.
    for read in (Demonstration.load, lambda path: load_all([path])):
        with pytest.raises(InputError, match=rf"{tmp_path}: cannot be read .*permissions"):
            read(tmp_path)


def test_a_joint_with_two_columns_in_a_folder_is_refused(tmp_path):
    write(tmp_path / "joints.csv", table(T, J, J[:, 0] + 0.1, header=f"{JOINTS},RShoulderPitch"))
    with pytest.raises(InputError, match=r"RShoulderPitch has two columns"):
        Demonstration.load(tmp_path)


def test_a_name_that_no_figure_can_draw_is_shown_by_its_codes(tmp_path):
    path = write(tmp_path / "\udcdcbung\n1.csv", CSV)
    assert Demonstration.load(path).name == r"\udcdcbung\n1"
    path = write(tmp_path / "\udcdc.csv", table(T, J, header=JOINTS))
    assert read_joint_recording(path).name == r"\udcdc"


def test_a_sensor_slower_than_the_log_does_not_jump(tmp_path):
    held = P[(np.arange(len(T)) // 5) * 5]
    assert len(Demonstration.load(write(tmp_path / "held.txt", rows(0.4 * T, held))).times)


def test_hand_and_joints_that_disagree_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"82 cm from the positions.*base_footprint"):
        Demonstration.load(folder(tmp_path / "floor", P + [0, 0, 0.82]))
    with pytest.raises(InputError, match=r"the hand and the joints disagree"):
        Demonstration.load(folder(tmp_path / "other", P[::-1]))
    with pytest.raises(InputError, match="the orientation and the joints disagree"):
        Demonstration.load(folder(tmp_path / "yaw first", angles=so3.to_angles(Q)[:, ::-1]))


def test_what_is_in_degrees_is_found_by_forward_kinematics(tmp_path):
    angles = so3.to_angles(Q)
    for one, other in (
        (folder(tmp_path / "joints", angles=angles, joints=np.degrees(J)), "joints"),
        (folder(tmp_path / "angles", angles=np.degrees(angles)), "orientation"),
    ):
        demo = Demonstration.load(one, angle="deg")
        np.testing.assert_allclose(demo.joints, J, atol=1e-9, err_msg=other)
        assert turn(demo.rotations, Q).max() < 1e-9


def test_a_pose_file_with_w_last_is_told_by_the_arm_that_reaches_it(tmp_path):
    path = write(tmp_path / "tum_pose.txt", rows(T, P, xyzw(MOTION)))
    demo = Demonstration.load(path)
    assert turn(demo.rotations, Q).max() < 1e-9
    assert any("xyzw" in note for note in demo.notes)


def test_a_path_of_two_dimensions_lies_on_the_plane_that_is_given(tmp_path):
    path = write(tmp_path / "flat.txt", rows(T, P[:, :2]))
    place = np.array([0.1, -0.2, 0.05])
    demo = Demonstration.load(path, plane=(*place, 0.3, 0.0, 0.0))
    normal = np.array([0.0, -np.sin(0.3), np.cos(0.3)])
    np.testing.assert_allclose((demo.positions - place) @ normal, 0.0, atol=1e-12)
    lengths = np.linalg.norm(np.diff(demo.positions, axis=0), axis=1)
    np.testing.assert_allclose(lengths, np.linalg.norm(np.diff(P[:, :2], axis=0), axis=1))


def test_all_motions_of_a_file_or_one_by_name_or_number(tmp_path):
    header = "time,hand_x,hand_y,hand_z,tip_x,tip_y,tip_z"
    path = write(tmp_path / "take.csv", table(T, P, P + 0.05, header=header))
    both = read_demonstrations(path)
    assert [demo.name for demo in both] == ["take_hand", "take_tip"]
    for track in ("take_tip", "2"):
        demo = Demonstration.load(path, track=track)
        np.testing.assert_allclose(demo.positions, P + 0.05)
    with pytest.raises(InputError, match="no motion 'foot' in it; there are take_hand"):
        Demonstration.load(path, track="foot")


def test_joints_of_any_number_are_read_without_a_hand(tmp_path):
    path = write(tmp_path / "two.csv", table(T, J[:, [3, 0]], header="t,RElbowRoll,RShoulderPitch"))
    recording = read_joint_recording(path)
    assert recording.names == ("RElbowRoll", "RShoulderPitch")
    np.testing.assert_allclose(recording.joints, J[:, [3, 0]])
    with pytest.raises(InputError, match="no joints of Pepper"):
        read_joint_recording(write(tmp_path / "hand.csv", table(T, P, header=XYZ)))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("deviation", [0.0003, 0.001, 0.003])
def test_noise_is_filtered_as_recordings_are(tmp_path, seed, deviation):
    noise = np.random.default_rng(seed).normal(0.0, deviation, P.shape)
    demo = Demonstration.load(write(tmp_path / "noisy.txt", rows(T, P + noise)))
    assert "smoothed" in demo.notes[-1]
    assert np.linalg.norm(demo.velocities[[0, -1]], axis=1).max() < 0.05
    path = MovementPrimitive.fit(demo).rollout()
    assert np.abs(path.accelerations).max() < 8.0
    own = np.column_stack([np.interp(T, path.times, p) for p in path.positions.T])
    assert np.linalg.norm(own - P, axis=1).max() < 4 * deviation


def test_without_noise_nothing_is_filtered(tmp_path):
    demo = Demonstration.load(write(tmp_path / "clean.txt", rows(T, P)))
    np.testing.assert_array_equal(demo.positions, P)
    assert not any("smoothed" in note for note in demo.notes)


def test_options_that_are_no_choice_are_refused(tmp_path):
    path = write(tmp_path / "motion.txt", rows(T, P))
    for said, words in (
        ({"unit": "yd"}, "unit: 'yd' is unknown; use one of m, cm"),
        ({"units": "mm"}, "units: no such option; use some of unit"),
        ({"plane": (1, 2)}, "plane: .* must be 6 finite"),
        ({"rate": 0.0}, "rate: 0.0 Hz"),
    ):
        with pytest.raises(InputError, match=words):
            Demonstration.load(path, **said)


@pytest.mark.parametrize("kept", [np.r_[0:40, 80:101], np.r_[0:101:20]])
def test_what_few_samples_gave_is_saved_and_loaded_as_it_was(tmp_path, kept):
    demo = Demonstration.load(write(tmp_path / "few.csv", table(T[kept], P[kept], header=XYZ)))
    demo.save(tmp_path / "saved")
    again = Demonstration.load(tmp_path / "saved")
    for name in ("times", "positions", "velocities", "accelerations"):
        np.testing.assert_array_equal(getattr(again, name), getattr(demo, name))


def test_quaternions_that_are_nearly_of_norm_one_are_performed(tmp_path):
    text = table(T, P, 1.004 * Q, header=f"{XYZ},qw,qx,qy,qz")
    path = MovementPrimitive.fit(Demonstration.load(write(tmp_path / "q.csv", text))).rollout()
    np.testing.assert_allclose(path.rotations[0], Q[0], atol=1e-6)
