import multiprocessing
import os
import signal
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.demonstration_folder import load_all
from pepper_drake.learning.demonstrations.recording import (
    PARTIAL,
    RecordingWriter,
    recorded_demonstration,
    recover,
    without_rest,
)

JOINTS = ("RElbowYaw", "RWristYaw")
STEP = 0.01


def record(count, rest=0, pace=1.0):
    """Samples of a hand that rests, moves ahead at 0.2 m/s and turns about z, and rests."""
    moved = np.clip(np.arange(count) - rest, 0, count - 1 - 2 * rest) * STEP * pace
    zero = np.zeros(count)
    columns = [0.2 * moved, zero, zero + 0.1]
    columns += [np.cos(moved / 2), zero, zero, np.sin(moved / 2), moved, -moved]
    return np.arange(count) * STEP, np.column_stack(columns)


def write_partial(folder, count, rest=0):
    with RecordingWriter(folder, JOINTS) as writer:
        writer.write(*record(count, rest))


def test_derivatives_are_those_of_a_steady_motion():
    demo = recorded_demonstration(*record(200), JOINTS)
    inner = slice(20, -20)
    np.testing.assert_allclose(demo.velocities[inner], [[0.2, 0, 0]] * 160, atol=1e-6)
    np.testing.assert_allclose(demo.accelerations[inner], 0, atol=1e-4)
    assert "10 Hz" in demo.derivation


def test_the_filter_halves_what_shakes_at_its_cutoff():
    times, samples = record(1000)
    samples[:, 1] = np.sin(2 * np.pi * 10.0 * times)
    smoothed = recorded_demonstration(times, samples, JOINTS).positions[200:800, 1]
    assert np.ptp(smoothed) / 2 == pytest.approx(0.5, abs=0.03)


def test_what_is_new_is_written_once_and_finished_by_its_files(tmp_path):
    times, samples = record(50)
    with RecordingWriter(tmp_path, JOINTS) as writer:
        writer.write(times[:20], samples[:20])
        writer.write(times[:20], samples[:20])
        assert len((tmp_path / PARTIAL).read_text().splitlines()) == 21
        assert len(Demonstration.load(tmp_path).times) == 20
        writer.write(times, samples)
        demo = recorded_demonstration(times, samples, JOINTS)
        writer.finish(demo)
    assert sorted(os.listdir(tmp_path)) == ["joints.csv", "rotation.txt", "translation.txt"]
    loaded = Demonstration.load(tmp_path)
    np.testing.assert_array_equal(loaded.positions, demo.positions)
    assert demo.derivation in (tmp_path / "translation.txt").read_text().splitlines()[0]


@given(cut=st.integers(0, 400), zeros=st.integers(0, 3))
@settings(max_examples=15)
def test_a_torn_end_costs_its_row_only(tmp_path_factory, cut, zeros):
    folder = tmp_path_factory.mktemp("torn")
    write_partial(folder, 30)
    path = folder / PARTIAL
    whole = path.read_bytes()
    torn = whole[: len(whole) - cut]
    path.write_bytes(torn + b"\0" * zeros)
    demo = Demonstration.load(folder)
    rows = torn.count(b"\n") - 1
    assert len(demo.times) == rows
    reference = recorded_demonstration(*(part[:rows] for part in record(30)), JOINTS)
    np.testing.assert_array_equal(demo.joints, reference.joints)
    assert demo.joint_names == JOINTS


def test_an_interrupted_recording_goes_before_the_files_of_an_earlier_one(tmp_path):
    folder = tmp_path / "demo"
    recorded_demonstration(*record(40), JOINTS).save(folder)
    write_partial(folder, 3)
    assert len(Demonstration.load(folder).times) == 40  # Nothing to speak of in it yet.
    (folder / PARTIAL).unlink()
    write_partial(folder, 25)
    assert len(Demonstration.load(folder).times) == 25
    assert [len(demo.times) for demo in load_all([folder, tmp_path])] == [25, 25]


def test_recovering_leaves_a_finished_demonstration_of_the_motion(tmp_path):
    write_partial(tmp_path, 60, rest=15)
    demo = recover(tmp_path)
    assert not (tmp_path / PARTIAL).exists()
    assert demo.times[0] == 0.0
    assert 30 <= len(demo.times) < 60
    np.testing.assert_array_equal(Demonstration.load(tmp_path).times, demo.times)
    with pytest.raises(InputError, match="no interrupted recording"):
        recover(tmp_path)


def test_a_hand_that_never_moves_is_kept_as_it_is():
    times, samples = record(30)
    demo = recorded_demonstration(times, np.tile(samples[0], (30, 1)), JOINTS)
    assert without_rest(demo) is demo


def test_bad_folders_and_files_get_one_sentence(tmp_path):
    write_partial(tmp_path / "a", 3)
    with pytest.raises(InputError, match="interrupted after 3 samples"):
        Demonstration.load(tmp_path / "a")
    with pytest.raises(InputError, match="--recover"):
        RecordingWriter(tmp_path / "a", JOINTS)
    write_partial(tmp_path / "b", 30)
    path = tmp_path / "b" / PARTIAL
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:10], lines[10] + ",x", *lines[11:], ""]))
    with pytest.raises(InputError, match=r"partial.csv, line 11: "):
        Demonstration.load(tmp_path / "b")
    path.write_text("\n".join(["when,where", *lines[1:], ""]))
    with pytest.raises(InputError, match=r"partial.csv, line 1: the header"):
        Demonstration.load(tmp_path / "b")
    (tmp_path / "c").write_text("")
    with pytest.raises(InputError, match="is a file; give a folder"):
        RecordingWriter(tmp_path / "c", JOINTS)
    with pytest.raises(InputError, match="cannot be written"):
        RecordingWriter(tmp_path / "c" / "d", JOINTS)
    with pytest.raises(InputError, match="2 samples; a recording needs at least 5"):
        recorded_demonstration(*record(2), JOINTS)


def record_quickly(folder, clock):
    """Records 15 s of motion in slices of 0.1 s, far faster than that, then finishes."""
    times, samples = record(1501, pace=0.1)
    with RecordingWriter(folder, JOINTS) as writer:
        for end in range(11, 1502, 10):
            time.sleep(0.002)
            clock.value = times[end - 1]
            writer.write(times[:end], samples[:end])
        writer.finish(recorded_demonstration(times, samples, JOINTS))


@pytest.mark.parametrize("seed", range(4))
def test_killed_at_any_moment_all_up_to_the_last_second_is_readable(tmp_path, seed):
    context = multiprocessing.get_context("fork")
    clock = context.Value("d", 0.0, lock=False)
    process = context.Process(target=record_quickly, args=(tmp_path, clock))
    process.start()
    while clock.value < 1.0:
        time.sleep(0.001)
    time.sleep(np.random.default_rng(seed).uniform(0.0, 0.6))
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    demo = Demonstration.load(tmp_path)
    assert demo.times[-1] >= clock.value - 1.0
    np.testing.assert_allclose(np.diff(demo.times), STEP, atol=1e-9)
    reference = record(len(demo.times), pace=0.1)[1]
    np.testing.assert_allclose(demo.positions, reference[:, :3], atol=1e-4)
    np.testing.assert_allclose(demo.joints, reference[:, 7:], atol=1e-3)
    if (tmp_path / PARTIAL).exists():
        recover(tmp_path)
    assert sorted(os.listdir(tmp_path))[-3:] == ["joints.csv", "rotation.txt", "translation.txt"]


def test_when_its_files_cannot_be_written_the_recording_stays_recoverable(tmp_path):
    (tmp_path / "rotation.txt").mkdir()  # In the way of the second of three files.
    times, samples = record(40)
    demo = recorded_demonstration(times, samples, JOINTS)
    with RecordingWriter(tmp_path, JOINTS) as writer:
        writer.write(times, samples)
        with pytest.raises(InputError, match=r"rotation.txt: cannot be written"):
            writer.finish(demo)
    assert len(Demonstration.load(tmp_path).times) == 40
    (tmp_path / "rotation.txt").rmdir()
    recover(tmp_path)
    assert Demonstration.load(tmp_path).rotations is not None


def test_an_interrupted_recording_of_what_cannot_be_is_not_recovered(tmp_path):
    times, samples = record(50)
    samples[20, 2] = 1e9
    with RecordingWriter(tmp_path, JOINTS) as writer:
        writer.write(times, samples)
    with pytest.raises(InputError, match=f"{PARTIAL}, line 22: the hand would be 1e\\+09 m"):
        recover(tmp_path)
    assert (tmp_path / PARTIAL).exists()
