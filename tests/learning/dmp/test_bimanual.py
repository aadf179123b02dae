import dataclasses

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.dmp.bimanual import BimanualPrimitive
from pepper_drake.learning.dmp.primitive import FIT_TOLERANCE


def turned(quaternions, vectors):
    return Rotation.from_quat(quaternions, scalar_first=True).apply(vectors)


def lift(with_rotations=True):
    """Both hands lift a box, turn it, and bring their grasps a little closer meanwhile."""
    s = np.linspace(0, 1, 251)
    walked = s**3 * (10 - 15 * s + 6 * s**2)
    middle = np.column_stack(
        (0.15 + 0.2 * walked, 0.05 * np.sin(np.pi * walked), 0.1 + 0.1 * walked)
    )
    angle = 0.6 * walked
    frame = np.column_stack((np.cos(angle / 2), 0 * s, 0 * s, np.sin(angle / 2)))
    gap = turned(frame, np.column_stack((0.02 * walked, 0.3 - 0.04 * walked, 0 * s)))
    facing = np.column_stack((0.4 + 0 * s, 0.2 * walked, 0 * s))
    hands = []
    for side in (0.5, -0.5):
        rotations = so3.multiply(frame, so3.exp_map(side * facing))
        hands.append(
            Demonstration.from_positions(
                2.5 * s,
                middle + side * gap,
                rotations=rotations if with_rotations else None,
            )
        )
    return hands


def relative_pose(paths):
    left, right = paths
    to_right = so3.conjugate(right.rotations)
    gap = turned(to_right, left.positions - right.positions)
    return gap, so3.multiply(to_right, left.rotations)


@pytest.fixture(scope="module")
def pair():
    return BimanualPrimitive.fit(*lift())


@pytest.mark.parametrize("with_rotations", [True, False])
def test_gives_back_what_was_shown(with_rotations):
    shown = lift(with_rotations)
    paths = BimanualPrimitive.fit(*shown).rollout()
    for path, demo in zip(paths, shown, strict=True):
        np.testing.assert_allclose(path.positions, demo.positions, atol=1e-5)
        np.testing.assert_allclose(path.velocities, demo.velocities, atol=1e-3)
        np.testing.assert_allclose(path.accelerations, demo.accelerations, atol=2e-2)
        if with_rotations:
            np.testing.assert_allclose(path.rotations, demo.rotations, atol=1e-5)
        else:
            assert path.rotations is None


def test_a_long_motion_gets_as_many_basis_functions_as_it_needs():
    times = np.linspace(0.0, 30.0, 1501)
    turn = 2.0 * np.pi * times
    left = np.column_stack((0.1 * np.sin(turn), 0.2 + 0.0 * turn, 0.05 * np.cos(turn)))
    hands = [Demonstration.from_positions(times, left * [1.0, side, 1.0]) for side in (1.0, -1.0)]
    path = BimanualPrimitive.fit(*hands).rollout(0.02).left
    assert np.abs(path.positions - left).max() < FIT_TOLERANCE


def test_relative_pose_is_held_wherever_the_pair_goes(pair):
    shown = relative_pose(pair.rollout())
    moved = pair.rollout(
        start=[0.1, 0.1, 0.0], goal=[0.4, 0.1, 0.3], goal_rotation=so3.exp_map([0.3, 1.2, 0.1])
    )
    gap, turn = relative_pose(moved)
    np.testing.assert_allclose(gap, shown[0], atol=1e-9)
    np.testing.assert_allclose(turn, shown[1], atol=1e-9)
    middle = 0.5 * (moved.left.positions + moved.right.positions)
    np.testing.assert_allclose(middle[0], [0.1, 0.1, 0.0], atol=1e-9)


def test_pair_arrives_at_its_goal(pair):
    goal, rotation = [0.35, -0.1, 0.25], so3.exp_map([0.0, 0.3, 0.8])
    left, right = pair.rollout(goal=goal, goal_rotation=rotation, settle=1.0)
    np.testing.assert_allclose(0.5 * (left.positions + right.positions)[-1], goal, atol=1e-3)
    # A is half-way between the hands' orientations.
    half = so3.exp_map(0.5 * so3.log_map(relative_pose((left, right))[1][-1]))
    frame = so3.multiply(right.rotations[-1], half)
    assert np.linalg.norm(so3.log_map(so3.multiply(frame, so3.conjugate(rotation)))) < 2e-3


def test_velocities_are_derivatives_of_the_path(pair):
    for path in pair.rollout(goal=[0.4, 0.1, 0.3], goal_rotation=so3.exp_map([0.3, 1.2, 0.1])):
        slopes = np.gradient(path.positions, path.times, axis=0)[2:-2]
        np.testing.assert_allclose(slopes, path.velocities[2:-2], atol=2e-3)
        turn = so3.multiply(path.rotations[2:], so3.conjugate(path.rotations[:-2]))
        np.testing.assert_allclose(
            so3.log_map(turn) / 0.02, path.angular_velocities[1:-1], atol=1e-2
        )


def held_error(pair, obstacles):
    """Returns the largest errors of the relative position and of the middle [m]."""
    free, paths = pair.rollout(settle=1.0), pair.rollout(obstacles=obstacles, settle=1.0)

    def part(hands, side):
        return hands.left.positions + side * hands.right.positions

    clock = np.interp(-np.log(paths.left.phases), -np.log(free.left.phases), free.left.times)
    errors = []
    for side in (-1, 1):
        shown = make_interp_spline(free.left.times, part(free, side))(clock)
        errors.append(np.linalg.norm(part(paths, side) - shown, axis=1).max())
    return errors[0], 0.5 * errors[1], paths


def test_obstacle_at_one_hand_moves_both_and_the_relative_position_is_held(pair):
    there = pair.rollout().left.positions[125] + np.array([0.0, 0.03, 0.0])
    cloud = there + 0.02 * np.random.default_rng(0).standard_normal((50, 3))
    apart, moved, paths = held_error(pair, cloud)
    assert moved > 0.02
    assert apart < 0.003
    assert paths.left.distances.min() > 0.05
    np.testing.assert_allclose(
        paths.left.positions[-1], pair.rollout(settle=1.0).left.positions[-1], atol=1e-3
    )
    np.testing.assert_array_equal(paths.left.phases, paths.right.phases)
    loose = dataclasses.replace(pair, hold_rate=5.0)
    assert held_error(loose, cloud)[0] > 10 * apart


def test_obstacles_far_away_change_nothing(pair):
    free = pair.rollout()
    paths = pair.rollout(obstacles=[[3.0, 3.0, 3.0]])
    np.testing.assert_allclose(paths.left.positions, free.left.positions, atol=1e-9)
    np.testing.assert_allclose(paths.right.velocities, free.right.velocities, atol=1e-4)
    np.testing.assert_allclose(paths.right.rotations, free.right.rotations, atol=1e-9)


def test_time_step_does_not_change_the_motion_around_an_obstacle(pair):
    there = pair.rollout().right.positions[125] + np.array([0.02, 0.0, 0.02])
    fine = pair.rollout(0.0025, obstacles=there[None], settle=1.0).right
    coarse = pair.rollout(0.01, obstacles=there[None], settle=1.0).right
    gaps = np.linalg.norm(coarse.positions[:, None] - fine.positions, axis=2).min(axis=1)
    assert gaps.max() < 0.003


def test_files_give_it_back_bit_for_bit(pair, tmp_path):
    pair.save(tmp_path)
    loaded = BimanualPrimitive.load(tmp_path)
    assert loaded.hold_rate == pair.hold_rate
    for one, other in zip(loaded.rollout(), pair.rollout(), strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
        np.testing.assert_array_equal(one.rotations, other.rotations)


def test_bad_input_is_refused(tmp_path):
    left, right = lift(False)
    slow = Demonstration.from_positions(2 * right.times, right.positions)
    with pytest.raises(InputError, match="record both hands"):
        BimanualPrimitive.fit(left, slow)
    with pytest.raises(InputError, match="hold_rate"):
        BimanualPrimitive.fit(left, right, hold_rate=0.0)
    MovementPrimitive.fit(left).save(tmp_path / "absolute.yaml")
    with pytest.raises(InputError, match=r"pair\.yaml"):
        BimanualPrimitive.load(tmp_path)
