import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.perception.mapping.solids import SolidSet
from pepper_drake.planning.collision.arm_collision_checker import (
    GRID_CAP,
    ArmCollisionChecker,
    arm_region,
)
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.trajectories.compiled_cost import cos_and_sin
from pepper_drake.planning.trajectories.joint_trajectories import minimum_duration, minimum_jerk
from pepper_drake.planning.trajectories.trajectory_cost import (
    PathCostParams,
    TrajectoryCost,
    TrajectoryRating,
    wanted_clearance,
)
from pepper_drake.planning.trajectories.trajectory_search import (
    PathSearchParams,
    optimize_trajectory,
)

MODEL = shared_control_model()
SAMPLES = 40
PARAMS, CLEARANCE = PathCostParams(), 0.020
VELOCITY, ACCELERATION = np.full(5, 1.0), np.full(5, 5.0)


def test_the_series_gives_cosines_and_sines():
    angles = np.linspace(-np.pi, np.pi, 1001)
    cosine, sine = np.empty((2, len(angles)))
    cos_and_sin(angles, cosine, sine)
    np.testing.assert_allclose(cosine, np.cos(angles), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(sine, np.sin(angles), rtol=0.0, atol=1e-14)


def straight(goal=1.0):
    return goal * minimum_jerk(np.linspace(0.0, 1.0, SAMPLES))[:, None] * np.ones(5)


def plain_rating(paths, reference, gaps_of, hand_of, duration):
    """The formula of `TrajectoryCost`, on whole arrays."""
    wanted = wanted_clearance(gaps_of(reference[[0, -1]]).T, SAMPLES, PARAMS, CLEARANCE).T
    cost, slack = [], []
    for path in paths:
        lack = wanted - gaps_of(path)
        bend = np.diff(path, n=2, axis=0) / (duration / (SAMPLES - 1)) ** 2
        off = hand_of(path) - hand_of(reference)
        excess = minimum_duration(path, VELOCITY, ACCELERATION) / duration - 1.0
        cost.append(
            PARAMS.proximity_weight * np.sum((np.maximum(lack, 0.0) / CLEARANCE) ** 2) / SAMPLES
            + PARAMS.slack_weight * max(lack.max(), 0.0)
            + np.mean(np.sum(off**2, axis=1)) / PARAMS.deviation**2
            + PARAMS.effort * np.sum(bend**2) / SAMPLES
            + PARAMS.duration_weight * max(excess, 0.0)
        )
        slack.append(-lack.max())
    return TrajectoryRating(np.array(cost), np.array(slack))


START, GOAL = np.array([1.3, -0.2, 1.2, 0.6, 0.0]), np.array([0.6, -0.5, 1.0, 1.1, 0.5])


def checker_among(points):
    layer = np.full(np.prod(arm_region("right").counts), GRID_CAP, np.float32)
    layer[:2000] = 0.03
    return ArmCollisionChecker(
        ExactDistance(MODEL, arm_kinematics(MODEL, "right")),
        PointCloudDistance(points),
        X_FT=RigidTransform(),
        goal_object=PointCloudDistance(np.zeros((0, 3))),
        X_TO=RigidTransform(),
        body=lambda: SolidSet([]),
        head=SolidSet([]),
        body_layer=lambda: layer,
    )


@pytest.mark.parametrize(("duration", "count"), [(3.0, 0), (0.5, 40)])
def test_compiled_code_rates_paths_as_the_formula_does(duration, count):
    rng = np.random.default_rng(2)
    checker = checker_among(rng.uniform([0.15, -0.5, -0.3], [0.5, 0.0, 0.2], (count, 3)))
    way = minimum_jerk(np.linspace(0.0, 1.0, SAMPLES))[:, None]
    reference = START + way * (GOAL - START)
    bump = np.sin(np.linspace(0.0, np.pi, SAMPLES))[:, None] ** 3
    paths = reference + bump * rng.uniform(-0.5, 0.5, (6, 1, 5))
    paths[0] = reference
    rate = TrajectoryCost(
        checker,
        reference[None],
        duration=duration,
        velocity=VELOCITY,
        acceleration=ACCELERATION,
        params=PARAMS,
        clearance=CLEARANCE,
    )
    found = rate(paths)
    expected = plain_rating(
        paths,
        reference,
        checker.approximate_distances,
        lambda q: checker.kinematics.poses(q).hand_position,
        duration,
    )
    np.testing.assert_allclose(found.cost, expected.cost, rtol=1e-5)
    np.testing.assert_allclose(found.slack, expected.slack, atol=1e-6)
    assert (found.slack < 0.0).any() == (count > 0)
    np.testing.assert_array_equal(rate(paths[::-1]).cost, found.cost[::-1])


def test_paths_may_have_a_reference_each():
    checker = checker_among(np.array([[0.4, -0.2, 0.0]]))
    way = minimum_jerk(np.linspace(0.0, 1.0, SAMPLES))[:, None]
    paths = np.array([START + way * (GOAL - START), GOAL + way * (START - GOAL)])
    numbers = {"duration": 5.0, "velocity": VELOCITY, "acceleration": ACCELERATION}
    numbers |= {"params": PARAMS, "clearance": CLEARANCE}
    both = TrajectoryCost(checker, paths, **numbers)(paths)
    for k in range(2):
        one = TrajectoryCost(checker, paths[k : k + 1], **numbers)(paths[k : k + 1])
        assert both.cost[k] == one.cost[0]
        assert both.slack[k] == one.slack[0]


def test_close_to_start_and_goal_no_more_is_wanted_than_they_allow():
    wanted = wanted_clearance(np.array([[0.005, 0.5], [0.5, -0.01]]), 101, PARAMS, CLEARANCE)
    less = PARAMS.end_allowance
    np.testing.assert_allclose(wanted[0, 0], 0.005 - less, atol=1e-7)
    np.testing.assert_allclose(wanted[0, 20:], CLEARANCE, atol=1e-7)
    np.testing.assert_allclose(wanted[1, :71], CLEARANCE, atol=1e-7)
    np.testing.assert_allclose(wanted[1, -1], -0.01 - less, atol=1e-7)
    assert np.all(np.diff(wanted[0]) >= 0)


def test_a_reference_that_is_clear_stays_as_it_is():
    path = straight()
    found = optimize_trajectory(
        path,
        lambda paths: TrajectoryRating(np.ones(len(paths)), np.ones(len(paths))),
        lower=np.full(5, -2.0),
        upper=np.full(5, 2.0),
        params=PathSearchParams(),
    )
    assert found.generations == 0
    np.testing.assert_array_equal(found.path, path)


def gap_to_pole(joints):
    """Gap (N, 1) in the plane of the first two joints to a round pole on the straight way."""
    return np.linalg.norm(joints[:, :2] - [0.5, 0.45], axis=1)[:, None] - 0.15


def around_the_pole(seed=0):
    path = straight()
    return optimize_trajectory(
        path,
        lambda paths: plain_rating(paths, path, gap_to_pole, lambda q: q[:, :3], 10.0),
        lower=np.full(5, -0.2),
        upper=np.full(5, 1.2),
        params=PathSearchParams(),
        seed=seed,
    )


def test_a_path_is_bent_around_what_is_in_the_way():
    found = around_the_pole()
    assert found.slack > PathSearchParams().min_slack
    assert gap_to_pole(found.path).min() > CLEARANCE + PathSearchParams().min_slack
    np.testing.assert_array_equal(found.path[[0, -1]], straight()[[0, -1]])
    assert np.all((found.path >= -0.2) & (found.path <= 1.2))
    # Only the joints that meet the pole go another way.
    assert np.abs(found.path - straight())[:, 2:].max() < 0.25
    assert np.abs(found.path - straight())[:, :2].max() > 0.05


def test_the_same_seed_finds_the_same_path():
    np.testing.assert_array_equal(around_the_pole(3).path, around_the_pole(3).path)
    assert not np.array_equal(around_the_pole(3).path, around_the_pole(4).path)


def test_where_there_is_no_way_the_best_one_says_so():
    path = straight()

    def walled(paths):
        return TrajectoryRating(paths[..., 0].sum(axis=1), np.full(len(paths), -0.05))

    found = optimize_trajectory(
        path,
        walled,
        lower=np.full(5, -2.0),
        upper=np.full(5, 2.0),
        params=PathSearchParams(generations=3, population=8),
    )
    assert found.slack == -0.05
    assert found.cost < walled(path[None]).cost[0]
