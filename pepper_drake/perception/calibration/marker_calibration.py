"""Estimates joint offsets, backlash and camera extrinsics from images of a marker on the hand.

Nonlinear least squares over the corners in all images, with the usual amounts of wear as priors
(maximum a posteriori), as in Pradeep, Konolige and Berger 2014, "Calibrating a multi-arm
multi-sensor robot: a bundle adjustment approach" (doi 10.1007/978-3-642-28572-1_15).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from pepper_drake.errors import PepperDrakeError
from pepper_drake.models.robot_calibration import (
    CalibrationResiduals,
    CameraCalibration,
    JointCalibration,
    RobotCalibration,
)
from pepper_drake.perception.calibration.marker_kinematics import MarkerModel, MarkerSighting
from pepper_drake.perception.goal.marker import marker_poses

Vector = npt.NDArray[np.float64]

FEWEST_POSTURES = 8
"""Smallest number of postures that separates errors of seven joints from camera extrinsics."""
_ROUNDS = 4
"""Iterations in which the corners' standard deviation is estimated along with the parameters."""
_SETTLED = 0.01
"""Relative change of this deviation at which the iterations end."""
_LEAST_SIGMA = 0.02
"""Smallest standard deviation of a corner [pixel]."""
_OUTLIER = 6.0
"""An image whose residual exceeds the median by this factor is an outlier."""
_NAMED = 0.35
"""Smallest component of a unit vector for which a parameter is named."""


@dataclass(frozen=True, eq=False)
class MarkerErrors:
    """Root mean square errors between the observed marker and the one predicted from the joints.

    Attributes:
        position: Error of its centre [m].
        rotation: Angle [rad].
        image: Error of its corners in the images [pixel].
    """

    position: float
    rotation: float
    image: float


@dataclass(frozen=True, eq=False)
class CalibrationEstimate:
    """Result of a calibration.

    Attributes:
        model: The model with the parameters' names.
        parameters: (n,).
        covariance: (n, n), from the Jacobian and the measured residual.
        before: Errors without calibration, with only the marker's pose fitted.
        after: Errors with the parameters.
        held: Directions determined more by the priors than by the images, in words.
        postures: Number of postures in which the marker was seen.
        images: Number of images used.
        left_out: Number of outlier images.
    """

    model: MarkerModel
    parameters: Vector
    covariance: Vector
    before: MarkerErrors
    after: MarkerErrors
    held: tuple[str, ...]
    postures: int
    images: int
    left_out: int

    @property
    def sigmas(self) -> Vector:
        """Standard deviations of the parameters (n,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


class _Fit:
    """Least squares over some sightings."""

    def __init__(self, model: MarkerModel, sightings: Sequence[MarkerSighting]) -> None:
        self.model, self.sightings = model, list(sightings)
        self._groups = []
        for camera in model.cameras:
            indices = [k for k, sighting in enumerate(sightings) if sighting.camera == camera]
            if indices:
                joints = np.array([sightings[k].joints for k in indices])
                approach = np.array([sightings[k].approach for k in indices])
                self._groups.append((camera, indices, joints, approach))
        self._seen = np.array([sighting.corners for sighting in sightings])
        self._sigma = np.array([sighting.corner_sigma for sighting in sightings])[:, None, None]

    def image_residuals(self, parameters: Vector) -> Vector:
        """Returns predicted minus observed corners (N, 4, 2) [pixel]."""
        projected = np.empty_like(self._seen)
        for camera, indices, joints, approach in self._groups:
            projected[indices] = self.model.project(parameters, camera, joints, approach)
        return projected - self._seen

    def whitened(self, parameters: Vector) -> Vector:
        """Returns the image residuals divided by their standard deviations (8 N,)."""
        # A trial step may put the marker behind the camera: a very large residual.
        residuals = np.nan_to_num(self.image_residuals(parameters), nan=1e4)
        return (residuals / self._sigma).ravel()

    def solve(
        self, free: npt.NDArray[np.bool_], scale: float, start: Vector | None = None
    ) -> tuple[Vector, Vector]:
        """Returns the parameters (n,), zero if not free, and the images' Jacobian (8 N, m)."""
        sigmas = self.model.prior_sigmas[free]

        def whole(x: Vector) -> Vector:
            parameters = np.zeros(len(free))
            parameters[free] = x * sigmas
            return parameters

        def residuals(x: Vector) -> Vector:
            return np.concatenate((self.whitened(whole(x)) / scale, x))

        begin = np.zeros(len(sigmas)) if start is None else start[free] / sigmas
        found = least_squares(residuals, begin, method="lm", xtol=1e-10)
        count = self._seen.size
        return whole(found.x), np.asarray(found.jac)[:count] * scale

    def errors(self, parameters: Vector) -> MarkerErrors:
        """Returns the marker's errors in space and in the images."""
        places, angles = [], []
        for camera, indices, joints, approach in self._groups:
            R_CM, p_CM = self.model.marker_poses(parameters, camera, joints, approach)
            intrinsics = self.model.camera(parameters, camera).intrinsics
            for k, R, p in zip(indices, R_CM, p_CM, strict=True):
                seen = marker_poses(self._seen[k], self.model.marker.size, intrinsics)
                if not seen:
                    continue
                turns = [
                    np.arccos(np.clip((np.sum(R * s.X_CM.rotation().matrix()) - 1) / 2, -1, 1))
                    for s in seen
                ]
                best = int(np.argmin(turns))  # One of the two ambiguous poses.
                angles.append(float(turns[best]))
                places.append(float(np.linalg.norm(seen[best].X_CM.translation() - p)))

        def rms(values: npt.ArrayLike) -> float:
            return float(np.sqrt(np.mean(np.square(values))))

        distances = np.linalg.norm(self.image_residuals(parameters), axis=-1)
        return MarkerErrors(rms(places), rms(angles), rms(distances))


def estimate_calibration(
    model: MarkerModel, sightings: Sequence[MarkerSighting]
) -> CalibrationEstimate:
    """Estimates all parameters of the chain.

    Args:
        model: The chain.
        sightings: The marker in all images in which it was seen.

    Raises:
        PepperDrakeError: The marker was seen, or fits the joints, in too few postures.
    """
    postures = {sighting.posture for sighting in sightings}
    if len(postures) < FEWEST_POSTURES:
        raise PepperDrakeError(
            f"the marker was seen in {len(postures)} postures, and {FEWEST_POSTURES} are needed: "
            f"put marker {model.marker.id} of {1000 * model.marker.size:.0f} mm flat on the back "
            "of the hand, and light it evenly"
        )
    free = np.ones(len(model.names), dtype=bool)
    fit, scale = _Fit(model, sightings), 1.0
    parameters, jacobian = fit.solve(free, scale)
    kept = _consistent(fit.image_residuals(parameters))
    left_out = int(np.count_nonzero(~kept))
    if left_out:
        chosen = [sighting for sighting, keep in zip(sightings, kept, strict=True) if keep]
        postures = {sighting.posture for sighting in chosen}
        if len(postures) < FEWEST_POSTURES:
            raise PepperDrakeError(
                f"the marker fits the joints in {len(postures)} postures only: see that it is "
                f"{1000 * model.marker.size:.0f} mm wide, flat, and does not slip on the hand"
            )
        fit = _Fit(model, chosen)
        parameters, jacobian = fit.solve(free, scale)
    for _ in range(_ROUNDS):
        before, scale = scale, _residual_scale(fit, parameters, jacobian, scale)
        if abs(scale - before) < _SETTLED * scale:
            break
        parameters, jacobian = fit.solve(free, scale, parameters)
    # Parameters are in units of their prior standard deviations here.
    information = jacobian.T @ jacobian / scale**2
    sigmas = model.prior_sigmas
    covariance = np.linalg.inv(information + np.eye(len(information))) * np.outer(sigmas, sigmas)
    marker_alone = np.zeros(len(free), dtype=bool)
    marker_alone[-6:] = True
    as_it_is, _ = fit.solve(marker_alone, scale)
    return CalibrationEstimate(
        model,
        parameters,
        np.asarray(covariance),
        fit.errors(as_it_is),
        fit.errors(parameters),
        _held_directions(model.names, information),
        len(postures),
        len(fit.sightings),
        left_out,
    )


def robot_calibration(
    estimate: CalibrationEstimate, *, robot: str, arm: str, reason: str, date: datetime
) -> RobotCalibration:
    """Returns the calibration to save.

    Args:
        estimate: The estimate.
        robot: Name of the robot.
        arm: "left" or "right".
        reason: Why it was calibrated.
        date: Time of the calibration.
    """
    model, before, after = estimate.model, estimate.before, estimate.after
    values, sigmas = estimate.parameters, estimate.sigmas
    joints = {
        name: JointCalibration(*map(float, numbers))
        for name, *numbers in zip(
            model.joint_names,
            model.offsets(values),
            model.offsets(sigmas),
            np.maximum(model.slacks(values), 0.0),
            model.slacks(sigmas),
            strict=True,
        )
    }
    cameras = {}
    for name in model.cameras:
        elements, spread = (v[model.camera_slice(name)].tolist() for v in (values, sigmas))
        cameras[name] = CameraCalibration(
            position=elements[:3],
            position_sigma=spread[:3],
            rotation=elements[3:6],
            rotation_sigma=spread[3:6],
            focal=1.0 + elements[6],
            focal_sigma=spread[6],
        )
    return RobotCalibration(
        robot=robot,
        date=date.isoformat(timespec="seconds"),
        reason=reason,
        arm=arm,
        joints=joints,
        cameras=cameras,
        residuals=CalibrationResiduals(
            position_before=before.position,
            position_after=after.position,
            rotation_before=before.rotation,
            rotation_after=after.rotation,
            image_after=after.image,
            postures=estimate.postures,
            images=estimate.images,
        ),
        held=list(estimate.held),
    )


def _consistent(residuals: Vector) -> npt.NDArray[np.bool_]:
    """Tells which sightings (N,) are inliers, by their residuals (N, 4, 2) [pixel]."""
    sizes = np.sqrt(np.mean(residuals**2, axis=(1, 2)))
    return np.asarray(sizes <= _OUTLIER * max(float(np.median(sizes)), _LEAST_SIGMA))


def _residual_scale(fit: _Fit, parameters: Vector, jacobian: Vector, scale: float) -> float:
    """Returns the corners' measured standard deviation as a factor of the detector's.

    The degrees of freedom of the sum of squares are the number of residuals minus the trace of the
    influence matrix.
    """
    whitened = fit.whitened(parameters)
    information = jacobian.T @ jacobian / scale**2
    fitted = float(np.trace(np.linalg.solve(information + np.eye(len(information)), information)))
    least = _LEAST_SIGMA / float(np.median([s.corner_sigma for s in fit.sightings]))
    return max(float(np.sqrt(whitened @ whitened / (len(whitened) - fitted))), least)


def _held_directions(names: Sequence[str], information: Vector) -> tuple[str, ...]:
    """Names the directions determined more by the priors than by the images.

    Args:
        names: Names of the parameters (n,).
        information: Information matrix of the images (n, n), in units of the priors' deviations.
    """
    values, vectors = np.linalg.eigh(information)
    return tuple(
        " with ".join(
            names[k] for k in np.argsort(-np.abs(vector), kind="stable") if abs(vector[k]) >= _NAMED
        )
        or "many parameters together"
        for value, vector in zip(values, vectors.T, strict=True)
        if value < 1.0
    )
