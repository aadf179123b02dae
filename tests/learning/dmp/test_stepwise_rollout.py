import numpy as np
import pytest

from pepper_drake.learning import (
    BarrierCoupling,
    Demonstration,
    MovementPrimitive,
    PointCloudDistance,
    ReportCoupling,
)
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.dmp import stepwise_rollout
from tests.learning.conftest import make_demonstration


@pytest.fixture(scope="module")
def primitive(demonstration):
    return MovementPrimitive.fit(demonstration)


@pytest.fixture(scope="module")
def straight():
    """A straight reach of 30 cm along x in 2 s, from rest to rest."""
    t = np.arange(201) * 0.01
    s = t / 2
    way = s**3 * (10 - 15 * s + 6 * s**2)
    return MovementPrimitive.fit(
        Demonstration.from_positions(t, way[:, None] * np.array([0.3, 0.0, 0.0]))
    )


def pillar(x=0.15, y=0.0, radius=0.02):
    """A cylinder that stands in the way."""
    angle, height = np.meshgrid(np.linspace(0, 2 * np.pi, 16, False), np.arange(-0.1, 0.06, 0.01))
    around = np.stack((x + radius * np.cos(angle), y + radius * np.sin(angle), height), axis=-1)
    return around.reshape(-1, 3)


def table(front=0.1, height=-0.04):
    x, y = np.meshgrid(np.arange(front, 0.4, 0.015), np.arange(-0.2, 0.2, 0.015))
    return np.column_stack((x.ravel(), y.ravel(), np.full(x.size, height)))


def test_steps_are_the_filter_when_nothing_disturbs(primitive):
    for steps in (
        primitive.rollout(goal=lambda _: primitive.goal),
        primitive.rollout(obstacles=[]),
        primitive.rollout(obstacles=[[50.0, 0.0, 0.0]]),
    ):
        whole = primitive.rollout()
        np.testing.assert_allclose(steps.positions, whole.positions, atol=1e-11)
        np.testing.assert_allclose(steps.velocities, whole.velocities, atol=1e-11)
        np.testing.assert_allclose(steps.accelerations, whole.accelerations, atol=1e-9)
        np.testing.assert_allclose(steps.phases, whole.phases, rtol=1e-11)
        np.testing.assert_allclose(steps.rotations, whole.rotations, atol=1e-11)


def test_a_motion_among_far_obstacles_is_exactly_undisturbed(straight):
    far = pillar(y=0.5)
    np.testing.assert_array_equal(straight.rollout(obstacles=far).coupling, 0.0)


def test_blocks_of_steps_are_the_single_steps(straight, monkeypatch):
    cloud = pillar(y=0.01)
    blocks = straight.rollout(obstacles=cloud)
    run = stepwise_rollout._undisturbed
    monkeypatch.setattr(
        stepwise_rollout, "_undisturbed", lambda *rest: run(*rest[:-2], 1, rest[-1])
    )
    single = straight.rollout(obstacles=cloud)
    assert np.any(blocks.coupling)
    np.testing.assert_allclose(blocks.positions, single.positions, atol=1e-11)
    np.testing.assert_allclose(blocks.coupling, single.coupling, atol=1e-8)


@pytest.mark.parametrize("y", [0.0, 0.01, -0.02])
def test_goes_around_a_pillar_even_dead_ahead_and_reaches_the_goal(straight, y):
    cloud = pillar(y=y)
    free = PointCloudDistance(cloud).distance(straight.rollout().positions).min()
    path = straight.rollout(obstacles=cloud, settle=1.5)
    assert free < 0.03
    assert path.distances.min() > 0.05
    assert np.linalg.norm(path.positions[-1] - straight.goal) < 5e-3


def test_goes_over_a_table_that_the_demonstration_touches(straight):
    free = PointCloudDistance(table()).distance(straight.rollout().positions).min()
    path = straight.rollout(obstacles=table(), settle=1.5)
    assert free < 0.041
    above = (path.positions[:, 0] > 0.1) & (path.positions[:, 0] < 0.2)
    assert path.distances[above].min() > 0.055
    assert path.positions[:, 2].max() > 0.01
    assert np.linalg.norm(path.positions[-1] - straight.goal) < 5e-3


def test_an_obstacle_that_appears_at_rest_is_left(straight):
    # The hand rests 3 cm from a pillar; the report's push is proportional to its velocity.
    start = np.zeros(3)
    cloud = pillar(x=0.05)
    path = straight.rollout(start=start, goal=start, obstacles=cloud, start_velocity=[0, 0, 0])
    assert path.distances[0] < 0.031
    assert path.distances[50] > 0.031
    report = ReportCoupling().push(
        PointCloudDistance(cloud), np.zeros((2, 3)), np.zeros(3), start, 0.0, 2.0
    )
    np.testing.assert_array_equal(report.coupling, np.zeros(3))


def test_near_obstacles_the_phase_slows_down(straight):
    free, among = straight.rollout(), straight.rollout(obstacles=pillar(y=0.01))
    assert len(among.times) > len(free.times)
    assert among.phases[-1] == pytest.approx(np.exp(-straight.translation.alpha_x), rel=0.05)
    assert np.all(np.diff(among.phases) < 0)


def test_coupling_enters_the_acceleration(straight):
    path = straight.rollout(obstacles=pillar(y=0.01), time_step=0.002)
    h = 0.002
    numeric = (path.velocities[2:] - path.velocities[:-2]) / (2 * h)
    error = np.abs(numeric - path.accelerations[1:-1]).max(axis=1)
    # C is held over each step: a step of it shows as half its jump.
    assert np.median(error[np.any(path.coupling[1:-1], axis=1)]) < 0.05


def test_steps_of_1_to_20_ms_agree_among_obstacles(straight):
    cloud = table()
    fine = straight.rollout(obstacles=cloud, time_step=0.002)
    for step in (5, 10):
        coarse = straight.rollout(obstacles=cloud, time_step=0.002 * step)
        count = min(len(coarse.times), (len(fine.times) - 1) // step + 1)
        gap = coarse.positions[:count] - fine.positions[::step][:count]
        assert np.abs(gap).max() < 3e-3


@pytest.mark.parametrize("coupling", ["barrier", "report"])
def test_batch_among_obstacles_is_the_single_rollouts(straight, coupling):
    rng = np.random.default_rng(0)
    weights = straight.weights + 0.3 * rng.normal(size=(4, *straight.weights.shape))
    cloud = pillar(y=0.01)
    batch = straight.rollout_batch(weights, obstacles=cloud, coupling=coupling)
    for k in range(4):
        single = straight.with_weights(weights[k]).rollout(obstacles=cloud, coupling=coupling)
        count = len(single.times)
        assert count <= len(batch.times)
        np.testing.assert_allclose(batch.positions[k, :count], single.positions, atol=1e-9)
        np.testing.assert_allclose(batch.phases[k, :count], single.phases, rtol=1e-9)


def test_a_coupling_with_other_constants(straight):
    wide = BarrierCoupling(margin=0.04)
    path = straight.rollout(obstacles=pillar(y=0.01), coupling=wide)
    assert path.distances.min() > straight.rollout(obstacles=pillar(y=0.01)).distances.min() + 0.01


def test_a_goal_that_jumps_is_followed_without_a_jump(straight):
    moved = straight.goal + np.array([0.0, 0.08, 0.0])
    path = straight.rollout(
        goal=lambda t: straight.goal if t < 1.0 else moved, settle=1.0, time_step=0.005
    )
    # The longer of the two: the displacement extends the duration by its share of the way.
    assert path.taus[-1] == pytest.approx(2.0 * (1 + 0.08 / 0.3), rel=1e-6)
    assert np.linalg.norm(path.positions[-1] - moved) < 1e-3
    jumps = np.abs(np.diff(path.velocities, axis=0)).max()
    assert jumps < 0.02


def test_a_goal_that_moves_with_known_velocity_is_met_without_lag(straight):
    velocity = np.array([0.0, 0.05, 0.0])
    path = straight.rollout(goal_velocity=velocity, settle=1.0)
    end = straight.goal + velocity * path.times[-1]
    # The duration grows with the displacement.
    displacement = np.linalg.norm(end - straight.goal)
    assert path.taus[-1] == pytest.approx(2.0 * (1 + displacement / 0.3), abs=0.02)
    assert np.linalg.norm(path.positions[-1] - end) < 1e-3
    np.testing.assert_allclose(path.velocities[-1], velocity, atol=1e-3)


def test_a_goal_and_its_velocity_as_functions(straight):
    def goal(t):
        return straight.goal + np.array([0.0, 0.1 * np.sin(t), 0.0])

    def velocity(t):
        return np.array([0.0, 0.1 * np.cos(t), 0.0])

    known = straight.rollout(goal=goal, goal_velocity=velocity, settle=1.0)
    unknown = straight.rollout(goal=goal, settle=1.0)
    gaps = []
    for path in (known, unknown):
        goals = np.array([goal(t) for t in path.times])
        late = path.times > path.times[-1] - 1.0
        gaps.append(np.linalg.norm(path.positions - goals, axis=1)[late].mean())
    assert gaps[0] < 0.3 * gaps[1]


def test_a_trembling_goal_is_ignored(straight):
    path = straight.rollout(goal=lambda t: straight.goal + np.array([0, 0.002 * np.sin(20 * t), 0]))
    np.testing.assert_allclose(path.positions, straight.rollout().positions, atol=1e-9)


def test_held_up_for_good_it_ends_all_the_same(straight):
    wall = np.stack(np.meshgrid([0.12], np.arange(-1, 1, 0.02), np.arange(-1, 1, 0.02)), -1)
    blocked = straight.rollout(obstacles=wall.reshape(-1, 3), time_step=0.02)
    assert np.isfinite(blocked.positions).all()
    assert blocked.distances.min() > 0.04


def test_orientation_keeps_step_with_a_motion_that_obstacles_slow_down():
    demo = make_demonstration(seed=2)
    primitive = MovementPrimitive.fit(demo)
    cloud = primitive.rollout().positions[100] + 0.02 * np.eye(3)
    path = primitive.rollout(obstacles=cloud)
    assert np.any(path.coupling)
    final = so3.multiply(path.rotations[-1], so3.conjugate(demo.rotations[-1]))
    assert np.linalg.norm(so3.log_map(final)) < 0.05
    np.testing.assert_allclose(np.linalg.norm(path.rotations, axis=1), 1.0)
