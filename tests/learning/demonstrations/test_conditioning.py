import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.conditioning import (
    BOUND,
    BOUND_SHARE,
    measure_noise,
)
from pepper_drake.learning.dmp.primitive import FIT_TOLERANCE
from tests.learning.conftest import make_demonstration

from .importers.recordings import make_motion


def chord_distances(times, positions, path):
    """Distances of a path to the line between the samples on either side of it [m]."""
    lines = np.column_stack([np.interp(path.times, times, p) for p in positions.T])
    chords = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    k = np.clip(np.searchsorted(times, path.times, side="right") - 1, 0, len(chords) - 1)
    return np.linalg.norm(path.positions - lines, axis=1), chords[k]


@settings(max_examples=20)
@example(35, 18)  # A last step of 9 cm in 0.14 s.
@given(st.integers(0, 10_000), st.integers(4, 20))
def test_few_way_points_are_not_left_by_more_than_the_bound(seed, count):
    rng = np.random.default_rng(seed)
    times = np.concatenate(([0.0], np.cumsum(rng.uniform(0.1, 1.5, count - 1))))
    positions = np.cumsum(rng.uniform(-0.15, 0.15, (count, 3)), axis=0)
    primitive = MovementPrimitive.fit(Demonstration.from_positions(times, positions))
    away, chords = chord_distances(times, positions, primitive.rollout())
    # The fit adds what its basis functions cannot express to what the samples leave open.
    assert np.all(away <= np.maximum(BOUND, BOUND_SHARE * chords) + 2 * FIT_TOLERANCE)
    assert primitive.distance(Demonstration.from_positions(times, positions)) <= FIT_TOLERANCE


@pytest.mark.parametrize("gap", [0.3, 0.6, 1.0])
def test_a_gap_is_bridged(gap):
    motion = make_motion()
    kept = (motion.times < 0.6) | (motion.times > 0.6 + gap)
    demo = Demonstration.from_positions(motion.times[kept], motion.positions[kept])
    path = MovementPrimitive.fit(demo).rollout()
    away, chords = chord_distances(demo.times, demo.positions, path)
    assert np.all(away <= np.maximum(BOUND, BOUND_SHARE * chords) + 0.005)


@pytest.mark.parametrize("rate", [5.0, 10.0, 25.0, 100.0, 1000.0])
def test_any_rate_is_learned(rate):
    shown = make_demonstration(duration=4.0, rate=rate)
    demo = Demonstration.from_positions(shown.times, shown.positions)
    exact = make_demonstration(duration=4.0, rate=1000.0)
    path = MovementPrimitive.fit(demo).rollout(time_step=0.01)
    own = np.column_stack([np.interp(exact.times, path.times, p) for p in path.positions.T])
    inside = exact.times <= demo.times[-1]
    away = np.linalg.norm(own - exact.positions, axis=1)[inside]
    assert away.max() < (0.05 if rate < 10.0 else 0.004)


def test_a_minute_at_a_kilohertz_gets_as_many_basis_functions_as_it_needs():
    times = np.arange(60_000) / 1000.0
    waves = np.column_stack([np.sin(2 * np.pi * f * times) for f in (0.5, 0.4, 0.6)])
    demo = Demonstration.from_positions(times, 0.1 * waves)
    primitive = MovementPrimitive.fit(demo)
    assert primitive.num_basis > 40
    assert primitive.distance(demo) < 0.01


@given(st.floats(1e-5, 5e-3), st.integers(0, 1000))
def test_white_noise_is_measured(deviation, seed):
    motion = make_demonstration(duration=4.0)
    noise = np.random.default_rng(seed).normal(0.0, deviation, motion.positions.shape)
    measured = measure_noise(motion.times, motion.positions + noise)
    assert measured.deviation == pytest.approx(deviation, rel=0.3)


def test_a_smooth_motion_has_no_noise():
    for rate in (20.0, 50.0, 100.0, 1000.0):
        motion = make_demonstration(duration=4.0, rate=rate)
        assert measure_noise(motion.times, motion.positions).acceleration < 1e-3
