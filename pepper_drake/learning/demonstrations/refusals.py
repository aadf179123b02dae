"""Refusals of implausible demonstrations, naming the sample and what to do."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.arm_chain import (
    MOST_CLIPPED,
    arm_chain,
    arm_of,
    joint_limits,
)
from pepper_drake.learning.demonstrations.importers.options import TIMES

if TYPE_CHECKING:
    from pepper_drake.learning.demonstrations.demonstration import Demonstration

Array = npt.NDArray[np.float64]
Where = Callable[[int], str]

FARTHEST = 2.0
"""Largest distance of the hand from the torso [m], in any frame of a recording: upright, Pepper's
head is 1.2 m above the floor, and its arm reaches 0.41 m."""

FASTEST = 6.0
"""Largest speed of a hand [m/s]."""

FASTEST_TURN = 40.0
"""Largest angular speed of a hand [rad/s]."""

FIERCEST, FIERCEST_TURN = 70.0, 700.0
"""Largest acceleration of a hand [m/s², rad/s²]: an arm's fastest strokes reach 50 m/s²."""

LONGEST_GAP = 10.0
"""Longest gap between samples [s]; the motion in a longer one is unknown."""

REACH_SLACK = 0.15
"""Tolerance of the hand beyond the stretched arm [m]: another grip, a person's arm."""

SMALLEST = 0.005
"""A hand that stays within this [m], and does not turn, did not move."""

SLOWEST, SLOW_STEP = 0.005, 0.5
"""A motion with a lower mean speed [m/s] and samples at least this far apart [s] must have another
unit of time."""

LIMIT_SLACK = 0.06
"""Tolerance of measured joints beyond their limits [rad]."""

HAND_DISTANCE, HAND_TURN = 0.03, 0.2
"""Largest median difference of the hand's pose from forward kinematics [m, rad]."""

_ASIDE = 0.1
"""A hand that is on average this far to one side [m] is of the arm on that side."""

_UP = np.array([0.0, 0.0, 0.82])
"""Position of the torso above the floor [m]."""

_DERIVATIVE_SHARE = 0.3
_OUTLIER, _TURN_OUTLIER = 0.03, 0.3
"""Shortest jump [m, rad]."""
_FEW = 8
_BESIDE, _TIMES_USUAL = 5, 5.0
"""A jump is this many times as long as the steps beside it, of which so many are looked at."""


def refuse_impossible(demonstration: "Demonstration", where: Where | None = None) -> None:
    """Raises if a demonstration is implausible.

    Args:
        demonstration: In the torso frame or the floor's [m, s, rad].
        where: Names a sample in the message, with the file.

    Raises:
        InputError: With the sample and what to do.
    """
    name = demonstration.name
    label = where or (lambda sample: f"{name}, sample {sample + 1}")
    t, p = demonstration.times, demonstration.positions
    refuse_far(p, label)
    refuse_gaps(t, label)
    refuse_jumps(t, p, label)
    refuse_derivatives(demonstration, label)
    if demonstration.rotations is not None:
        refuse_turns(t, demonstration.rotations, label)
    if demonstration.joints is not None:
        refuse_joints(demonstration, label)


def refuse_far(positions: Array, label: Where, unit_known: bool = False) -> None:
    """Refuses positions metres away: another unit, if it is not known, or another frame."""
    far = np.linalg.norm(positions, axis=1)
    k = int(np.argmax(far))
    if far[k] <= FARTHEST:
        return
    lost = np.flatnonzero(_far_off(positions))
    if len(lost):
        raise InputError(
            f"{label(int(lost[0]))}: the hand would be {far[lost[0]]:.3g} m from the torso, where"
            f" all but {len(lost)} samples are within {FARTHEST:g} m: a number in place of what was"
            " not measured? Remove the rows (or say --drop-outliers)"
        )
    units = [
        f"{word} (--unit {unit})"
        for unit, word, size in (("mm", "millimetres", 1e-3), ("cm", "centimetres", 1e-2))
        if far[k] * size <= FARTHEST and not unit_known
    ]
    guess = f"are they {' or '.join(units[::-1])}, or in" if units else "are they in"
    hint = f"{guess} another unit or frame (--unit, --start X Y Z)?"
    if unit_known:
        hint = "say where the motion starts (--start X Y Z)"
    raise InputError(
        f"{label(k)}: the hand would be {far[k]:.3g} m from the torso, and the arm reaches 0.41 m;"
        f" positions must be metres in the torso frame: {hint}"
    )


def refuse_far_place(place: npt.ArrayLike, name: str) -> None:
    """Refuses a place (3,) [m] in the torso frame, given by a user, at which no hand can be.

    Args:
        place: The place.
        name: Its option, for the message.
    """
    far = float(np.linalg.norm(np.asarray(place, dtype=float)))
    if far > FARTHEST:
        raise InputError(
            f"{name}: {far:.3g} m from the torso, and the arm reaches 0.41 m; give metres in the"
            " torso frame"
        )


def refuse_unreached(positions: Array, label: Where, unit_known: bool = False) -> None:
    """Refuses a motion out of reach of both arms: another frame or unit."""
    shoulders = [arm_chain(arm).shoulder for arm in ("left", "right")]

    length = arm_chain("right").length

    def away(p: Array) -> Array:
        """Returns how far beyond the stretched arm the hand is [m]."""
        far = np.min([np.linalg.norm(p - shoulder, axis=1) for shoulder in shoulders], axis=0)
        return np.asarray(far - length)

    here = away(positions)
    if here.min() <= 0.01:
        return
    readings = {"are they above the floor (--frame base_footprint)": positions - _UP}
    if not unit_known:
        readings |= {
            "are they feet (--unit ft)": 0.3048 * positions,
            "are they inches (--unit in)": 0.0254 * positions,
            "are they centimetres (--unit cm)": 0.01 * positions,
        }
    mends = [mend for mend, p in readings.items() if np.mean(away(p) <= 0.01) > 0.8]
    if here.min() <= REACH_SLACK and not mends:
        return
    mends.append("say where the motion starts (--start X Y Z), or --frame torso if it is right")
    raise InputError(
        f"{label(0)}: the arm reaches {length:.2f} m from the shoulder, and no position is within"
        f" that; positions must be metres in the torso frame: {'; '.join(mends)}"
    )


def refuse_rest(positions: Array, rotations: Array | None, label: Where) -> None:
    """Refuses a motion without movement: another unit, or a body at rest."""
    size = float(np.linalg.norm(np.ptp(positions, axis=0)))
    turned = 0.0
    if rotations is not None:
        first = np.broadcast_to(rotations[0], rotations.shape)
        turns = so3.log_map(so3.multiply(rotations, so3.conjugate(first)))
        turned = float(np.linalg.norm(turns, axis=1).max())
    if size < SMALLEST and turned < 0.1:
        raise InputError(
            f"{label(0)}: the hand moves by {1000 * size:.2g} mm in all; are lengths in another"
            " unit (--unit), or is it another body or arm (--track, --arm)?"
        )


def refuse_gaps(times: Array, label: Where) -> None:
    """Refuses a gap longer than any pause in an otherwise dense recording."""
    steps = np.diff(times)
    k = int(np.argmax(steps))
    if steps[k] > max(LONGEST_GAP, 50.0 * float(np.median(steps))):
        raise InputError(
            f"{label(k + 1)}: {steps[k]:.4g} s without a sample before it; cut the recording there"
        )


def refuse_time(times: Array, positions: Array, label: Where) -> None:
    """Refuses a motion so slow that its times must have another unit."""
    step = float(np.median(np.diff(times)))
    length = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    duration = float(times[-1] - times[0])
    if step >= SLOW_STEP and 0.01 < length < SLOWEST * duration:
        mean = length / duration
        units = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
        fits = [(u, word) for u, word in units.items() if SLOWEST < mean / TIMES[u] < FASTEST]
        unit, word = fits[0] if fits else ("ms", "milliseconds")
        raise InputError(
            f"{label(len(times) - 1)}: {duration:.4g} s for {length:.2f} m, {mean:.2g} m/s: times"
            f" must be seconds; are they {word} (--time {unit})? Say --time s if it was that slow"
        )


def _far_off(positions: Array) -> npt.NDArray[np.bool_]:
    """Tells which samples are far beyond all others, and farther than a hand can be (N,).

    None are where most samples are as far: these have another unit or frame.
    """
    far = np.linalg.norm(positions, axis=1)
    near = far <= FARTHEST
    if 2 * int(near.sum()) <= len(far):
        return np.zeros(len(far), dtype=bool)
    return np.asarray(far > max(FARTHEST, 2.0 * float(far[near].max())))


def find_outliers(times: Array, positions: Array) -> npt.NDArray[np.int64]:
    """Returns the samples that jump away and back: outliers from the line between their neighbours.

    Their distance from it exceeds 3 cm, ten times the median over all samples, and one and a half
    times the distance between the neighbours. Samples farther than a hand can be are outliers, too.
    """
    if len(times) < _FEW:
        return np.empty(0, dtype=np.int64)
    share = ((times[1:-1] - times[:-2]) / (times[2:] - times[:-2]))[:, None]
    between = positions[:-2] + share * (positions[2:] - positions[:-2])
    away = np.linalg.norm(positions[1:-1] - between, axis=1)
    apart = np.linalg.norm(positions[2:] - positions[:-2], axis=1)
    lost = _far_off(positions)
    lost[1:-1] |= (away > _OUTLIER) & (away > 10.0 * np.median(away)) & (away > 1.5 * apart)
    return np.flatnonzero(lost)


def find_jump(times: Array, steps: Array, shortest: float, fiercest: float) -> int | None:
    """Returns the number of a step that is far longer than those beside it, None if none is.

    At the ends and between two places, a jump does not show by going back. The hand would need more
    than its acceleration for it. Steps of no length are passed over: a sensor may be slower than
    the log, and a hand may rest.

    Args:
        times: (N,) [s].
        steps: (N - 1,) distances between neighbouring samples [m or rad].
        shortest: Shortest jump [m or rad].
        fiercest: Largest acceleration of a hand [m/s² or rad/s²].
    """
    moved = np.flatnonzero(steps > 1e-9)
    if len(times) < _FEW:
        return None
    for place in np.flatnonzero(steps[moved] > shortest):
        k = int(moved[place])
        beside = moved[max(0, place - _BESIDE) : place + _BESIDE + 1]
        beside = beside[beside != k]
        usual = float(np.median(steps[beside])) if len(beside) else 0.0
        acceleration = (steps[k] - usual) / (times[k + 1] - times[k]) ** 2
        if steps[k] > _TIMES_USUAL * usual and acceleration > fiercest:
            return k
    return None


def refuse_jumps(times: Array, positions: Array, label: Where) -> None:
    """Refuses outliers, zeros of a lost tracker, and jumps."""
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    usual = float(np.median(steps))
    zero = np.flatnonzero(np.all(positions == 0.0, axis=1))
    for k in zero[:1] if 0 < len(zero) < len(positions) else ():
        beside = np.union1d(zero - 1, zero)
        beside = steps[beside[(beside >= 0) & (beside < len(steps))]]
        run = steps[steps > 0.0]
        if len(times) >= _FEW and beside.max() > max(0.02, 5.0 * float(np.median(run))):
            raise InputError(
                f"{label(int(k))}: a jump to 0 0 0 (an outlier: the tracker was lost there);"
                f" remove the row ({len(zero)} such)"
            )
    outliers = find_outliers(times, positions)
    if len(outliers):
        k = int(outliers[0])
        raise InputError(
            f"{label(k)}: an outlier, a jump of {100 * steps[k - 1]:.0f} cm and back"
            f" ({len(outliers)} such samples); remove the rows (or say --drop-outliers)"
        )
    speeds = steps / np.diff(times)
    k = int(np.argmax(steps))
    if speeds[k] > FASTEST and steps[k] > _OUTLIER:
        raise InputError(
            f"{label(k + 1)}: a jump of {100 * steps[k]:.0f} cm in {np.diff(times)[k]:.2g} s,"
            f" {speeds[k]:.3g} m/s; remove what is wrong there, or are positions metres and times"
            " seconds (--unit, --time)?"
        )
    # Speed over a fiftieth of a second: over less, noise dominates.
    stride = int(
        np.clip(round(0.02 / float(np.median(np.diff(times)))), 1, max(1, len(times) // 4))
    )
    travel = np.linalg.norm(positions[stride:] - positions[:-stride], axis=1)
    fast = travel / (times[stride:] - times[:-stride])
    if fast.max() > FASTEST:
        j = int(np.argmax(fast))
        raise InputError(
            f"{label(j + stride)}: the hand at {fast[j]:.3g} m/s; are positions metres and times"
            " seconds (--unit, --time)?"
        )
    jump = find_jump(times, steps, _OUTLIER, FIERCEST)
    if len(times) >= _FEW and steps[k] > max(0.10, 20.0 * usual) and speeds[k] > 1.0:
        jump = k
    if jump is not None:
        k = jump
        raise InputError(
            f"{label(k + 1)}: a jump of {100 * steps[k]:.0f} cm where the hand moves"
            f" {1000 * usual:.1f} mm from sample to sample; remove what is wrong there"
        )


def refuse_derivatives(demonstration: "Demonstration", label: Where) -> None:
    """Refuses velocities and accelerations that are not the derivatives they should be."""
    from pepper_drake.learning.demonstrations.importers.number_columns import derivative_error

    t, p = demonstration.times, demonstration.positions
    v, a = demonstration.velocities, demonstration.accelerations
    if len(t) < 5 or demonstration.derivation.startswith("derivatives"):
        return
    wrong = []
    if derivative_error(t, p, v) > _DERIVATIVE_SHARE:
        wrong.append("velocities are not the derivatives of the positions")
    elif np.ptp(v) > 0.01 and derivative_error(t, v, a) > 0.5:
        wrong.append("accelerations are not the derivatives of the velocities")
    if wrong:
        raise InputError(
            f"{label(0)}: the {wrong[0]} (another unit, other columns, or a path of 1 or 2"
            " dimensions?); leave them out and they are derived"
        )


def refuse_turns(times: Array, rotations: Array, label: Where) -> None:
    """Refuses orientations that jump."""
    turns = so3.log_map(so3.multiply(rotations[1:], so3.conjugate(rotations[:-1])))
    sizes = np.linalg.norm(turns, axis=1)
    rates = sizes / np.diff(times)
    k = int(np.argmax(rates))
    jump = find_jump(times, sizes, _TURN_OUTLIER, FIERCEST_TURN)
    if rates[k] > FASTEST_TURN and sizes[k] > 0.5:
        jump = k
    if jump is not None:
        k = jump
        raise InputError(
            f"{label(k + 1)}: the hand turns by {np.degrees(sizes[k]):.0f} degrees in"
            f" {np.diff(times)[k]:.2g} s; are angles in degrees (--angle deg), or was the tracker"
            " lost there?"
        )


def refuse_joints(demonstration: "Demonstration", label: Where) -> None:
    """Refuses joints beyond their limits, and joints that contradict the hand's pose."""
    joints, names = demonstration.joints, demonstration.joint_names
    assert joints is not None
    refuse_limits(joints, names, label)
    arm = arm_of(names)
    if arm is not None:
        _refuse_disagreement(demonstration, joints, arm, label)


def refuse_limits(joints: Array, names: Sequence[str], label: Where) -> None:
    """Refuses joints (N, J) [rad] beyond their limits."""
    limits = joint_limits()
    for j, name in enumerate(names):
        if name not in limits:
            continue
        lower, upper = limits[name]
        over = np.maximum(lower - joints[:, j], joints[:, j] - upper)
        k = int(np.argmax(over))
        if over[k] > LIMIT_SLACK:
            # More than 4 rad: no joint of Pepper goes that far.
            degrees = np.abs(joints).max() > 4.0
            mend = "are they degrees (--angle deg)?" if degrees else "correct it"
            if not degrees and over[k] <= MOST_CLIPPED:
                mend = "correct it, or say --clip-joints to stop at the limit, as ALMotion does"
            raise InputError(
                f"{label(k)}: joint {name} at {joints[k, j]:.4g} rad is beyond its limits,"
                f" {lower:g} to {upper:g} rad; {mend}"
            )


def _refuse_disagreement(
    demonstration: "Demonstration", joints: Array, arm: str, label: Where
) -> None:
    hand, rotation = arm_chain(arm).hand(joints)
    offsets = demonstration.positions - hand
    distances = np.linalg.norm(offsets, axis=1)
    median = float(np.median(distances))
    if median > HAND_DISTANCE:
        k = int(np.argmax(distances))
        mean = offsets.mean(axis=0)
        steady = float(np.linalg.norm(offsets - mean, axis=1).max()) < HAND_DISTANCE
        if steady and abs(mean[2] - _UP[2]) < 0.05 and np.abs(mean[:2]).max() < 0.05:
            mend = "they are above the floor (--frame base_footprint)"
        elif steady:
            mend = f"they are in another frame, shifted by {np.round(mean, 3)} m"
        else:
            mend = "are they of the same motion, arm, unit and frame?"
        raise InputError(
            f"{label(k)}: the hand and the joints disagree: by forward kinematics the hand is"
            f" {100 * median:.0f} cm from the positions (median); {mend}"
        )
    if demonstration.rotations is None:
        return
    turns = so3.log_map(so3.multiply(rotation, so3.conjugate(demonstration.rotations)))
    sizes = np.linalg.norm(turns, axis=1)
    if float(np.median(sizes)) > HAND_TURN:
        k = int(np.argmax(sizes))
        raise InputError(
            f"{label(k)}: the orientation and the joints disagree by"
            f" {np.degrees(np.median(sizes)):.0f} degrees (median) by forward kinematics; is the"
            " quaternion's order another (--quaternion xyzw), or are the angles degrees (--angle"
            " deg)?"
        )


def refuse_unlike(demonstrations: "list[Demonstration]") -> None:
    """Refuses demonstrations of different movements.

    Sizes and durations may differ by a factor of 10. The displacements from the start, over
    relative time, must agree in direction: their normalised correlation with the mean of the
    others' is at least 0.3. They must be on the same side of the torso.

    Raises:
        InputError: Naming the one that is unlike the others.
    """
    if len(demonstrations) < 2:
        return
    sides = [_side(demo) for demo in demonstrations]
    first = next((side for side in sides if side), "")
    for demo, side in zip(demonstrations, sides, strict=True):
        if side not in ("", first):
            raise InputError(
                f"{demo.name}: it is a motion of the {side} arm, and another demonstration one of"
                f" the {first}: their mean is neither; learn each by itself"
            )
    share = np.linspace(0.0, 1.0, 60)
    paths = []
    for demo in demonstrations:
        s = (demo.times - demo.times[0]) / demo.duration
        moved = np.column_stack([np.interp(share, s, column) for column in demo.positions.T])
        paths.append(moved - moved[0])
    for kind, values in (
        ("long", [demo.path_length for demo in demonstrations]),
        ("slow", [demo.duration for demo in demonstrations]),
    ):
        middle = float(np.median(values))
        worst = int(np.argmax([abs(np.log(max(v, 1e-9) / max(middle, 1e-9))) for v in values]))
        ratio = max(values[worst], 1e-9) / max(min(values), 1e-9)
        ratio = max(ratio, max(values) / max(values[worst], 1e-9))
        if ratio > 10.0 and max(values) > 0.01:
            unit = "m" if kind == "long" else "s"
            raise InputError(
                f"{demonstrations[worst].name}: {values[worst]:.3g} {unit} where others have"
                f" {middle:.3g} {unit}: the demonstrations are not alike; are their units the same?"
            )
    for k, path in enumerate(paths):
        rest = np.mean(
            [p / max(float(np.linalg.norm(p)), 1e-12) for i, p in enumerate(paths) if i != k],
            axis=0,
        )
        size = float(np.linalg.norm(path) * np.linalg.norm(rest))
        likeness = float(np.sum(path * rest)) / size if size > 1e-9 else 1.0
        if likeness < 0.3:
            raise InputError(
                f"{demonstrations[k].name}: it moves differently from the other demonstrations"
                f" (correlation {likeness:.2f}): they are not alike; learn it by itself"
            )


def _side(demonstration: "Demonstration") -> str:
    """Returns the arm of a demonstration, by its joints or its side of the torso, "" if unsure."""
    arm = arm_of(demonstration.joint_names)
    aside = float(demonstration.positions[:, 1].mean())
    return arm or ("" if abs(aside) < _ASIDE else "left" if aside > 0.0 else "right")


def turn_between(one: Array, other: Array) -> float:
    """Returns the median angle between orientations (N, 4) and (N, 4) [rad]."""
    turns = so3.log_map(so3.multiply(one, so3.conjugate(other)))
    return float(np.median(np.linalg.norm(turns, axis=1)))
