"""From a track to a demonstration: units, order, frame and arm.

What the file or the user states is taken. Anything else is SI unless the numbers contradict it;
then it is inferred, with a note, if there is only one reading, or else refused with a question.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError, one_line
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations import arm_chain as arms
from pepper_drake.learning.demonstrations.arm_chain import ARMS, arm_chain, joint_limits, rotate
from pepper_drake.learning.demonstrations.conditioning import (
    LEVER,
    LOUD,
    Noise,
    choose_cutoff,
    end_speed_noise,
    measure_noise,
    smooth_from_rest,
)
from pepper_drake.learning.demonstrations.demonstration import TORSO_HEIGHT, Demonstration
from pepper_drake.learning.demonstrations.importers.headers import joint_of
from pepper_drake.learning.demonstrations.importers.number_columns import dimensions
from pepper_drake.learning.demonstrations.importers.options import (
    ANGLES,
    LENGTHS,
    ImportOptions,
)
from pepper_drake.learning.demonstrations.importers.track import Track
from pepper_drake.learning.demonstrations.orientation_columns import read_rotations
from pepper_drake.learning.demonstrations.refusals import (
    HAND_DISTANCE,
    find_outliers,
    refuse_far,
    refuse_impossible,
    refuse_jumps,
    refuse_limits,
    refuse_rest,
    refuse_time,
    refuse_unreached,
)
from pepper_drake.learning.demonstrations.time_column import refuse_order, with_times

Array = npt.NDArray[np.float64]

_FRAMES = {
    "torso": "torso",
    "base_link": "torso",
    "base_footprint": "base_footprint",
    "floor": "base_footprint",
}


def interpret(track: Track, options: ImportOptions) -> Demonstration:
    """Returns the demonstration in T [m, s, rad], checked.

    Raises:
        InputError: With file, line and what to do.
    """
    track = track.without_repeats()
    notes = [f"read as {track.kind}", *track.notes]
    if track.velocities is None and track.accelerations is not None:
        track = replace(track, accelerations=None)  # An accelerometer's, which feel gravity, too.
        notes.append("accelerations without velocities were left out")
    track = with_times(track, options, notes)
    refuse_order(track)
    positions, scale = _positions(track, options, notes)
    arm, joints, names = _joints(track, options, positions, notes)
    rotations, angles = read_rotations(track, options, arm, joints, positions, notes)
    assert track.times is not None
    if positions is None:
        if joints is None or arm is None:
            raise InputError(
                f"{track.path}: no positions of the hand, and not all five joints of one arm"
                f" ({', '.join(arm_chain('right').joint_names)}) to find the hand by"
            )
        positions, rotations = arm_chain(arm).hand(joints)
        notes.append(f"the {arm} hand by forward kinematics of its joints")
        rates: tuple[Array | None, Array | None] = (None, None)
    else:
        rates = (
            None if track.velocities is None else track.velocities * scale,
            None if track.accelerations is None else track.accelerations * scale,
        )
    placed = _Placed(positions, rates[0], rates[1], rotations)
    if track.positions is not None:
        placed = _in_torso(placed, track, options, notes)
    if options.drop_outliers:
        placed, joints, track = _without_outliers(placed, joints, track, notes)
    assert track.times is not None
    where = track.where
    notes += _taken_as(track, options)
    unit_known = (options.unit or track.unit) is not None
    refuse_far(placed.positions, where, unit_known)
    if len(names) < 5 and (options.frame, options.start) == (None, None):
        refuse_unreached(placed.positions, where, unit_known)
    if options.unit is None:
        refuse_rest(placed.positions, placed.rotations, where)
    if options.time is None and track.time_unit is None:
        refuse_time(track.times, placed.positions, where)
    refuse_jumps(track.times, placed.positions, where)
    try:
        demonstration = Demonstration.from_positions(
            track.times,
            placed.positions,
            placed.velocities,
            placed.accelerations,
            rotations=placed.rotations,
            joints=joints,
            joint_names=names,
            name=one_line(track.name),
        )
    except InputError as error:
        raise InputError(f"{track.path}: {error}") from None
    if options.up == "y" or options.plane is not None:
        angles = None  # They refer to another frame.
    demonstration = replace(demonstration, angles=angles, notes=tuple(notes))
    refuse_impossible(demonstration, where)
    return filtered(demonstration)


@dataclass(frozen=True, eq=False)
class JointRecording:
    """A motion of joints.

    Attributes:
        name: Of the motion.
        times: (N,) [s].
        joints: (N, J) [rad].
        names: J names, as NAOqi's.
        notes: How the file was interpreted.
    """

    name: str
    times: Array
    joints: Array
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()


def interpret_joints(track: Track, options: ImportOptions) -> JointRecording:
    """Returns the motion of those of Pepper's joints that a track has [rad, s].

    With `options.arm`, only that arm's joints are kept; joints at rest are kept as well.

    Raises:
        InputError: It has none, or they are beyond their limits.
    """
    track = track.without_repeats()
    notes = [f"read as {track.kind}", *track.notes]
    track = with_times(track, options, notes)
    found = [joint_of(name) for name in track.joint_names]
    limits = joint_limits()
    kept = [k for k, name in enumerate(found) if name is not None and name in limits]
    if options.arm is not None:
        kept = [k for k in kept if str(found[k]).startswith(options.arm[0].upper())]
    if track.joints is None or track.times is None or not kept:
        raise InputError(f"{track.path}: no joints of Pepper in it; name the columns as NAOqi does")
    unit = options.angle or track.joint_unit or "rad"
    joints = track.joints[:, kept] * ANGLES[unit]
    names = tuple(str(found[k]) for k in kept)
    _refuse_repeated(track, names)
    if options.clip_joints:
        joints = arms.clip_to_limits(joints, names, notes)
    refuse_limits(joints, names, track.where)
    return JointRecording(one_line(track.name), track.times, joints, names, tuple(notes))


def _refuse_repeated(track: Track, names: Sequence[str | None]) -> None:
    """Refuses a joint with two columns: which of them is meant is not known."""
    known = [name for name in names if name is not None]
    twice = next((name for name in known if known.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{track.path}: {twice} has two columns; leave out one")


@dataclass(frozen=True)
class _Placed:
    """Positions [m], their derivatives where known, orientations."""

    positions: Array
    velocities: Array | None
    accelerations: Array | None
    rotations: Array | None

    def turned(self, rotation: Array) -> "_Placed":
        """Returns the motion rotated by a quaternion (4,)."""
        q = np.tile(rotation, (len(self.positions), 1))

        def turn(values: Array | None) -> Array | None:
            return None if values is None else rotate(q, values)

        return _Placed(
            rotate(q, self.positions),
            turn(self.velocities),
            turn(self.accelerations),
            None if self.rotations is None else so3.multiply(q, self.rotations),
        )

    def shifted(self, offset: npt.ArrayLike) -> "_Placed":
        """Returns the motion shifted by an offset (3,) [m]."""
        return replace(self, positions=self.positions + np.asarray(offset, dtype=float))


def filtered(demonstration: Demonstration) -> Demonstration:
    """Returns a demonstration low-pass filtered like our recordings, if it is noisy.

    Nothing is done where the noise would cause less than `LOUD` in the accelerations. A start or an
    end whose speed is within the noise is taken to be at rest.
    """
    t = demonstration.times
    noises = [measure_noise(t, demonstration.positions)]
    if demonstration.rotations is not None:
        noises.append(measure_noise(t, 2.0 * LEVER * demonstration.rotations))
    if demonstration.joints is not None:
        noises.append(measure_noise(t, LEVER * demonstration.joints))
    loudest: Noise = max(noises, key=lambda noise: noise.acceleration)
    if loudest.acceleration <= LOUD:
        return demonstration
    step = float(np.median(np.diff(t)))
    cutoff = choose_cutoff(loudest, step)
    smooth = demonstration.smoothed(cutoff)
    slow = 3.0 * end_speed_noise(noises[0], step, cutoff)
    resting = [float(np.linalg.norm(smooth.velocities[end])) < slow for end in (0, -1)]
    if any(resting):
        smooth = smooth_from_rest(demonstration, cutoff, *resting)
    note = (
        f"noise of {1000 * loudest.deviation:.2g} mm (or as much at {LEVER:g} m):"
        f" smoothed with a cut-off of {cutoff:.1f} Hz, as recordings are"
    )
    return replace(smooth, notes=(*demonstration.notes, note))


def _taken_as(track: Track, options: ImportOptions) -> list[str]:
    """Returns a note on assumed units and frame; none for our own folders."""
    own = track.positions is None or track.kind == "a folder of a demonstration"
    said = {
        "in metres": (options.unit, track.unit),
        "in seconds": (options.time, track.time_unit),
        "in the torso frame": (options.frame, options.start, options.plane, track.frame),
    }
    taken = [word for word, values in said.items() if all(value is None for value in values)]
    return [f"taken to be {', '.join(taken)}: nothing says otherwise"] if taken and not own else []


def _positions(
    track: Track, options: ImportOptions, notes: list[str]
) -> tuple[Array | None, float]:
    """Returns positions (N, 2 or 3) [m] and their unit in metres."""
    p = track.positions
    if p is None:
        return None, 1.0
    assert track.times is not None
    if p.shape[1] == 3 and track.velocities is not None and track.accelerations is None:
        # Seven columns: x, y and their two derivatives look like x, y, z and velocities.
        table = np.column_stack((track.times, p, track.velocities))
        if dimensions(table) == 2:
            raise InputError(
                f"{track.path}: columns 5 to 7 are not the derivatives of 2 to 4; it is a path of"
                " two dimensions with velocities and accelerations; say on which plane it lies"
                " (--plane X Y Z ROLL PITCH YAW)"
            )
    unit = options.unit or track.unit
    if options.unit is not None and track.unit not in (None, options.unit):
        notes.append(f"lengths in {options.unit}, as given; the file says {track.unit}")
    elif unit is not None and unit != "m":
        notes.append(f"lengths in {unit}")
    scale = LENGTHS[unit or "m"]
    if p.shape[1] == 1:
        raise InputError(
            f"{track.path}: a motion of one dimension: columns 3 and 4 are the derivatives"
            " (velocity and acceleration) of column 2; a hand's motion needs x, y, z"
        )
    if p.shape[1] > 3:
        raise InputError(
            f"{track.path}: a motion of {p.shape[1]} dimensions without names; a hand's has x, y,"
            " z, and joints are named in a first line (time,RShoulderPitch,...)"
        )
    if p.shape[1] == 2 and options.plane is None:
        raise InputError(
            f"{track.path}: a path of two dimensions; say on which plane it lies"
            " (--plane X Y Z ROLL PITCH YAW [m, rad] in the torso frame)"
        )
    return p * scale, scale


def _in_torso(placed: _Placed, track: Track, options: ImportOptions, notes: list[str]) -> _Placed:
    if placed.positions.shape[1] == 2:
        assert options.plane is not None

        def lift(values: Array | None) -> Array | None:
            return None if values is None else np.column_stack((values, np.zeros(len(values))))

        lifted = lift(placed.positions)
        assert lifted is not None
        placed = _Placed(lifted, lift(placed.velocities), lift(placed.accelerations), None)
        placed = placed.turned(so3.from_angles(options.plane[3:])).shifted(options.plane[:3])
        notes.append("a path of two dimensions, placed on the plane that was given")
    if options.up == "y":
        placed = placed.turned(np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]))
    frame = options.frame or (None if track.frame is None else _FRAMES.get(track.frame))
    if frame is None and track.frame is not None and options.start is None:
        raise InputError(
            f"{track.path}: positions are in frame '{track.frame[:40]}', and where that is to the"
            " torso is not known; say --frame torso or base_footprint, or where the motion starts"
            " (--start X Y Z)"
        )
    if frame == "base_footprint":
        placed = placed.shifted((0.0, 0.0, -TORSO_HEIGHT))
        notes.append(f"from above the floor to the torso, {TORSO_HEIGHT} m higher (upright)")
    if options.start is not None:
        placed = placed.shifted(np.asarray(options.start) - placed.positions[0])
        notes.append("shifted to the start that was given")
    return placed


def _joints(
    track: Track, options: ImportOptions, positions: Array | None, notes: list[str]
) -> tuple[str | None, Array | None, tuple[str, ...]]:
    """Returns the arm, its joints (N, 5) [rad] and their names; of two arms, the one that moves."""
    if track.joints is None:
        return options.arm, None, ()
    names = [joint_of(name) for name in track.joint_names]
    _refuse_repeated(track, names)
    whole = [arm for arm in ARMS if set(arm_chain(arm).joint_names) <= set(names)]
    if options.arm is not None and whole and options.arm not in whole:
        raise InputError(
            f"{track.path}: no joints of the {options.arm} arm in it, but those of the {whole[0]}"
        )
    unit = options.angle or track.joint_unit or "rad"
    if unit == "deg" and track.joint_unit is None and _agree(track, names, whole, positions):
        unit = "rad"  # Only the orientation is in degrees.
    elif unit == "deg":
        notes.append("joints in degrees")
        if whole and options.angle is None and np.abs(track.joints).max() < np.pi:
            raise InputError(
                f"{track.path}: joints in degrees, but none is beyond 3.1; say --angle rad or"
                " --angle deg"
            )
    joints = track.joints * ANGLES[unit]
    if options.clip_joints:
        joints = arms.clip_to_limits(joints, names, notes)
    if not whole:
        joints_of_arm, joint_names = _part_of_an_arm(track, names, joints, notes)
        if joints_of_arm is not None:
            refuse_limits(joints_of_arm, joint_names, track.where)
        return None, joints_of_arm, joint_names
    columns = {arm: joints[:, _columns(names, arm)] for arm in whole}
    if options.arm is None and len(whole) == 1:
        _refuse_the_arm_at_rest(track, names, joints, whole[0])
    arm = options.arm or (whole[0] if len(whole) == 1 else None)
    if arm is None:
        for side, values in columns.items():
            refuse_limits(values, arm_chain(side).joint_names, track.where)
        arm = _arm_that_moves(track, columns, positions)
    if len(names) > 5:
        notes.append(f"the {arm} arm's joints, picked by name among {len(names)}")
    refuse_limits(columns[arm], arm_chain(arm).joint_names, track.where)
    return arm, columns[arm], arm_chain(arm).joint_names


def _refuse_the_arm_at_rest(
    track: Track, names: Sequence[str | None], joints: Array, whole: str
) -> None:
    """Refuses an arm at rest while the other, some of whose joints are missing, moves."""
    other = "left" if whole == "right" else "right"
    missing = [name for name in arm_chain(other).joint_names if name not in names]
    present = [names.index(name) for name in arm_chain(other).joint_names if name in names]
    moved = float(np.ptp(joints[:, _columns(names, whole)], axis=0).max())
    if present and float(np.ptp(joints[:, present], axis=0).max()) > 5.0 * moved:
        raise InputError(
            f"{track.path}: the {other} arm moves, but {missing[0]} is not among the columns; the"
            f" {whole} arm rests (say --arm {whole} if it is meant)"
        )


def _columns(names: Sequence[str | None], arm: str) -> list[int]:
    return [names.index(name) for name in arm_chain(arm).joint_names]


def _agree(
    track: Track, names: Sequence[str | None], arms: Sequence[str], positions: Array | None
) -> bool:
    """Tells whether the joints, taken as radians, give the recorded positions of the hand."""
    if positions is None or track.joints is None or positions.shape[1] != 3:
        return False
    return any(
        float(
            np.median(
                np.linalg.norm(
                    arm_chain(arm).hand(track.joints[:, _columns(names, arm)])[0] - positions,
                    axis=1,
                )
            )
        )
        < HAND_DISTANCE
        for arm in arms
    )


def _part_of_an_arm(
    track: Track, names: Sequence[str | None], joints: Array, notes: list[str]
) -> tuple[Array | None, tuple[str, ...]]:
    arms = {arm: [n for n in names if n in arm_chain(arm).joint_names] for arm in ARMS}
    most = max(arms.values(), key=len)
    if not most:
        shown = track.joint_names[0][:40] if track.joint_names else ""
        notes.append(f"joints ('{shown}', ...) are not Pepper's and were left out")
        return None, ()
    notes.append(f"only {len(most)} of the arm's five joints")
    return joints[:, [names.index(name) for name in most]], tuple(str(name) for name in most)


def _arm_that_moves(track: Track, columns: dict[str, Array], positions: Array | None) -> str:
    if positions is not None and positions.shape[1] == 3:
        apart = {
            arm: float(np.median(np.linalg.norm(arm_chain(arm).hand(q)[0] - positions, axis=1)))
            for arm, q in columns.items()
        }
        best = min(apart, key=lambda arm: apart[arm])
        if apart[best] < HAND_DISTANCE:
            return best
    ranges = {arm: float(np.ptp(q, axis=0).max()) for arm, q in columns.items()}
    least, most = sorted(ranges, key=lambda arm: ranges[arm])
    if ranges[most] > 5.0 * ranges[least]:
        return most
    raise InputError(
        f"{track.path}: both arms' joints move; say which is meant (--arm left or --arm right)"
    )


def _without_outliers(
    placed: _Placed, joints: Array | None, track: Track, notes: list[str]
) -> tuple[_Placed, Array | None, Track]:
    assert track.times is not None
    wrong = find_outliers(track.times, placed.positions)
    if not len(wrong):
        return placed, joints, track
    kept = np.setdiff1d(np.arange(len(track.times)), wrong)
    notes.append(f"{len(wrong)} outliers were left out, the first: {track.where(int(wrong[0]))}")

    def part(values: Array | None) -> Array | None:
        return None if values is None else values[kept]

    lines = np.arange(len(track.times)) + 1 if track.lines is None else track.lines
    shorter = replace(track, times=track.times[kept], lines=lines[kept])
    return (
        _Placed(
            placed.positions[kept],
            part(placed.velocities),
            part(placed.accelerations),
            part(placed.rotations),
        ),
        part(joints),
        shorter,
    )
