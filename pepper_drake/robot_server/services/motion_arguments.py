"""Conversion of ALMotion's forms of names, angles and times to one.

A name is a joint, a chain or "Body"; names are one of these or a list of them. Values are one
number for all joints, one for each, or a list for each. Errors are ValueErrors with a sentence.
"""

import math
from collections.abc import Sequence
from typing import Any

from pepper_drake.naoqi.constants import BODY, GROUPS, WHEELS
from pepper_drake.robot_server.robot.time_laws import BezierKey, Handle

LONGEST_MOTION = 3600.0
"""Longest motion along timed keys [s]: its path is computed as a whole when it starts."""


def joint_names(names: Any) -> list[str]:
    """Returns the joints and wheels of names, in order.

    Raises:
        ValueError: There is no such joint or chain.
    """
    found: list[str] = []
    for name in [names] if isinstance(names, str) else _as_list(names, "names"):
        if not isinstance(name, str):
            raise ValueError(f"names must be text, not {_brief(name)}")
        if name in GROUPS:
            found.extend(GROUPS[name])
        elif name in BODY:
            found.append(name)
        else:
            raise ValueError(f"there is no joint or chain {name!r}")
    return found


def one_each(names: Any, values: Any, what: str) -> dict[str, float]:
    """Returns one number for each joint, wheels left out.

    Args:
        names: Names in ALMotion's forms.
        values: One number for all, or one for each joint; for "Body" with or without the wheels.
        what: What the values are, for the error.

    Returns:
        Number by joint.

    Raises:
        ValueError: A name is unknown, a value is not a number, or their number is wrong.
    """
    joints = joint_names(names)
    if _is_number(values):
        numbers = [number(values, what)] * len(joints)
    else:
        numbers = [
            number(v[0] if isinstance(v, Sequence) and len(v) == 1 else v, what)
            for v in _as_list(values, what)
        ]
        if len(numbers) == 1 and len(joints) != 1 and isinstance(names, str):
            numbers *= len(joints)
    joints = _without_wheels(joints, len(numbers))
    if len(joints) != len(numbers):
        raise ValueError(f"{len(joints)} joints, but {len(numbers)} {what}")
    return {
        joint: value for joint, value in zip(joints, numbers, strict=True) if joint not in WHEELS
    }


def one_for_each_chain(names: Any, values: Any) -> Any:
    """Expands values given for each of several chains to values for `one_each`."""
    if not (isinstance(names, list | tuple) and isinstance(values, list | tuple)):
        return values
    if len(names) != len(values):
        return values
    return [v for name, v in zip(names, values, strict=True) for _ in joint_names(name)]


def lists_each(
    names: Any, values: Any, times: Any, what: str
) -> dict[str, tuple[list[float], list[float]]]:
    """Returns the timed keys of each joint, wheels left out.

    Args:
        names: Names in ALMotion's forms.
        values: A number for all; the keys of one joint; a number or a list for each of several.
        times: Likewise, from now, increasing [s].
        what: What the values are, for the error.

    Returns:
        Times [s] and values by joint.

    Raises:
        ValueError: A name is unknown or the lists do not fit.
    """
    joints = joint_names(names)
    joints = _without_wheels(joints, len(values) if isinstance(values, Sequence) else len(joints))
    keys = _nested(values, len(joints), what)
    when = _nested(times, len(joints), "times")
    result = {}
    for joint, xs, ts in zip(joints, keys, when, strict=True):
        if len(xs) != len(ts):
            raise ValueError(f"{joint} has {len(xs)} {what}, but {len(ts)} times")
        check_times(joint, ts)
        if joint not in WHEELS:
            result[joint] = (ts, xs)
    return result


def bezier_keys(
    names: Any, times: Any, controls: Any
) -> dict[str, tuple[list[float], list[BezierKey]]]:
    """Returns the timed keys of `angleInterpolationBezier` by joint.

    Each key is an angle, or an angle with one or two handles `[type, time, angle]`.

    Raises:
        ValueError: A name is unknown or the lists do not fit.
    """
    joints = joint_names(names)
    when = _nested(times, len(joints), "times")
    lists = _as_list(controls, "control points")
    if len(lists) != len(joints):
        raise ValueError(f"{len(joints)} joints, but {len(lists)} lists of control points")
    result = {}
    for joint, ts, points in zip(joints, when, lists, strict=True):
        keys = [_bezier_key(point) for point in _as_list(points, "control points")]
        if len(keys) != len(ts):
            raise ValueError(f"{joint} has {len(keys)} control points, but {len(ts)} times")
        check_times(joint, ts)
        if joint not in WHEELS:
            result[joint] = (ts, keys)
    return result


def fraction(value: Any) -> float:
    """Returns a fraction of the largest speed.

    Raises:
        ValueError: It is not between 0 and 1.
    """
    share = number(value, "fraction")
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"the fraction of the largest speed is {share:g}; it must be in [0, 1]")
    return share


def number(value: Any, what: str) -> float:
    """Returns a finite number.

    Raises:
        ValueError: It is not a finite number.
    """
    if not _is_number(value) or not math.isfinite(value):
        raise ValueError(f"{what} must be finite numbers, not {_brief(value)}")
    return float(value)


def numbers(values: Any, count: int, what: str) -> list[float]:
    """Returns a list of finite numbers of a length.

    Raises:
        ValueError: It is not such a list.
    """
    result = [number(value, what) for value in _as_list(values, what)]
    if len(result) != count:
        raise ValueError(f"{what} must be {count} numbers, not {len(result)}")
    return result


def settings(config: Any) -> dict[str, float]:
    """Returns a configuration `[[key, value], ...]` as numbers by key.

    Keys of other robots are included, and ignored by the reader.

    Raises:
        ValueError: It is not a list of pairs.
    """
    found = {}
    for pair in _as_list(config, "the configuration"):
        if not isinstance(pair, Sequence) or len(pair) != 2 or not isinstance(pair[0], str):
            raise ValueError(f"the configuration has {_brief(pair)}, not [key, value]")
        found[pair[0]] = number(pair[1], pair[0])
    return found


def check_times(joint: str, times: Sequence[float]) -> None:
    """Raises ValueError unless times [s] are positive, increase, and end within an hour."""
    if any(b <= a for a, b in zip([0.0, *times], times, strict=False)):
        raise ValueError(f"the times of {joint} must be above 0 and increase")
    if times and times[-1] > LONGEST_MOTION:
        raise ValueError(
            f"the motion of {joint} takes {times[-1]:g} s, but at most {LONGEST_MOTION:g}; are the"
            " times seconds?"
        )


def _bezier_key(point: Any) -> BezierKey:
    if _is_number(point):
        return number(point, "control points"), None, None
    parts = _as_list(point, "control points")
    if not 1 <= len(parts) <= 3:
        raise ValueError(f"a control point is [angle, handle, handle], not {_brief(point)}")
    handles: list[Handle | None] = []
    for part in parts[1:]:
        kind, dt, dx = numbers(part, 3, "handles")
        handles.append((int(kind), dt, dx))
    handles += [None] * (2 - len(handles))
    return number(parts[0], "control points"), handles[0], handles[1]


def _nested(values: Any, count: int, what: str) -> list[list[float]]:
    if _is_number(values):
        return [[number(values, what)]] * count
    items = _as_list(values, what)
    if not items:
        raise ValueError(f"{what} are empty")
    if all(_is_number(item) for item in items):
        if count == 1:
            return [[number(item, what) for item in items]]
        if len(items) == 1:
            return [[number(items[0], what)]] * count
        lists = [[item] for item in items]
    else:
        lists = [[item] if _is_number(item) else _as_list(item, what) for item in items]
    if len(lists) != count:
        raise ValueError(f"{count} joints, but {len(lists)} {what}")
    if not all(lists):
        raise ValueError(f"{what} of a joint are empty")
    return [[number(value, what) for value in values] for values in lists]


def _without_wheels(joints: list[str], count: int) -> list[str]:
    """Leaves the wheels out if there are values for the joints alone."""
    positioned = [joint for joint in joints if joint not in WHEELS]
    return positioned if count == len(positioned) else joints


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float)


def _as_list(value: Any, what: str) -> list[Any]:
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise ValueError(f"{what} must be a list, not {_brief(value)}")
    return list(value)


def _brief(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
