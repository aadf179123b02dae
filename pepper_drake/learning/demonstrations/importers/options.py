"""Import options: what a recording's file does not state."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.short_repr import short_repr, short_signature

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
"""Units of length, in metres."""

ANGLES = {"rad": 1.0, "deg": np.pi / 180.0}
"""Units of angle, in radians."""

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "day": 86400.0}
"""Units of time, in seconds."""

QUATERNIONS = ("wxyz", "xyzw")

FRAMES = ("torso", "base_footprint")

_CHOICES: dict[str, tuple[str, ...]] = {
    "unit": tuple(LENGTHS),
    "angle": tuple(ANGLES),
    "time": tuple(TIMES),
    "quaternion": QUATERNIONS,
    "frame": FRAMES,
    "arm": ("left", "right"),
    "up": ("y", "z"),
}


@dataclass(frozen=True)
class ImportOptions:
    """Options given by the user; None leaves it to the file.

    Attributes:
        unit: Of lengths: m, cm, mm, um, in or ft.
        angle: Of angles: rad or deg.
        time: Of the time column: s, ms, us, ns, min, h or day.
        quaternion: Order of its four columns: wxyz or xyzw.
        frame: Frame of the positions: torso, or base_footprint (Pepper upright).
        arm: Which arm moves: left or right.
        up: Axis of the recording that points up: z, or y as in motion capture; y becomes z,
            and z becomes -y.
        plane: Pose of the plane on which a two-dimensional path lies, in T: x, y, z [m], roll,
            pitch, yaw [rad]. The path's coordinates are along the plane's x and y axes.
        start: (3,) where the motion starts in T [m]; the whole motion is shifted there.
        rate: Sampling rate [Hz]; replaces the file's times.
        track: Name or number (from 1) of the motion, where a file holds several.
        drop_outliers: Leave out single samples that jump away and back, instead of refusing them.
        clip_joints: Clip joints up to 0.5 rad beyond Pepper's limits, as ALMotion does, instead of
            refusing them.
    """

    unit: str | None = None
    angle: str | None = None
    time: str | None = None
    quaternion: str | None = None
    frame: str | None = None
    arm: str | None = None
    up: str | None = None
    plane: tuple[float, ...] | None = None
    start: tuple[float, ...] | None = None
    rate: float | None = None
    track: str | None = None
    drop_outliers: bool = False
    clip_joints: bool = False

    __repr__ = short_repr
    __signature__ = short_signature

    def __post_init__(self) -> None:
        """Refuses unknown choices and malformed numbers."""
        for name, choices in _CHOICES.items():
            value = getattr(self, name)
            if value is not None and value not in choices:
                raise InputError(f"{name}: {value!r} is unknown; use one of {', '.join(choices)}")
        for name, size in (("plane", 6), ("start", 3)):
            value = getattr(self, name)
            if value is not None and (np.shape(value) != (size,) or not np.isfinite(value).all()):
                raise InputError(f"{name}: {value!r} must be {size} finite numbers")
        if self.rate is not None and not 0.0 < self.rate < 1e6:
            raise InputError(f"rate: {self.rate} Hz; give the samples a second, above 0")

    @classmethod
    def of(cls, **said: Any) -> Self:
        """Makes options of keywords.

        Raises:
            InputError: A keyword is unknown, or its value is.
        """
        names = [field.name for field in fields(cls)]
        for name in said:
            if name not in names:
                raise InputError(f"{name}: no such option; use some of {', '.join(names)}")
        return cls(**said)
