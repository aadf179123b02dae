"""Temporal alignment of several demonstrations."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import least_squares

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.demonstration import Demonstration

Array = npt.NDArray[np.float64]


def align(
    demonstrations: Sequence[Demonstration],
    *,
    num_samples: int = 200,
    duration: float | None = None,
    warp: bool = False,
) -> list[Demonstration]:
    """Resamples demonstrations at the same uniform times, so that their arrays can be stacked.

    Each motion is scaled in time to the same duration. With `warp`, time is also warped within each
    motion so that the paths, relative to their starts, come closest to their mean: hesitations of
    one hand would otherwise count as variability. The warp is smooth and increasing by
    construction,

        t(s) proportional to the integral of exp(u(s)),  u a cubic spline of 8 coefficients,

    where dynamic time warping would hold and jump.

    Args:
        demonstrations: At least one; all with rotations, or their rotations are left out.
        num_samples: Of each result.
        duration: Of each result [s]; the median of the demonstrations' when left out.
        warp: Whether time is warped within each motion, too.

    Raises:
        InputError: There is no demonstration, or fewer than 6 samples are asked for.
    """
    if not demonstrations:
        raise InputError("there is no demonstration to align; give at least one.")
    if num_samples < 6:
        raise InputError(f"num_samples is {num_samples}; alignment needs at least 6.")
    length = duration or float(np.median([demo.duration for demo in demonstrations]))
    clocks = np.tile(np.linspace(0, 1, num_samples), (len(demonstrations), 1))
    if warp and len(demonstrations) > 1:
        clocks = _warped_clocks(demonstrations, num_samples)
    with_rotations = all(demo.rotations is not None for demo in demonstrations)
    return [
        _resampled(demo, clock, length, with_rotations)
        for demo, clock in zip(demonstrations, clocks, strict=True)
    ]


def _resampled(
    demo: Demonstration, clock: Array, duration: float, with_rotations: bool
) -> Demonstration:
    """Returns a motion at its normalised times `clock`, evenly spaced over `duration`."""
    times = np.linspace(0, duration, len(clock))
    own = demo.times[0] + demo.duration * clock
    # The chain rule for y(t(s)), t(s) a quintic spline, keeps the recorded derivatives.
    rate_spline = make_interp_spline(times, own, k=5)
    rate, acceleration = rate_spline.derivative(1)(times), rate_spline.derivative(2)(times)
    positions, velocities, accelerations = (
        make_interp_spline(demo.times, values, k=5 if len(demo.times) > 5 else 3)(own)
        for values in (demo.positions, demo.velocities, demo.accelerations)
    )
    rotations = None
    if with_rotations and demo.rotations is not None:
        rotations = so3.normalize(make_interp_spline(demo.times, demo.rotations, k=3)(own))
    return replace(
        demo,
        times=times,
        positions=positions,
        velocities=velocities * rate[:, None],
        accelerations=accelerations * rate[:, None] ** 2 + velocities * acceleration[:, None],
        rotations=rotations,
        angles=None,
        joints=None if demo.joints is None else make_interp_spline(demo.times, demo.joints)(own),
        derivation="resampled on a common clock",
    )


def _warped_clocks(demonstrations: Sequence[Demonstration], num_samples: int) -> Array:
    """Returns normalised times (M, num_samples) that bring the paths closest to their mean."""
    grid = np.linspace(0, 1, num_samples)
    num_coefficients, degree, rounds, stiffness = 8, 3, 4, 0.02
    inner = np.linspace(0, 1, num_coefficients - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    basis = BSpline.design_matrix(grid, knots, degree).toarray()
    paths = [
        make_interp_spline((demo.times - demo.times[0]) / demo.duration, demo.positions)
        for demo in demonstrations
    ]
    size = np.mean([demo.path_length for demo in demonstrations])

    def clock(coefficients: Array) -> Array:
        speed = np.exp(basis @ coefficients)
        covered = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
        return np.asarray(covered / covered[-1])

    warps = np.zeros((len(paths), num_coefficients))
    for _ in range(rounds):
        moved = np.array([path(clock(c)) - path(0.0) for path, c in zip(paths, warps, strict=True)])
        mean = moved.mean(axis=0)
        for index, path in enumerate(paths):

            def miss(coefficients: Array, path: BSpline = path, mean: Array = mean) -> Array:
                gap = (path(clock(coefficients)) - path(0.0) - mean) / size
                return np.concatenate(
                    [gap.ravel() / np.sqrt(num_samples), stiffness * coefficients]
                )

            warps[index] = least_squares(miss, warps[index], method="lm").x
        warps -= warps.mean(axis=0)  # The mean motion keeps its own timing.
    return np.array([clock(coefficients) for coefficients in warps])
