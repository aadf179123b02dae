"""Rays against solids whose distance is known, and the sensors made of them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import (
    Box,
    Cylinder,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.robot_server.robot.range_sensors import MEASURED, RangeSensors


def _scene(*solids):
    graph = SceneGraph()
    source = graph.RegisterSource("test")
    for number, (shape, X_WG) in enumerate(solids):
        instance = GeometryInstance(X_WG, shape, f"solid{number}")
        instance.set_proximity_properties(ProximityProperties())
        graph.RegisterAnchoredGeometry(source, instance)
    context = graph.CreateDefaultContext()
    return graph.model_inspector(), graph.get_query_output_port().Eval(context)


def _measured(solids, base_pose=(0.0, 0.0, 0.0)):
    inspector, query = _scene(*solids)
    values = RangeSensors(inspector, set()).measure(query, np.array(base_pose))
    return dict(zip(MEASURED, values, strict=True))


def _segment(values, side, number):
    name = f"Platform/LaserSensor/{side}/Horizontal/Seg{number:02d}"
    return values[f"{name}/X"], values[f"{name}/Y"]


def test_a_wall_ahead_is_told_in_the_sensors_frame_from_left_to_right():
    values = _measured([(Box(0.1, 10.0, 2.0), RigidTransform([1.05, 0.0, 1.0]))])
    for number in range(1, 16):
        x, y = _segment(values, "Front", number)
        assert x == pytest.approx(1.0 - 0.0562)
        assert y == pytest.approx(x * math.tan(math.radians(30.0 - 60.0 * (number - 1) / 14)))
    assert values["Platform/Front/Sonar"] == pytest.approx(1.0 - 0.0687)
    assert values["Platform/Back/Sonar"] == 5.0
    assert math.hypot(*_segment(values, "Left", 15)) > 3.0


def test_the_sensors_turn_with_the_base():
    wall = (Box(0.1, 10.0, 2.0), RigidTransform([1.05, 0.0, 1.0]))
    values = _measured([wall], (0.2, 0.3, math.pi))
    assert values["Platform/Back/Sonar"] == pytest.approx(0.8 - 0.0587)
    assert math.hypot(*_segment(values, "Front", 8)) == pytest.approx(5.0)


def test_lasers_that_look_down_tell_where_they_meet_the_floor_or_a_box_on_it():
    def shovel(*solids):
        values = _measured(solids)
        name = "Platform/LaserSensor/Front/{}/Seg{:02d}/{}"
        places = [("Shovel", 1), ("Shovel", 2), ("Vertical/Right", 1)]
        return [[values[name.format(*place, axis)] for axis in "XY"] for place in places]

    left, ahead, right = shovel()
    down = 0.2648 / math.sin(0.349066)
    assert ahead == pytest.approx([down, 0.0])
    assert left == pytest.approx([down, down * math.tan(math.radians(30.0))])
    assert right == pytest.approx([down, down * math.tan(math.radians(30.21))])
    box = (Box(0.4, 0.1, 0.2), RigidTransform([0.7, 0.0, 0.1]))
    hidden, nearer, _ = shovel(box)
    assert hidden == left
    assert nearer == pytest.approx([(0.5 - 0.0562) / math.cos(0.349066), 0.0])


@given(
    x=st.floats(0.6, 2.5),
    y=st.floats(-0.2, 0.2),
    turn=st.floats(-3.0, 3.0),
    kind=st.sampled_from(["sphere", "cylinder", "box"]),
)
def test_what_a_ray_hits_lies_on_the_surface(x, y, turn, kind):
    shape = {"sphere": Sphere(0.3), "cylinder": Cylinder(0.3, 0.5), "box": Box(0.5, 0.7, 0.4)}[kind]
    X_WG = RigidTransform(RollPitchYaw(0.0, 0.0, turn), [x, y, 0.0])
    inspector, query = _scene((shape, X_WG))
    measured = RangeSensors(inspector, set()).measure(query, np.zeros(3))
    values = dict(zip(MEASURED, measured, strict=True))
    hits = 0
    for number in range(1, 16):
        place = np.array([*_segment(values, "Front", number), 0.0]) + (0.0562, 0.0, 0.0333)
        if np.hypot(*(place[:2] - (0.0562, 0.0))) < 4.99:
            hits += 1
            (found,) = query.ComputeSignedDistanceToPoint(place)
            assert found.distance == pytest.approx(0.0, abs=1e-6)
    assert hits > 0
