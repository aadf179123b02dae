import json

import numpy as np
import pytest

from pepper_drake.models.control_model import BODY_JOINTS
from pepper_drake.models.robot_calibration import load_calibration
from pepper_drake.models.robot_wear import RobotWear
from pepper_drake.scenario import Scenario, load_scenario
from tests.printed import missing, shown_lines


@pytest.mark.render
def test_a_worn_robot_is_calibrated_by_its_own_images(run_app, tmp_path):
    """Rendered images, the real detector, the true latency: the truth is only the judge."""
    done = run_app(
        "calibrate", "--seed", 3, "--postures", 12, "--reason", "a test", "--output", tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert load_scenario(tmp_path / "scenario.yaml") == Scenario(seed=3, robot="worn")
    found, wear = load_calibration(tmp_path / "calibration.yaml"), RobotWear.draw(3)
    assert (found.robot, found.reason, found.arm) == ("worn, seed 3", "a test", "right")
    for name in ("RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll"):
        joint, index = found.joints[name], BODY_JOINTS.index(name)
        assert abs(joint.offset - wear.encoder_offset[index]) < max(
            4.0 * joint.offset_sigma, np.radians(0.02)
        )
        assert abs(joint.slack - wear.backlash[index]) < np.radians(0.05)
        assert joint.offset_sigma < np.radians(0.03)
    for name, camera in found.cameras.items():
        error = np.array(camera.position) - wear.cameras[name].position
        assert np.all(np.abs(error) < 4.5 * np.array(camera.position_sigma) + 2e-4)
    assert found.residuals.position_before > 0.004
    assert found.residuals.position_after < 0.001
    report = json.loads((tmp_path / "calibration.json").read_text())
    assert report["robot_seconds"] < 120.0, "two minutes for a user"
    assert "RShoulderPitch" in done.stdout
    assert "not told apart" in done.stdout
    assert missing(shown_lines("docs/howto/calibrate.md"), done.stdout) == [], done.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--postures", "3"], "give 8 to 60"),
        (["--size", "0.3"], "0.02 to 0.08 m"),
        (["--marker", "70"], "DICT_4X4_50"),
        (["--reason", " "], "plain text"),
        (["--robot", "new"], "--robot"),
    ],
)
def test_bad_options_are_refused_in_one_sentence(run_app, tmp_path, options, words):
    done = run_app("calibrate", *options, "--output", tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("app", ["reach", "teach", "benchmark"])
def test_apps_refuse_a_calibration_that_is_none(run_app, tmp_path, app):
    path = tmp_path / "wrong.yaml"
    path.write_text("robot: worn, seed 0\njoints: {RElbowRoll: {offset: 10}}\n")
    done = run_app(app, "--robot", "worn", "--calibration", path, "--output", tmp_path / "out")
    assert done.returncode == 2
    assert f"{path} line" in done.stderr
    assert done.stderr.count("\n") == 1
