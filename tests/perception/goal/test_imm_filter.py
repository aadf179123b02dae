import copy

import numpy as np
import pytest
from pydrake.math import RollPitchYaw, RotationMatrix

from pepper_drake.perception.goal.imm_filter import (
    GoalFilterParameters,
    GoalMeasurement,
    GoalState,
    start_track,
    update_goal,
    update_track,
)

PARAMETERS = GoalFilterParameters()
P_OM = np.array([-0.05, 0.0, 0.15])
UPRIGHT = RotationMatrix()


def sight(time, position, R_WO=UPRIGHT, sigma=0.002):
    return GoalMeasurement(time, np.array(position, float), R_WO, sigma**2 * np.eye(3), 0.01**2)


def run(positions, state=None, start=0.0, period=0.2, noise=0.0, seed=0, parameters=PARAMETERS):
    rng = np.random.default_rng(seed)
    state = GoalState() if state is None else state
    for k, p in enumerate(positions):
        measured = np.array(p, float) + noise * rng.standard_normal(3)
        state = update_goal(state, sight(start + k * period, measured), P_OM, parameters)
    return state


def test_no_goal_before_three_sights_agree():
    p = [1.0, 0.2, 0.9]
    assert run([p] * 2).published is None
    state = run([p] * 3)
    assert state.is_valid(0.4, PARAMETERS)
    np.testing.assert_allclose(state.published.translation(), p - P_OM, atol=1e-9)


def test_sights_that_disagree_never_make_a_goal():
    rng = np.random.default_rng(0)
    state = run(rng.uniform(-1, 1, (300, 3)))
    assert state.published is None


def test_resting_goal_is_averaged():
    single, filtered = [], []
    for seed in range(40):
        state = run([[1, 0, 0.8]] * 15, noise=0.002, seed=seed)
        filtered.append(np.linalg.norm(state.track.p_WM - [1, 0, 0.8]))
        single.append(0.002 * np.linalg.norm(np.random.default_rng(seed).standard_normal(3)))
    assert np.median(filtered) < 0.6 * np.median(single)


def test_covariance_is_honest():
    squares = []
    for seed in range(60):
        state = run([[1, 0, 0.8]] * 12, noise=0.002, seed=seed)
        error = state.track.p_WM - [1, 0, 0.8]
        squares.append(error @ np.linalg.solve(state.track.position_covariance, error))
    assert np.mean(squares) < 3.0  # Three for an exact covariance, less for a cautious one.


def test_moving_goal_is_followed_without_lag_and_known_to_move():
    path = [[1 + max(0, k - 5) * 0.02, 0, 0.8] for k in range(15)]  # 10 cm/s from 1 s on.
    state = run(path, noise=0.001)
    assert state.track.probabilities[1] > 0.9
    assert np.linalg.norm(state.track.p_WM - path[-1]) < 0.003
    np.testing.assert_allclose(state.track.velocity, [0.1, 0, 0], atol=0.02)
    state = run([path[-1]] * 8, state, start=3.0, noise=0.001)
    assert state.track.probabilities[0] > 0.9
    np.testing.assert_allclose(state.track.p_WM, path[-1], atol=0.0015)


def test_single_outlier_moves_nothing():
    state = run([[1, 0, 0.8]] * 8)
    after = update_goal(state, sight(1.6, [1.3, 0.2, 0.8]), P_OM, PARAMETERS)
    assert after.track is state.track
    assert after.published is state.published
    again = update_goal(after, sight(1.8, [1, 0, 0.8]), P_OM, PARAMETERS)
    np.testing.assert_allclose(again.track.p_WM, [1, 0, 0.8], atol=1e-6)


def test_goal_carried_elsewhere_is_taken_after_three_sights_there():
    state = run([[1, 0, 0.8]] * 8)
    elsewhere = [1, 0.8, 0.9]
    assert run([elsewhere] * 2, state, start=1.6).published is state.published
    moved = run([elsewhere] * 3, state, start=1.6)
    np.testing.assert_allclose(moved.published.translation(), elsewhere - P_OM, atol=1e-3)


def test_lost_goal_is_held_then_called_invalid_then_confirmed_anew():
    state = run([[1, 0, 0.8]] * 5)
    assert state.is_valid(0.8 + PARAMETERS.hold_seconds, PARAMETERS)
    assert not state.is_valid(0.81 + PARAMETERS.hold_seconds, PARAMETERS)
    assert state.age(3.0) == pytest.approx(2.2)
    assert not run([[1, 0.1, 0.8]] * 2, state, start=5.0).is_valid(5.2, PARAMETERS)
    found = run([[1, 0.1, 0.8]] * 3, state, start=5.0)
    assert found.is_valid(5.4, PARAMETERS)
    np.testing.assert_allclose(found.published.translation(), [1, 0.1, 0.8] - P_OM, atol=1e-6)


@pytest.mark.parametrize(("shift", "published"), [(0.002, False), (0.005, True)])
def test_goal_is_handed_on_anew_beyond_three_millimetres(shift, published):
    state = run([[1, 0, 0.8]] * 8)
    after = run([[1 + shift, 0, 0.8]] * 12, state, start=1.6)
    assert (after.published is not state.published) == published


def test_goal_is_handed_on_anew_when_it_is_known_much_better():
    far = [sight(0.2 * k, [1.0, 0, 0.8], sigma=0.008) for k in range(4)]
    near = [sight(0.8 + 0.2 * k, [1.0015, 0, 0.8], sigma=0.0005) for k in range(4)]
    state = GoalState()
    for seen in (*far, *near):
        state = update_goal(state, seen, P_OM, PARAMETERS)
    np.testing.assert_allclose(state.published.translation(), [1.0015, 0, 0.8] - P_OM, atol=3e-4)


def test_systematic_errors_are_not_averaged_away():
    state = GoalState()
    for k in range(30):
        shared = np.diag([0.004**2, 0, 0])
        cov = 0.001**2 * np.eye(3) + shared
        seen = GoalMeasurement(0.2 * k, np.array([1, 0, 0.8]), UPRIGHT, cov, 1e-4, shared)
        state = update_goal(state, seen, P_OM, PARAMETERS)
    sigma = np.sqrt(np.diag(state.track.position_covariance))
    assert sigma[0] > 0.004
    assert sigma[1] < 0.0012


def test_flipped_orientation_is_ignored_unless_it_stays():
    flipped = RotationMatrix(RollPitchYaw(0.9, 0, 0))
    state = run([[1, 0, 0.8]] * 6)
    once = update_goal(state, sight(1.2, [1, 0, 0.8], flipped), P_OM, PARAMETERS)
    np.testing.assert_allclose(once.track.R_WO.matrix(), UPRIGHT.matrix(), atol=1e-9)
    for k in range(2):
        once = update_goal(once, sight(1.4 + 0.2 * k, [1, 0, 0.8], flipped), P_OM, PARAMETERS)
    np.testing.assert_allclose(once.track.R_WO.matrix(), flipped.matrix(), atol=1e-9)


def test_old_sights_are_passed_over():
    state = run([[1, 0, 0.8]] * 5)
    assert update_goal(state, sight(0.1, [1.001, 0, 0.8]), P_OM, PARAMETERS) is state


def test_filter_without_walk_is_the_recursive_mean():
    still = GoalFilterParameters(
        rest_walk=0.0, position_floor=0.0, rest_seconds=1e12, moving_seconds=1e-9
    )
    values = [0.001, -0.002, 0.003, 0.0005]
    track = start_track(sight(0.0, [values[0], 0, 0]), still)
    for k, value in enumerate(values[1:], 1):
        track = update_track(track, sight(0.2 * k, [value, 0, 0]), still)
    np.testing.assert_allclose(track.p_WM, [np.mean(values), 0, 0], atol=1e-9)
    np.testing.assert_allclose(np.diag(track.position_covariance), 0.002**2 / 4, rtol=1e-6)


def test_object_covariance_has_the_lever_arm():
    track = start_track(sight(0, [0, 0, 0]), PARAMETERS)
    lever = np.diag(track.object_covariance(np.array([0, 0, 1.0])) - track.position_covariance)
    np.testing.assert_allclose(lever, [1e-4, 1e-4, 0], atol=1e-12)


def test_states_are_values_that_copies_share():
    state = run([[1, 0, 0.8]] * 3)
    assert copy.deepcopy(state) is state
