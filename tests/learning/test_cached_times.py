"""Matrices that are kept for samples with the same times."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from pepper_drake.learning.cached_times import spline_derivatives
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.primitive import MovementPrimitive


@pytest.mark.parametrize("count", [5, 40, 300])
def test_derivatives_are_those_of_the_spline_through_the_values(count):
    rng = np.random.default_rng(count)
    times = np.linspace(0.0, 1.0, count) + np.append(rng.uniform(-0.2, 0.2, count - 1) / count, 0.0)
    for values in rng.normal(size=(2, count, 3)).cumsum(axis=1):  # The second time from the cache.
        spline = make_interp_spline(times, values, k=5 if count > 5 else 3)
        first, second = spline_derivatives(times, values)
        size = np.abs(second).max()
        np.testing.assert_allclose(first, spline.derivative(1)(times), rtol=0, atol=1e-11 * size)
        np.testing.assert_allclose(second, spline.derivative(2)(times), rtol=0, atol=1e-11 * size)


@pytest.mark.parametrize("approximator", ["trajectory", "trajectory_slopes"])
def test_what_is_learned_does_not_depend_on_what_was_learned_before(approximator):
    rates = np.array([1.0, 1.3, 1.7])

    def learn(duration, samples=201):
        """Returns the weights as bytes; relative times differ in their last bits by duration."""
        angles = np.linspace(0.0, 3.0, samples)[:, None] * rates
        demonstration = Demonstration.from_positions(
            duration * np.linspace(0.0, 1.0, samples),
            np.sin(angles),
            np.cos(angles) * rates,
            -np.sin(angles) * rates**2,
            joints=np.column_stack((np.sin(angles), np.cos(angles))),
            joint_names=tuple("abcdef"),
        )
        primitive = MovementPrimitive.fit(demonstration, approximator=approximator, check=False)
        return primitive.weights.tobytes() + primitive.posture.weights.tobytes()

    def fill_caches():
        for samples in range(202, 242):
            learn(3.0, samples)

    for duration in (2.9, 3.1, 3.3, 4.7):
        fill_caches()
        alone = learn(duration)
        fill_caches()
        learn(3.7)
        assert learn(duration) == alone
