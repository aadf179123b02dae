import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.models.marker_script import MARKER_SCRIPTS, load_marker_script

GOOD = """\
rest: 0.3
path:
- {time: 0.0, position: [1.0, 0.1, 0.0], rpy: [0, 0, 0]}
- {time: 1.0, position: [0.9, 0.2, 0.1], rpy: [0, 0, 0]}
- {time: 2.0, position: [0.8, 0.2, 0.2], rpy: [0, 0, 0.1]}
"""


@pytest.mark.parametrize("name", MARKER_SCRIPTS)
def test_shipped_scripts_load_and_mirror(name):
    script = load_marker_script(name)
    mirrored = script.mirrored()
    mirrored.check()
    assert mirrored.arm == "left"
    assert mirrored.mirrored() == script


def test_poses_face_the_robot_and_begin_after_the_rest(tmp_path):
    path = tmp_path / "script.yaml"
    path.write_text(GOOD)
    times, poses = load_marker_script(path).poses()
    np.testing.assert_allclose(times, [0.3, 1.3, 2.3])
    np.testing.assert_allclose(poses[0].translation(), [1.0, 0.1, 0.0])
    # x to the robot's right as one looks at it, y up, z to the robot.
    np.testing.assert_allclose(
        poses[0].rotation().matrix().T, [[0, -1, 0], [0, 0, 1], [-1, 0, 0]], atol=1e-12
    )


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("rest: 0.3", "camera: side", 'line 1: camera is "side"; it must be one of top, bottom'),
        ("rest: 0.3", "scale: 0", "line 1: scale is 0; it must be above 0"),
        ("rest: 0.3", "marker_id: 50", "line 1: marker_id is 50; DICT_4X4_50 has 0 to 49"),
        ("time: 2.0", "time: 1.0", r"line 5: path\[2\].time is 1 s; times must increase"),
        ("time: 0.0", "time: 0.5", r"line 3: path\[0\].time is 0.5 s; it must be 0"),
        ("[1.0, 0.1, 0.0]", "[1.0, 0.1]", r"line 3: path\[0\].position must be three"),
        ("- {time: 2.0", "#", "line 2: path holds 2 poses; it needs at least three"),
    ],
)
def test_bad_scripts_get_one_sentence(tmp_path, old, new, sentence):
    path = tmp_path / "script.yaml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=sentence):
        load_marker_script(path)
