import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.probabilistic.ds_gmr import fit_ds_gmr
from pepper_drake.learning.probabilistic.gaussian_mixture import GaussianMixture
from pepper_drake.learning.probabilistic.tp_gmm import (
    TaskFrame,
    TaskParameterizedMixture,
    fit_task_parameterized,
    start_and_goal,
)


def reach(start, frame, duration=2.5):
    """Leaves the start upwards and comes to the goal along the goal frame's x axis."""
    along = frame.rotation @ [0.08, 0, 0]
    start, goal = np.asarray(start), frame.position
    above = start + np.array([0, 0, 0.08])
    points = np.array([start, start, above, goal - along, goal, goal])
    knots = np.concatenate((np.zeros(4), [1 / 3, 2 / 3], np.ones(4)))
    s = np.linspace(0, 1, 120)
    return Demonstration.from_positions(duration * s, BSpline(knots, points, 3)(s))


def task(rng):
    start = rng.uniform(-0.05, 0.05, 3)
    rotation = Rotation.from_euler("z", rng.uniform(-0.8, 0.8)).as_matrix()
    goal = TaskFrame(rotation, np.array([0.3, 0.1, 0.1]) + rng.uniform(-0.08, 0.08, 3))
    return [TaskFrame(np.eye(3), start), goal]


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(0)
    frames = [task(rng) for _ in range(8)]
    return [reach(start.position, goal) for start, goal in frames], frames


@pytest.fixture(scope="module")
def mixture(shown):
    return fit_task_parameterized(*shown, num_components=8)


@pytest.fixture(scope="module")
def system(shown):
    return fit_ds_gmr(*shown, num_components=8)


TIMES = np.linspace(0, 1, 120)


def test_product_of_two_frames_worked_by_hand():
    # No slope in time. Frame 1 says x = 1 with variance 1, frame 2, at x = 4 and turned by 90
    # degrees about z, says its own y = 0 (T's x = 4) with variance 2: x = (1 + 4 / 2) / 1.5.
    def component(position, variances):
        return GaussianMixture(
            np.ones(1),
            np.array([[0.5, *position]]),
            np.diag([0.01, *variances])[None],
        )

    both = TaskParameterizedMixture(
        (component([1, 0, 0], [1, 1, 1]), component([0, 0, 0], [5, 2, 1]))
    )
    turned = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    frames = [TaskFrame(np.eye(3), np.zeros(3)), TaskFrame(turned, np.array([4.0, 0, 0]))]
    regression = both.in_frames(frames).regress(np.array([[0.5]]))
    np.testing.assert_allclose(regression.means[0], [2.0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(
        regression.covariances[0], np.diag([1 / 1.5, 5 / 6, 0.5]), atol=1e-12
    )


def test_time_counts_once_however_many_frames(mixture, shown):
    placed = mixture.in_frames(shown[1][0])
    np.testing.assert_allclose(placed.means[:, 0], mixture.mixtures[0].means[:, 0])
    np.testing.assert_allclose(
        placed.covariances[:, 0, 0], mixture.mixtures[0].covariances[:, 0, 0]
    )


def test_new_frames_are_reached_in_the_shown_manner(mixture, shown):
    rng = np.random.default_rng(1)
    for _ in range(5):
        frames = task(rng)
        path = mixture.in_frames(frames).regress(TIMES[:, None]).means
        truth = reach(frames[0].position, frames[1]).positions
        assert np.linalg.norm(path[0] - truth[0]) < 0.01
        assert np.linalg.norm(path[-1] - truth[-1]) < 0.01
        assert np.linalg.norm(path - truth, axis=1).mean() < 0.025
        coming = path[-1] - path[-10]
        along = frames[1].rotation[:, 0]
        assert coming @ along > 0.97 * np.linalg.norm(coming)


def test_moves_and_turns_with_its_frames(mixture, system):
    rng = np.random.default_rng(2)
    frames = task(rng)
    turn = Rotation.from_rotvec([0.3, -0.7, 1.1]).as_matrix()
    shift = np.array([0.2, -0.4, 0.1])
    moved = [TaskFrame(turn @ f.rotation, turn @ f.position + shift) for f in frames]
    before = mixture.in_frames(frames).regress(TIMES[:, None])
    after = mixture.in_frames(moved).regress(TIMES[:, None])
    np.testing.assert_allclose(after.means, before.means @ turn.T + shift, atol=1e-10)
    np.testing.assert_allclose(after.covariances, turn @ before.covariances @ turn.T, atol=1e-10)
    here = system.rollout(frames, frames[0].position).positions
    there = system.rollout(moved, moved[0].position).positions
    np.testing.assert_allclose(there, here @ turn.T + shift, atol=1e-10)


def test_learning_does_not_depend_on_where_it_was_shown(shown):
    turn = Rotation.from_rotvec([1.0, 0.5, -0.2]).as_matrix()
    demonstrations = [
        Demonstration.from_positions(d.times, d.positions @ turn.T + 3.0) for d in shown[0]
    ]
    frames = [
        [TaskFrame(turn @ f.rotation, turn @ f.position + 3.0) for f in of_one]
        for of_one in shown[1]
    ]
    elsewhere = fit_task_parameterized(demonstrations, frames, num_components=8)
    here = fit_task_parameterized(*shown, num_components=8)
    for one, other in zip(here.mixtures, elsewhere.mixtures, strict=True):
        np.testing.assert_allclose(one.means, other.means, atol=1e-2)


def test_springs_follow_the_shown_motion_and_rest_at_the_goal(system):
    rng = np.random.default_rng(3)
    for _ in range(3):
        frames = task(rng)
        start, goal = frames[0].position, frames[1].position
        path = system.rollout(frames, start, settling=2.5)
        truth = reach(start, frames[1]).positions
        shown_part = path.positions[:251:250]
        np.testing.assert_allclose(shown_part, truth[[0, -1]], atol=0.004)
        np.testing.assert_allclose(path.positions[-1], goal, atol=5e-4)


def test_springs_reach_the_goal_from_another_start(system, shown):
    frames = shown[1][0]
    start = frames[0].position + np.array([0.1, -0.1, 0.05])
    path = system.rollout(frames, start, settling=2.5)
    np.testing.assert_allclose(path.positions[-1], frames[1].position, atol=5e-4)


def test_time_step_does_not_change_the_path(system, shown):
    frames = shown[1][1]
    fine = system.rollout(frames, frames[0].position, time_step=0.001)
    coarse = system.rollout(frames, frames[0].position, time_step=0.02)
    np.testing.assert_allclose(coarse.positions, fine.positions[::20], atol=1e-7)
    slopes = np.gradient(fine.positions, fine.times, axis=0)[1:-1]
    np.testing.assert_allclose(slopes, fine.velocities[1:-1], atol=1e-4)
    curvature = np.gradient(fine.velocities, fine.times, axis=0)[1:-1]
    np.testing.assert_allclose(curvature, fine.accelerations[1:-1], atol=1e-2)


def test_activations_add_up_and_pass_from_one_spring_to_the_next(system, shown):
    h = system.activations(shown[1][0], TIMES)
    np.testing.assert_allclose(h.sum(axis=1), 1)
    order = h.argmax(axis=1)
    assert len(set(order)) >= 5
    assert np.count_nonzero(np.diff(order)) == len(set(order)) - 1


def test_start_and_goal_are_the_ends_of_a_demonstration(shown):
    start, goal = start_and_goal(shown[0][0])
    np.testing.assert_array_equal(start.position, shown[0][0].positions[0])
    np.testing.assert_array_equal(goal.to_frame(shown[0][0].positions)[-1], np.zeros(3))


def test_bad_input_is_refused(mixture, shown):
    demonstrations, frames = shown
    with pytest.raises(InputError, match="always the same number"):
        fit_task_parameterized(demonstrations, frames[:-1])
    with pytest.raises(InputError, match="always the same number"):
        fit_task_parameterized(demonstrations, [*frames[:-1], frames[0][:1]])
    with pytest.raises(InputError, match="num_components is 0"):
        fit_task_parameterized(demonstrations, frames, num_components=0)
    with pytest.raises(InputError, match="1 frames given, 2 were"):
        mixture.in_frames(frames[0][:1])
