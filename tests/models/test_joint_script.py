import pytest

from pepper_drake.errors import InputError
from pepper_drake.models.joint_script import JOINT_SCRIPTS, load_joint_script

GOOD = """\
arm: left
moves:
- {joint: LElbowYaw, angle: -0.5, duration: 0.5}
- {joint: LWristYaw, angle: 0.3, duration: 1.0}
"""


@pytest.mark.parametrize("name", JOINT_SCRIPTS)
def test_shipped_scripts_load_and_mirror(name):
    script = load_joint_script(name)
    mirrored = script.mirrored()
    mirrored.check()
    assert mirrored.moves[0].joint == "LShoulderRoll"
    assert mirrored.moves[0].angle == -script.moves[0].angle
    assert mirrored.moves[3].angle == script.moves[3].angle  # A pitch.
    assert mirrored.mirrored() == script


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("LElbowYaw", "RElbowYaw", r'line 3: moves\[0\].joint is "RElbowYaw"; the left arm has'),
        ("duration: 1.0", "duration: 0", r"line 4: moves\[1\].duration is 0 s; it must be above 0"),
        ("angle: 0.3", "angle: .nan", r"line 4: moves\[1\].angle"),
        ("moves:", "pause: -1\nmoves:", "line 2: pause is -1 s"),
        ("arm: left", "arm: left\nposture: lie", 'line 2: posture is "lie"'),
    ],
)
def test_bad_scripts_get_one_sentence(tmp_path, old, new, sentence):
    path = tmp_path / "script.yaml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=sentence):
        load_joint_script(path)


def test_a_script_without_moves_is_none(tmp_path):
    path = tmp_path / "script.yaml"
    path.write_text("arm: left\n")
    with pytest.raises(InputError, match="moves holds none"):
        load_joint_script(path)
