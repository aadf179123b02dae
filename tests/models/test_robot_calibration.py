import math

import numpy as np
import pytest
import yaml

from pepper_drake.errors import InputError
from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.models.robot_calibration import (
    CalibrationResiduals,
    CameraCalibration,
    JointCalibration,
    RobotCalibration,
    calibration_of,
    load_calibration,
    save_calibration,
    simulated_robot,
)


def make(**changes):
    fields = {
        "robot": "worn, seed 3",
        "date": "2026-11-28T23:15:00+00:00",
        "reason": "routine",
        "joints": {"RElbowRoll": JointCalibration(0.004, 0.0001, 0.017, 0.0002)},
        "cameras": {"camera_top": CameraCalibration(position=[0.001, 0.0, -0.002], focal=1.004)},
        "residuals": CalibrationResiduals(0.008, 0.0002, postures=20, images=22),
        "held": ["RWristYaw offset"],
    }
    return RobotCalibration(**{**fields, **changes})


def test_a_calibration_comes_back_as_it_was_written(tmp_path):
    save_calibration(make(), tmp_path / "c.yaml")
    assert load_calibration(tmp_path / "c.yaml") == make()


def test_joints_that_it_does_not_know_are_as_in_the_model():
    offsets = make().joint_values("offset")
    assert len(offsets) == len(BODY_JOINTS)
    assert offsets[BODY_JOINTS.index("RElbowRoll")] == 0.004
    assert np.count_nonzero(offsets) == 1


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        (("joints", "RElbowRoll", "offset"), 0.4, "within 0 ± 0.175 rad"),
        (("joints", "RElbowRoll", "slack"), -0.01, "cannot be negative"),
        (("joints", "RKnee"), {"offset": 0.0}, '"RKnee"'),
        (("cameras", "camera_top", "position"), [0.1, 0.0, 0.0], "within 0 ± 0.05 m"),
        (("cameras", "camera_top", "rotation"), [0.0, 0.0], "give three"),
        (("cameras", "camera_top", "focal"), 1.5, "within 1 ± 0.1"),
        (("cameras", "camera_ear"), {"focal": 1.0}, "camera_bottom"),
        (("units", "angles"), "deg", "angles: rad"),
        (("date",), "yesterday", "2026-11-28"),
        (("robot",), "", "name the robot"),
        (("arm",), "both", '"left" or "right"'),
        (("joints", "RElbowRoll", "offset"), "a lot", "a number"),
        (("joints", "RElbowRoll", "offset"), math.nan, "finite"),
        (("gain",), 1.0, 'no field "gain"'),
    ],
)
def test_a_file_that_cannot_be_is_refused_in_one_sentence(tmp_path, field, value, words):
    path = tmp_path / "c.yaml"
    save_calibration(make(), path)
    content = yaml.safe_load(path.read_text())
    inside = content
    for key in field[:-1]:
        inside = inside[key]
    inside[field[-1]] = value
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(InputError, match=r"c\.yaml line \d+: ") as error:
        load_calibration(path)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_an_empty_calibration_is_none():
    with pytest.raises(InputError, match="both empty"):
        make(joints={}, cameras={}).check()


def test_a_calibration_of_another_robot_is_refused(tmp_path):
    save_calibration(make(), tmp_path / "3.yaml")
    name = str(tmp_path / "{seed}.yaml")
    found = calibration_of(name, "worn", 3)
    assert found is not None
    assert found.robot == simulated_robot("worn", 3)
    with pytest.raises(InputError, match='is of the robot "worn, seed 3" and this is "ideal"'):
        calibration_of(name, "ideal", 3)
    assert calibration_of("", "worn", 3) is None
