"""Timelines of Choregraphe: behavior.xar and .xml, and exported Python."""

import ast
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.importers.headers import joint_of
from pepper_drake.learning.demonstrations.importers.track import Track

Array = npt.NDArray[np.float64]

RATE = 50.0
"""Rate [Hz] at which a timeline is sampled: ALMotion's own."""

_LONGEST = 3600.0
_MOST_KEYS = 100_000
_LONGEST_TEXT = 10_000_000


@dataclass(frozen=True)
class _Curve:
    """Keys of one joint: times [s], values, and (K, 2, 2) handles (left, right: time, value)."""

    joint: str
    times: Array
    values: Array
    handles: Array | None


def read_timeline(path: Path, text: str) -> list[Track]:
    """Reads the timelines of a behavior (XML); each is a joint track in degrees.

    Raises:
        InputError: It is not XML, or has no timeline with keys of joints.
    """
    if "<!ENTITY" in text or "<!DOCTYPE" in text:
        raise InputError(f"{path}: XML with entities is not read; export the timeline again")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: not valid XML ({error})") from None
    tracks: list[Track] = []
    for timeline in root.iter():
        if _local(timeline) != "Timeline":
            continue
        fps = _number(timeline, "fps", path, 25.0)
        if not 0.0 < fps < 1e4:
            raise InputError(f"{path}: a timeline of {fps:g} frames a second; correct fps")
        elements = list(_outer_curves(timeline))
        curves = [read for curve in elements if (read := _curve(curve, fps, path)) is not None]
        if curves:
            number = len(tracks) + 1
            name = path.stem if number == 1 else f"{path.stem}_{number}"
            last = _number(timeline, "end_frame", path, -1.0)
            track = _track(
                path,
                name,
                "Choregraphe timeline",
                curves,
                "deg",
                last / fps if last > 0.0 else None,
            )
            models = {e.get("model", "") for e in timeline if _local(e) == "ActuatorList"}
            if "nao" in models:
                note = "made for NAO, whose arms are shorter: Pepper's hand goes elsewhere"
                track = replace(track, notes=(*track.notes, note))
            tracks.append(track)
    if not tracks:
        raise InputError(f"{path}: XML without a timeline of Choregraphe that has keys of joints")
    return tracks


def _outer_curves(timeline: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """Yields the curves of a timeline, not those of a timeline nested in it."""
    waiting = list(timeline)[::-1]
    while waiting:
        element = waiting.pop()
        if _local(element) == "ActuatorCurve":
            yield element
        elif _local(element) != "Timeline":
            waiting += list(element)[::-1]


def is_exported_python(text: str) -> bool:
    """Tells whether a text is the output of Choregraphe's *Export motion to clipboard*."""
    return "names.append(" in text and "keys.append(" in text and "times.append(" in text


def read_exported_python(path: Path, text: str) -> list[Track]:
    """Reads the lists `names`, `times` and `keys` of exported Python, without running it.

    Each new list `names` begins a motion of its own; triple-quoted strings are skipped.

    Raises:
        InputError: The text is not such Python, or its lists do not match.
    """
    code = _STRINGS.sub(lambda match: "\n" * match[0].count("\n"), text)
    starts = [match.start() for match in _NEW_LISTS.finditer(code)]
    parts = [code[a:b] for a, b in pairwise((*starts, len(code)))] if starts else [code]
    first = [code.count("\n", 0, start) for start in starts] or [0]
    functions = [(m.start(), m[1]) for m in re.finditer(r"^[ \t]*def (\w+)", code, re.MULTILINE)]
    found = []
    for part, start, line in zip(parts, starts or [0], first, strict=True):
        curves = _exported_curves(path, part, line)
        within = [name for place, name in functions if place < start]
        if curves:
            found.append((within[-1] if within else "", curves))
    if not found:
        raise InputError(f"{path}: no joint of Pepper among the names")
    tracks: list[Track] = []
    for number, (function, curves) in enumerate(found, start=1):
        name = path.stem if len(found) == 1 else f"{path.stem}_{function or number}"
        if name in [track.name for track in tracks]:
            name = f"{name}_{number}"
        tracks.append(_track(path, name, "Choregraphe's exported Python", curves, "rad"))
    return tracks


_STRINGS = re.compile(r"\"\"\".*?\"\"\"|\'\'\'.*?\'\'\'", re.DOTALL)
_NEW_LISTS = re.compile(r"^[ \t]*names[ \t]*=[ \t]*(?:list\(\)|\[\])", re.MULTILINE)


def _exported_curves(path: Path, text: str, before: int) -> list[_Curve]:
    """Returns the curves of one motion that starts after `before` lines of the file."""
    lists: dict[str, list[Any]] = {"names": [], "times": [], "keys": []}
    for number, name, argument in _appended(path, text, before):
        try:
            lists[name].append((number, ast.literal_eval(argument)))
        except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
            raise InputError(
                f"{path}, line {number}: what is appended to {name} is not a list of numbers or a"
                " name; write numbers out"
            ) from None
    ordered = {
        key: [v for _, v in sorted(values, key=lambda e: e[0])] for key, values in lists.items()
    }
    names, times, keys = ordered["names"], ordered["times"], ordered["keys"]
    if not names and not times and not keys:
        return []
    if not len(names) == len(times) == len(keys):
        raise InputError(
            f"{path}: {len(names)} names, {len(times)} lists of times and {len(keys)} of keys;"
            " there must be one of each for each joint"
        )
    _check_order(path, lists)
    curves: list[_Curve] = []
    for name, when, what in zip(names, times, keys, strict=True):
        joint = joint_of(name) if isinstance(name, str) else None
        if joint is None:
            continue
        if joint in [curve.joint for curve in curves]:
            raise InputError(
                f"{path}: {joint} is appended twice, so two motions are in one list; put each into"
                " a file of its own"
            )
        try:
            bezier = isinstance(what[0], Sequence)
            at = np.array(when, dtype=float)
            values = np.array([key[0] if bezier else key for key in what], dtype=float)
            handles = None
            if bezier:
                handles = np.array([[key[1][1:3], key[2][1:3]] for key in what], dtype=float)
        except (TypeError, ValueError, IndexError, KeyError, OverflowError):
            raise InputError(f"{path}: the keys of {joint} are not numbers") from None
        curves.append(_checked(_Curve(joint, at, values, handles), path))
    return curves


def _appended(path: Path, text: str, before: int) -> Iterator[tuple[int, str, str]]:
    """Yields line, list and argument of each append; the other lines may be Python 2."""
    lines = text.split("\n")
    for k, line in enumerate(lines):
        match = re.match(r"\s*(names|times|keys)\.append\((.*)", line)
        if match is None:
            continue
        argument, end = match[2], k
        while argument.count("(") >= argument.count(")"):
            end += 1
            if end == len(lines) or len(argument) > _LONGEST_TEXT:
                raise InputError(
                    f"{path}, line {before + k + 1}: the bracket of {match[1]} is not closed"
                )
            argument += lines[end]
        yield before + k + 1, match[1], argument.strip().rstrip(";").strip()[:-1].strip()


def _check_order(path: Path, lists: dict[str, list[Any]]) -> None:
    """Refuses names, times and keys in an order that does not tell which belong together."""
    order = [key for _, key in sorted((line, key) for key, v in lists.items() for line, _ in v)]
    count = len(lists["names"])
    rows, columns = ["names", "times", "keys"] * count, []
    for key in ("names", "times", "keys"):
        columns += [key] * count
    if order not in (rows, columns):
        raise InputError(
            f"{path}: names, times and keys are not appended in turn; export the timeline again"
        )


def _curve(element: ElementTree.Element, fps: float, path: Path) -> _Curve | None:
    joint = joint_of(element.get("actuator", ""))
    if joint is None or joint.endswith("Hand") or element.get("mute") == "1":
        return None
    keys = [child for child in element if _local(child) == "Key"]
    if not keys:
        return None
    times = np.array([_number(key, "frame", path) for key in keys]) / fps
    values = np.array([_number(key, "value", path) for key in keys])
    handles = np.zeros((len(keys), 2, 2))
    smooth = False
    for k, key in enumerate(keys):
        for tangent in key:
            if _local(tangent) == "Tangent" and tangent.get("interpType", "bezier") == "bezier":
                side = 0 if tangent.get("side") == "left" else 1
                handles[k, side] = (
                    _number(tangent, "abscissaParam", path, 0.0) / fps,
                    _number(tangent, "ordinateParam", path, 0.0),
                )
                smooth = True
    return _checked(_Curve(joint, times, values, handles if smooth else None), path)


def _checked(curve: _Curve, path: Path) -> _Curve:
    parts = [curve.times, curve.values, *([] if curve.handles is None else [curve.handles])]
    shape = curve.times.shape
    if curve.values.shape != shape or len(shape) != 1 or not 0 < shape[0] < _MOST_KEYS:
        raise InputError(f"{path}: the times and keys of {curve.joint} do not belong together")
    if curve.handles is not None and curve.handles.shape != (*shape, 2, 2):
        raise InputError(f"{path}: the tangents of {curve.joint} do not belong to its keys")
    if not all(np.isfinite(part).all() and np.abs(part).max() < 1e6 for part in parts):
        raise InputError(
            f"{path}: a key of {curve.joint} is not a finite number of a sensible size"
        )
    if np.any(np.diff(curve.times) <= 0.0) or curve.times[0] < 0.0:
        raise InputError(f"{path}: the keys of {curve.joint} are not in order of time")
    if curve.times[-1] > _LONGEST:
        raise InputError(
            f"{path}: {curve.joint} has a key at {curve.times[-1]:g} s; an hour at most"
        )
    return curve


def _track(
    path: Path, name: str, kind: str, curves: list[_Curve], unit: str, last: float | None = None
) -> Track:
    """Returns the curves sampled at `RATE`, to their end or the timeline's, `last` [s]."""
    arms = [c for c in curves if c.joint[1:].startswith(("Shoulder", "Elbow", "Wrist"))] or curves
    twice = {c.joint for i, c in enumerate(arms) if c.joint in [d.joint for d in arms[:i]]}
    if twice:
        raise InputError(
            f"{path}: {sorted(twice)[0]} has two curves in one timeline; remove one of them"
        )
    # Before its first key a joint moves there from the robot's posture, which is unknown.
    start = min(curve.times[0] for curve in arms)
    end = max(curve.times[-1] for curve in arms)
    end = end if last is None else max(start, min(end, last))
    late = [c.joint for c in arms if len(c.times) > 1 and c.times[0] > start + 1.0 / RATE]
    count = round((end - start) * RATE) + 1
    times = start + np.arange(count) / RATE
    joints = np.column_stack([_evaluate(curve, times) for curve in arms])
    keys = sum(len(curve.times) for curve in arms)
    notes = [
        f"{keys} keys of {len(arms)} joints, taken {RATE:g} times a second from {start:g} s"
        f" to {end:g} s"
    ]
    if late:
        notes.append(f"held at the first key, which comes later: {', '.join(late)}")
    return Track(
        path,
        name,
        kind,
        times - start,
        joints=joints,
        joint_names=tuple(curve.joint for curve in arms),
        joint_unit=unit,
        time_unit="s",
        notes=tuple(notes),
    )


def _evaluate(curve: _Curve, at: Array) -> Array:
    """Returns a curve's values: cubic Bezier segments between its keys, held beyond them."""
    times, values = curve.times, curve.values
    if len(times) == 1:
        return np.full(len(at), values[0])
    clipped = np.clip(at, times[0], times[-1])
    k = np.clip(np.searchsorted(times, clipped, side="right") - 1, 0, len(times) - 2)
    width = times[k + 1] - times[k]
    handles = _smooth_handles(times, values) if curve.handles is None else curve.handles
    t1 = np.clip(handles[k, 1, 0], 0.0, width)
    t2 = width + np.clip(handles[k + 1, 0, 0], -width, 0.0)
    local = clipped - times[k]
    low, high = np.zeros(len(at)), np.ones(len(at))
    for _ in range(50):  # Time is monotone in the parameter: bisection.
        u = 0.5 * (low + high)
        late = 3 * (1 - u) ** 2 * u * t1 + 3 * (1 - u) * u**2 * t2 + u**3 * width > local
        low, high = np.where(late, low, u), np.where(late, u, high)
    u = 0.5 * (low + high)
    v0, v3 = values[k], values[k + 1]
    v1, v2 = v0 + handles[k, 1, 1], v3 + handles[k + 1, 0, 1]
    return np.asarray(
        (1 - u) ** 3 * v0 + 3 * (1 - u) ** 2 * u * v1 + 3 * (1 - u) * u**2 * v2 + u**3 * v3
    )


def _smooth_handles(times: Array, values: Array) -> Array:
    """Returns handles of keys without tangents: PCHIP slopes, which do not overshoot."""
    from scipy.interpolate import PchipInterpolator

    slopes = np.asarray(PchipInterpolator(times, values).derivative()(times))
    slopes[[0, -1]] = 0.0
    third = np.diff(times) / 3.0
    left, right = np.append(0.0, third), np.append(third, 0.0)
    return np.stack(
        (np.stack((-left, -left * slopes), axis=1), np.stack((right, right * slopes), axis=1)),
        axis=1,
    )


def _number(
    element: ElementTree.Element, attribute: str, path: Path, default: float | None = None
) -> float:
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        return float(text or "")
    except ValueError:
        raise InputError(
            f"{path}: {attribute} of a {_local(element)} is {str(text)[:40]!r}, not a number"
        ) from None


def _local(element: ElementTree.Element) -> str:
    return str(element.tag).rpartition("}")[2]
