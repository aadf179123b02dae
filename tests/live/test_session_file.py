import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.arm_chain import arm_chain
from pepper_drake.live.session_file import LESSONS, SESSION, SessionFolder, Taught, find_lesson
from pepper_drake.models.control_model import arm_joints


@pytest.fixture
def motion():
    times = np.linspace(0.0, 1.0, 60)
    joints = np.array([0.5, -0.3, 1.0, 0.8, 0.1]) + 0.4 * np.outer(np.sin(times), np.ones(5))
    positions, rotations = arm_chain("right").hand(joints)
    return Demonstration.from_positions(
        times,
        positions,
        rotations=so3.make_continuous(rotations),
        joints=joints,
        joint_names=arm_joints("right"),
    )


@pytest.fixture
def stored(tmp_path, motion):
    """A folder with three demonstrations, of which one was discarded, and what was learned."""
    folder = SessionFolder(tmp_path / "session")
    one, other, third = (folder.named(motion) for _ in range(3))
    primitive = MovementPrimitive.fit([one, other])
    folder.write(Taught((one, other), primitive, other, {"ball": (0.1, 0.0, -0.02)}))
    folder.write(Taught((one, third), primitive, other, {"ball": (0.1, 0.0, -0.02)}))
    return folder


def test_what_was_taught_is_read_back(stored, motion):
    taught = SessionFolder(stored.path).taught("right")
    assert [one.name for one in taught.shown] == ["01", "03"]
    assert taught.learned.name == "02"
    assert taught.offsets == {"ball": (0.1, 0.0, -0.02)}
    np.testing.assert_allclose(taught.demonstration.positions, motion.positions, atol=1e-9)
    np.testing.assert_allclose(taught.primitive.goal, motion.positions[-1])


def test_numbers_go_on_after_a_restart(stored, motion):
    assert SessionFolder(stored.path).named(motion).name == "04"


def test_a_session_before_is_kept_and_can_be_gone_on_with(stored):
    aside = stored.begin_anew()
    assert not stored.exists()
    assert SessionFolder(aside).taught("right").learned.name == "02"
    assert stored.begin_anew() is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("arm: both", 'arm is "both"'),
        ("offsets: {ball: [0, 1]}", "offsets.ball must be three finite numbers"),
        ("offsets: {ball: [0, .inf, 0]}", "offsets"),
        ("colour: red", "colour"),
        ("demonstrations: [../../other]", "leads out of its folder"),
        ("demonstrations: [09]", "09"),
        ("learned: 01", "primitive.yaml"),
    ],
)
def test_what_is_wrong_with_a_session_is_told_in_one_sentence(stored, text, words):
    (stored.path / "primitive.yaml").unlink()
    (stored.path / SESSION).write_text(text.replace("01", '"01"').replace("09", '"09"'))
    with pytest.raises(InputError) as error:
        SessionFolder(stored.path).taught("right")
    assert words in str(error.value)
    assert str(stored.path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_demonstration_of_the_other_arm_is_refused(stored):
    with pytest.raises(InputError, match="01: joints of the left arm are needed; it has RShoulder"):
        stored.taught("left")


@pytest.mark.parametrize("name", LESSONS)
def test_lessons_that_ship_have_tasks(name):
    lesson = find_lesson(name)
    assert lesson.record.title
    assert lesson.record.tasks
    lesson.taught(lesson.record.arm)


def test_a_lesson_that_is_not_there_names_those_that_are(tmp_path):
    with pytest.raises(InputError, match="first"):
        find_lesson(str(tmp_path))
