"""Meaning and unit of a column by its name, as the various tools write it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from pepper_drake.learning.demonstrations.arm_chain import joint_limits
from pepper_drake.learning.demonstrations.importers.options import LENGTHS, TIMES

_UNITS = {
    "m": ("unit", "m"),
    "meter": ("unit", "m"),
    "meters": ("unit", "m"),
    "metre": ("unit", "m"),
    "metres": ("unit", "m"),
    "cm": ("unit", "cm"),
    "mm": ("unit", "mm"),
    "millimeter": ("unit", "mm"),
    "millimetre": ("unit", "mm"),
    "millimeters": ("unit", "mm"),
    "millimetres": ("unit", "mm"),
    "centimeter": ("unit", "cm"),
    "centimetre": ("unit", "cm"),
    "centimeters": ("unit", "cm"),
    "centimetres": ("unit", "cm"),
    "um": ("unit", "um"),
    "in": ("unit", "in"),
    "ft": ("unit", "ft"),
    "feet": ("unit", "ft"),
    "foot": ("unit", "ft"),
    "inch": ("unit", "in"),
    "inches": ("unit", "in"),
    "s": ("time", "s"),
    "sec": ("time", "s"),
    "secs": ("time", "s"),
    "second": ("time", "s"),
    "seconds": ("time", "s"),
    "ms": ("time", "ms"),
    "msec": ("time", "ms"),
    "milliseconds": ("time", "ms"),
    "millisecond": ("time", "ms"),
    "microsecond": ("time", "us"),
    "nanosecond": ("time", "ns"),
    "us": ("time", "us"),
    "usec": ("time", "us"),
    "microseconds": ("time", "us"),
    "ns": ("time", "ns"),
    "nsec": ("time", "ns"),
    "nanoseconds": ("time", "ns"),
    "µs": ("time", "us"),
    "μs": ("time", "us"),
    "min": ("time", "min"),
    "minutes": ("time", "min"),
    "h": ("time", "h"),
    "hours": ("time", "h"),
    "days": ("time", "day"),
    "rad": ("angle", "rad"),
    "radian": ("angle", "rad"),
    "radians": ("angle", "rad"),
    "deg": ("angle", "deg"),
    "degree": ("angle", "deg"),
    "degrees": ("angle", "deg"),
    "°": ("angle", "deg"),
}

UNKNOWN = "?"
"""Prefix of a unit in a header that is not supported."""

_FOREIGN_UNITS = {
    "px", "pixel", "pixels", "dm", "km", "yd", "yards", "turns", "rev", "revolutions", "grad",
    "gon", "%", "percent", "ticks", "counts", "volt", "volts",
}  # fmt: skip

_COMMANDS = {
    "des", "desired", "cmd", "command", "commanded", "target", "setpoint", "ref", "reference",
    "actuator",
}  # fmt: skip
"""Words of commanded, not measured, values."""

_MEASURED = {"actual", "act", "measured", "meas", "state", "sensor"}

_TIME = {"time", "timestamp", "t", "stamp", "timestamps", "clock", "elapsed", "secs", "seconds"}
_TIME_PHRASES = {("time", "from", "start"), ("time", "since", "start")}
"""Names of more words: MoveIt's and ros2_control's trajectories."""
_POSITION = {
    "p", "pos", "position", "positions", "translation", "trans", "t", "point", "xyz", "coord",
    "coordinate", "location", "loc",
}  # fmt: skip
_ROTATION = {
    "q", "quat", "quaternion", "orientation", "rotation", "rot", "ori", "orient", "or", "orn",
}  # fmt: skip
_VELOCITY = {"v", "vel", "velocity", "velocities", "linear", "speed", "d"}
_ACCELERATION = {"a", "acc", "accel", "acceleration", "accelerations", "dd"}
_ANGLES = {
    "roll": 0, "pitch": 1, "yaw": 2, "alpha_roll": 0, "rollangle": 0, "pitchangle": 1,
    "yawangle": 2,
}  # fmt: skip
_OTHER = {
    "angular", "covariance", "gyro", "gyroscope", "mag", "magnetometer", "magnetic", "imu", "force",
    "torque", "wrench", "effort", "bias", "b", "w", "omega", "error", "scale", "size", "normal",
    "pixel", "gravity", "std", "sigma", "cov",
}  # fmt: skip
"""Words of vectors that are neither a position nor its derivatives."""

_EUROC_FRAMES = ("rs", "r", "s", "rw", "ws", "wb", "wr")

_AXES = {"x": 0, "y": 1, "z": 2, "w": 3}

_DERIVATIVE_WORDS = {"velocity", "vel", "effort", "torque", "current", "temperature", "speed"}

_ANGLE_AT_END = re.compile(r"[^A-Za-z0-9](rad|radians?|deg|degrees?)$", re.IGNORECASE)

_LONGEST_NAME = 200
"""Longer texts are no column names; the search for a unit takes quadratic time."""


@dataclass(frozen=True)
class Meaning:
    """Content of a column.

    Attributes:
        kind: time, position, velocity, acceleration, quaternion, angle, joint or rotation_vector.
        axis: 0 to 2 for x, y, z (roll, pitch, yaw); 3 for w.
        group: What it belongs to, such as the body's name; "" if there is only one.
        unit: From the header, or None.
        joint: Pepper's name of the joint.
    """

    kind: str
    axis: int = 0
    group: str = ""
    unit: str | None = None
    joint: str = ""


def meaning(header: str) -> Meaning | None:
    """Returns the meaning of a column by its name, None if unknown."""
    if len(header) > _LONGEST_NAME:
        return None
    text, unit = _split_unit(header.strip().strip("\"'#%").strip())
    joint = joint_of(text)
    if joint is None and unit is None and (tail := _ANGLE_AT_END.search(text)):
        joint = joint_of(text[: tail.start()])  # RElbowYaw_deg.
        unit = None if joint is None else _UNITS[tail[1].lower()][1]
    if joint is not None:
        known = (
            unit if unit is not None and (unit in ("deg", "rad") or unit[0] == UNKNOWN) else None
        )
        return Meaning("joint", unit=known, joint=joint)
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)  # xPos, timeStamp.
    words = [word for word in re.split(r"[^a-z0-9°µμ]+", apart.lower()) if word]
    if not words:
        return None
    if unit is None and _ends_with_unit(words):
        unit = _UNITS[words.pop()][1]
    return _meaning(words, unit)


def _ends_with_unit(words: list[str]) -> bool:
    """Tells whether the last word is a unit: x_mm, x_m, time_s; but no other s."""
    if len(words) < 2 or words[-1] not in _UNITS:
        return False
    return len(words[-1]) > 1 or words[0] in {*_AXES, *_TIME} or words[-2] in _AXES


def _meaning(words: list[str], unit: str | None) -> Meaning | None:
    last = words[-1]
    if tuple(words) in _TIME_PHRASES:
        words, last = ["time"], "time"
    if (last in _TIME and (len(words) == 1 or last != "t")) or words[0] in ("time", "timestamp"):
        if len(words) > 2 and "stamp" not in words:
            return None
        group = "" if len(words) == 1 else "_".join(words)
        known = unit is not None and (unit in TIMES or unit[0] == UNKNOWN)
        return Meaning("time", group=group, unit=unit if known else None)
    if last in ("nsecs", "nanosec", "seq", "frame_id", "id", "frame"):
        return None
    if last in _ANGLES:
        rest = [w for w in words[:-1] if w not in _ROTATION | {"euler", "rpy", "angle"}]
        return Meaning("angle", _ANGLES[last], "_".join(rest), unit)
    axis, stem = _axis(last)
    before = list(words[:-1])
    if axis is None and before and before[0] in _AXES and last in _POSITION | _ROTATION:
        # x_pos, w_quat.
        axis, stem, before = _AXES[before[0]], last, []
    if axis is None:
        return None
    if stem:
        before.append(stem)
    return _with_axis(axis, before, unit)


def _with_axis(axis: int, before: list[str], unit: str | None) -> Meaning | None:
    # EuRoC's p_RS_R_x and q_RS_w name frames, not bodies.
    if len(before) > 1 and before[0] in ("p", "q", "v") and before[1] in _EUROC_FRAMES:
        before = [before[0], *(w for w in before[1:] if w not in _EUROC_FRAMES)]
    names = set(before)
    if names & _OTHER:
        return None
    if names & {"euler", "rpy", "angle", "angles"} or (
        names & {"rot", "rotation", "orient", "ori"} and unit in ("deg", "rad")
    ):
        return Meaning("rotation_vector", axis, unit=unit)  # Angles of unknown order.
    if names & {"r", "rotvec", "axisangle"} and not names & _ROTATION:
        kind, used = "rotation_vector", {"r", "rotvec", "axisangle"}
    elif names & _ROTATION or axis == 3:
        kind, used = "quaternion", _ROTATION
    elif names & _ACCELERATION:
        kind, used = "acceleration", _ACCELERATION | {"linear"}
    elif names & _VELOCITY:
        kind, used = "velocity", _VELOCITY | {"twist"}
    else:
        kind, used = "position", _POSITION
    rest = [w for w in before if w not in used | {"field", "pose", "twist", "transform", "msg"}]
    if kind == "position" and unit is not None and unit not in LENGTHS and unit[0] != UNKNOWN:
        return None
    return Meaning(kind, axis, "_".join(rest), unit)


def _axis(word: str) -> tuple[int | None, str]:
    """Returns the axis in a word and the rest of the word: qx, vx, xdd, posx."""
    if word in _AXES:
        return _AXES[word], ""
    for stem in sorted(_POSITION | _ROTATION | _VELOCITY | _ACCELERATION | {"r"}, key=len)[::-1]:
        if word.startswith(stem) and word[len(stem) :] in _AXES:
            return _AXES[word[len(stem) :]], stem
    if len(word) in (2, 3) and word[0] in _AXES and word[1:] in ("d", "dd"):
        return _AXES[word[0]], word[1:]
    return None, ""


def joint_of(text: str) -> str | None:
    """Returns which of Pepper's joints a name means: RElbowYaw, r_elbow_yaw_joint, .../Value."""
    words = [word for word in re.split(r"[^A-Za-z0-9]+", text) if word]
    if any(word.lower() in _DERIVATIVE_WORDS | _COMMANDS for word in words):
        return None
    words = [word for word in words if word.lower() not in _MEASURED]
    joined = "".join(word.lower() for word in words)
    known = {name.lower(): name for name in (*joint_limits(), "RHand", "LHand")}
    for word in words:
        if word.lower() in known and (len(word) > 5 or word in ("RHand", "LHand")):
            tail = words[words.index(word) + 1 :]
            if not tail or tail[0].lower() in ("position", "pos", "joint", "q", "angle"):
                return known[word.lower()]
            return None
    for suffix in ("joint", "position", "pos", ""):
        name = joined.removesuffix(suffix)
        if name in known and len(name) > 5:
            return known[name]
    return None


def _split_unit(text: str) -> tuple[str, str | None]:
    """Returns a header without its unit in brackets, and the unit."""
    match = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]", text)
    if match is None:
        return text, None
    word = match.group(1).lower()
    base = re.split(r"[/*^ ]", word)[0]
    unit = _UNITS.get(word) or _UNITS.get(base)
    rest = (text[: match.start()] + text[match.end() :]).strip()
    if unit is None:
        return rest, f"{UNKNOWN}{word}" if base in _FOREIGN_UNITS else None
    return rest, unit[1]


def unit_of(word: str) -> str | None:
    """Returns the unit that a word names, None if none: `mm` of millimetres, `deg` of degrees."""
    found = _UNITS.get(word) or _UNITS.get(word.removesuffix("s"))
    return None if found is None else found[1]


def is_command(group: str) -> bool:
    """Tells whether a body's name marks its values as commanded, not measured."""
    return bool(_COMMANDS & set(group.split("_")))


def unit_words(row: Sequence[str]) -> bool:
    """Tells whether all words of a row are units, as in a second line of a header."""
    bare = [word.strip("[]() ").lower() for word in row if word.strip("[]()- ")]
    return bool(bare) and all(re.split(r"[/*^ ]", w)[0] in _UNITS for w in bare)
