import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.files import write_atomically
from pepper_drake.learning import Demonstration
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.text_files import format_table, parse_table

ROWS = "\n".join(f"{0.1 * k:.1f} 0.{k} 0 0 1 0 0 0 0 0" for k in range(6))


def write(path, text):
    path.write_text(text)
    return path


def same(one, other):
    for field in ("times", "positions", "velocities", "accelerations"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


def test_ten_columns_come_back_to_the_last_digit(demonstration, tmp_path):
    path = tmp_path / "motion.txt"
    demonstration.save(path)
    back = Demonstration.load(path)
    same(back, demonstration)
    np.testing.assert_array_equal(back.rotations, demonstration.rotations)
    back.save(tmp_path / "again.txt")
    assert (tmp_path / "again.txt").read_text() == path.read_text()


def test_folder_comes_back_to_the_last_digit(demonstration, tmp_path):
    demonstration.save(tmp_path / "first")
    once = Demonstration.load(tmp_path / "first")
    same(once, demonstration)
    np.testing.assert_array_equal(once.joints, demonstration.joints)
    assert once.joint_names == demonstration.joint_names
    turn = so3.log_map(so3.multiply(once.rotations, so3.conjugate(demonstration.rotations)))
    assert np.abs(turn).max() < 1e-12
    once.save(tmp_path / "second")
    twice = Demonstration.load(tmp_path / "second")
    np.testing.assert_array_equal(twice.angles, once.angles)
    for name in ("translation.txt", "rotation.txt", "joints.csv"):
        first, second = tmp_path / "first" / name, tmp_path / "second" / name
        assert first.read_text() == second.read_text()


def test_pose_file_comes_back_to_the_last_digit(demonstration, tmp_path):
    path = tmp_path / "motion_pose.txt"
    demonstration.save(path)
    back = Demonstration.load(path)
    assert back.name == "motion"
    np.testing.assert_array_equal(back.positions, demonstration.positions)
    np.testing.assert_array_equal(back.rotations, demonstration.rotations)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=4, max_size=4))
def test_every_float_survives_a_table(tmp_path_factory, values):
    table = np.column_stack((np.arange(4.0), values))
    path = tmp_path_factory.getbasetemp() / "table.txt"
    back = parse_table(format_table(table), path, (2,), "time, value")
    np.testing.assert_array_equal(back, table)


def test_reads_times_positions_and_derives_the_rest(tmp_path):
    rows = "# time x y z\n\n" + "\n".join(f"{0.1 * k} {(0.1 * k) ** 2} 0 0  # ok" for k in range(8))
    demo = Demonstration.load(write(tmp_path / "motion.txt", rows))
    np.testing.assert_allclose(demo.velocities[:, 0], 2 * demo.times, atol=1e-9)


def test_angles_are_unwrapped(tmp_path):
    write(tmp_path / "translation.txt", ROWS)
    yaw = np.linspace(3.0, 3.5, 6)
    wrapped = (yaw + np.pi) % (2 * np.pi) - np.pi
    rows = "\n".join(f"{0.1 * k:.1f} 0 0 {wrapped[k]} 0 0 1 0 0 0" for k in range(6))
    write(tmp_path / "rotation.txt", rows)
    demo = Demonstration.load(tmp_path)
    np.testing.assert_allclose(demo.angles[:, 2], yaw)


@pytest.mark.parametrize(
    ("rows", "line", "words"),
    [
        (ROWS.replace("0.2 0.2", "0.2 two"), 3, "'two' is not a number"),
        (ROWS.replace("0.2 0.2", "0.2 nan"), 3, "not a finite number"),
        (ROWS.replace("0.2 0.2", "0.2 1e999"), 3, "not a finite number"),
        (ROWS.replace("0.2 0.2 0", "0.2 0.2"), 3, "9 columns where 10"),
        (ROWS.replace(" 0\n", "\n"), 1, "9 columns where 4 or 7 or 10"),
        (ROWS.replace("0.3 0.3", "0.1 0.3"), 4, "does not come after"),
        (ROWS.replace("0.3 0.3", "0.2 0.3"), 4, "each time once"),
        (ROWS.replace("0.2 0.2", "0,2 0.2"), 3, "decimal point"),
    ],
)
def test_errors_name_file_line_and_mend(tmp_path, rows, line, words):
    path = write(tmp_path / "motion.txt", rows)
    with pytest.raises(InputError) as caught:
        Demonstration.load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}, line {line}: ")
    assert words in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "0 rows"), (b"0 1 2 3\n1 1 2 3\n", "2 rows"), (b"\xff\xfe\x00", "not a text file")],
)
def test_refuses_files_without_a_motion(tmp_path, content, words):
    path = tmp_path / "motion.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        Demonstration.load(path)


def test_refuses_what_is_not_there(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        Demonstration.load(tmp_path / "nothing.txt")
    with pytest.raises(InputError, match=r"translation\.txt: no such file"):
        Demonstration.load(tmp_path)


def test_refuses_a_pose_that_is_no_unit_quaternion(tmp_path):
    rows = "\n".join(f"{k} 0 0 0 1 {1 if k == 2 else 0} 0 0" for k in range(5))
    path = write(tmp_path / "motion_pose.txt", rows)
    with pytest.raises(InputError, match=r"sample 3.*norm is 1\.414"):
        Demonstration.load(path)


def test_refuses_a_pose_file_with_other_times(tmp_path):
    write(tmp_path / "motion.txt", ROWS)
    rows = "\n".join(f"{k} 0 0 0 1 0 0 0" for k in range(6))
    write(tmp_path / "motion_pose.txt", rows)
    with pytest.raises(InputError, match="same rows"):
        Demonstration.load(tmp_path / "motion.txt")


def test_joint_errors_have_the_line_of_the_file(tmp_path):
    write(tmp_path / "translation.txt", ROWS)
    rows = ["time,RElbowYaw"] + [f"{0.1 * k:.1f},{'x' if k == 1 else 0}" for k in range(6)]
    write(tmp_path / "joints.csv", "\n".join(rows))
    with pytest.raises(InputError, match=r"joints\.csv, line 3: 'x' is not a number"):
        Demonstration.load(tmp_path)
    write(tmp_path / "joints.csv", "\n".join(["RElbowYaw", *rows[1:]]))
    with pytest.raises(InputError, match="line 1: the header"):
        Demonstration.load(tmp_path)


def test_a_pose_file_needs_an_orientation(tmp_path, demonstration):
    bare = Demonstration.from_positions(demonstration.times, demonstration.positions)
    with pytest.raises(InputError, match="no orientation"):
        bare.save(tmp_path / "motion_pose.txt")


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = write(tmp_path / "motion.txt", "old")

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", fail)
    with pytest.raises(InputError, match="No space left"):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["motion.txt"]


def test_a_folder_keeps_nothing_of_an_earlier_demonstration(demonstration, tmp_path):
    demonstration.save(tmp_path)
    bare = Demonstration.from_positions(demonstration.times[:50], demonstration.positions[:50])
    bare.save(tmp_path)
    back = Demonstration.load(tmp_path)
    same(back, bare)
    assert back.rotations is None
    assert back.joints is None
