import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pepper_drake.errors import InputError
from pepper_drake.learning import BarrierCoupling, PointCloudDistance, ReportCoupling, get_coupling

GOAL = np.array([2.0, 0.0, 0.0])
vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)


def push(
    coupling,
    points,
    position,
    velocity,
    acceleration=(0, 0, 0),
    goal=GOAL,
    tau=1.0,
    extension=0.12,
):
    field = PointCloudDistance(points, extension)
    state = np.array([position, velocity], dtype=float)
    clearance = coupling.clearance(field, goal)
    return coupling.push(field, state, np.array(acceleration, float), goal, clearance, tau)


# Equation 2.7, the reference mode.


def test_report_worked_by_hand():
    # Heading along x at 2 m/s, the point at 45 degrees: theta = pi / 4, r = (o - y) x y' points
    # down, and turning y' about it by 90 degrees gives -y: C = gamma 2 theta exp(-beta theta).
    found = push(ReportCoupling(gamma=3.0, beta=2.0), [[1, 1, 0]], [0, 0, 0], [2, 0, 0])
    size = 3.0 * 2.0 * np.pi / 4 * np.exp(-2.0 * np.pi / 4)
    np.testing.assert_allclose(found.coupling, [0, -size, 0], atol=1e-12)


@given(vectors, vectors, vectors)
def test_report_is_the_rotation_it_is_written_as(point, position, velocity):
    towards = point - position
    r = np.cross(towards, velocity)
    if np.linalg.norm(r) < 1e-3 * max(1e-3, np.linalg.norm(towards) * np.linalg.norm(velocity)):
        return
    turned = Rotation.from_rotvec(np.pi / 2 * r / np.linalg.norm(r)).apply(velocity)
    cosine = towards @ velocity / np.linalg.norm(towards) / np.linalg.norm(velocity)
    theta = np.arccos(np.clip(cosine, -1, 1))
    expected = 5.0 * turned * theta * np.exp(-2.0 * theta)
    found = push(ReportCoupling(5.0, 2.0), [point], position, velocity)
    np.testing.assert_allclose(found.coupling, expected, atol=1e-6)


def test_report_adds_up_over_the_points_and_ignores_distance():
    coupling = ReportCoupling()
    one = push(coupling, [[1, 1, 0]], [0, 0, 0], [2, 0, 0]).coupling
    many = push(coupling, [[1, 1, 0]] * 7, [0, 0, 0], [2, 0, 0]).coupling
    far = push(coupling, [[100, 100, 0]], [0, 0, 0], [2, 0, 0]).coupling
    np.testing.assert_allclose(many, 7 * one)
    np.testing.assert_allclose(far, one)


@pytest.mark.parametrize(
    ("point", "velocity"),
    [
        ([1, 0, 0], [2, 0, 0]),
        ([-1, 0, 0], [2, 0, 0]),
        ([1, 1, 0], [0, 0, 0]),
        ([0, 0, 0], [1, 0, 0]),
    ],
)
def test_report_pushes_nothing_where_it_is_undefined(point, velocity):
    found = push(ReportCoupling(), [point], [0, 0, 0], velocity)
    np.testing.assert_array_equal(found.coupling, np.zeros(3))


def test_report_is_continuous_where_a_point_comes_dead_ahead():
    sizes = [
        np.linalg.norm(push(ReportCoupling(), [[1, y, 0]], [0, 0, 0], [2, 0, 0]).coupling)
        for y in (1e-3, 1e-5, 1e-7)
    ]
    assert sizes[0] > sizes[1] > sizes[2]
    assert sizes[2] < 1e-4


# The barrier, the default.


def test_barrier_worked_by_hand():
    # One point 5 cm ahead, the hand at rest far from the goal, drawn on with 2 m/s^2: rho = 0.06,
    # a_n = 2 + 0.8 * 225 * 0.01 = 3.8, away from the point. Sliding is upwards by 0.5 / 0.5.
    barrier = BarrierCoupling()
    found = push(barrier, [[0.05, 0, 0]], [0, 0, 0], [0, 0, 0], [2, 0, 0], tau=2.0, extension=0.0)
    np.testing.assert_allclose(found.coupling / 4, [-3.8, 0.0, 3.8], atol=1e-9)
    assert found.slowdown == pytest.approx(0.05 * 3.8 * np.sqrt(2))
    assert found.distance == pytest.approx(0.05)


def test_barrier_slides_up_and_on():
    field = [[0.05, 0, 0]]
    at_rest = push(BarrierCoupling(), field, [0, 0, 0], [0, 0, 0], [2, 0, 0]).coupling
    aside = push(BarrierCoupling(), field, [0, 0, 0], [0, 0.2, 0], [2, 0, 0]).coupling
    assert at_rest[2] > 0.5
    assert abs(at_rest[1]) < 1e-9
    assert aside[1] > 0.3


@given(vectors, vectors)
def test_barrier_is_silent_beyond_its_bound(velocity, acceleration):
    barrier = BarrierCoupling()
    state = np.array([[0.0, 0.0, 0.0], velocity])
    limit = barrier.zero_beyond(state, acceleration)
    towards = velocity if np.linalg.norm(velocity) > 1e-9 else np.array([1.0, 0.0, 0.0])
    ahead = towards / np.linalg.norm(towards) * (limit + 1e-6)
    found = push(barrier, [ahead], [0, 0, 0], velocity, acceleration, extension=0.0)
    np.testing.assert_array_equal(found.coupling, np.zeros(3))


@given(vectors, vectors)
def test_barrier_cancels_inward_motion_and_is_limited(velocity, acceleration):
    barrier = BarrierCoupling(sliding=0.0)
    points = [[0.05, 0.0, 0.0]]
    found = push(barrier, points, [0, 0, 0], velocity, acceleration).coupling
    assert found[0] <= 1e-12
    assert np.linalg.norm(found) <= 12 + 1e-9
    strong = push(BarrierCoupling(), points, [0, 0, 0], 50 * velocity, acceleration).coupling
    assert np.linalg.norm(strong) <= 15 + 1e-9


def test_barrier_lets_the_hand_come_to_a_goal_near_an_obstacle():
    barrier = BarrierCoupling()
    goal = np.array([0.0, 0.0, 0.03])
    field = PointCloudDistance([[0.0, 0.0, 0.0]])
    assert barrier.clearance(field, goal) == pytest.approx(0.026)
    found = push(barrier, [[0, 0, 0]], goal, [0, 0, 0], goal=goal)
    np.testing.assert_array_equal(found.coupling, np.zeros(3))


def test_barrier_does_not_depend_on_how_dense_the_cloud_is():
    def cloud(step):
        grid = np.arange(-0.1, 0.1001, step)
        y, z = np.meshgrid(grid, grid)
        return np.column_stack((np.full(y.size, 0.05), y.ravel(), z.ravel()))

    sparse, dense = (
        push(BarrierCoupling(), cloud(step), [0, 0, 0], [0.3, 0, 0], [1, 0, 0]).coupling
        for step in (0.02, 0.005)
    )
    assert np.linalg.norm(sparse - dense) < 0.1 * np.linalg.norm(dense)


def test_no_obstacles_no_push():
    for coupling in (ReportCoupling(), BarrierCoupling()):
        found = push(coupling, [], [0, 0, 0], [1, 0, 0], [1, 0, 0])
        np.testing.assert_array_equal(found.coupling, np.zeros(3))
        assert np.isinf(found.distance)


@pytest.mark.parametrize("name", ["barrier", "report"])
def test_many_hands_at_once(name):
    coupling = get_coupling(name)
    rng = np.random.default_rng(0)
    field = PointCloudDistance(rng.uniform(-0.1, 0.1, (40, 3)))
    states = rng.normal(size=(30, 2, 3)) * 0.1
    accelerations = rng.normal(size=(30, 3))
    goal = np.array([0.1, 0.1, 0.2])
    clearance = coupling.clearance(field, goal)
    many = coupling.push(field, states, accelerations, goal, clearance, 1.5)
    for k in range(30):
        one = coupling.push(field, states[k], accelerations[k], goal, clearance, 1.5)
        np.testing.assert_allclose(many.coupling[k], one.coupling, atol=1e-9)
        assert many.slowdown[k] == pytest.approx(float(one.slowdown))
        assert many.distance[k] == pytest.approx(float(one.distance))


def test_unknown_coupling():
    with pytest.raises(InputError, match="barrier, report"):
        get_coupling("spring")
