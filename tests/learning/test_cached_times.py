"""Matrices that are kept for samples with the same times."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from pepper_drake.learning.cached_times import spline_derivatives


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
