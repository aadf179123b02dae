"""Calibration postures of arm and head in which a head camera sees a marker on the hand.

They are sampled at random, kept if they are free of collisions and the marker is in view, and
selected greedily to maximise the determinant of the information matrix (D-optimal design; for
robots Sun and Hollerbach 2008, "Observability index selection for robot calibration",
doi 10.1109/ROBOT.2008.4543308).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.planning import SceneGraphCollisionChecker

from pepper_drake.errors import PepperDrakeError
from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.models.pepper import (
    BODY_JOINTS,
    JOINT_GROUPS,
    elbow_roll_limits,
    head_pitch_limits,
)
from pepper_drake.perception.calibration.calibrated_cameras import HEAD_CAMERA_MODELS
from pepper_drake.perception.calibration.marker_kinematics import MarkerModel
from pepper_drake.perception.gaze.head_aiming import aim_head
from pepper_drake.planning.collision.sphere_model import arm_link_names

Vector = npt.NDArray[np.float64]

APPROACH = np.radians(3.0)
"""Angle of the final motion of each joint to its posture [rad]: more than any backlash."""
_PADDING = 0.03
"""Padding between links for the marker's plate and joint errors [m]."""
_MARGIN = 30.0
"""Least distance of the marker from the image border, for calibration errors [pixel]."""
_FACING = 0.6
"""Least cosine of the angle between the marker's normal and the line of sight."""
_NEAREST, _FARTHEST = 0.22, 0.6
"""Range of distances at which the marker is sharp and large enough [m]."""
_AROUND = 0.3
"""Largest offset of the gaze from the marker, so that the whole image is used [rad]."""
_AHEAD = 0.1
"""Least distance of the marker ahead of the torso frame [m]."""
_LARGEST_YAW = 1.2
"""Largest yaw of the head [rad]."""
_CANDIDATES = 120
"""Number of candidate postures at which sampling ends."""
_BATCH, _BATCHES = 2000, 20
"""Samples per batch, and largest number of batches."""
_SPARE = (0, 2, 5, 10, 20, 40)
"""Numbers of additional postures to try if the arm cannot get from one to another."""
_STEP = 1e-3
"""Step of finite differences, in standard deviations of the priors."""
_PIXEL = 1.0
"""Standard deviation of a marker corner [pixel]."""


@dataclass(frozen=True, eq=False)
class CalibrationPosture:
    """A posture with the direction from which each joint approaches it.

    Attributes:
        joints: Head and arm (7,) [rad].
        approach: Direction of each joint's final motion (7,), 1 or -1.
    """

    joints: Vector
    approach: Vector

    @property
    def before(self) -> Vector:
        """Posture (7,) from which the final motion begins [rad]."""
        return self.joints - APPROACH * self.approach


def choose_postures(
    model: ControlModel, marker_model: MarkerModel, arm: str, start: Vector, count: int, seed: int
) -> list[CalibrationPosture]:
    """Chooses postures in an order in which the arm moves from each to the next without collision.

    Args:
        model: Pepper.
        marker_model: The kinematic chain from the cameras to the marker, and its parameters.
        arm: "left" or "right".
        start: All joints (15,) at the start [rad].
        count: Number of postures.
        seed: Seed of the sampling.

    Raises:
        PepperDrakeError: Fewer postures were found.
    """
    rng = np.random.default_rng((seed, 0xCA))
    collisions = _SelfCollisions(model, arm, start)
    postures: list[CalibrationPosture] = []
    for _ in range(_BATCHES):
        drawn = _draw(marker_model, arm, rng)
        seen = np.any(list(_in_view(marker_model, drawn).values()), axis=0)
        postures += [drawn[k] for k in np.flatnonzero(seen) if collisions.is_free(drawn[k])]
        if len(postures) >= _CANDIDATES:
            break
    chosen = _most_informative(_information_matrices(marker_model, postures), len(postures))
    ordered: list[CalibrationPosture] = []
    for spare in _SPARE:
        ordered = collisions.ordered([postures[k] for k in chosen[: count + spare]], count)
        if len(ordered) == count:
            break
    if len(ordered) < count:
        raise PepperDrakeError(
            f"only {len(ordered)} postures show the marker to a camera where nothing touches, and "
            f"{count} are asked for: ask for fewer, or start with the arms beside the body"
        )
    return ordered


def _draw(model: MarkerModel, arm: str, rng: np.random.Generator) -> list[CalibrationPosture]:
    """Samples postures in which the head looks approximately at the marker."""
    lower, upper = model.arm_limits
    margin = 1.5 * APPROACH
    arms = rng.uniform(lower + margin, upper - margin, (_BATCH, 5))
    approach = rng.choice((-1.0, 1.0), (_BATCH, 7))
    cameras = rng.choice(model.cameras, _BATCH)
    gaze_offset = rng.uniform(-_AROUND, _AROUND, (_BATCH, 2))
    drawn = []
    places = model.marker_places(arms)
    for k in np.flatnonzero(places[:, 0] > _AHEAD):
        low, high = elbow_roll_limits(float(arms[k, 2]), arm)
        if not low + margin < arms[k, 3] < high - margin:
            continue
        aimed = aim_head(HEAD_CAMERA_MODELS[str(cameras[k])], places[k])
        yaw, pitch = (aimed + gaze_offset[k]).tolist()
        low, high = head_pitch_limits(yaw)
        if abs(yaw) < _LARGEST_YAW and low + margin < pitch < high - margin:
            joints = np.concatenate(([yaw, pitch], arms[k]))
            drawn.append(CalibrationPosture(joints, approach[k]))
    return drawn


def _in_view(
    model: MarkerModel, postures: list[CalibrationPosture]
) -> dict[str, npt.NDArray[np.bool_]]:
    """Tells for each camera in which postures it has the whole marker well in view (N,)."""
    joints = np.array([posture.joints for posture in postures]).reshape(-1, 7)
    approach = np.array([posture.approach for posture in postures]).reshape(-1, 7)
    zero = np.zeros(len(model.names))
    seen = {}
    for camera in model.cameras:
        R_CM, p_CM = model.marker_poses(zero, camera, joints, approach)
        distance = np.linalg.norm(p_CM, axis=1)
        facing = -np.sum(R_CM[:, :, 2] * p_CM, axis=1) / distance
        corners = model.project(zero, camera, joints, approach)
        intrinsics = HEAD_CAMERA_MODELS[camera].intrinsics
        last = np.array([intrinsics.width, intrinsics.height]) - _MARGIN
        inside = np.all((corners > _MARGIN) & (corners < last), axis=(1, 2))  # False for NaN.
        near = (distance > _NEAREST) & (distance < _FARTHEST)
        seen[camera] = inside & near & (facing > _FACING)
    return seen


def _information_matrices(model: MarkerModel, postures: list[CalibrationPosture]) -> Vector:
    """Returns information matrices (N, n, n) of the parameters, scaled by their priors' deviations.

    By finite differences of the corners in all cameras that see the marker.
    """
    zero = np.zeros(len(model.names))
    total = np.zeros((len(postures), len(zero), len(zero)))
    for camera, seen in _in_view(model, postures).items():
        visible = np.flatnonzero(seen)
        joints = np.array([postures[k].joints for k in visible])
        approach = np.array([postures[k].approach for k in visible])
        corners = model.project(zero, camera, joints, approach)
        columns = [
            (model.project(step, camera, joints, approach) - corners).reshape(len(visible), -1)
            for step in np.diag(_STEP * model.prior_sigmas)
        ]
        jacobian = np.stack(columns, axis=-1) / (_STEP * _PIXEL)
        total[visible] += np.swapaxes(jacobian, 1, 2) @ jacobian
    return total


def _most_informative(informations: Vector, count: int) -> list[int]:
    """Selects postures greedily by the determinant of their total information (N, n, n)."""
    chosen: list[int] = []
    total = np.eye(informations.shape[-1])
    remaining = np.ones(len(informations), dtype=bool)
    for _ in range(min(count, len(informations))):
        gains = np.linalg.slogdet(total + informations)[1]
        best = int(np.argmax(np.where(remaining, gains, -np.inf)))
        chosen.append(best)
        remaining[best] = False
        total = total + informations[best]
    return chosen


class _SelfCollisions:
    """Checks postures and motions for self-collision."""

    def __init__(self, model: ControlModel, arm: str, start: Vector) -> None:
        self._model, self._start = model, start
        self._checker = _make_checker(model, arm, _PADDING)
        # At the start the arm may hang closer to the body than the padding.
        self._unpadded_checker = _make_checker(model, arm, 0.0)
        self._moving = [BODY_JOINTS.index(n) for n in (*JOINT_GROUPS["head"], *arm_joints(arm))]

    def _positions(self, joints: Vector) -> Vector:
        q = self._start.copy()
        q[self._moving] = joints
        return self._model.positions(q, np.zeros(3))

    def is_free(self, posture: CalibrationPosture) -> bool:
        """True if a posture and the final motion to it are free of collisions."""
        return self.is_clear_between(posture.before, posture.joints)

    def is_clear_between(self, one: Vector, other: Vector) -> bool:
        """True if the straight path between joints (7,) is free of collisions."""
        start = self._start[self._moving]
        checker = self._checker
        if np.array_equal(one, start) or np.array_equal(other, start):
            checker = self._unpadded_checker
        return bool(checker.CheckEdgeCollisionFree(self._positions(one), self._positions(other)))

    def ordered(self, postures: list[CalibrationPosture], count: int) -> list[CalibrationPosture]:
        """Orders up to `count` postures, always the nearest reachable one next.

        Unreachable postures are left out; so are last ones from which the start is unreachable.
        """
        start = self._start[self._moving]
        present, remaining = start, list(postures)
        order: list[CalibrationPosture] = []
        while remaining and len(order) < count:
            remaining.sort(key=lambda posture: float(np.abs(posture.before - present).max()))
            for posture in remaining:
                if self.is_clear_between(present, posture.before):
                    break
            else:
                break
            remaining.remove(posture)
            order.append(posture)
            present = posture.joints
        while order and not self.is_clear_between(order[-1].joints, start):
            order.pop()
        return order


def _make_checker(model: ControlModel, arm: str, padding: float) -> SceneGraphCollisionChecker:
    """Makes a checker of self-collisions with a padding [m] of forearm and hand to the body."""
    checker = model.make_collision_checker()
    checker.set_edge_step_size(0.05)
    plant = checker.plant()
    for name in arm_link_names(arm)[-2:]:
        for other in ("torso", "Head", "Pelvis", "Hip", "Tibia"):
            one, two = plant.GetBodyByName(name), plant.GetBodyByName(other)
            if not checker.IsCollisionFilteredBetween(one.index(), two.index()):
                checker.SetPaddingBetween(one.index(), two.index(), padding)
    return checker
