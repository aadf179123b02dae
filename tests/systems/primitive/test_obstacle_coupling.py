import numpy as np
import pytest
from pydrake.common.value import Value

from pepper_drake.learning import PointCloudDistance
from pepper_drake.learning.dmp.obstacle_coupling import get_coupling
from pepper_drake.systems.primitive.obstacle_coupling import ObstacleCoupling
from tests.systems.motion_example import make_cloud, moving

BARRIER = get_coupling("barrier")


def fixed_coupling(points, name="barrier"):
    system = ObstacleCoupling()
    context = system.CreateDefaultContext()
    system.movement_port.FixValue(context, moving(None, coupling=get_coupling(name)))
    if points is not None:
        system.cloud_port.FixValue(context, Value(make_cloud(points)))
    for port, value in (
        (system.position_port, [0.0, 0.0, 0.06]),
        (system.velocity_port, [0.1, 0.0, -0.2]),
        (system.nominal_acceleration_port, [0.0, 0.0, -1.0]),
        (system.goal_position_port, [0.3, 0.0, 0.1]),
        (system.tau_port, [2.0]),
    ):
        port.FixValue(context, value)
    return system, context


@pytest.mark.parametrize("name", ["barrier", "report"])
def test_coupling_ports_are_the_functions_values(name):
    points = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [np.nan, 0.0, 0.0]])
    system, context = fixed_coupling(points, name)
    field = PointCloudDistance(points.astype(np.float32))
    goal = np.array([0.3, 0.0, 0.1])
    law = get_coupling(name)
    expected = law.push(
        field,
        np.array([[0.0, 0.0, 0.06], [0.1, 0.0, -0.2]]),
        np.array([0.0, 0.0, -1.0]),
        goal,
        law.clearance(field, goal),
        2.0,
    )
    assert np.any(expected.coupling)
    np.testing.assert_array_equal(system.coupling_port.Eval(context), expected.coupling)
    assert system.slowdown_port.Eval(context)[0] == expected.slowdown
    assert system.distance_port.Eval(context)[0] == expected.distance


@pytest.mark.parametrize("points", [None, np.zeros((0, 3)), np.full((3, 3), np.nan)])
def test_without_obstacles_nothing_is_pushed(points):
    system, context = fixed_coupling(points)
    np.testing.assert_array_equal(system.coupling_port.Eval(context), np.zeros(3))
    np.testing.assert_array_equal(system.slowdown_port.Eval(context), [0.0])
    assert np.isinf(system.distance_port.Eval(context)[0])


@pytest.mark.parametrize("movement", [moving(None, 1), moving(None, 0, coupling=BARRIER)])
def test_at_rest_or_without_a_law_nothing_is_pushed(movement):
    system, context = fixed_coupling(np.zeros((1, 3)))
    assert np.any(system.coupling_port.Eval(context))
    system.movement_port.FixValue(context, movement)
    np.testing.assert_array_equal(system.coupling_port.Eval(context), np.zeros(3))


def test_predicted_points_push_like_those_that_are_seen():
    points = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]])
    seen, context = fixed_coupling(points)
    predicted, its_context = fixed_coupling(points[:1])
    predicted.predicted_cloud_port.FixValue(its_context, Value(make_cloud(points[1:])))
    np.testing.assert_array_equal(
        predicted.coupling_port.Eval(its_context), seen.coupling_port.Eval(context)
    )


def test_the_tree_is_built_once_for_each_cloud(monkeypatch):
    built = []

    def count(points, **options):
        built.append(len(points))
        return PointCloudDistance(points, **options)

    monkeypatch.setattr(
        "pepper_drake.systems.primitive.obstacle_field_cache.PointCloudDistance", count
    )
    system, context = fixed_coupling(np.zeros((4, 3)))
    for x in (0.0, 0.01, 0.02):
        system.position_port.FixValue(context, [x, 0.0, 0.06])
        system.coupling_port.Eval(context)
    assert built == [4]
    system.cloud_port.FixValue(context, Value(make_cloud(np.zeros((4, 3)))))
    system.coupling_port.Eval(context)
    assert built == [4]
    system.cloud_port.FixValue(context, Value(make_cloud(np.ones((5, 3)))))
    system.coupling_port.Eval(context)
    assert built == [4, 5]
