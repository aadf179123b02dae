"""The robot's joints and odometry, requested once per cycle, stamped by both clocks."""

import asyncio
import math
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np

from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.measurements import Measurement, Measurements
from pepper_drake.hardware.transport import Transport
from pepper_drake.models.control_model import BODY_JOINTS
from pepper_drake.naoqi.clock import join_time
from pepper_drake.naoqi.constants import BODY, CYCLE, HANDS
from pepper_drake.naoqi.streaming import lookahead

FRESH = 0.1
"""Largest age of a valid state or command [s]."""
FROZEN = 1.0
"""Timeout of an answer, after which the robot counts as frozen [s]."""
FIRST_ANSWERS = 3
"""Answers before the round trip is checked: the first ones include the lookup of services."""
_CLOCK_KEY = "Device/SubDeviceList/HeadYaw/Position/Sensor/Value"


class StateReader:
    """Measurements of a robot, and the latency of its answers.

    Attributes:
        measured: The measurements so far.
        answers: Number of them.
        round_trip: Low-pass filtered round-trip time [s]; 0 before the first answer.
        shortest_trip: Shortest round-trip time [s]; infinite before the first answer.
        hands: Opening of each of `HANDS`; NaN before the first.

    Args:
        transport: The robot.
        clock: The link's.
    """

    def __init__(self, transport: Transport, clock: LinkClock) -> None:
        self._transport, self._clock = transport, clock
        self._columns = [BODY.index(name) for name in BODY_JOINTS]
        self._request_time = 0.0
        self._question: asyncio.Task[None] | None = None
        self.measured = Measurements()
        self.answers = 0
        self.round_trip, self.shortest_trip = 0.0, np.inf
        self.hands = [np.nan] * len(HANDS)

    @property
    def _is_asking(self) -> bool:
        return self._question is not None and not self._question.done()

    def ask(self, start: Callable[[Coroutine[Any, Any, None]], asyncio.Task[None]]) -> None:
        """Requests a state, unless the last request is still pending.

        Args:
            start: Starts a task, whose exceptions the link handles.
        """
        if not self._is_asking:
            self._request_time = self._clock.now()
            self._question = start(self._read())

    def check(self) -> None:
        """Checks the robot's answers.

        Raises:
            LinkFault: It does not answer, its clock has stopped, or it answers too slowly.
        """
        now, newest = self._clock.now(), self.measured.newest
        silent = now - self._request_time if self._is_asking else 0.0
        if silent > FROZEN:
            raise LinkFault("link_frozen", f"no answer for {FROZEN:g} s")
        if silent < FRESH and newest and now - newest.time > FROZEN:
            raise LinkFault("state_stale", f"its clock stood still for {FROZEN:g} s")
        if self.answers > FIRST_ANSWERS and lookahead(self.round_trip) is None:
            raise LinkFault("link_slow", f"{self.round_trip * 1000:.0f} ms to an answer")

    async def at(self, robot_time: float) -> Measurement | None:
        """Returns the state at a time of the robot's clock; None if unknown."""
        taken = self.measured.at(robot_time)
        if taken is None:
            # The state of that time may still be in transit.
            await self._clock.pause(2 * CYCLE + self.round_trip)
            taken = self.measured.at(robot_time)
        return taken

    async def _read(self) -> None:
        call = self._transport.call
        stamp, angles, base = await asyncio.gather(
            call("ALMemory", "getTimestamp", _CLOCK_KEY),
            call("ALMotion", "getAngles", "Body", True),
            call("ALMotion", "getRobotPosition", True),
        )
        answered = self._clock.now()
        trip = answered - self._request_time
        if self.answers < FIRST_ANSWERS:
            self.round_trip = min(trip, self.round_trip or trip)
        else:
            self.round_trip += 0.1 * (trip - self.round_trip)
        self.shortest_trip = min(self.shortest_trip, trip)
        if len(angles) != len(BODY):
            raise LinkFault("wrong_robot", f"its body has {len(angles)} joints, not {len(BODY)}")
        if len(base) != 3:
            raise LinkFault("wrong_robot", f"its base pose has {len(base)} numbers, not 3")
        positions, base_pose = np.array(angles)[self._columns], np.array(base, dtype=float)
        self.hands = [float(angles[BODY.index(name)]) for name in HANDS]
        if not (np.isfinite(positions).all() and np.isfinite(base_pose).all()):
            raise LinkFault("wrong_robot", "it measures what is not a number")
        newest = self.measured.newest
        if newest:  # Robots give the angle in [-pi, pi]: it is unwrapped.
            turned = base_pose[2] - newest.base_pose[2]
            base_pose[2] = newest.base_pose[2] + math.remainder(turned, 2 * math.pi)
        # On average it answers in the middle, with a measurement half a cycle old.
        measured = (self._request_time + answered) / 2 - CYCLE / 2
        self.answers += 1
        self.measured.add(
            Measurement(join_time(stamp[1], stamp[2]), measured, positions, base_pose)
        )
