"""The arm's way back to where a movement starts: the way that it was shown, backwards."""

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


class WayBack:
    """Joint angles over time from a posture back along a demonstration to its first posture.

    From where the arm is it goes straight to the nearest posture of the demonstration, then along
    some of its postures backwards (not along all: a limp elbow swings), with the speed profile of
    least jerk, s(u) = 10 u^3 - 15 u^4 + 6 u^5.

    Args:
        joints: (5,) where the arm is [rad].
        shown: (N, 5) the demonstration's joints [rad].
        speed: Of the joint that moves farthest, on average [rad/s].
        every: How many of the demonstration's samples apart the postures are.

    Attributes:
        duration: [s].
    """

    def __init__(
        self, joints: Vector, shown: Vector, *, speed: float = 1.5, every: int = 40
    ) -> None:
        nearest = int(np.argmin(np.abs(shown - joints).max(axis=1)))
        self._way = np.concatenate((joints[None], shown[nearest:0:-every], shown[:1]))
        steps = np.abs(np.diff(self._way, axis=0)).max(axis=1)
        self._lengths = np.concatenate(([0.0], np.cumsum(steps)))
        self.duration = max(float(self._lengths[-1]) / speed, 0.5)

    def at(self, time: float) -> Vector:
        """Returns the joints (5,) [rad] at a time [s]; the ends before and after it."""
        u = float(np.clip(time / self.duration, 0.0, 1.0))
        gone = self._lengths[-1] * (10 * u**3 - 15 * u**4 + 6 * u**5)
        return np.array([np.interp(gone, self._lengths, column) for column in self._way.T])
