import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.models.pad_script import PAD_SCRIPTS, PadScript, PadStep, load_pad_script
from pepper_drake.systems.guiding.gamepad_velocity import (
    GamepadParams,
    GamepadState,
    gamepad_velocity,
)

GOOD = """\
rest: 0.2
steps:
- {duration: 0.5, axes: [0.5, -1, 0, 0], pressed: [4]}
- {duration: 1.0, axes: [0, 0, 0, 1]}
"""


@pytest.mark.parametrize("name", PAD_SCRIPTS)
def test_shipped_scripts_load_and_mirror(name):
    script = load_pad_script(name)
    mirrored = script.mirrored()
    mirrored.check()
    assert mirrored.arm == "left"
    assert mirrored.mirrored() == script


def test_a_mirrored_step_moves_the_mirror_image():
    script = PadScript(steps=[PadStep(1.0, [0.7, -0.8, 0.4, 0.9], [4, 12])])

    def velocity(step):
        return gamepad_velocity(GamepadState.of(step.axes, step.buttons()), GamepadParams())

    (step,), (mirror,) = script.steps, script.mirrored().steps
    # Angular velocities are axial: they mirror with the other signs.
    np.testing.assert_allclose(velocity(mirror), velocity(step) * [-1, 1, -1, 1, -1, 1])


def test_steps_follow_one_another_after_the_rest():
    script = PadScript(rest=0.2, steps=[PadStep(0.5, [1.0, 0, 0, 0]), PadStep(1.0, [0, 1.0, 0, 0])])
    assert script.end_time == pytest.approx(1.7)
    assert script.step_at(0.1) == PadStep()
    assert script.step_at(0.3) is script.steps[0]
    assert script.step_at(0.71) is script.steps[1]
    assert script.step_at(1.8) == PadStep()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[0.5, -1, 0, 0]", "[0.5, -1.2, 0, 0]", r"line 3: steps\[0\].axes must be 4 numbers"),
        ("[0, 0, 0, 1]", "[0, 0]", r"line 4: steps\[1\].axes must be 4 numbers"),
        ("[4]", "[17]", r"line 3: steps\[0\].pressed must hold numbers from 0 to 16"),
        ("duration: 1.0", "duration: -1", r"line 4: steps\[1\].duration is -1 s"),
    ],
)
def test_bad_scripts_get_one_sentence(tmp_path, old, new, sentence):
    path = tmp_path / "script.yaml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=sentence):
        load_pad_script(path)
    path.write_text("rest: 0.1\n")
    with pytest.raises(InputError, match="steps holds none"):
        load_pad_script(path)
