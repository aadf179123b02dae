import numpy as np
import pytest

from pepper_drake.errors import InputError, PepperDrakeError
from pepper_drake.live.script import SCRIPTS, LiveScript, ScriptStep, load_script, play
from pepper_drake.models.guide import ViaPoint

BAD = {
    "unknown_button": ("steps:\n- {press: Jump}\n", "steps[0].press"),
    "two_things": ("steps:\n- {press: Stop, move: ball, to: [0, 0, 0]}\n", "press and move"),
    "no_steps": ("name: nothing\n", "steps is empty"),
    "unknown_mode": ("steps:\n- {until: asleep, wait: 1}\n", "steps[0].until"),
    "negative_wait": ("steps:\n- {wait: -1}\n", "steps[0].wait"),
    "short_offset": ("steps:\n- {move: ball, to: [0, 1]}\n", "steps[0].to"),
    "arm": ("arm: both\nsteps:\n- {wait: 1}\n", 'arm is "both"'),
    "one_pose": (
        "steps:\n- lead:\n  - {time: 1, position: [0, 0, 0], rpy: [0, 0, 0]}\n",
        "steps[0].lead",
    ),
    "unknown_field": ("steps:\n- {push: Record}\n", "push"),
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_that_ship_are_good_and_have_a_mirror_image(name):
    script = load_script(name)
    mirror = script.mirrored()
    mirror.check()
    assert mirror.arm != script.arm
    assert mirror.mirrored() == script


@pytest.mark.parametrize("name", BAD)
def test_bad_scripts_are_answered_in_one_sentence(tmp_path, name):
    text, words = BAD[name]
    path = tmp_path / "script.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        load_script(str(path))
    assert words in str(error.value)
    assert str(path) in str(error.value)


def test_a_script_that_is_not_there_names_those_that_are(tmp_path):
    with pytest.raises(InputError, match="story"):
        load_script(str(tmp_path / "none.yaml"))


def test_a_script_leads_the_hand_and_moves_objects(show):
    start = show.session.simulation.hand_pose()
    via = [
        ViaPoint(time, list(start.translation() + [0.1 * time, 0, 0]), [1.38, 0.93, 0.12])
        for time in (0.4, 0.8)
    ]
    steps = [
        ScriptStep(press="Record"),
        ScriptStep(lead=via, wait=0.6),
        ScriptStep(move="ball", to=[0.02, 0, 0]),
        ScriptStep(press="Stop", wait=0.1),
    ]
    lines = []
    play(show, LiveScript(steps=steps), lines.append)
    assert len(lines) == 4
    assert "Recorded" in lines[-1]
    moved = show.session.simulation.hand_pose().translation() - start.translation()
    np.testing.assert_allclose(moved, [0.08, 0, 0], atol=0.015)
    np.testing.assert_allclose(show.session.simulation.offset("ball"), [0.02, 0, 0])


def test_a_script_that_waits_in_vain_fails_with_what_pepper_says(show):
    steps = [ScriptStep(press="Reach"), ScriptStep(until="holding", wait=0.2)]
    with pytest.raises(PepperDrakeError, match="nothing to perform"):
        play(show, LiveScript(steps=steps), lambda line: None)
