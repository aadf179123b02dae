"""Specification of faults: which signal fails, how, when and for how long."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches

from pepper_drake.errors import InputError

AT_REACH = "reach"
"""A fault with this start begins when the arm starts."""

KINDS: dict[str, str] = {
    "off": "nothing comes any more",
    "stuck": "the value of the start comes for ever",
    "garbage": "values without meaning come: not a number, or far outside",
    "wrong": "plausible values come that are off",
    "slow": "new values come a fifth as often",
    "delayed": "values come late",
    "intermittent": "every other new value is lost, at random",
    "noisy": "values come with much noise",
}
"""The ways in which a signal fails."""


@dataclass(frozen=True)
class Signal:
    """One signal that can fail.

    Attributes:
        meaning: Description of the signal.
        period: Sampling period [s].
        slow_period: Time between values for the kind "slow" [s].
        delay: Delay for the kind "delayed" [s].
        offset: Error for the kind "wrong", in the signal's unit; for images a fraction of their
            width.
        noise: Standard deviation for the kind "noisy", in the signal's unit; for images the
            fraction of broken pixels.
        refused: Kinds that make no sense for the signal, each with the reason.
    """

    meaning: str
    period: float
    slow_period: float
    delay: float
    offset: float = 0.0
    noise: float = 0.0
    refused: dict[str, str] = field(default_factory=dict)


def _images(meaning: str, *, offset: float = 0.05, noise: float = 0.02) -> Signal:
    return Signal(meaning, 0.05, 1.0, 1.0, offset, noise)


SIGNALS: dict[str, Signal] = {
    "top": _images("the top camera's images"),
    "bottom": _images("the bottom camera's images"),
    "depth": _images("the depth camera's images"),
    "stamps": _images("the time stamps of all images", offset=1000.0, noise=0.3),
    "goal": Signal("the estimated pose of the goal object", 0.05, 0.5, 0.5, 0.1, 0.02),
    "cloud": Signal("the cloud of obstacles", 0.05, 1.0, 1.0, 0.05, 0.02),
    "encoders": Signal("the measured joint angles", 0.02, 0.1, 0.1, 0.05, 0.01),
    "commands": Signal("the joint commands before they are limited", 0.02, 0.1, 0.2, 0.2, 0.05),
    "base_pose": Signal("the base's odometry", 0.02, 0.2, 0.3, 0.05, 0.01),
    "base_command": Signal("the base's commands before they are limited", 0.02, 0.2, 0.3, 0.1, 0.1),
    "actuators": Signal(
        "what arrives of the commands at the motors",
        0.02,
        0.1,
        0.1,
        0.1,
        0.01,
        {
            "garbage": "only what the limiter lets pass gets to the motors; commands:garbage is "
            "garbage before it"
        },
    ),
    "planner": Signal(
        "the plans",
        0.05,
        1.0,
        1.0,
        0.1,
        0.0,
        {
            "stuck": "a plan is made once; planner:wrong gives a false one",
            "delayed": "a plan that comes late is planner:slow",
            "noisy": "a plan has no noise; planner:wrong gives a false one",
        },
    ),
}
"""The signals by name."""


@dataclass(frozen=True)
class Fault:
    """A fault of one signal.

    Attributes:
        signal: A name in SIGNALS.
        kind: A name in KINDS.
        start: Start time [s]; NaN for when the arm starts.
        duration: Duration [s]; may be infinite.
    """

    signal: str
    kind: str
    start: float
    duration: float = math.inf

    def __str__(self) -> str:
        start = AT_REACH if math.isnan(self.start) else f"{self.start:g}"
        lasts = "" if math.isinf(self.duration) else f"+{self.duration:g}"
        return f"{self.signal}:{self.kind}@{start}{lasts}"

    def sentence(self) -> str:
        """Describes the fault in words."""
        begin = "the arm starts" if math.isnan(self.start) else f"{self.start:g} s"
        lasts = "" if math.isinf(self.duration) else f", for {self.duration:g} s"
        return f"{SIGNALS[self.signal].meaning}: {KINDS[self.kind]}, from {begin} on{lasts}"


def parse_fault(text: str) -> Fault:
    """Parses a fault given as SIGNAL:KIND@START[+DURATION].

    START is a time [s], or "reach" for when the arm starts; DURATION is in s.

    Raises:
        InputError: The text is malformed, or the fault makes no sense.
    """
    signal, colon, rest = text.strip().partition(":")
    kind, at, when = rest.partition("@")
    if not (colon and at):
        raise InputError(
            f'the fault "{text}" is not SIGNAL:KIND@START[+DURATION], as in depth:stuck@4+2'
        )
    _check_name(text, "signal", signal, SIGNALS)
    _check_name(text, "kind", kind, KINDS)
    begin, plus, lasts = when.partition("+")
    start = math.nan if begin == AT_REACH else _seconds(text, "start", begin)
    duration = _seconds(text, "duration", lasts) if plus else math.inf
    if duration == 0.0:
        raise InputError(f'the fault "{text}" lasts for no time; leave +0 out or give a duration')
    refused = SIGNALS[signal].refused
    if kind in refused:
        raise InputError(f'the fault "{text}" makes no sense: {refused[kind]}')
    return Fault(signal, kind, start, duration)


def parse_faults(texts: Iterable[str]) -> tuple[Fault, ...]:
    """Parses several faults, at most one per signal.

    Raises:
        InputError: A fault is invalid, or two concern the same signal.
    """
    faults = tuple(parse_fault(text) for text in texts)
    for k, fault in enumerate(faults):
        for other in faults[:k]:
            if other.signal == fault.signal:
                raise InputError(
                    f"{other} and {fault} both concern {fault.signal}; give one fault for a signal"
                )
    return faults


def sensible_faults() -> list[tuple[str, str]]:
    """The pairs of signal and kind that make sense."""
    return [
        (signal, kind)
        for signal, spec in SIGNALS.items()
        for kind in KINDS
        if kind not in spec.refused
    ]


def _check_name(text: str, part: str, name: str, known: Iterable[str]) -> None:
    names = list(known)
    if name in names:
        return
    near = get_close_matches(name, names, 1)
    hint = f'did you mean "{near[0]}"?' if near else f"it must be one of {', '.join(names)}"
    raise InputError(f'the fault "{text}" has the {part} "{name}"; {hint}')


def _seconds(text: str, part: str, number: str) -> float:
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0.0):
        begin = f', or "{AT_REACH}"' if part == "start" else ""
        raise InputError(
            f'the fault "{text}" has the {part} "{number}"; it must be a time in s, zero or '
            f"more{begin}"
        )
    return value
