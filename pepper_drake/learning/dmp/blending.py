"""Quintic corrections near the ends of a movement, and their duration."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_KEPT = 0.0015
"""Largest mean distance over a movement (equation 4.1) between the corrected and the learned path
[m]; the correction is shortened to stay below it, ..."""

LEAST_ACCELERATION = 2.0
"""... as long as that takes no more acceleration than this, or than the movement's own largest
[m/s²]. Then the distance is exceeded: a movement demonstrated to end at 1 m/s that must stop leaves
its path by 15 mm."""

_SHARES = np.array([1.0, 0.85, 0.7, 0.6, 0.5, 0.4, 0.3, 0.25])
"""Shares of the longest duration that are tried."""

# 1 - 10 u^3 + 15 u^4 - 6 u^5 and so on: the Hermite basis of the fifth degree.
_HERMITE = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    ]
)
_QUINTICS = tuple(
    np.pad(np.polynomial.polynomial.polyder(_HERMITE, order, axis=1), ((0, 0), (0, order)))
    for order in range(3)
)
"""Coefficients of the basis, and of its first and second derivatives."""


def from_end(u: Array, wanted: Array) -> Array:
    """Returns (3, N, D): quintics of u with given value, slope and curvature at 0, none at 1.

    Value, first and second derivative by u; zero beyond u = 1.
    """
    powers = (u < 1.0)[:, None] * u[:, None] ** np.arange(6)
    return np.stack([powers @ (rows.T @ wanted) for rows in _QUINTICS])


def powers(width: float) -> Array:
    """Returns factors (3, 1) that turn derivatives by time into those by time / width."""
    return np.array([[1.0], [width], [width * width]])


def blend_width(wanted: Array, tau: float, longest: float, most: float) -> float:
    """Returns the duration of an end's correction [s], the longest that keeps the movement's shape.

    The mean of a quintic of `from_end` is 1/2, 1/10 and 1/120 of its initial value, slope and
    curvature; its second derivative is at most 5.78 and 3.95 times the first two.

    Args:
        wanted: (3, D) initial value, velocity and acceleration of the correction.
        tau: The movement's duration [s].
        longest: Upper bound [s].
        most: Largest acceleration of the correction [m/s²].
    """
    offset, slope, curve = np.sqrt(np.sum(wanted * wanted, axis=1))
    widths = longest * _SHARES
    moved = widths / tau * (offset / 2 + slope * widths / 10 + curve * widths**2 / 120)
    gentle = 5.78 * offset / widths**2 + 3.95 * slope / widths <= most
    good = gentle & (moved <= _KEPT)
    if good.any():
        return float(widths[np.argmax(good)])
    return float(widths[gentle].min()) if gentle.any() else longest
