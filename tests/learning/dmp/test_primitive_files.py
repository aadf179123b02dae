import re

import numpy as np
import pytest
import yaml

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive, approximator_names
from tests.learning.conftest import make_demonstration


@pytest.fixture(scope="module")
def saved(tmp_path_factory, demonstration):
    path = tmp_path_factory.mktemp("primitive") / "reach.yaml"
    MovementPrimitive.fit(demonstration, num_basis=10).save(path)
    return path


@pytest.mark.parametrize("scaling", ["none", "goal", "rotation_dilation"])
@pytest.mark.parametrize("approximator", approximator_names())
def test_rollouts_are_the_same_bit_for_bit(tmp_path, approximator, scaling):
    demo = make_demonstration(1.0, seed=1)
    primitive = MovementPrimitive.fit(demo, approximator, 12, scaling)
    primitive.save(tmp_path / "p.yaml")
    loaded = MovementPrimitive.load(tmp_path / "p.yaml")
    goal = primitive.goal + 0.07
    one, other = primitive.rollout(goal=goal), loaded.rollout(goal=goal)
    for field in ("positions", "velocities", "accelerations", "rotations", "joints"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))
    one, other = primitive.rollout(obstacles=[goal]), loaded.rollout(obstacles=[goal])
    np.testing.assert_array_equal(one.positions, other.positions)
    loaded.save(tmp_path / "again.yaml")
    assert (tmp_path / "again.yaml").read_text() == (tmp_path / "p.yaml").read_text()


def test_extreme_numbers_survive(tmp_path, saved):
    primitive = MovementPrimitive.load(saved)
    weights = primitive.weights.copy()
    weights.flat[:6] = [1e-300, 1e-22, -1e-5, 0.1 + 0.2, -0.0, 5e-324]
    primitive.with_weights(weights).save(tmp_path / "p.yaml")
    np.testing.assert_array_equal(MovementPrimitive.load(tmp_path / "p.yaml").weights, weights)


def test_file_is_readable_by_any_yaml_reader(saved):
    data = yaml.safe_load(saved.read_text())
    assert data["version"] == 1
    assert data["approximator"] == "trajectory_slopes"
    assert len(data["translation"]["forcing"]["weights"]) == 20
    assert data["posture"]["names"][0] == "RShoulderPitch"


def test_names_that_yaml_could_mistake_survive(tmp_path, saved):
    from dataclasses import replace

    for name in ("true", "1e5", "a: b", "# c", "  d", "l'été"):
        replace(MovementPrimitive.load(saved), name=name).save(tmp_path / "p.yaml")
        assert MovementPrimitive.load(tmp_path / "p.yaml").name == name


@pytest.mark.parametrize(
    ("pattern", "replacement", "words"),
    [
        (r"^version: 1", "version: 99", "version 99 is not known"),
        (r"^version: 1\n", "", "version is missing"),
        (r"^duration: .*", "duration: soon", "duration: 'soon' is not a finite number"),
        (r"^duration: .*", "duration: -1.0", "duration: -1.0 is not positive"),
        (r"^duration: .*", "duration: .nan", "is not a finite number"),
        (r"^duration: .*", "duration: 1:30", "'1:30' is not a finite number"),
        (r"^duration: .*", "duration: 0x10", "'0x10' is not a finite number"),
        (r"^duration: .*", "duration: 1.0e+6", "it must be 0.01 to 600 s"),
        (r"^    weights:\n.*\n", "    weights:\n      - [1.0e+22, 0.0, 0.0]\n", "leads farther"),
        (r"^  alpha_z: .*", "  alpha_z: 1.0e+9", "alpha_z: 1e.09 must be 0.1 to 1000"),
        (r"^  names: .*", "  names: [RElbowRoll]", "as many weights as names"),
        (r"^name: .*", "? [1, 2]\n: 3\nname: x", "a list or mapping stands where"),
        (r"^name: .*", "name: " + "[" * 10_000, "nested too deeply"),
        (r"^approximator: .*", "approximator: magic", "'magic' is unknown"),
        (r"^  scaling: .*", "  scaling: magic", "scaling: 'magic' is unknown"),
        (r"^  goal: .*", "  goal: [1.0, 2.0]", "goal: .* must be"),
        (r"^  goal: .*", "  goal: [1.0, a, 2.0]", "goal: .* must be 3 finite numbers"),
        (r"^    weights:", "    wieghts:", r"translation\.forcing\.weights is missing"),
        (r"^    centres: .*", "    centres: [a]", r"translation\.forcing"),
        (r"^    centres: .*", "    centres: [1.0]", "same length"),
        (r"^    weights:\n.*\n", "    weights:\n", "20 rows"),
        (r"^    weights:\n.*\n", "    weights:\n      - [.inf, 0.0, 0.0]\n", "finite"),
        (r"^translation:", "translation: 3\nother:", "translation: 3 is not a dict"),
        (r"^  mode: .*", "  mode: magic", r"orientation\.mode"),
        (r"^name: .*", "name: [", "line"),
    ],
)
def test_errors_name_the_file_and_the_field(tmp_path, saved, pattern, replacement, words):
    text = re.sub(pattern, replacement, saved.read_text(), count=1, flags=re.MULTILINE)
    assert text != saved.read_text()
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        MovementPrimitive.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[1, 2]", "just words", "a: &x [*x]"])
def test_other_files_are_refused(tmp_path, text):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"mapping|missing|aliases"):
        MovementPrimitive.load(path)
