import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from pepper_drake.naoqi.constants import CYCLE
from pepper_drake.robot_server.robot.time_laws import (
    duration_with_speed,
    sample_bezier,
    sample_keys,
    sample_ramp,
    step_towards,
    stopping_point,
)

_ANGLE = st.floats(-2.0, 2.0)


def _go(position, velocity, target, speed, acceleration, cycles=2000):
    x, v = np.array([position]), np.array([velocity])
    path = [(position, velocity)]
    limits = np.array([speed]), np.array([acceleration])
    for _ in range(cycles):
        x, v = step_towards(x, v, np.array([target]), *limits)
        path.append((x[0], v[0]))
        if path[-1] == path[-2]:  # It stays as it is from here on.
            break
    return np.array(path)


@given(_ANGLE, st.floats(-3, 3), _ANGLE, st.floats(0.2, 8.0), st.floats(5.0, 90.0))
@settings(max_examples=60, deadline=None)
def test_a_target_is_reached_with_limited_speed_and_acceleration(x, v, target, speed, acceleration):
    path = _go(x, v, target, speed, acceleration)
    assert path[-1, 0] == pytest.approx(target, abs=1e-9)
    assert path[-1, 1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.diff(path[:, 1])).max() <= acceleration * CYCLE + 1e-9
    assert np.abs(path[:, 1]).max() <= max(abs(v), speed) + 1e-9


@given(_ANGLE, _ANGLE, st.floats(0.2, 8.0), st.floats(5.0, 90.0))
@settings(max_examples=60, deadline=None)
def test_from_rest_it_never_goes_back_or_beyond(x, target, speed, acceleration):
    path = _go(x, 0.0, target, speed, acceleration)[:, 0]
    way = (path - x) * np.sign(target - x)
    assert np.diff(way).min() >= -1e-12
    assert way.max() <= abs(target - x) + 1e-9


def test_long_way_takes_the_time_of_a_trapezoid():
    path = _go(0.0, 0.0, 2.0, 1.0, 10.0)
    arrived = np.argmax(np.abs(path[:, 0] - 2.0) < 1e-9) * CYCLE
    assert arrived == pytest.approx(2.0 / 1.0 + 1.0 / 10.0, abs=2.5 * CYCLE)


@given(_ANGLE, st.floats(-3, 3), st.floats(5.0, 90.0))
@settings(max_examples=60, deadline=None)
def test_who_brakes_stops_at_the_stopping_point(x, v, acceleration):
    rest = stopping_point(np.array([x]), np.array([v]), np.array([acceleration]))[0]
    path = _go(x, v, rest, abs(v), acceleration, cycles=200)
    moved = np.sign(v) * np.diff(path[:, 0])
    assert moved.min() >= -1e-9
    assert path[-1, 0] == pytest.approx(rest, abs=1e-9)
    assert abs(rest - x) == pytest.approx(v**2 / (2 * acceleration), abs=abs(v) * CYCLE + 1e-9)


_KEYS = st.lists(st.tuples(st.floats(0.1, 1.0), _ANGLE), min_size=1, max_size=5)


@given(_ANGLE, _KEYS)
@settings(max_examples=100, deadline=None)
def test_keys_are_hit_in_time_and_never_overshot(start, keys):
    times = np.cumsum([round(gap / CYCLE) * CYCLE for gap, _ in keys])
    values = [value for _, value in keys]
    samples = sample_keys(start, 0.0, times.tolist(), values)
    assert len(samples) == round(times[-1] / CYCLE)
    for time, value in zip(times, values, strict=True):
        assert samples[round(time / CYCLE) - 1] == pytest.approx(value, abs=1e-9)
    everything = [start, *values]
    assert samples.min() >= min(everything) - 1e-9
    assert samples.max() <= max(everything) + 1e-9


def test_slopes_at_keys_are_those_of_another_implementation():
    times, values = [0.5, 1.2, 2.0, 3.0], [0.3, 0.5, 0.2, 0.9]
    t, x = [0.0, *times], [0.1, *values]
    slopes = PchipInterpolator(t, x).derivative()(t)
    slopes[0] = slopes[-1] = 0.0
    grid = np.arange(1, 151) * CYCLE
    np.testing.assert_allclose(
        sample_keys(0.1, 0.0, times, values), CubicHermiteSpline(t, x, slopes)(grid), atol=1e-12
    )


def test_one_key_from_rest_is_the_cubic_between_two_rests():
    samples = sample_keys(0.0, 0.0, [1.0], [1.0])
    t = np.arange(1, 51) * CYCLE
    np.testing.assert_allclose(samples, 3 * t**2 - 2 * t**3, atol=1e-12)
    peak = np.diff(samples).max() / CYCLE
    assert duration_with_speed(1.0, peak) == pytest.approx(1.0, rel=1e-3)


def test_a_path_begins_with_the_speed_that_there_is():
    samples = sample_keys(0.0, 0.8, [1.0], [1.0])
    assert samples[0] / CYCLE == pytest.approx(0.8, abs=0.05)


def test_a_ramp_is_straight():
    np.testing.assert_allclose(sample_ramp(0.0, [1.0], [1.0]), np.arange(1, 51) * CYCLE)


def test_a_bezier_path_without_handles_rests_at_each_key():
    samples = sample_bezier(0.0, [1.0, 2.0], [(1.0, None, None), (0.0, None, None)])
    t = np.arange(1, 51) * CYCLE
    # With thirds for handles time is even and the curve is the smooth cubic.
    np.testing.assert_allclose(samples[:50], 3 * t**2 - 2 * t**3, atol=1e-4)
    np.testing.assert_allclose(samples[50:], samples[48::-1].tolist() + [0.0], atol=1e-4)


def test_bezier_handles_bend_the_path_as_bernstein_says():
    handle_out, handle_in = (3, 0.2, 0.6), (3, -0.4, 0.1)
    samples = sample_bezier(0.0, [0.5, 1.5], [(0.5, None, handle_out), (-0.2, handle_in, None)])
    u = 0.37
    bernstein = np.array([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3])
    time = bernstein @ [0.5, 0.7, 1.1, 1.5]
    value = bernstein @ [0.5, 1.1, -0.1, -0.2]
    grid = np.arange(1, 76) * CYCLE
    assert np.interp(time, grid, samples) == pytest.approx(value, abs=2e-3)


def test_bezier_types_constant_and_linear():
    constant = sample_bezier(0.0, [0.1, 0.5], [(1.0, None, (0, 0.0, 0.0)), (2.0, None, None)])
    assert set(np.round(constant[5:-1], 9)) == {1.0}
    assert constant[-1] == 2.0
    linear = sample_bezier(0.0, [0.1, 0.5], [(1.0, None, (1, 0.0, 0.0)), (2.0, None, None)])
    np.testing.assert_allclose(np.diff(linear[4:]), 1.0 / 20, atol=1e-9)


def test_a_handle_beyond_its_segment_never_turns_time_back():
    wild = sample_bezier(0.0, [1.0], [(1.0, (3, -50.0, 0.0), None)])
    assert np.isfinite(wild).all()
    assert wild.min() >= -1e-9
    assert wild.max() <= 1.0 + 1e-9
