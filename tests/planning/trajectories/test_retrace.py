import numpy as np
import pytest

from pepper_drake.planning.trajectories.joint_trajectories import Retrace

SHOWN = np.linspace([0.0, 0.0, 0, 0, 0], [1.0, -0.5, 0, 0, 0.2], 201)


def test_goes_from_here_along_what_was_shown_to_its_start():
    here = np.array([0.8, -0.4, 0.1, 0, 0.16])
    way = Retrace(here, SHOWN)
    assert way.at(0.0) == pytest.approx(here)
    assert way.at(way.duration) == pytest.approx(SHOWN[0])
    assert way.at(way.duration + 5.0) == pytest.approx(SHOWN[0])
    middle = way.at(0.6 * way.duration)
    assert np.abs(SHOWN - middle).max(axis=1).min() < 0.01


def test_starts_and_ends_gently_and_keeps_its_speed():
    way = Retrace(SHOWN[-1], SHOWN, speed=0.5)
    assert way.duration == pytest.approx(1.0 / 0.5)
    times = np.linspace(0, way.duration, 401)
    speeds = np.abs(np.gradient([way.at(t) for t in times], times, axis=0)).max(axis=1)
    # The profile of least jerk is 15 / 8 times as fast in its middle as on average.
    assert speeds.max() == pytest.approx(0.5 * 15 / 8, rel=0.01)
    assert speeds[0] < 0.01
    assert speeds[-1] < 0.01


def test_an_arm_that_is_back_waits_a_moment():
    way = Retrace(SHOWN[0], SHOWN)
    assert way.duration == 0.5
    assert way.at(0.25) == pytest.approx(SHOWN[0])
