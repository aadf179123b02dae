"""Units, quaternion order and frame stated in a table's comments."""

import re
from collections.abc import Iterable
from dataclasses import replace

from pepper_drake.learning.demonstrations.importers.headers import unit_of
from pepper_drake.learning.demonstrations.importers.options import ANGLES, LENGTHS, TIMES
from pepper_drake.learning.demonstrations.importers.track import Track

_LINK = r"\W{0,3}(?:(?:are|is|in|units?|of)\W+){0,3}"
_LENGTHS = re.compile(
    r"\b(?:units?|lengths?|positions?|coordinates?|translations?|distances?|xyz|x,? ?y,? ?z)\b"
    + _LINK
    + r"(mm|millimet(?:er|re)s?|cm|centimet(?:er|re)s?|m|met(?:er|re)s?|inch(?:es)?|feet|ft)\b"
)
_ANGLES = re.compile(
    r"\b(?:units?|angles?|joints?|joint angles|orientations?|euler|rpy|roll,? pitch,? yaw)\b"
    + _LINK
    + r"(deg|degrees?|rad|radians?)\b"
)
_TIMES = re.compile(
    r"\b(?:times?|timestamps?|stamps?)\b"
    + _LINK
    + r"(s|sec|seconds?|ms|msec|milliseconds?|us|microseconds?|ns|nanoseconds?|minutes|hours)\b"
)
_ORDER = re.compile(r"\bquat\w*\b.*?\b(w\W*x\W*y\W*z|x\W*y\W*z\W*w)\b")
_FRAME = re.compile(r"\bframe(?:_id)?\s*[:=]\s*['\"/]*([A-Za-z]\w*)")


def with_comments(tracks: list[Track], comments: Iterable[tuple[int, str]]) -> list[Track]:
    """Returns tracks with units, order and frame from comments where the columns' names give none.

    Contradictory comments are ignored.
    """
    lower = [text.lower() for _, text in comments]
    unit = _only(unit_of(m[1]) for text in lower for m in _LENGTHS.finditer(text))
    angle = _only(unit_of(m[1]) for text in lower for m in _ANGLES.finditer(text))
    time = _only(unit_of(m[1]) for text in lower for m in _TIMES.finditer(text))
    order = _only(re.sub(r"\W", "", m[1]) for text in lower for m in _ORDER.finditer(text))
    frame = _only(m[1] for text in lower for m in _FRAME.finditer(text))
    return [
        replace(
            track,
            unit=track.unit or (unit if unit in LENGTHS else None),
            angle_unit=track.angle_unit or (angle if angle in ANGLES else None),
            joint_unit=track.joint_unit or (angle if angle in ANGLES else None),
            time_unit=track.time_unit or (time if time in TIMES else None),
            quaternion=track.quaternion or (None if track.rotations is None else order),
            frame=track.frame or frame,
        )
        for track in tracks
    ]


def _only(found: Iterable[str | None]) -> str | None:
    """Returns the value on which all agree, or None."""
    values = set(found)
    return values.pop() if len(values) == 1 else None
