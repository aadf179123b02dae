from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.workspace_map import (
    Sightings,
    WorkspaceMap,
    sighted_motion,
)

START = np.array([0.1, -0.2, 0.0])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def shown(offsets, turns=None, start=(1.0, 0.2, 0.1), held=(0.0, 0.0, 0.0)):
    """A motion of N offsets [m] and rotation vectors [rad] from where it starts."""
    offsets = np.array(offsets, dtype=float)
    turns = np.zeros((len(offsets), 3)) if turns is None else np.array(turns)
    return Demonstration.from_positions(
        0.1 * np.arange(len(offsets)),
        np.array(start) + offsets,
        rotations=so3.multiply(so3.exp_map(turns), so3.exp_map(held)),
    )


WAY = [[0, 0, 0], [-0.1, 0, 0], [-0.1, 0.2, 0], [-0.1, 0.2, 0.3]]


def test_face_to_face_the_persons_ahead_and_right_are_the_robots():
    mapped = WorkspaceMap(scale=0.5, yaw=np.pi).apply(shown(WAY), START, LEVEL)
    # The person's ahead is -x of T, the person's right +y.
    expected = [[0, 0, 0], [0.05, 0, 0], [0.05, -0.1, 0], [0.05, -0.1, 0.15]]
    np.testing.assert_allclose(mapped.positions - START, expected, atol=1e-12)


def test_turns_are_about_the_mapped_axes_and_not_scaled():
    # The person tilts the marker about -y: the upper edge away from the own body.
    turns = [[0, -0.1 * k, 0] for k in range(4)]
    mapped = WorkspaceMap(scale=0.5, yaw=np.pi).apply(shown(WAY, turns), START, LEVEL)
    np.testing.assert_allclose(so3.log_map(mapped.rotations), -np.array(turns), atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_how_and_where_the_marker_is_held_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    offsets = np.cumsum(rng.normal(0, 0.05, (6, 3)), axis=0)
    turns = np.cumsum(rng.normal(0, 0.1, (6, 3)), axis=0)
    workspace = WorkspaceMap(rng.uniform(0.3, 1.2), rng.uniform(-3, 3))
    rotation = so3.exp_map(rng.normal(size=3))
    one = workspace.apply(shown(offsets, turns), START, rotation)
    other = workspace.apply(
        shown(offsets, turns, start=rng.normal(size=3), held=rng.normal(size=3)), START, rotation
    )
    np.testing.assert_allclose(one.positions, other.positions, atol=1e-9)
    np.testing.assert_allclose(abs(np.sum(one.rotations * other.rotations, axis=1)), 1, atol=1e-9)
    np.testing.assert_allclose(one.positions[0], START, atol=1e-12)
    assert one.path_length == pytest.approx(workspace.scale * shown(offsets).path_length)


def test_a_motion_without_orientation_is_refused():
    with pytest.raises(InputError, match="no orientation"):
        WorkspaceMap().apply(replace(shown(WAY), rotations=None), START, LEVEL)


def sighted(times, noise=0.0, seed=0):
    """Half a metre to and fro within 4 s, turning by 1 rad, with noise [m]."""
    s = 0.5 * (1 - np.cos(np.pi * times / 4))
    rng = np.random.default_rng(seed)
    positions = np.outer(s, [0, 0.5, 0.2]) + [0.8, 0, 0.1] + noise * rng.normal(size=(len(s), 3))
    turns = np.outer(s, [0, 0, 1.0]) + 5 * noise * rng.normal(size=(len(s), 3))
    return Sightings(times, positions, so3.exp_map(turns))


def test_a_sighted_motion_is_smooth_and_at_a_constant_step():
    times = 0.3 + 0.1 * np.arange(41)
    motion = sighted_motion(sighted(times, noise=0.003))
    np.testing.assert_allclose(motion.times, 0.01 * np.arange(401), atol=1e-9)
    true = sighted(0.3 + motion.times)
    assert np.sqrt(np.mean((motion.positions - true.positions) ** 2)) < 0.003
    angles = 2 * np.arccos(np.clip(abs(np.sum(motion.rotations * true.rotations, axis=1)), 0, 1))
    assert angles.max() < 0.03
    # The true peak is 0.54 pi / 8 = 0.21 m/s.
    assert np.linalg.norm(motion.velocities, axis=1).max() == pytest.approx(0.21, abs=0.05)


def test_a_marker_that_was_lost_is_refused_where_it_was_lost():
    times = np.concatenate((np.arange(0, 1.25, 0.1), np.arange(2.0, 3.0, 0.1)))
    with pytest.raises(InputError, match=r"not seen from 1\.2 to 2\.0 s"):
        sighted_motion(sighted(times))
    with pytest.raises(InputError, match="seen in 3 images"):
        sighted_motion(sighted(np.arange(3.0)))
    short = np.concatenate((np.arange(0, 1.25, 0.1), np.arange(1.6, 3.0, 0.1)))
    assert sighted_motion(sighted(short)).duration == pytest.approx(2.9)
