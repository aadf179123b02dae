"""Errors that were put into the chain come back, by measurements that are computed elsewhere."""

from datetime import UTC, datetime
from functools import lru_cache

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from scipy.stats import chi2

from pepper_drake.errors import PepperDrakeError
from pepper_drake.models.control_model import BODY_JOINTS, body_indices, shared_control_model
from pepper_drake.models.robot_wear import RobotWear
from pepper_drake.models.scene import HandMarker
from pepper_drake.perception.calibration.marker_calibration import (
    estimate_calibration,
    robot_calibration,
)
from pepper_drake.perception.calibration.marker_kinematics import (
    COLOR_CAMERAS,
    MarkerModel,
    MarkerSighting,
    PriorSigmas,
)
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP, moved_camera
from pepper_drake.perception.goal.marker import marker_corners
from pepper_drake.planning.calibration.calibration_postures import choose_postures

NOISE = 0.15
"""Standard deviation of a corner's coordinate [pixel]."""


def chain(arm="right"):
    return MarkerModel(arm, HandMarker(), COLOR_CAMERAS, PriorSigmas.of_wear())


@lru_cache
def postures():
    model = shared_control_model()
    start = np.zeros(15)
    return choose_postures(model, chain(), "right", start, 20, seed=0)


def truth(wear, model, X_HM):
    """The parameters that a worn robot has."""
    own = body_indices(model.joint_names)
    parameters = np.zeros(len(model.names))
    parameters[:7], parameters[7:14] = wear.encoder_offset[own], wear.backlash[own]
    for name in COLOR_CAMERAS:
        camera = wear.cameras[name]
        parameters[model.camera_slice(name)] = [
            *camera.position,
            *camera.rotation,
            camera.focal - 1.0,
        ]
    return parameters


def sightings(wear, X_HM, rng, noise=NOISE, slack=True):
    """Sightings by a worn robot, by Drake's kinematics of its true joints."""
    control, model = shared_control_model(), chain()
    context = control.create_context()
    own = body_indices(model.joint_names)
    found = []
    for number, posture in enumerate(postures()):
        q = np.zeros(len(BODY_JOINTS))
        gap = 0.5 * wear.backlash[own] * posture.approach if slack else 0.0
        q[own] = posture.joints - wear.encoder_offset[own] - gap
        control.plant.SetPositions(context, control.positions(q, np.zeros(3)))
        X_WM = control.pose(context, "r_hand_effector") @ X_HM
        for name, ideal in (("camera_top", CAMERA_TOP), ("camera_bottom", CAMERA_BOTTOM)):
            error = wear.cameras[name]
            camera = moved_camera(ideal, error.position, error.rotation, error.focal)
            X_CM = (control.pose(context, "Head") @ camera.X_HeadC).inverse() @ X_WM
            corners = (X_CM @ marker_corners(0.05).T).T
            if X_CM.rotation().matrix()[2, 2] > -0.2 or not camera.intrinsics.sees(corners).all():
                continue
            pixels = camera.intrinsics.project(corners) + rng.normal(0.0, noise, (4, 2))
            found.append(
                MarkerSighting(name, posture.joints, posture.approach, pixels, 0.1, number)
            )
    return found


def misplaced(rng):
    """The marker as a person puts it."""
    X_HM = HandMarker().pose()
    turn = RotationMatrix.ProjectToRotationMatrix(
        X_HM.rotation().matrix() + rng.uniform(-0.02, 0.02, (3, 3))
    )
    return RigidTransform(turn, X_HM.translation() + rng.uniform(-0.003, 0.003, 3))


@pytest.mark.parametrize("seed", [0, 519, 7777])
def test_the_errors_of_a_worn_robot_come_back_within_their_uncertainty(seed):
    rng = np.random.default_rng(seed)
    wear, X_HM = RobotWear.draw(seed), misplaced(rng)
    estimate = estimate_calibration(chain(), sightings(wear, X_HM, rng))
    number = len(estimate.parameters) - 6  # The marker's own place is not asked for.
    error = (estimate.parameters - truth(wear, chain(), X_HM))[:number]
    # Of 28 numbers one is beyond 3 sigma in one of 13 draws, beyond 4 in one of 560.
    assert np.abs(error / estimate.sigmas[:number]).max() < 4.5
    # Their errors go together, so that single sigmas say little about the sum of all.
    squared = error @ np.linalg.solve(estimate.covariance[:number, :number], error)
    assert 1e-3 < chi2.cdf(squared, number) < 1.0 - 1e-3
    # What the arm's errors put wrong by centimetres is left to less than a millimetre.
    assert estimate.before.position > 0.003
    assert estimate.after.position < 0.002
    assert np.degrees(estimate.sigmas[2:6]).max() < 0.05
    assert estimate.after.image == pytest.approx(NOISE * np.sqrt(2.0), rel=0.4)


def test_the_stated_uncertainty_is_that_of_many_calibrations():
    """Not too small, and not so large that it says nothing: the mean square is one."""
    wear = RobotWear.draw(5)
    z = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        X_HM = misplaced(rng)
        estimate = estimate_calibration(chain(), sightings(wear, X_HM, rng))
        error = estimate.parameters - truth(wear, chain(), X_HM)
        z.append((error / estimate.sigmas)[2:6])  # Shoulder and elbow: well told.
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6


def test_what_the_images_cannot_tell_is_named_and_held():
    rng = np.random.default_rng(0)
    estimate = estimate_calibration(chain(), sightings(RobotWear.draw(1), misplaced(rng), rng))
    words = " ".join(estimate.held)
    # The last joint turns the marker about its axis, and how the marker was put on is not known;
    # the head's pitch turns both cameras alike.
    assert "RWristYaw offset" in words
    assert "HeadPitch offset" in words
    assert "Shoulder" not in words
    prior = chain().prior_sigmas
    wrist = chain().names.index("RWristYaw offset")
    assert estimate.sigmas[wrist] > 0.8 * prior[wrist]


def test_more_noise_is_more_uncertainty():
    wear, sigmas = RobotWear.draw(2), []
    for noise in (0.1, 0.4):
        rng = np.random.default_rng(3)
        seen = sightings(wear, misplaced(rng), rng, noise=noise)
        sigmas.append(estimate_calibration(chain(), seen).sigmas[2:6])
    ratio = sigmas[1] / sigmas[0]
    assert np.all((ratio > 2.5) & (ratio < 5.5))


def test_a_robot_without_slack_has_none():
    rng = np.random.default_rng(4)
    seen = sightings(RobotWear.draw(4), misplaced(rng), rng, slack=False)
    estimate = estimate_calibration(chain(), seen)
    slack, sigma = (
        estimate.model.slacks(estimate.parameters),
        estimate.model.slacks(estimate.sigmas),
    )
    assert np.all(np.abs(slack) < 4.0 * sigma)


def test_an_image_that_shows_something_else_is_left_out():
    rng = np.random.default_rng(6)
    wear = RobotWear.draw(6)
    seen = sightings(wear, misplaced(rng), rng)
    wrong = seen[4]
    seen[4] = MarkerSighting(
        wrong.camera, wrong.joints, wrong.approach, wrong.corners + 60.0, 0.1, wrong.posture
    )
    estimate = estimate_calibration(chain(), seen)
    assert estimate.left_out == 1
    own = body_indices(chain().joint_names)[2:6]
    np.testing.assert_allclose(
        estimate.parameters[2:6], wear.encoder_offset[own], atol=np.radians(0.05)
    )


def test_too_few_postures_are_refused_with_the_mend():
    rng = np.random.default_rng(0)
    seen = [s for s in sightings(RobotWear.draw(0), misplaced(rng), rng) if s.posture < 5]
    with pytest.raises(PepperDrakeError, match=r"seen in [345] postures, and 8 are needed: put"):
        estimate_calibration(chain(), seen)


def test_what_is_kept_has_the_numbers_and_the_robot(tmp_path):
    rng = np.random.default_rng(0)
    wear = RobotWear.draw(7)
    estimate = estimate_calibration(chain(), sightings(wear, misplaced(rng), rng))
    date = datetime(2026, 11, 28, tzinfo=UTC)
    kept = robot_calibration(estimate, robot="r", arm="right", reason="why", date=date)
    kept.check()
    assert (kept.robot, kept.reason) == ("r", "why")
    assert datetime.fromisoformat(kept.date) == date
    index = BODY_JOINTS.index("RShoulderPitch")
    assert kept.joints["RShoulderPitch"].offset == pytest.approx(
        wear.encoder_offset[index], abs=4 * kept.joints["RShoulderPitch"].offset_sigma
    )
    assert kept.residuals.images == estimate.images
    assert kept.held == list(estimate.held)
