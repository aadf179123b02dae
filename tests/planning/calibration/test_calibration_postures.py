import itertools

import numpy as np
import pytest

from pepper_drake.errors import PepperDrakeError
from pepper_drake.models.control_model import BODY_JOINTS, body_indices, shared_control_model
from pepper_drake.models.pepper import elbow_roll_limits, head_pitch_limits
from pepper_drake.models.scene import HandMarker, load_scene
from pepper_drake.perception.calibration.marker_kinematics import (
    COLOR_CAMERAS,
    MarkerModel,
    PriorSigmas,
)
from pepper_drake.planning.calibration.calibration_postures import APPROACH, choose_postures


@pytest.fixture(scope="module", params=["right", "left"])
def chosen(request):
    arm = request.param
    model = MarkerModel(arm, HandMarker(), COLOR_CAMERAS, PriorSigmas.of_wear())
    positions = load_scene("table").robot.positions()
    start = np.array([positions[name] for name in BODY_JOINTS])
    return arm, model, start, choose_postures(shared_control_model(), model, arm, start, 20, 1)


def test_there_are_as_many_as_asked_for_and_they_keep_the_limits(chosen):
    arm, model, _, postures = chosen
    assert len(postures) == 20
    limits = shared_control_model().command_limits(model.joint_names)
    for posture in postures:
        for joints in (posture.joints, posture.before):
            assert np.all((joints > limits.position_lower) & (joints < limits.position_upper))
            low, high = head_pitch_limits(joints[0])
            assert low < joints[1] < high
            low, high = elbow_roll_limits(joints[4], arm)
            assert low < joints[5] < high
        np.testing.assert_allclose(
            posture.joints - posture.before, APPROACH * posture.approach, atol=1e-12
        )


def test_nothing_touches_on_the_way(chosen):
    """With Drake's checker and no room: the choice keeps room."""
    _, model, start, postures = chosen
    control = shared_control_model()
    checker = control.make_collision_checker()
    own = body_indices(model.joint_names)
    way = [start[own], *(q for p in postures for q in (p.before, p.joints)), start[own]]
    for one, other in itertools.pairwise(way):
        for share in np.linspace(0.0, 1.0, 15):
            q = start.copy()
            q[own] = one + share * (other - one)
            assert checker.CheckConfigCollisionFree(control.positions(q, np.zeros(3)))


def test_both_senses_and_both_cameras_are_used(chosen):
    _, model, _, postures = chosen
    approach = np.array([posture.approach for posture in postures])
    assert np.abs(approach.mean(axis=0)).max() < 0.7
    zero, seen = np.zeros(len(model.names)), set()
    for posture in postures:
        for camera in COLOR_CAMERAS:
            pixels = model.project(zero, camera, posture.joints[None], posture.approach[None])
            if np.all(pixels > 0) and np.all(pixels < [640, 480]):
                seen.add(camera)
    assert seen == set(COLOR_CAMERAS)


def test_where_there_are_too_few_it_says_so():
    model = MarkerModel(
        "right",
        HandMarker(size=0.05, position=[0.0, 0.0, -0.3]),
        COLOR_CAMERAS,
        PriorSigmas.of_wear(),
    )
    with pytest.raises(PepperDrakeError, match="postures show the marker"):
        choose_postures(shared_control_model(), model, "right", np.zeros(15), 500, 0)
