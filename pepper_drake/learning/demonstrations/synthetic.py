"""Synthetic motions of the hand, to try the learners without recordings."""

import numpy as np
from scipy.interpolate import BSpline

from pepper_drake.learning.demonstrations.demonstration import Demonstration

CENTRE = (0.15, -0.18, 0.08)
"""In front of the right shoulder, in the torso frame [m]."""


def example_demonstrations(count: int = 10, seed: int = 0) -> list[Demonstration]:
    """Makes smooth motions in a box of 25 cm, 2 to 5 s at 100 Hz; every second one never rests.

    They are quintic splines over random control points with exact derivatives, similar to
    hand-guided motions in size and speed.
    """
    rng = np.random.default_rng(seed)
    return [_example(f"example_{index}", rng, at_rest=index % 2 == 0) for index in range(count)]


def _example(name: str, rng: np.random.Generator, at_rest: bool) -> Demonstration:
    degree, duration = 5, round(rng.uniform(2.0, 5.0), 2)
    control = rng.uniform(-1.0, 1.0, (rng.integers(6, 12), 3))
    if at_rest:  # Three equal control points end a clamped spline without speed or acceleration.
        control = np.concatenate((control[[0, 0]], control, control[[-1, -1]]))
    inner = np.linspace(0.0, duration, len(control) - degree + 1)
    knots = np.concatenate((np.zeros(degree), inner, np.full(degree, duration)))
    times = np.linspace(0.0, duration, round(100 * duration) + 1)
    shape = BSpline(knots, control, degree)(times)
    scale = 0.25 / np.ptp(shape, axis=0).max()
    middle = 0.5 * (shape.min(axis=0) + shape.max(axis=0))
    spline = BSpline(knots, scale * (control - middle) + np.array(CENTRE), degree)
    return Demonstration(
        times,
        spline(times),
        spline.derivative(1)(times),
        spline.derivative(2)(times),
        name=name,
        derivation="exact",
    )
