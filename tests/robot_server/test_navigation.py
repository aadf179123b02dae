"""A room is explored, kept, found again, and driven through around what stands there."""

import asyncio
import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import Box, GeometryInstance, ProximityProperties, SceneGraph
from pydrake.math import RigidTransform
from virtual_pepper import CALLER, VirtualPepper, virtual

from pepper_drake.robot_server.robot.floor_map import CELL, FloorMap, composed, inverted
from pepper_drake.robot_server.robot.range_sensors import MEASURED, PERIOD, RangeSensors, laser_scan
from pepper_drake.robot_server.wire.service import ServiceError

WALL = 2.0
"""The room reaches so far from where the robot starts [m]."""
_WALLS = [
    (Box(0.1, 4.2, 1.0), RigidTransform([x, 0.0, 0.5])) for x in (-WALL - 0.05, WALL + 0.05)
] + [(Box(4.2, 0.1, 1.0), RigidTransform([0.0, y, 0.5])) for y in (-WALL - 0.05, WALL + 0.05)]
PILLAR = (Box(0.3, 0.3, 1.0), RigidTransform([1.0, 0.0, 0.5]))


def sensors(*more):
    """Returns what the lasers of a base at a pose measure in the room."""
    graph = SceneGraph()
    source = graph.RegisterSource("room")
    for number, (shape, X_WG) in enumerate((*_WALLS, *more)):
        solid = GeometryInstance(X_WG, shape, f"solid{number}")
        solid.set_proximity_properties(ProximityProperties())
        graph.RegisterAnchoredGeometry(source, solid)
    context = graph.CreateDefaultContext()
    lasers = RangeSensors(graph.model_inspector(), set())

    @lru_cache(maxsize=4)
    def measure(pose):
        query = graph.get_query_output_port().Eval(context)
        return dict(zip(MEASURED, lasers.measure(query, np.array(pose)).tolist(), strict=True))

    return lambda pose: measure(tuple(pose))


async def put_into(pepper: VirtualPepper, measure) -> None:
    """Lets a robot's lasers see a room."""
    state, due = pepper.robot.state, pepper.robot.now

    def seeing():
        nonlocal due
        now = state()
        if now.time >= due:
            due = now.time + PERIOD
            pepper.robot._ranges = measure(now.base_pose)
        return replace(now, ranges=pepper.robot._ranges)

    pepper.robot.state = seeing
    await pepper.cycle()


async def call(pepper, method, *arguments):
    answer = pepper.call(f"ALNavigation.{method}", *arguments)
    if not asyncio.iscoroutine(answer):
        return answer
    task = asyncio.get_running_loop().create_task(answer)
    await pepper.finish(task, within=600.0)
    return task.result()


def pixel(found, x, y):
    metres, width, height, (left, top), pixels = found
    row, column = int((top - y) / metres), int((x - left) / metres)
    return np.array(pixels).reshape(height, width)[row, column]


def test_a_room_is_explored_kept_and_driven_through_around_what_stands_there(tmp_path):
    async def scenario(pepper):
        await put_into(pepper, sensors(PILLAR))
        assert await call(pepper, "explore", 3.0) == 0
        path = await call(pepper, "saveExploration")
        assert path.startswith("/home/nao/.local/share/Explorer/")
        assert await call(pepper, "getExplorationPath") == path
        found = await call(pepper, "getMetricalMap")
        assert found[1] == found[2]  # Programs take it for a square.
        assert pixel(found, 0.0, 1.0) < 10
        assert pixel(found, 0.88, 0.0) > 90
        assert pixel(found, 1.0, 0.0) == 50  # Inside the pillar nothing is known.
        assert pixel(found, 0.0, WALL + 0.02) > 90
        await call(pepper, "startLocalization")
        assert await call(pepper, "navigateToInMap", [1.55, 0.0, math.pi / 2]) == 0
        place, error = await call(pepper, "getRobotPositionInMap")
        np.testing.assert_allclose(place, [1.55, 0.0, math.pi / 2], atol=0.1)
        assert error == [CELL] * 3
        np.testing.assert_allclose(pepper.robot.state().base_pose, place, atol=0.05)
        assert await call(pepper, "navigateToInMap", [1.0, 0.0, 0.0]) == 1
        await call(pepper, "stopLocalization")
        with pytest.raises(ServiceError, match="not localized"):
            await call(pepper, "getRobotPositionInMap")
        # Another day: the odometry restarts, and the robot stands a bit beside the place told.
        assert await call(pepper, "loadExploration", path.rpartition("/")[2]) == 0
        told = [1.5, 0.12, math.pi / 2 + 0.1]
        place, _ = await call(pepper, "relocalizeInMap", told)
        np.testing.assert_allclose(place, pepper.robot.state().base_pose, atol=0.06)

    virtual(scenario, files=tmp_path)


def test_an_exploration_that_is_stopped_keeps_what_it_saw(tmp_path):
    async def scenario(pepper):
        await put_into(pepper, sensors())
        exploring = pepper.start("ALNavigation.explore", 3.0)
        await pepper.run(3.0)
        await call(pepper, "stopExploration")
        await pepper.finish(exploring)
        assert exploring.result() == 1
        assert pixel(await call(pepper, "getMetricalMap"), 1.0, 0.0) < 45
        await pepper.run(1.0)
        rest = pepper.robot.state().base_pose
        await pepper.run(0.5)
        assert pepper.robot.state().base_pose == rest

    virtual(scenario, files=tmp_path)


def test_what_cannot_be_is_said(tmp_path):
    async def scenario(pepper):
        for method, arguments, words in [
            ("explore", (2.0,), "lasers measure nothing"),
            ("explore", (0.0,), "above 0"),
            ("getMetricalMap", (), "there is no map"),
            ("startLocalization", (), "there is no map"),
            ("navigateToInMap", ([0.0, 0.0, 0.0],), "not localized"),
            ("getExplorationPath", (), "no exploration"),
            ("loadExploration", ("yesterday.explo",), "there is not an exploration /home/nao"),
            ("loadExploration", ("../../etc/passwd",), "is not a path"),
        ]:
            with pytest.raises(ServiceError, match=words):
                await call(pepper, method, *arguments)
        broken = tmp_path / "home/nao/.local/share/Explorer/broken.explo"
        broken.write_bytes(b"no map")
        with pytest.raises(ServiceError, match=r"broken\.explo is not an exploration"):
            await call(pepper, "loadExploration", "broken.explo")

    virtual(scenario, files=tmp_path)
    assert CALLER.client == 1


@given(*(st.tuples(*[st.floats(-3, 3)] * 3) for _ in range(2)))
def test_poses_compose_and_invert(first, second):
    both = composed(first, second)
    back = composed(inverted(first), both)
    np.testing.assert_allclose(back[:2], second[:2], atol=1e-9)
    assert math.cos(back[2] - second[2]) == pytest.approx(1.0)


def test_a_pose_is_found_by_what_the_lasers_see():
    measure, known = sensors(PILLAR), FloorMap()
    for theta in np.arange(0.0, 2 * math.pi, 0.5):
        known.add(laser_scan(measure((0.0, 0.0, theta))), (0.0, 0.0, theta))
    true = np.array([0.2, -0.3, 0.4])
    scan = laser_scan(measure(true))
    found = known.matched(scan, true + [0.1, -0.12, 0.1])
    np.testing.assert_allclose(found, true, atol=0.05)


def test_no_way_leads_through_a_wall_or_the_unknown():
    known = FloorMap()
    known.add(laser_scan(sensors()((0.0, 0.0, 0.0))), (0.0, 0.0, 0.0))
    assert known.path((0.0, 0.0), (1.0, 0.0)) is not None
    assert known.path((0.0, 0.0), (2.5, 0.0)) is None
    assert known.path((0.0, 0.0), (-1.0, 0.0)) is None  # Nobody looked there.
    assert known.path((0.0, 0.0), (100.0, 0.0)) is None
