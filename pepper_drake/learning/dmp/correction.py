"""Correction of a primitive by a tutor's pushes during its reproduction.

Where the hand was pushed off the primitive's path, the new path is followed; everywhere else, and
at the start and the goal, the primitive stays unchanged.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.primitive import MovementPrimitive, Path3D
from pepper_drake.learning.phase import relative_time_at

Array = npt.NDArray[np.float64]

_STEP = 0.005
_ENDS = 0.08


@dataclass(frozen=True)
class ReproducedMotion:
    """Record of a reproduction: N samples of the arm.

    Attributes:
        times: (N,) [s], increasing.
        phases: (N,) of the canonical system, 1 until the motion begins, then falling.
        positions: (N, 3) of the hand in T, as measured [m].
        rotations: (N, 4) unit quaternions w, x, y, z of the hand in T.
        joints: (N, J) measured [rad], in the order of the primitive's posture.
        goal: (3,) of the motion, in T [m].
    """

    times: Array
    phases: Array
    positions: Array
    rotations: Array
    joints: Array
    goal: Array


@dataclass(frozen=True)
class Correction:
    """A corrected motion.

    Attributes:
        demonstration: The primitive's own motion with the corrections.
        primitive: Learned from it.
        deviation: Farthest distance of the hand from the primitive's path [m].
    """

    demonstration: Demonstration
    primitive: MovementPrimitive
    deviation: float


def learn_correction(
    primitive: MovementPrimitive, motion: ReproducedMotion, *, threshold: float = 0.01
) -> Correction:
    """Learns a primitive from a reproduction in which the hand was pushed.

    The phase at each time t of the reproduction gives the point r(s(t)) of the primitive's path
    where the hand should have been. The deviation d(t) = p(t) - r(s(t)) counts fully from
    `threshold` on, not at all below half of it, and not at the two ends of the motion. The
    corrected motion is the primitive's own, from its own start to its own goal, plus the weighted
    deviation,

        p*(t) = r*(s(t)) + w(t) d(t),

    in the times of the reproduction: where the phase waited for the hand, the new motion is slow as
    well. The duration grows in proportion to the path length. Orientation and joints are corrected
    with the same weights. The new primitive is fitted with the old one's settings.

    Args:
        primitive: The performed primitive, with orientation and posture.
        motion: The reproduction.
        threshold: Smallest intended deviation [m]; a smaller one is tracking error.

    Raises:
        InputError: The hand was never that far from its path, or the reproduction is too short.
    """
    if primitive.orientation is None or primitive.posture is None:
        raise InputError(f"{primitive.name}: a primitive without orientation and joints")
    moving = _moving(motion.phases, primitive)
    if np.count_nonzero(moving) < 20:
        raise InputError(f"{primitive.name}: the reproduction ended before it had begun")
    times = motion.times[moving]
    share = relative_time_at(motion.phases[moving], primitive.translation.alpha_x)
    meant = primitive.rollout(
        _STEP,
        start=motion.positions[moving][0],
        goal=motion.goal,
        start_velocity=np.zeros(3),
        start_rotation=so3.normalize(motion.rotations[moving][0]),
    )
    own = _at(primitive.rollout(_STEP), primitive, share)
    seen = _at(meant, primitive, share)

    ends = _smoothstep(share / _ENDS) * _smoothstep((1.0 - share) / _ENDS)
    deviations = (motion.positions[moving] - seen.positions) * ends[:, None]
    distances = np.linalg.norm(deviations, axis=1)
    if not distances.max() >= threshold:
        raise InputError(
            f"{primitive.name}: the hand was never more than {1000 * distances.max():.0f} mm from"
            f" its path, less than the {1000 * threshold:.0f} mm that count as a correction"
        )
    weights = _smoothstep(2.0 * distances / threshold - 1.0)[:, None]
    positions = own.positions + weights * deviations
    assert own.rotations is not None
    assert own.joints is not None
    assert seen.rotations is not None
    assert seen.joints is not None
    turns = so3.log_map(
        so3.multiply(so3.make_continuous(motion.rotations[moving]), so3.conjugate(seen.rotations))
    )
    rotations = so3.multiply(so3.exp_map(weights * turns * ends[:, None]), own.rotations)
    joints = own.joints + weights * ends[:, None] * (motion.joints[moving] - seen.joints)

    length = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    duration = primitive.duration * max(1.0, length / primitive.path_length)
    corrected = Demonstration.from_positions(
        (times - times[0]) * duration / (times[-1] - times[0]),
        positions,
        rotations=rotations,
        joints=joints,
        joint_names=primitive.posture.names,
        name=f"{primitive.name}, corrected",
    ).smoothed()
    learned = MovementPrimitive.fit(
        corrected,
        approximator=primitive.approximator,
        num_basis=primitive.num_basis,
        scaling=primitive.translation.scaling,
        orientation=primitive.orientation.mode,
        alpha_z=primitive.translation.alpha_z,
        check=False,
    )
    return Correction(corrected, learned, float(distances.max()))


def _moving(phases: Array, primitive: MovementPrimitive) -> npt.NDArray[np.bool_]:
    """Marks the samples of the motion: from the last at rest to its nominal end."""
    end = primitive.phase_at([primitive.duration])[0]
    moving = (phases < 1.0) & (phases >= end)
    first = int(np.argmax(moving))
    if moving.any() and first > 0:
        moving[first - 1] = True
    return moving


def _at(path: Path3D, primitive: MovementPrimitive, share: Array) -> Path3D:
    """A rollout at relative times (N,)."""
    known = relative_time_at(path.phases, primitive.translation.alpha_x)

    def at(values: Array) -> Array:
        return np.column_stack([np.interp(share, known, column) for column in values.T])

    assert path.rotations is not None
    assert path.joints is not None
    return replace(
        path,
        positions=at(path.positions),
        rotations=so3.normalize(at(so3.make_continuous(path.rotations))),
        joints=at(path.joints),
    )


def _smoothstep(values: Array) -> Array:
    """0 below 0, 1 above 1, smooth between."""
    x = np.clip(values, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
