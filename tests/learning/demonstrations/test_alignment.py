import dataclasses

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.alignment import align
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.learning.probabilistic.variability import variability_along


def hesitant(amount, duration=2.0, offset=0.0, count=150):
    """One arc, walked through with a hesitation in its middle; bulging by `offset` at the end."""
    s = np.linspace(0, 1, count)
    walked = s + amount * np.sin(2 * np.pi * s) / (2 * np.pi)
    bulge = offset * np.sin(np.pi * walked) ** 2
    positions = np.column_stack(
        (0.3 * walked, 0.1 * np.sin(np.pi * walked) + bulge, 0.05 * walked**2)
    )
    return Demonstration.from_positions(duration * s, positions)


def test_durations_become_one_and_velocities_stay_derivatives():
    motions = align([hesitant(0.0, 2.0), hesitant(0.0, 3.0)], num_samples=301)
    for motion in motions:
        assert motion.duration == pytest.approx(2.5)
        assert len(motion.times) == 301
        slopes = np.gradient(motion.positions, motion.times, axis=0)[2:-2]
        curvature = np.gradient(motion.velocities, motion.times, axis=0)[2:-2]
        np.testing.assert_allclose(slopes, motion.velocities[2:-2], atol=2e-4)
        np.testing.assert_allclose(curvature, motion.accelerations[2:-2], atol=2e-3)
    np.testing.assert_allclose(motions[0].positions, motions[1].positions, atol=1e-9)


def test_aligning_with_the_own_samples_changes_nothing():
    demo = example_demonstrations(1)[0]
    (same,) = align([demo], num_samples=len(demo.times))
    np.testing.assert_allclose(same.positions, demo.positions, atol=1e-12)
    np.testing.assert_allclose(same.velocities, demo.velocities, atol=1e-9)
    np.testing.assert_allclose(same.accelerations, demo.accelerations, atol=1e-7)


def test_warping_removes_what_is_only_timing():
    motions = [hesitant(amount) for amount in (-0.5, -0.2, 0.3, 0.6)]
    stretched = np.std([m.positions for m in align(motions)], axis=0)
    warped = align(motions, warp=True)
    assert np.std([m.positions for m in warped], axis=0).max() < 0.25 * stretched.max()
    for motion in warped:  # The path is walked forwards, all of it.
        assert np.all(np.diff(motion.positions[:, 0]) > 0)
        np.testing.assert_allclose(motion.positions[[0, -1], 0], [0, 0.3], atol=1e-9)
        slopes = np.gradient(motion.positions, motion.times, axis=0)[2:-2]
        np.testing.assert_allclose(slopes, motion.velocities[2:-2], atol=2e-3)


def test_spread_is_that_between_the_demonstrations():
    # The second coordinate differs by offsets with a standard deviation of 2 cm in the middle.
    offsets = 0.02 * np.array([-1.5, -0.5, 0.5, 1.5]) / np.sqrt(1.25)
    spread = variability_along([hesitant(0.0, offset=offset) for offset in offsets])
    middle = len(spread.times) // 2
    deviations = spread.standard_deviations
    assert deviations[middle, 1] == pytest.approx(0.02, rel=0.1)
    assert deviations[[0, -1], 1].max() < 0.004
    assert deviations[:, 2].max() < 0.004
    np.testing.assert_allclose(spread.means, align([hesitant(0.0)])[0].positions, atol=2e-3)


def test_rotations_are_resampled_as_unit_quaternions():
    demo = hesitant(0.0)
    angle = np.linspace(0, 1, len(demo.times))
    turning = np.column_stack((np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle))
    turned = dataclasses.replace(demo, rotations=turning)
    (same,) = align([turned], num_samples=11)
    expected = np.linspace(0, 1, 11)
    np.testing.assert_allclose(2 * np.arctan2(same.rotations[:, 1], same.rotations[:, 0]), expected)
    assert align([turned, demo])[0].rotations is None


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="at least one"):
        align([])
    with pytest.raises(InputError, match="num_samples is 3"):
        align([hesitant(0.0)], num_samples=3)
    with pytest.raises(InputError, match="at least two"):
        variability_along([hesitant(0.0)])
