"""The law of a joint's motion, fitted to a robot that is late and slow by known amounts."""

import asyncio

import numpy as np
import pytest

from pepper_drake.errors import PepperDrakeError
from pepper_drake.hardware.motion_law import JOINT, fit_turn, law_checks, measure_motion_law
from pepper_drake.models.control_model import shared_control_model

RATED = float(shared_control_model().command_limits((JOINT,)).velocity[0])


class LateRobot:
    """A head that starts a while after a command, and turns at a share of the speed asked for."""

    def __init__(self, delay, share):
        self.now, self._delay, self._share = 100.0, delay, share
        self._start = self._goal = 0.2
        self._begins, self._speed = np.inf, 1.0

    def angle(self):
        way = self._goal - self._start
        gone = max(self.now - self._begins, 0.0) * self._speed
        return self._start + np.sign(way) * min(gone, abs(way))

    async def pause(self, seconds):
        self.now += seconds

    async def call(self, service, method, *arguments):
        self.now += 0.001
        if method == "getTimestamp":
            seconds = int(self.now)
            return [self.angle(), seconds, round(1e6 * (self.now - seconds))]
        if method == "getAngles":
            return [self.angle()]
        _, target, fraction = arguments
        self._start, self._goal = self.angle(), target
        self._begins, self._speed = self.now + self._delay, fraction * RATED * self._share
        return None


def measured(delay, share):
    robot = LateRobot(delay, share)
    law = asyncio.run(measure_motion_law(robot, lambda: robot.now, robot.pause))
    robot.now += 10.0
    assert robot.angle() == pytest.approx(0.2)  # It looks where it looked.
    return law


@pytest.mark.parametrize(("delay", "share"), [(0.0, 1.0), (0.08, 1.0), (0.1, 0.6)])
def test_delay_and_speed_are_found(delay, share):
    law = measured(delay, share)
    assert law.delay == pytest.approx(delay, abs=0.005)
    assert law.speed == pytest.approx(share * RATED, rel=0.02)
    assert law.spread < 0.02


def test_what_a_streamed_arm_cannot_have_is_a_warning():
    assert not any(check.is_warning for check in law_checks(measured(0.08, 1.0)))
    late, slow = law_checks(measured(0.3, 0.6))
    assert late.is_warning
    assert "30" in str(late).split(" ms")[0]
    assert slow.is_warning
    assert "0.60 of the fraction" in str(slow)


def test_a_head_that_does_not_turn_is_said():
    with pytest.raises(PepperDrakeError, match="HeadYaw did not turn"):
        measured(0.0, 0.0)


def test_a_line_is_fitted_to_the_steady_part_alone():
    times = np.linspace(0.0, 1.0, 101)
    ramp = np.clip(times - 0.2, 0.0, 0.5)
    delay, speed = fit_turn(times, 0.3 - 0.6 * ramp)
    assert (delay, speed) == pytest.approx((0.2, 0.6), abs=1e-9)
