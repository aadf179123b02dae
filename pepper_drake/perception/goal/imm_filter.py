"""Tracking of the goal object from noisy marker poses with outliers.

The marker's position is tracked by an interacting multiple model filter (Blom and Bar-Shalom 1988,
doi:10.1109/9.1299) with two modes: at rest (a slow random walk) and moving (constant velocity
driven by white acceleration). At rest it averages, when the goal moves it follows without lag, and
it estimates the probability of each mode. Orientation is a random walk on the rotations with one
variance, faster when the goal probably moves.

A new track needs several consistent measurements. A measurement outside the gate never changes the
track, but several outside that are consistent with each other replace it. The published pose
changes only when the estimate has moved by more than a threshold, or has become much better.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.short_repr import short_repr, short_signature

Vector = npt.NDArray[np.float64]
_REST, _MOVING = 0, 1


@dataclass(unsafe_hash=True)
class GoalFilterParameters:
    """Noise, gates and thresholds of the goal filter.

    Attributes:
        rest_walk: Random walk of a resting goal's position [m/sqrt(s)].
        acceleration: White acceleration of a moving goal [m/s^1.5].
        rest_seconds: Mean time for which a goal stays at rest [s].
        moving_seconds: Mean time for which a goal keeps moving [s].
        rotation_rest_walk: Random walk of a resting goal's orientation [rad/sqrt(s)].
        rotation_moving_walk: Random walk of a moving goal's orientation [rad/sqrt(s)].
        position_floor: Standard deviation added to every position (kinematics, time stamps) [m].
        rotation_floor: Standard deviation added to every orientation [rad].
        gate: Largest squared Mahalanobis distance of a position from its prediction; 16.3 keeps
            99.9 % of the true ones.
        rotation_gate: Largest angle between a measured orientation and the track's [rad].
        confirmations: Number of consistent measurements that start a track.
        agreement: Largest distance of consistent measurements, in addition to their noise [m].
        hold_seconds: Time after the last sighting for which the goal remains valid [s].
        publish_distance: The pose is published when it has moved by more than this [m], ...
        publish_angle: ... or turned by more than this [rad], ...
        publish_improvement: ... or when its standard deviation relative to that of the last
            published pose has fallen below this.
    """

    rest_walk: float = 0.001
    acceleration: float = 0.5
    rest_seconds: float = 4.0
    moving_seconds: float = 1.5
    rotation_rest_walk: float = 0.01
    rotation_moving_walk: float = 0.3
    position_floor: float = 0.0005
    rotation_floor: float = 0.005
    gate: float = 16.3
    rotation_gate: float = 0.6
    confirmations: int = 3
    agreement: float = 0.02
    hold_seconds: float = 1.0
    publish_distance: float = 0.003
    publish_angle: float = 0.035
    publish_improvement: float = 0.7

    __repr__ = short_repr
    __signature__ = short_signature


@dataclass(frozen=True)
class GoalMeasurement:
    """One measurement of the marker.

    Attributes:
        time: Capture time of the image [s].
        p_WM: The marker's position [m].
        R_WO: The object's orientation.
        position_covariance: (3, 3) in W [m^2].
        rotation_variance: Variance of the orientation about any axis [rad^2].
        systematic_covariance: (3, 3) in W [m^2]: the part of position_covariance that is the same
            in every image and is not reduced by averaging.
    """

    time: float
    p_WM: "Vector"
    R_WO: RotationMatrix
    position_covariance: "Vector"
    rotation_variance: float
    systematic_covariance: "Vector" = field(default_factory=lambda: np.zeros((3, 3)))

    __repr__ = short_repr


@dataclass(frozen=True)
class GoalTrack:
    """Immutable estimate of one goal.

    Attributes:
        time: Time of the last accepted measurement [s].
        modes: Means (2, 6) of position and velocity in W, at rest and moving.
        covariances: Their covariances (2, 6, 6).
        probabilities: Probabilities (2,) of the two modes.
        R_WO: Orientation.
        rotation_variance: Its variance about any axis [rad^2].
        systematic_covariance: That of the last measurement (3, 3) [m^2].
        rotation_misses: Number of consecutive measured orientations outside the gate.
    """

    time: float
    modes: Vector
    covariances: Vector
    probabilities: Vector
    R_WO: RotationMatrix
    rotation_variance: float
    systematic_covariance: Vector
    rotation_misses: int = 0

    @property
    def p_WM(self) -> Vector:
        """Returns the position of the marker in W (3,) [m]."""
        return self.probabilities @ self.modes[:, :3]

    @property
    def velocity(self) -> Vector:
        """Returns the velocity of the marker in W (3,) [m/s]."""
        return self.probabilities @ self.modes[:, 3:]

    @property
    def position_covariance(self) -> Vector:
        """Returns the covariance (3, 3) of the marker's position [m^2]."""
        spread = self.modes[:, :3] - self.p_WM
        inner = self.covariances[:, :3, :3] + np.einsum("ki,kj->kij", spread, spread)
        return np.einsum("k,kij->ij", self.probabilities, inner) + self.systematic_covariance

    def object_covariance(self, p_OM: Vector) -> Vector:
        """Returns the covariance (3, 3) of the object's position, with that of the lever arm."""
        lever = self.R_WO.multiply(p_OM)
        turned = lever @ lever * np.eye(3) - np.outer(lever, lever)
        return self.position_covariance + self.rotation_variance * turned

    def pose(self, p_OM: Vector) -> RigidTransform:
        """Returns the pose X_WO of an object with its marker at p_OM (3,)."""
        return RigidTransform(self.R_WO, self.p_WM - self.R_WO.multiply(p_OM))


@dataclass(frozen=True)
class GoalState:
    """Immutable state of the goal filter.

    Attributes:
        track: The track; None before the first.
        candidate: Measurements consistent with each other but not with the track.
        published: Last published pose X_WO; None before the first.
        published_sigma: Standard deviation of its position when published [m].
    """

    track: GoalTrack | None = None
    candidate: tuple[GoalMeasurement, ...] = ()
    published: RigidTransform | None = None
    published_sigma: float = np.inf

    __repr__ = short_repr

    def __deepcopy__(self, memo: dict) -> "GoalState":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self

    def age(self, time: float) -> float:
        """Returns the time since the goal was last seen [s]; infinite before the first."""
        return np.inf if self.track is None else time - self.track.time

    def is_valid(self, time: float, parameters: GoalFilterParameters) -> bool:
        """Tells whether a goal was seen within `hold_seconds`."""
        return self.published is not None and self.age(time) <= parameters.hold_seconds


def update_goal(
    state: "GoalState",
    measurement: "GoalMeasurement",
    p_OM: "Vector",
    parameters: "GoalFilterParameters",
) -> "GoalState":
    """Updates the filter with one measurement.

    Args:
        state: The previous state.
        measurement: The new measurement; an older one than the last is ignored.
        p_OM: The marker's position on the object (3,) [m].
        parameters: Noise, gates and thresholds.

    Returns:
        The new state.
    """
    measurement = _with_floor(measurement, parameters)
    track = state.track
    if track is not None and measurement.time < track.time:
        return state
    is_lost = state.age(measurement.time) > parameters.hold_seconds
    updated = None
    if track is not None and not is_lost:
        updated = update_track(track, measurement, parameters)
    candidate: tuple[GoalMeasurement, ...] = ()
    if updated is None:
        candidate = _extend_candidate(state.candidate, measurement, parameters)
        if len(candidate) >= parameters.confirmations:
            updated = start_track(candidate[0], parameters)
            for other in candidate[1:]:
                updated = update_track(updated, other, parameters) or updated
            candidate = ()
    if updated is None:
        return replace(state, candidate=candidate)
    return _published(replace(state, track=updated, candidate=candidate), p_OM, parameters)


def start_track(measurement: GoalMeasurement, parameters: GoalFilterParameters) -> GoalTrack:
    """Starts a track, equally likely at rest and moving, with one measurement."""
    mean = np.concatenate([measurement.p_WM, np.zeros(3)])
    covariance = np.zeros((2, 6, 6))
    covariance[:, :3, :3] = measurement.position_covariance
    # A goal that starts to move reaches this speed within a second.
    covariance[_MOVING, 3:, 3:] = parameters.acceleration**2 * np.eye(3)
    return GoalTrack(
        measurement.time,
        np.stack([mean, mean]),
        covariance,
        np.array([0.5, 0.5]),
        measurement.R_WO,
        measurement.rotation_variance,
        measurement.systematic_covariance,
    )


def update_track(
    track: GoalTrack, measurement: GoalMeasurement, parameters: GoalFilterParameters
) -> GoalTrack | None:
    """Predicts a track to the measurement's time and corrects it.

    Returns:
        The new track; None when the measurement is outside the gate.
    """
    dt = measurement.time - track.time
    means, covariances, priors = _mix(track, dt, parameters)
    innovations = measurement.p_WM - means[:, :3]
    S = covariances[:, :3, :3] + measurement.position_covariance
    distances = np.einsum(
        "ki,ki->k", innovations, np.linalg.solve(S, innovations[..., None])[..., 0]
    )
    if distances.min() > parameters.gate:
        return None
    gains = np.swapaxes(np.linalg.solve(S, covariances[:, :3, :]), 1, 2)
    means = means + np.einsum("kij,kj->ki", gains, innovations)
    covariances = covariances - gains @ covariances[:, :3, :]
    covariances = (covariances + np.swapaxes(covariances, 1, 2)) / 2
    log_likelihoods = -0.5 * (distances + np.linalg.slogdet(S)[1])
    weights = priors * np.exp(log_likelihoods - log_likelihoods.max())
    probabilities = weights / weights.sum()
    R_WO, variance, misses = _update_rotation(
        track, measurement, probabilities[_MOVING], dt, parameters
    )
    return GoalTrack(
        measurement.time,
        means,
        covariances,
        probabilities,
        R_WO,
        variance,
        measurement.systematic_covariance,
        misses,
    )


def _mix(
    track: GoalTrack, dt: float, parameters: GoalFilterParameters
) -> tuple[Vector, Vector, Vector]:
    """Mixes the modes (IMM), then predicts each by its own model."""
    stay = np.exp(-dt / np.array([parameters.rest_seconds, parameters.moving_seconds]))
    transition = np.array([[stay[0], 1 - stay[0]], [1 - stay[1], stay[1]]])
    priors = track.probabilities @ transition
    mixing = (track.probabilities[:, None] * transition) / priors
    means = np.einsum("ij,ia->ja", mixing, track.modes)
    spread = track.modes[:, None] - means[None]
    covariances = np.einsum(
        "ij,ijab->jab",
        mixing,
        track.covariances[:, None] + np.einsum("ija,ijb->ijab", spread, spread),
    )
    identity, zero = np.eye(3), np.zeros((3, 3))
    F = np.stack(
        [
            np.block([[identity, zero], [zero, zero]]),
            np.block([[identity, dt * identity], [zero, identity]]),
        ]
    )
    q = parameters.acceleration**2
    Q = np.stack(
        [
            np.block([[parameters.rest_walk**2 * dt * identity, zero], [zero, zero]]),
            np.block(
                [
                    [q * dt**3 / 3 * identity, q * dt**2 / 2 * identity],
                    [q * dt**2 / 2 * identity, q * dt * identity],
                ]
            ),
        ]
    )
    means = np.einsum("kij,kj->ki", F, means)
    return means, F @ covariances @ np.swapaxes(F, 1, 2) + Q, priors


def _update_rotation(
    track: GoalTrack,
    measurement: GoalMeasurement,
    moving: float,
    dt: float,
    parameters: GoalFilterParameters,
) -> tuple[RotationMatrix, float, int]:
    """Moves the orientation towards the measured one by the Kalman gain, along the shortest arc."""
    walk = (1 - moving) * parameters.rotation_rest_walk**2
    walk += moving * parameters.rotation_moving_walk**2
    variance = track.rotation_variance + walk * dt
    turn = track.R_WO.InvertAndCompose(measurement.R_WO).ToAngleAxis()
    if abs(turn.angle()) > parameters.rotation_gate:
        if track.rotation_misses + 1 < parameters.confirmations:
            return track.R_WO, variance, track.rotation_misses + 1
        return measurement.R_WO, measurement.rotation_variance, 0
    gain = variance / (variance + measurement.rotation_variance)
    step = RotationMatrix(AngleAxis(gain * turn.angle(), turn.axis()))
    return track.R_WO @ step, (1 - gain) * variance, 0


def _with_floor(measurement: GoalMeasurement, parameters: GoalFilterParameters) -> GoalMeasurement:
    return replace(
        measurement,
        position_covariance=measurement.position_covariance
        + parameters.position_floor**2 * np.eye(3),
        rotation_variance=measurement.rotation_variance + parameters.rotation_floor**2,
    )


def _extend_candidate(
    candidate: tuple[GoalMeasurement, ...],
    measurement: GoalMeasurement,
    parameters: GoalFilterParameters,
) -> tuple[GoalMeasurement, ...]:
    """Appends a measurement consistent with the candidate; else starts a new candidate."""
    if not candidate:
        return (measurement,)
    last = candidate[-1]
    if measurement.time <= last.time:
        return candidate
    noise = np.sqrt(np.trace(last.position_covariance) + np.trace(measurement.position_covariance))
    is_close = np.linalg.norm(measurement.p_WM - last.p_WM) <= parameters.agreement + 2 * noise
    is_recent = measurement.time - last.time <= parameters.hold_seconds
    return (*candidate, measurement) if is_close and is_recent else (measurement,)


def _published(state: GoalState, p_OM: Vector, parameters: GoalFilterParameters) -> GoalState:
    """Publishes the track's pose if it has moved, turned or improved enough."""
    if state.track is None:
        return state
    estimate, last = state.track.pose(p_OM), state.published
    sigma = float(np.sqrt(np.trace(state.track.object_covariance(p_OM))))
    if last is not None:
        moved = np.linalg.norm(estimate.translation() - last.translation())
        turned = abs(last.rotation().InvertAndCompose(estimate.rotation()).ToAngleAxis().angle())
        if (
            moved <= parameters.publish_distance
            and turned <= parameters.publish_angle
            and sigma >= parameters.publish_improvement * state.published_sigma
        ):
            return state
    return replace(state, published=estimate, published_sigma=sigma)
