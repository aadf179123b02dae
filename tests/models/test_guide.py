import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.models.guide import GUIDES, load_guide

GOOD = """\
name: wave
arm: left
via_points:
- {time: 0.5, position: [0.1, 0.2, 0.0], rpy: [0, 0, 0]}
- {time: 1.0, position: [0.2, 0.2, 0.1], rpy: [0, 0, 0.5]}
"""


@pytest.mark.parametrize("name", GUIDES)
def test_shipped_guides_load_and_mirror(name):
    guide = load_guide(name)
    mirrored = guide.mirrored()
    mirrored.check()
    assert mirrored.arm != guide.arm
    np.testing.assert_allclose(
        mirrored.via_points[0].position, np.multiply(guide.via_points[0].position, [1, -1, 1])
    )
    assert mirrored.mirrored() == guide


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("arm: left", "arm: top", 'line 2: arm is "top"'),
        ("time: 1.0", "time: 0.5", r"line 5: via_points\[1\].time is 0.5 s; times must be above"),
        ("[0, 0, 0.5]", "[0, 0]", r"line 5: via_points\[1\].rpy must be three finite numbers"),
        ("[0, 0, 0.5]", "[0, 0, a]", r'line 5: via_points\[1\].rpy\[2\] is "a"'),
        ("arm: left", "joints: {LHip: 1}", 'line 2: joints names "LHip"'),
        ("arm: left", "posture: lie", 'posture is "lie"'),
        ("arm: left", "rest: -1", "rest is -1 s"),
        ("- {time: 0.5", "#", "line 3: via_points holds 1; it needs at least two"),
    ],
)
def test_bad_guides_get_one_sentence(tmp_path, old, new, sentence):
    assert GOOD.count(old) == 1
    path = tmp_path / "guide.yaml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=sentence):
        load_guide(path)


def test_unknown_guide():
    with pytest.raises(InputError, match="neither a guide script nor one that ships: reach"):
        load_guide("wave")
