"""Conditioning of samples before learning: noise filtered, gaps filled.

Recordings of this program are low-pass filtered when they are made. Others get the same filter when
their noise would show in the accelerations, with a cut-off chosen by the noise.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator, make_interp_spline

if TYPE_CHECKING:
    from pepper_drake.learning.demonstrations.demonstration import Demonstration

Array = npt.NDArray[np.float64]

HIGHEST_CUTOFF, LOWEST_CUTOFF = 10.0, 2.0
"""Cut-off frequencies [Hz] between which the filter is chosen."""

QUIET = 0.3
"""Standard deviation of the acceleration [m/s²] that noise may cause after filtering."""

LOUD = 0.1
"""Standard deviation of the acceleration [m/s²] up to which samples are left unfiltered."""

LEVER = 0.1
"""Lever arm [m/rad] that converts rotations to lengths."""

BOUND, BOUND_SHARE = 0.02, 0.25
"""Between two samples the path may leave the straight line between them by this distance [m], or
this share of the samples' distance: no motion is invented."""

CAREFUL = "shape-preserving cubic (PCHIP)"
"""Name of the interpolation of few or uneven samples."""

_FOURTH = 70.0
"""Variance of the fourth difference of white noise of variance one."""


@dataclass(frozen=True)
class Noise:
    """White noise of samples.

    Attributes:
        deviation: Standard deviation in each coordinate [m].
        acceleration: Standard deviation of the samples' second derivatives that it causes [m/s²].
    """

    deviation: float
    acceleration: float


def measure_noise(times: Array, values: Array) -> Noise:
    """Returns the white noise of samples (N, D); none where it cannot be told from motion.

    Fourth differences of a smooth motion are small and vary slowly; those of noise change sign from
    sample to sample (their correlation is -0.8). The median makes single outliers harmless.
    """
    if len(times) < 12:
        return Noise(0.0, 0.0)
    step = float(np.median(np.diff(times)))
    even = np.abs(np.diff(times) - step) < 0.5 * step
    fourth = np.diff(values, 4, axis=0)
    whole = np.convolve(even, np.ones(4), "valid") == 4
    fourth = fourth[whole]
    if len(fourth) < 8:
        return Noise(0.0, 0.0)
    size = np.median(np.abs(fourth), axis=0)
    kept = np.clip(fourth, -5.0 * size, 5.0 * size)
    power = np.sum(kept[1:-1] ** 2)
    correlation = np.sum(kept[:-2] * kept[1:-1]) / power if power > 0.0 else 0.0
    if correlation > -0.5:
        return Noise(0.0, 0.0)
    deviation = float(np.sqrt(np.mean((size / 0.6745) ** 2) / _FOURTH))
    return Noise(deviation, deviation * np.sqrt(6.0) / step**2)


def choose_cutoff(noise: Noise, step: float) -> float:
    """Returns the highest cut-off [Hz] with which noise causes `QUIET` at most.

    Args:
        noise: The samples'.
        step: Between samples [s].
    """
    cutoffs = np.geomspace(HIGHEST_CUTOFF, LOWEST_CUTOFF, 24)
    for cutoff in cutoffs:
        if _filtered(noise, step, float(cutoff), 2) <= QUIET:
            return float(cutoff)
    return LOWEST_CUTOFF


def end_speed_noise(noise: Noise, step: float, cutoff: float) -> float:
    """Returns the standard deviation of a filtered motion's speed at its ends [m/s].

    An end has data on one side only: twice the deviation of the middle, three coordinates.
    """
    return 2.0 * np.sqrt(3.0) * _filtered(noise, step, cutoff, 1)


def smooth_from_rest(
    demonstration: "Demonstration", cutoff: float, start: bool, end: bool
) -> "Demonstration":
    """Returns a demonstration through the smoothing spline, at rest at its start, its end or both.

    The samples are mirrored in time at such an end, so that the spline is level there and has data
    on both sides.
    """
    count = len(demonstration.times)
    own = np.arange(count)
    before = own[:0:-1] if start else own[:0]
    after = own[-2::-1] if end else own[:0]
    samples = np.concatenate((before, own, after))
    t = demonstration.times
    times = np.concatenate((2.0 * t[0] - t[before], t, 2.0 * t[-1] - t[after]))
    mirrored = demonstration.selected(samples)
    smooth = replace(mirrored, times=times).smoothed(cutoff)
    return smooth.selected(len(before) + own)


def _filtered(noise: Noise, step: float, cutoff: float, order: int) -> float:
    """Returns the deviation of a derivative of white noise after 1 / (1 + (f / cutoff)⁴)."""
    f = np.linspace(0.0, 0.5 / step, 400)
    gain = (2.0 * np.pi * f) ** (2 * order) / (1.0 + (f / cutoff) ** 4) ** 2
    return float(noise.deviation * np.sqrt(2.0 * step * np.trapezoid(gain, f)))


def interpolant(times: Array, values: Array) -> tuple[Array, Array, str]:
    """Returns first and second derivatives (N, D) of a smooth curve through samples, and its name.

    It is the quintic spline; where that strays between two samples by more than `BOUND` and
    `BOUND_SHARE`, as between few or uneven samples, it is the piecewise cubic that does not
    overshoot (`careful`).
    """
    spline = make_interp_spline(times, values, k=5 if len(times) > 5 else 3)
    if not strays(times, values, spline):
        return spline.derivative(1)(times), spline.derivative(2)(times), "quintic spline"
    curve = careful(times, values)
    slopes = np.asarray(curve.derivative(1)(times))
    return slopes, np.asarray(curve.derivative(2)(times)), CAREFUL


def careful(times: Array, values: Array) -> CubicHermiteSpline:
    """Returns the piecewise cubic through values (N, D) without overshoot, at rest at both ends.

    Fritsch and Carlson 1980, DOI 10.1137/0717021, with slopes of at most twice those of the lines
    on both sides, so that no coordinate leaves its line by more than `BOUND_SHARE`, a quarter.
    """
    slopes = np.asarray(PchipInterpolator(times, values).derivative(1)(times))
    lines = np.abs(np.diff(values, axis=0) / np.diff(times)[:, None])
    steepest = 2.0 * np.minimum(lines[:-1], lines[1:])
    slopes[1:-1] = np.clip(slopes[1:-1], -steepest, steepest)
    slopes[[0, -1]] = 0.0
    return CubicHermiteSpline(times, values, slopes)


def strays(times: Array, values: Array, curve: object) -> bool:
    """Tells whether a curve leaves the lines between the samples by more than the bound."""
    share = np.linspace(0.05, 0.95, 19)
    between = times[:-1, None] + share * np.diff(times)[:, None]
    lines = values[:-1, None] + share[:, None] * np.diff(values, axis=0)[:, None]
    gaps = np.linalg.norm(curve(between) - lines, axis=2).max(axis=1)  # type: ignore[operator]
    chords = np.linalg.norm(np.diff(values, axis=0), axis=1)
    return bool(np.any(gaps > np.maximum(BOUND, BOUND_SHARE * chords)))


def fill_times(times: Array, longest: float) -> Array:
    """Returns times with others inserted between those further apart than `longest` [s]."""
    steps = np.diff(times)
    if not np.any(steps > longest):
        return times
    parts = [
        np.linspace(a, b, int(np.ceil((b - a) / longest)), endpoint=False)
        if b - a > longest
        else np.array([a])
        for a, b in pairwise(times)
    ]
    return np.append(np.concatenate(parts), times[-1])


def evenly_chosen(count: int, most: int) -> npt.NDArray[np.int64]:
    """Returns evenly spaced indices of at most `most` of `count` samples, ends included.

    Args:
        count: Number of samples.
        most: Number of samples to choose at most.
    """
    return np.unique(np.round(np.linspace(0, count - 1, min(count, most))).astype(np.int64))


def hermite(times: Array, values: Array, rates: Array) -> CubicHermiteSpline:
    """Returns the cubic through values (N, D) with given rates."""
    return CubicHermiteSpline(times, values, rates)
