import numpy as np
import pytest

from pepper_drake.learning import Demonstration

from .recordings import BINARIES, NAMES, TEXTS, make_motion, turn


@pytest.fixture(scope="module")
def motion():
    return make_motion()


def agrees(read, motion):
    assert read.duration == pytest.approx(motion.duration, abs=1e-6)
    np.testing.assert_allclose(read.positions, motion.positions, atol=5e-4)
    if read.rotations is not None:
        assert turn(read.rotations, motion.rotations).max() < 5e-3
    if read.joints is not None:
        assert read.joint_names == NAMES
        np.testing.assert_allclose(read.joints, motion.joints, atol=2e-3)
    assert read.times[0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", TEXTS)
def test_a_text_is_read_by_what_it_says(name, motion, tmp_path):
    agrees(Demonstration.load(TEXTS[name](tmp_path, motion)), motion)


@pytest.mark.parametrize("name", BINARIES)
def test_a_binary_is_read_by_its_library(name, motion, tmp_path):
    library, write = BINARIES[name]
    pytest.importorskip(library, reason=f"{library} is not installed: .[formats] has it")
    agrees(Demonstration.load(write(tmp_path, motion)), motion)


def test_the_orientation_is_read_where_there_is_one(motion, tmp_path):
    for name in ("csv", "shuffled", "tum", "bare_tum", "euroc", "rostopic", "motive", "vicon"):
        read = Demonstration.load(TEXTS[name](tmp_path, motion))
        assert turn(read.rotations, motion.rotations).max() < 1e-5, name
