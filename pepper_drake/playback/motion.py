"""Recorded motion of all joints over time, with its captions."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pepper_drake.models.scene import Scene

Vector = npt.NDArray[np.float64]


def _nothing() -> Vector:
    return np.zeros((0, 3))


@dataclass(frozen=True)
class Signal:
    """A figure that changes with time.

    Attributes:
        unit: Of the values, such as "mm".
        values: (N,), one for each of the motion's times.
    """

    unit: str
    values: Vector


@dataclass(frozen=True, eq=False)
class Motion:
    """N samples of Pepper and of what moves around it. T is the torso frame, W the world.

    Attributes:
        name: What it is called beside others.
        arm: The arm that moves, "left" or "right".
        times: (N,) increasing [s].
        positions: Of joints by name, (N,) each [rad, m]; objects that move have joints, too. A
            joint that is left out rests where the scene, or else the posture "stand", has it.
        hands: Openings by the names of `HANDS`, (N,) each, from 0, closed, to 1, open.
        scene: What is around Pepper, if anything.
        arm_starts: When the arm starts [s].
        hand_T: (N, 3) the hand's path where no joints tell it.
        hand_rotations_T: (N, 4) unit quaternions w, x, y, z that go with `hand_T`.
        shown_T: (M, 3) the hand's demonstrated path.
        cloud_T: (P, 3) the obstacles as they were seen when the arm started.
        stages: What the robot was doing, by the time from which on.
        signals: Figures over time, by name.
        figures: What the motion came to: a text or a number by what it is and its unit.
    """

    name: str
    arm: str
    times: Vector
    positions: Mapping[str, Vector] = field(default_factory=dict)
    hands: Mapping[str, Vector] = field(default_factory=dict)
    scene: Scene | None = None
    arm_starts: float = 0.0
    hand_T: Vector | None = None
    hand_rotations_T: Vector | None = None
    shown_T: Vector = field(default_factory=_nothing)
    cloud_T: Vector = field(default_factory=_nothing)
    stages: tuple[tuple[float, str], ...] = ()
    signals: Mapping[str, Signal] = field(default_factory=dict)
    figures: Mapping[str, str | float] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.times[-1] - self.times[0])
