"""Phase stopping: a movement slows down when the hand is held or pushed.

Ijspeert et al. 2013, section 2.4, doi:10.1162/NECO_a_00393: with y the primitive's desired position
and y_a the hand's actual one,

    e' = alpha_e (y_a - y - e),   slowdown = k_c |e|²,   C_t = k_t e.

The slowdown makes the phase wait for the hand; C_t moves the desired position along, so that it
does not run away from a hand that is held, and nothing jumps when the hand is released.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(unsafe_hash=True)
class PhaseStopping:
    """Constants of phase stopping.

    With the defaults and the spring of a primitive, alpha_z beta_z = 156, a hand held 3 cm off
    moves the desired position by 3 cm * 300 / 156 = 6 cm, and slows the phase to a tenth.
    """

    rate: float = 15.0
    """alpha_e, rate of the low-pass filter of the error [1/s]."""
    slowdown_gain: float = 3e3
    """k_c, gain of the slowdown [1/m²]."""
    coupling_gain: float = 300.0
    """k_t, gain of the coupling term."""
    dead_zone: float = 0.005
    """Dead zone of the error [m]: the tracking error of a compliant arm that nothing pushes."""

    def error_after(self, error: Array, deviation: Array, time_step: float) -> Array:
        """Returns the filtered error e (3,) [m] one step later, with the deviation held.

        Args:
            error: (3,) current e [m].
            deviation: (3,) y_a - y [m], before the dead zone.
            time_step: [s].
        """
        length = float(np.linalg.norm(deviation))
        share = max(0.0, length - self.dead_zone) / length if length > 0.0 else 0.0
        return error + (1.0 - np.exp(-self.rate * time_step)) * (share * deviation - error)

    def slowdown(self, error: Array) -> float:
        """Returns how much slower the phase runs: its rate is divided by one plus this."""
        return float(self.slowdown_gain * (error @ error))

    def coupling(self, error: Array) -> Array:
        """Returns C_t (3,) [m]."""
        return self.coupling_gain * error
