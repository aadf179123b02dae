"""Recorded motion of all joints over time, with stages, signals and figures."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pepper_drake.models.scene import Scene

Vector = npt.NDArray[np.float64]


def _no_points() -> Vector:
    return np.zeros((0, 3))


@dataclass(frozen=True)
class Signal:
    """A quantity over time.

    Attributes:
        unit: Unit of the values, such as "mm".
        values: (N,), one for each of the motion's times.
    """

    unit: str
    values: Vector


@dataclass(frozen=True, eq=False)
class Motion:
    """N samples of Pepper and of moving objects. T is the torso frame, W the world.

    Attributes:
        name: Name for display.
        arm: The arm that moves, "left" or "right".
        times: (N,) increasing [s].
        positions: Joint positions by name, (N,) each [rad, m], including joints of moving objects.
            Missing joints keep their position in the scene, or else in the posture "stand".
        hands: Openings by the names of `HANDS`, (N,) each, from 0, closed, to 1, open.
        scene: The scene around Pepper, if any.
        arm_starts: Time at which the arm starts [s].
        hand_T: (N, 3) the hand's path, if the joints are unknown.
        hand_rotations_T: (N, 4) unit quaternions w, x, y, z of the hand, as for `hand_T`.
        shown_T: (M, 3) the hand's demonstrated path.
        cloud_T: (P, 3) the perceived obstacle cloud when the arm started.
        stages: Start time and name of each stage of the run.
        signals: Quantities over time, by name.
        figures: Results, a text or a number each, by name and unit.
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
    shown_T: Vector = field(default_factory=_no_points)
    cloud_T: Vector = field(default_factory=_no_points)
    stages: tuple[tuple[float, str], ...] = ()
    signals: Mapping[str, Signal] = field(default_factory=dict)
    figures: Mapping[str, str | float] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.times[-1] - self.times[0])
