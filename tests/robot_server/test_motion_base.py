import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from virtual_pepper import CALLER, virtual

from pepper_drake.naoqi.constants import CYCLE
from pepper_drake.robot_server.robot.base_controller import trapezoid, trapezoid_duration
from pepper_drake.robot_server.wire.service import Caller


@given(st.floats(0.01, 3.0), st.floats(0.1, 0.55), st.floats(0.1, 0.55))
def test_a_trapezoid_begins_and_ends_at_rest_within_its_limits(distance, speed, acceleration):
    duration = trapezoid_duration(distance, speed, acceleration)
    times = np.linspace(0, duration, 400)
    way, rate = np.array([trapezoid(t, distance, speed, acceleration) for t in times]).T
    assert way[0] == rate[0] == 0.0
    assert (way[-1], rate[-1]) == pytest.approx((distance, 0.0), abs=1e-9)
    assert rate.max() <= speed + 1e-9
    assert np.abs(np.diff(rate)).max() <= acceleration * (times[1] - times[0]) + 1e-9
    step = times[1] - times[0]
    mean = (rate[1:] + rate[:-1]) / 2
    np.testing.assert_allclose(np.diff(way) / step, mean, atol=acceleration * step / 2)


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3, 3), st.floats(-3, 3))
@settings(max_examples=8, deadline=None)
def test_move_to_goes_where_it_was_sent_from_where_it_stands(x, y, theta, start):
    async def scenario(pepper):
        await pepper.finish(pepper.start("ALMotion.moveTo", 0.0, 0.0, start))
        x0, y0, theta0 = pepper.call("ALMotion.getRobotPosition", True)
        move = pepper.start("ALMotion.moveTo", x, y, theta)
        await pepper.finish(move)
        assert move.result() is True
        c, s = math.cos(theta0), math.sin(theta0)
        goal = (x0 + c * x - s * y, y0 + s * x + c * y)
        *place, turned = pepper.call("ALMotion.getRobotPosition", True)
        assert place == pytest.approx(goal, abs=0.011)
        assert abs(turned) <= math.pi
        error = math.remainder(turned - theta0 - theta, 2 * math.pi)
        assert error == pytest.approx(0.0, abs=0.011)
        *_, back = pepper.call("ALMotion.getSupportPolygon", 1, True)
        behind = [place[0] - 0.17 * math.cos(turned), place[1] - 0.17 * math.sin(turned)]
        assert back == pytest.approx(behind)
        velocities = np.array([command.base_velocity for command in pepper.history])
        assert np.hypot(*velocities[:, :2].T).max() <= 0.35 + 1e-9
        assert np.abs(velocities[:, 2]).max() <= 1.0 + 1e-9
        # Over the floor: the base's frame turns meanwhile.
        headings = np.cumsum(velocities[:, 2]) * CYCLE
        floor = (velocities[:, 0] + 1j * velocities[:, 1]) * np.exp(1j * (headings - headings[0]))
        shifted = floor * np.exp(-1j * velocities[:, 2] * CYCLE)
        assert np.abs(np.diff(shifted)).max() / CYCLE <= 0.3 + 1e-6
        assert np.abs(np.diff(velocities[:, 2])).max() / CYCLE <= 0.75 + 1e-6

    virtual(scenario)


def test_move_to_takes_the_time_of_its_limits_or_the_time_it_is_given():
    async def scenario(pepper):
        expected = 1.0 / 0.35 + 0.35 / 0.3
        took = await pepper.finish(pepper.start("ALMotion.moveTo", 1.0, 0.0, 0.0))
        assert took == pytest.approx(expected, abs=0.2)
        slow = await pepper.finish(pepper.start("ALMotion.moveTo", 0.5, 0.0, 0.0, 6.0))
        assert slow == pytest.approx(6.0, abs=0.2)
        settings = [["MaxVelXY", 0.1], ["Frequency", 1.0]]
        careful = await pepper.finish(pepper.start("ALMotion.moveTo", 0.5, 0.0, 0.0, settings))
        assert careful > 5.0
        points = [[0.2, 0.0, 0.0], [0.2, 0.2, 0.0]]
        await pepper.finish(pepper.start("ALMotion.moveTo", points))
        assert pepper.call("ALMotion.getRobotPosition", True)[1] == pytest.approx(0.2, abs=0.01)

    virtual(scenario)


def test_the_newest_move_wins_and_the_older_call_returns_false():
    async def scenario(pepper):
        first = pepper.start("ALMotion.moveTo", 2.0, 0.0, 0.0)
        await pepper.run(2.0)
        second = pepper.start("ALMotion.moveTo", 0.0, 0.0, 0.5)
        await pepper.finish(second)
        assert first.done()
        assert first.result() is False
        assert second.result() is True

    virtual(scenario)


def test_move_goes_on_until_stop_and_brakes():
    async def scenario(pepper):
        pepper.call("ALMotion.move", 0.2, 0.0, 0.3)
        await pepper.run(3.0)
        assert pepper.call("ALMotion.moveIsActive")
        assert pepper.call("ALMotion.getRobotVelocity") == pytest.approx([0.2, 0.0, 0.3])
        pepper.call("ALMotion.stopMove")
        await pepper.finish(pepper.start("ALMotion.waitUntilMoveIsFinished"))
        await pepper.run(1.0)
        assert not pepper.call("ALMotion.moveIsActive")
        assert pepper.call("ALMotion.getRobotVelocity") == [0.0, 0.0, 0.0]

    virtual(scenario)


def test_move_toward_takes_shares_of_the_largest_velocity():
    async def scenario(pepper):
        pepper.call("ALMotion.moveToward", 0.5, 0.0, -3.0)
        await pepper.run(3.0)
        assert pepper.call("ALMotion.getRobotVelocity") == pytest.approx([0.175, 0.0, -1.0])
        pepper.call("ALMotion.moveToward", 0.0, 0.0, 0.0)
        await pepper.run(3.0)
        assert not pepper.call("ALMotion.moveIsActive")

    virtual(scenario)


def test_a_robot_at_rest_does_not_roll():
    async def scenario(pepper):
        move = pepper.start("ALMotion.moveTo", 1.0, 0.0, 0.0)
        await pepper.finish(move)
        assert move.result() is False
        pepper.call("ALMotion.move", 0.2, 0.0, 0.0)
        await pepper.run(1.0)
        assert pepper.call("ALMotion.getRobotPosition", True) == [0.0, 0.0, 0.0]

    virtual(scenario, awake=False)


def test_a_client_that_leaves_takes_its_move_with_it_and_no_other():
    async def scenario(pepper):
        leaver = Caller(client=7)
        pepper.call("ALMotion.move", 0.2, 0.0, 0.0, caller=leaver)
        pepper.services["ALMotion"].on_client_left(CALLER)
        await pepper.run(2.0)
        assert pepper.call("ALMotion.moveIsActive")
        pepper.services["ALMotion"].on_client_left(leaver)
        await pepper.run(2.0)
        assert not pepper.call("ALMotion.moveIsActive")

    virtual(scenario)
