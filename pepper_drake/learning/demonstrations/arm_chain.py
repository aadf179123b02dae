"""Forward kinematics and limits of Pepper's arms for checking recordings.

The numbers are read from Pepper's URDF with numpy alone, so that no simulator is needed. The tests
compare it with Drake's kinematics of the same file.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from functools import lru_cache
from importlib import resources

import numpy as np
import numpy.typing as npt

from pepper_drake.learning import rotations as so3

Array = npt.NDArray[np.float64]

ARMS = ("left", "right")

_JOINTS = ("ShoulderPitch", "ShoulderRoll", "ElbowYaw", "ElbowRoll", "WristYaw")


MOST_CLIPPED = 0.5
"""Joints beyond their limits by more than this [rad] are not clipped."""


class ArmChain:
    """The five joints of one arm, from the torso to the hand's control frame H.

    Attributes:
        arm: "left" or "right".
        joint_names: Five names, shoulder to wrist.
        lower: (5,) position limits [rad].
        upper: (5,) position limits [rad].
        speed: (5,) velocity limits [rad/s].
        shoulder: (3,) p_TS, the shoulder in the torso frame [m].
        length: Distance of the hand's frame from the shoulder, the arm stretched [m].
    """

    def __init__(self, arm: str) -> None:
        root = _robot()
        side = arm[0].upper()
        self.arm = arm
        self.joint_names = tuple(side + name for name in _JOINTS)
        joints = {joint.get("name"): joint for joint in root.findall("joint")}
        found = [joints[name] for name in self.joint_names]
        limits = [joint.find("limit") for joint in found]
        self.lower = _numbers(limits, "lower")
        self.upper = _numbers(limits, "upper")
        self.speed = _numbers(limits, "velocity")
        self._axes = [_vector(joint.find("axis"), "xyz") for joint in found]
        self._offsets = [_vector(joint.find("origin"), "xyz") for joint in found]
        self._turns = [so3.from_angles(_vector(joint.find("origin"), "rpy")) for joint in found]
        frames = {frame.get("name"): frame for frame in root.iter() if frame.tag.endswith("frame")}
        hand = frames[f"{side.lower()}_hand_effector"]
        self._p_WH, self._q_WH = _vector(hand, "xyz"), so3.from_angles(_vector(hand, "rpy"))
        self.shoulder = self._offsets[0]
        sizes = [float(np.linalg.norm(offset)) for offset in (*self._offsets[1:], self._p_WH)]
        self.length = sum(sizes)

    def hand(self, joints: npt.ArrayLike) -> tuple[Array, Array]:
        """Returns p_TH (N, 3) [m] and unit quaternions of R_TH (N, 4) at joints (N, 5) [rad]."""
        position, rotation, _, _ = self._chain(np.asarray(joints, dtype=float))
        return position, rotation

    def _chain(self, q: Array) -> tuple[Array, Array, list[Array], list[Array]]:
        """Returns the hand's pose, and each joint's position (N, 3) and axis (N, 3), in T."""
        position = np.zeros((len(q), 3))
        rotation = np.tile([1.0, 0.0, 0.0, 0.0], (len(q), 1))
        places, axes = [], []
        chain = zip(self._offsets, self._turns, self._axes, strict=True)
        for k, (offset, turn, axis) in enumerate(chain):
            position = position + rotate(rotation, offset)
            rotation = so3.multiply(rotation, np.broadcast_to(turn, rotation.shape))
            places.append(position)
            axes.append(rotate(rotation, axis))
            rotation = so3.multiply(rotation, so3.exp_map(q[:, k, None] * axis))
        position = position + rotate(rotation, self._p_WH)
        rotation = so3.multiply(rotation, np.broadcast_to(self._q_WH, rotation.shape))
        return position, rotation, places, axes

    def pose_distances(self, positions: Array, rotations: Array, lever: float = 0.1) -> Array:
        """Returns the distance (N,) [m] of each of N poses from the nearest pose the arm can reach.

        Damped least squares from a grid of starts: the arm has five joints for six coordinates, so
        most poses are out of reach, and one that is not is evidence.

        Args:
            positions: (N, 3) [m] in T.
            rotations: (N, 4) unit quaternions.
            lever: Weight of an orientation error of one radian [m].
        """
        middle, half = 0.5 * (self.lower + self.upper), 0.5 * (self.upper - self.lower)
        # Shoulder and elbow yaw decide the branch of the solution.
        starts = np.stack(np.meshgrid(*([-0.7, 0.0, 0.7],) * 3, indexing="ij"), axis=-1).reshape(
            -1, 3
        )
        starts = np.concatenate((starts, np.zeros((len(starts), 2))), axis=1)
        count, tries = len(positions), len(starts)
        q = np.tile(middle + half * starts, (count, 1))
        position = np.repeat(positions, tries, axis=0)
        rotation = np.repeat(rotations, tries, axis=0)
        damping = np.full(len(q), 1e-2)
        error, jacobian = self._pose_error(q, position, rotation, lever)
        for _ in range(25):
            normal = jacobian.swapaxes(1, 2) @ jacobian
            normal = normal + damping[:, None, None] * 1e-2 * np.eye(5)
            step = np.linalg.solve(normal, jacobian.swapaxes(1, 2) @ error[..., None])[..., 0]
            tried = np.clip(q - step, self.lower, self.upper)
            left, slope = self._pose_error(tried, position, rotation, lever)
            better = np.sum(left**2, axis=1) < np.sum(error**2, axis=1)
            q = np.where(better[:, None], tried, q)
            error = np.where(better[:, None], left, error)
            jacobian = np.where(better[:, None, None], slope, jacobian)
            nearest = np.sum(error**2, axis=1).reshape(count, tries).min(axis=1)
            if nearest.max() < 1e-8:
                break
            damping = np.clip(np.where(better, 0.2 * damping, 5.0 * damping), 1e-8, 1e4)
        return np.asarray(np.sqrt(np.sum(error**2, axis=1).reshape(count, tries).min(axis=1)))

    def _pose_error(
        self, q: Array, position: Array, rotation: Array, lever: float
    ) -> tuple[Array, Array]:
        """Returns errors (N, 6) [m] from a pose, and their Jacobian (N, 6, 5)."""
        p, r, places, axes = self._chain(q)
        turn = so3.log_map(so3.multiply(r, so3.conjugate(rotation)))
        jacobian = np.stack(
            [
                np.concatenate((_cross(axis, p - place), lever * axis), axis=1)
                for place, axis in zip(places, axes, strict=True)
            ],
            axis=-1,
        )
        return np.concatenate((p - position, lever * turn), axis=1), jacobian


def rotate(rotations: Array, vectors: Array) -> Array:
    """Returns vectors (3,) or (N, 3) rotated by quaternions (N, 4), (N, 3)."""
    w, axis = rotations[..., :1], rotations[..., 1:]
    v = np.broadcast_to(vectors, axis.shape)
    twice = 2.0 * _cross(axis, v)
    return np.asarray(v + w * twice + _cross(axis, twice))


def _cross(a: Array, b: Array) -> Array:
    """Returns cross products (N, 3), as `numpy.cross`, in half the time for small N."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-1)


@lru_cache(maxsize=2)
def arm_chain(arm: str) -> ArmChain:
    """Returns the chain of the "left" or the "right" arm, read once."""
    return ArmChain(arm)


@lru_cache(maxsize=1)
def joint_limits() -> dict[str, tuple[float, float]]:
    """Returns lower and upper limit [rad] of each of Pepper's joints that has limits."""
    limits = {}
    for joint in _robot().findall("joint"):
        limit = joint.find("limit")
        if joint.get("type") == "revolute" and limit is not None:
            name = str(joint.get("name"))
            limits[name] = (float(limit.get("lower", "nan")), float(limit.get("upper", "nan")))
    return limits


def clip_to_limits(joints: Array, names: Sequence[str | None], notes: list[str]) -> Array:
    """Returns joints (N, J) [rad], clipped if up to `MOST_CLIPPED` beyond a limit, as in ALMotion.

    Args:
        joints: Recorded positions [rad].
        names: J names of Pepper's joints; others have no limits.
        notes: A line on what was clipped is appended to it.
    """
    none = (-np.inf, np.inf)
    lower, upper = np.array([joint_limits().get(str(name), none) for name in names]).T
    inside = np.clip(joints, lower, upper)
    over = np.abs(joints - inside)
    moved = (over > 0.0) & (over <= MOST_CLIPPED)
    if moved.any():
        which = ", ".join(str(name) for name, m in zip(names, moved.T, strict=True) if m.any())
        notes.append(f"brought to Pepper's limits, by {over[moved].max():.2f} rad at most: {which}")
    return np.where(moved, inside, joints)


def arm_of(joint_names: Sequence[str]) -> str | None:
    """Returns the arm whose five joints these are, shoulder to wrist: "left", "right" or None."""
    for arm in ARMS:
        if tuple(joint_names) == arm_chain(arm).joint_names:
            return arm
    return None


@lru_cache(maxsize=1)
def _robot() -> ElementTree.Element:
    file = resources.files("pepper_drake") / "models" / "pepper" / "pepper.urdf"
    return ElementTree.fromstring(file.read_text(encoding="utf-8"))


def _vector(element: ElementTree.Element | None, attribute: str) -> Array:
    text = "0 0 0" if element is None else element.get(attribute, "0 0 0")
    return np.array([float(number) for number in text.split()])


def _numbers(elements: Sequence[ElementTree.Element | None], attribute: str) -> Array:
    return np.array([float("nan" if e is None else e.get(attribute, "nan")) for e in elements])
