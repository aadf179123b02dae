"""A room is explored, kept, found again, and driven through around what stands there."""

import asyncio
import itertools
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
RADIUS = 0.28
"""Radius of the base [m]."""


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


async def put_into(pepper: VirtualPepper, measure) -> list[tuple[float, float, float]]:
    """Lets a robot's lasers see a room; returns the poses in which the base is from then on."""
    state, due = pepper.robot.state, pepper.robot.now
    poses = []

    def seeing():
        nonlocal due
        now = state()
        if now.time >= due:
            due = now.time + PERIOD
            pepper.robot._ranges = measure(now.base_pose)
        poses.append(now.base_pose)
        return replace(now, ranges=pepper.robot._ranges)

    pepper.robot.state = seeing
    await pepper.cycle()
    return poses


def from_pillar(place):
    """Returns how far a place is from the pillar's surface [m]."""
    return math.hypot(max(abs(place[0] - 1.0) - 0.15, 0.0), max(abs(place[1]) - 0.15, 0.0))


def apart(first, second):
    """Returns the largest difference between two poses [m, rad]."""
    turn = math.remainder(first[2] - second[2], 2 * math.pi)
    return max(abs(first[0] - second[0]), abs(first[1] - second[1]), abs(turn))


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
    return pixels.value.reshape(height, width)[row, column]


def test_a_room_is_explored_kept_and_driven_through_around_what_stands_there(tmp_path):
    async def scenario(pepper):
        driven = await put_into(pepper, sensors(PILLAR))
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
        for goal in ([1.0, 1.0, 0.5], [1.0, -1.0, math.pi / 2]):  # The pillar is between them.
            assert await call(pepper, "navigateToInMap", goal) == 0
            place, error = await call(pepper, "getRobotPositionInMap")
            assert apart(place, goal) < CELL
            assert error == [CELL] * 3
            assert apart(pepper.robot.state().base_pose, goal) < CELL
        assert min(from_pillar(pose) for pose in driven) > RADIUS
        assert await call(pepper, "navigateToInMap", [1.0, 0.0, 0.0]) == 1
        # The map is gone over on other threads: other clients' calls go on meanwhile.
        work = asyncio.get_running_loop()._default_executor.done
        assert work >= {"with_scan", "frontier", "path", "leads_straight", "matched"}
        await call(pepper, "stopLocalization")
        with pytest.raises(ServiceError, match="not localized"):
            await call(pepper, "getRobotPositionInMap")
        # Another day: the odometry restarts, and the robot stands a bit beside the place told.
        assert await call(pepper, "loadExploration", path.rpartition("/")[2]) == 0
        told = np.array(pepper.robot.state().base_pose) + [-0.05, 0.12, 0.1]
        place, _ = await call(pepper, "relocalizeInMap", told.tolist())
        assert apart(place, pepper.robot.state().base_pose) < 0.06
        # Where it is not, what it sees does not fit.
        with pytest.raises(ServiceError, match="does not fit the map near"):
            await call(pepper, "relocalizeInMap", [0.0, 0.8, 0.8])
        with pytest.raises(ServiceError, match="not localized"):
            await call(pepper, "getRobotPositionInMap")
        with pytest.raises(ServiceError, match="the place 1e\\+09, 0 is not on the map"):
            await call(pepper, "relocalizeInMap", [1e9, 0.0])

    virtual(scenario, files=tmp_path)


@pytest.mark.parametrize(
    ("after", "stop"),
    [
        (0.1, "ALNavigation.stopExploration"),  # It waits for a scan, and does not move.
        (0.1, "ALMotion.stopMove"),
        (0.1, "ALMotion.killAll"),
        (3.0, "ALNavigation.stopExploration"),
    ],
)
def test_an_exploration_that_is_stopped_keeps_what_it_saw(after, stop):
    async def scenario(pepper):
        await put_into(pepper, sensors())
        exploring = pepper.start("ALNavigation.explore", 3.0)
        await pepper.run(after)
        pepper.call(stop)
        assert await pepper.finish(exploring) < 0.1
        assert exploring.result() == 1
        if after > 1.0:
            assert pixel(await call(pepper, "getMetricalMap"), 1.0, 0.0) < 45
        await pepper.run(1.0)
        rest = pepper.robot.state().base_pose
        await pepper.run(0.5)
        assert pepper.robot.state().base_pose == rest
        assert not pepper.motion.move_is_active()

    virtual(scenario)


def test_driving_in_a_map_is_stopped_while_it_looks():
    async def scenario(pepper):
        poses = await put_into(pepper, sensors())
        exploring = pepper.start("ALNavigation.explore", 3.0)
        await pepper.run(3.0)
        await call(pepper, "stopExploration")
        await pepper.finish(exploring)
        await call(pepper, "startLocalization")
        await pepper.run(1.0)
        for stop in ("ALNavigation.stopNavigateTo", "ALMotion.stopMove"):
            driving = pepper.start("ALNavigation.navigateToInMap", [0.5, 0.0, 0.0])
            await pepper.run(0.1)
            pepper.call(stop)
            await pepper.finish(driving, within=0.1)
            assert driving.result() == 1
        straight = pepper.start("ALNavigation.navigateTo", 0.5, 0.0)
        await pepper.run(0.1)
        await call(pepper, "stopNavigateTo")
        await pepper.finish(straight)
        assert straight.result() is False
        assert abs(poses[-1][0]) < 0.05

    virtual(scenario)


def test_one_thing_is_done_at_a_time():
    async def scenario(pepper):
        await put_into(pepper, sensors())
        exploring = pepper.start("ALNavigation.explore", 3.0)
        await pepper.run(0.1)
        for method, arguments in [
            ("explore", (1.0,)),
            ("navigateTo", (0.1, 0.0)),
            ("startLocalization", ()),
            ("relocalizeInMap", ([0.0, 0.0],)),
        ]:
            with pytest.raises(ServiceError, match=f"{method}: explore is already running"):
                await call(pepper, method, *arguments)
        exploring.cancel()  # Its client leaves.
        await pepper.run(0.1)
        assert exploring.cancelled()
        assert await call(pepper, "navigateTo", 0.1, 0.0) is True

    virtual(scenario)


def test_what_cannot_be_is_said(tmp_path):
    async def scenario(pepper):
        for method, arguments, words in [
            ("explore", (2.0,), "lasers measure nothing"),
            ("explore", (0.0,), "above 0"),
            ("explore", (51.0,), "at most 50"),
            ("getMetricalMap", (), "there is no map"),
            ("startLocalization", (), "there is no map"),
            ("navigateToInMap", ([0.0, 0.0, 0.0],), "not localized"),
            ("getExplorationPath", (), "no exploration"),
            ("loadExploration", ("yesterday.explo",), "there is no exploration /home/nao"),
            ("loadExploration", ("../../etc/passwd",), "is not a path"),
        ]:
            with pytest.raises(ServiceError, match=words):
                await call(pepper, method, *arguments)
        broken = tmp_path / "home/nao/.local/share/Explorer/broken.explo"
        grid, origin, nowhere = np.zeros((5, 5)), np.zeros(2), np.full(2, np.nan)
        for content, words in [
            (b"no map", "not an npz file"),
            ({"log_odds": grid}, "has no origin"),
            ({"log_odds": np.zeros(5), "origin": origin}, "must be a grid"),
            ({"log_odds": np.zeros((5, 1008)), "origin": origin}, "must be a grid of 1 to 1007"),
            ({"log_odds": grid * np.nan, "origin": origin}, "log_odds has a value"),
            ({"log_odds": grid, "origin": nowhere}, "origin must be two numbers"),
            ({"log_odds": grid, "origin": origin + 1.0}, "does not contain the place"),
        ]:
            if isinstance(content, dict):
                with broken.open("wb") as file:
                    np.savez(file, **content)
            else:
                broken.write_bytes(content)
            told = r"an exploration: /home/nao/\.local/share/Explorer/broken\.explo: .*"
            with pytest.raises(ServiceError, match=told + words) as refusal:
                await call(pepper, "loadExploration", "broken.explo")
            assert str(tmp_path) not in str(refusal.value)

    virtual(scenario, files=tmp_path)
    assert CALLER.client == 1


@given(*(st.tuples(*[st.floats(-3, 3)] * 3) for _ in range(2)))
def test_poses_compose_and_invert(first, second):
    both = composed(first, second)
    back = composed(inverted(first), both)
    np.testing.assert_allclose(back[:2], second[:2], atol=1e-9)
    assert math.cos(back[2] - second[2]) == pytest.approx(1.0)


def seen_from_the_middle(*more):
    """Returns the map of the room as it is seen from the map's origin, turning once around."""
    measure, known = sensors(*more), FloorMap()
    for theta in np.arange(0.0, 2 * math.pi, 0.5):
        known = known.with_scan(laser_scan(measure((0.0, 0.0, theta))), (0.0, 0.0, theta))
    return known


@pytest.mark.parametrize("true", [(0.2, -0.3, 0.4), (0.1, -0.12, 0.1), (-0.3, 0.25, -2.5)])
def test_a_pose_is_found_by_what_the_lasers_see(true):
    known = seen_from_the_middle(PILLAR)
    scan = laser_scan(sensors(PILLAR)(true))
    for error in ([0.1, -0.12, 0.1], [-0.1, 0.12, -0.1], [0.0, 0.0, 0.0]):
        found, mismatch = known.matched(scan, np.array(true) + error)
        np.testing.assert_allclose(found, true, atol=0.05)
        assert mismatch < CELL


def test_a_pose_is_not_found_without_a_map_or_without_hits():
    scan = laser_scan(sensors()((0.0, 0.0, 0.0)))
    assert FloorMap().matched(scan, (0.1, 0.2, 0.3))[1] == math.inf
    nothing = replace(scan, hits=np.zeros_like(scan.hits))
    assert seen_from_the_middle().matched(nothing, (0.1, 0.2, 0.3))[1] == math.inf


@given(st.floats(0.0, 1.5), st.floats(-1.5, -0.6))
def test_a_way_keeps_its_distance_from_what_was_seen(x, y):
    known, goal = _ROOM, (1.0, 0.9)
    way = known.path((x, y), goal)
    np.testing.assert_allclose(way[-1], goal)
    corners = np.array([(x, y), *way])
    shares = np.linspace(0.0, 1.0, 100)[:, None]
    for start, end in itertools.pairwise(corners):
        assert min(map(from_pillar, start + shares * (end - start))) > RADIUS
        assert known.leads_straight(start, end)
    assert known.leads_straight((x, y), goal) == (len(way) == 1)


def _seen_all_around():
    """Returns the map of the room from places around the pillar."""
    measure, known = sensors(PILLAR), FloorMap()
    for x, y in ((0.0, 0.0), (1.0, 1.0), (1.6, 0.0), (1.0, -1.0)):
        for theta in np.arange(0.0, 2 * math.pi, 0.25):
            known = known.with_scan(laser_scan(measure((x, y, theta))), (x, y, theta))
    return known


_ROOM = _seen_all_around()


def test_places_where_it_was_are_left_out_until_none_is_left():
    known, looked_from = seen_from_the_middle(PILLAR), []
    while (way := known.frontier((0.0, 0.0), 3.0, looked_from)) is not None:
        assert all(np.linalg.norm(way[-1] - place) > 3 * CELL for place in looked_from)
        looked_from.append(way[-1])
    assert 3 < len(looked_from) < 200


def test_a_map_ends_somewhere():
    scan, far = laser_scan(sensors()((0.0, 0.0, 0.0))), FloorMap()
    for pose in ((0.0, 0.0, 0.0), (49.0, 49.0, 0.0), (-49.0, -49.0, 0.0), (1e9, 0.0, 0.0)):
        far = far.with_scan(scan, pose)
        assert far.log_odds.shape[0] == far.log_odds.shape[1] <= 1007
    assert far.contains((48.0, 48.0))
    assert not far.contains((60.0, 0.0))
    assert far.path((60.0, 0.0), (0.1, 0.0)) is None
    assert far.frontier((60.0, 0.0), 50.0, []) is None


def test_no_way_leads_through_a_wall_or_the_unknown():
    known = FloorMap().with_scan(laser_scan(sensors()((0.0, 0.0, 0.0))), (0.0, 0.0, 0.0))
    assert known.path((0.0, 0.0), (1.0, 0.0)) is not None
    assert known.path((0.0, 0.0), (2.5, 0.0)) is None
    assert known.path((0.0, 0.0), (-1.0, 0.0)) is None  # Nobody looked there.
    assert known.path((0.0, 0.0), (100.0, 0.0)) is None
    assert known.path((0.0, 0.0), (1e300, 0.0)) is None


def test_the_nearest_free_zone_is_found_beside_a_pillar():
    async def scenario(pepper):
        await put_into(pepper, sensors(PILLAR))

        async def find(radius, farthest):
            call = pepper.start("ALNavigation.findFreeZone", radius, farthest)
            await pepper.finish(call)
            return call.result()

        error, found, place = await find(0.6, 0.5)
        assert (error, found, place) == (0, 0.6, [0.0, 0.0])
        error, found, place = await find(1.0, 0.5)
        assert (error, found) == (0, 1.0)
        assert from_pillar(place) > 0.9  # A ray sees the pillar's face somewhere, not its edges.
        error, found, _ = await find(3.0, 0.5)
        assert error == 1
        assert found < 3.0
        answers = []
        for gather in (False, True, False):
            if gather:
                pepper.call("ALNavigation.startFreeZoneUpdate")
            call = pepper.start("ALNavigation.stopAndComputeFreeZone", 0.6, [0.5])
            await pepper.finish(call)
            answers.append(call.result())
        assert answers == [[1, 0.0, [0.0, 0.0]], [0, 0.6, [0.0, 0.0]], [1, 0.0, [0.0, 0.0]]]

    virtual(scenario)


def test_a_trajectory_of_lines_and_a_circle_is_driven():
    line = ["Holonomic", ["Line", [0.4, 0.0]], 0.5, 5.0]
    back = ["Holonomic", ["Line", [-0.4, 0.0]], -0.5, 5.0]
    half = ["Holonomic", ["Circle", [0.0, 0.2], math.pi], math.pi, 8.0]

    async def scenario(pepper):
        async def drive(trajectory):
            call = pepper.start("ALNavigation.moveAlong", trajectory)
            await pepper.finish(call)
            assert call.result() is True
            return np.array(pepper.robot.state().base_pose)

        np.testing.assert_allclose(await drive(line), [0.4, 0.0, 0.5], atol=0.01)
        there = np.array([0.4, 0.0]) - 0.4 * np.array([math.cos(0.5), math.sin(0.5)])
        np.testing.assert_allclose(await drive(back), [*there, 0.0], atol=0.01)
        pose = await drive(["Composed", half, half])
        np.testing.assert_allclose(pose[:2], there, atol=0.03)
        assert abs(math.remainder(pose[2], 2 * math.pi)) < 0.05
        for wrong in ([], ["Line", [1.0, 0.0]], ["Holonomic", ["Line", [1.0]], 0.0, 5.0], 3):
            with pytest.raises(ServiceError, match=r"^ALNavigation::moveAlong: "):
                await pepper.call("ALNavigation.moveAlong", wrong)

    virtual(scenario)


def test_a_home_is_learned_and_found_again():
    async def scenario(pepper):
        async def go(method, *arguments):
            call = pepper.start(method, *arguments)
            await pepper.finish(call)
            return call.result()

        assert await go("ALLocalization.goToHome") == 1
        assert pepper.call("ALLocalization.getMessageFromErrorCode", 1) == "no home was learned"
        await go("ALMotion.moveTo", 0.3, 0.1, 0.5)
        assert pepper.call("ALLocalization.learnHome") == 0
        assert await go("ALLocalization.goToPosition", [0.4, 0.0, 0.2]) == 0
        position = pepper.call("ALLocalization.getRobotPosition", False)
        np.testing.assert_allclose(position, [0.4, 0.0, 0.2], atol=0.01)
        assert pepper.call("ALLocalization.save", "kitchen") == 0
        assert await go("ALLocalization.goToHome") == 0
        pose = pepper.robot.state().base_pose
        np.testing.assert_allclose(pose, [0.3, 0.1, 0.5], atol=0.01)
        assert pepper.call("ALLocalization.isInCurrentHome") is True
        assert pepper.call("ALLocalization.load", "garden") == 3
        assert await go("ALVisualCompass.moveStraightTo", -0.1) is True
        there = [0.3 - 0.1 * math.cos(0.5), 0.1 - 0.1 * math.sin(0.5), 0.5]
        np.testing.assert_allclose(pepper.robot.state().base_pose, there, atol=0.01)

    virtual(scenario)
