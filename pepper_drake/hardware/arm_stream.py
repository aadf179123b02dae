"""Streaming of joint commands to a robot: the station's, with lookahead, or holding."""

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.robot_commands import streamed_targets, within_limits
from pepper_drake.hardware.state_reader import FRESH, StateReader
from pepper_drake.hardware.transport import Transport
from pepper_drake.models.control_model import CommandLimits, body_indices, shared_control_model
from pepper_drake.naoqi.streaming import lookahead

Vector = npt.NDArray[np.float64]

HOLD_FRACTION = 0.1
"""Fraction of the largest speed in a command to hold the measured position."""
_BEHIND = 0.05
"""Tracking error above which a joint may catch up, with the same fraction [rad]."""
STALLED = 0.2
"""Tracking error of a stalled joint [rad]."""
STALLED_SECONDS = 1.0
ON_ITS_WAY = 1.5
"""Time for which a robot may be moving towards a target [s]; a longer one means that it stalled."""
FROZEN_STATE_SECONDS = 0.2
_REACTION = 0.1
"""Latency from a command until a robot at rest is measured to move [s]."""
MOVING = 0.05
"""Commanded speed above which a measurement must change [rad/s]."""


class ArmStream:
    """Streams commands to the joints of a link, each after the last one was accepted.

    Attributes:
        is_holding: True if the joints were last sent to their measured positions.
        limits: Of the joints.

    Args:
        transport: The robot.
        joints: Names of the n joints.
        reader: Measures them.
        clock: The link's.
        start: Starts a task, whose exceptions the link handles.
    """

    def __init__(
        self,
        transport: Transport,
        joints: tuple[str, ...],
        reader: StateReader,
        clock: LinkClock,
        start: Callable[[Coroutine[Any, Any, Any]], asyncio.Task[None]],
    ) -> None:
        self._transport, self._joints, self._reader = transport, joints, reader
        self._clock, self._start = clock, start
        self._rows = body_indices(joints)
        self._last_tracked = clock.now()
        self._sending: asyncio.Task[None] | None = None
        self.limits: CommandLimits = shared_control_model().command_limits(joints)
        self.is_holding = False
        self._targets: deque[tuple[float, Vector]] = deque()

    @property
    def _is_sending(self) -> bool:
        return self._sending is not None and not self._sending.done()

    def range_of_targets(self) -> tuple[Vector, Vector] | None:
        """Returns the least and the largest recent target (n,) of each joint [rad].

        The robot's own command is between them. Holding does not count: another program may have
        moved the joints there. None before the first target.
        """
        if not self._targets:
            return None
        targets = np.array([target for _, target in self._targets])
        return targets.min(axis=0), targets.max(axis=0)

    def rest(self) -> None:
        """Counts the joints as resting: measurements need not change for a moment."""
        self._reader.measured.excuse(_REACTION)

    def follow(self, command: Any, *, may_move: bool) -> None:
        """Streams the newest command, or holds if a condition is not met.

        Args:
            command: Of dtype `mailbox.COMMAND`.
            may_move: False to hold.

        Raises:
            LinkFault: The command is not finite, or the measured joints do not follow.
        """
        newest, now = self._reader.measured.newest, self._clock.now()
        ahead = lookahead(self._reader.round_trip)
        if newest is None or ahead is None:
            self.hold()
            return
        if not may_move or now - newest.time > FRESH or now - command["time"] > FRESH:
            # Until the station, the robot or the person at the switch is back, the arm holds.
            self.rest()
            self._last_tracked = now
            self.hold()
            return
        position = np.array(command["positions"])[self._rows]
        velocity = np.array(command["velocities"])[self._rows]
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            raise LinkFault("planner_silent", "a command that is not a number")
        self._check_lag(newest.positions[self._rows], position, velocity, now)
        if self._is_sending:
            return
        self.is_holding = False
        targets, fraction = streamed_targets(self._joints, position, velocity, ahead, self.limits)
        if np.max(np.abs(position - newest.positions[self._rows])) > _BEHIND:
            # After a pause the path's speed, which may be zero, would never close the gap.
            fraction = max(fraction, HOLD_FRACTION)
        self._targets.append((now, targets))
        while len(self._targets) > 1 and self._targets[1][0] < now - ON_ITS_WAY:
            self._targets.popleft()
        self._send(targets, fraction)

    def hold(self) -> None:
        """Sends the joints, once, to their measured positions."""
        newest = self._reader.measured.newest
        if self.is_holding or newest is None or self._is_sending or self._transport.is_lost:
            return
        self.is_holding = True
        here = newest.positions[self._rows]
        self._send(within_limits(self._joints, here, self.limits), HOLD_FRACTION)

    def _check_lag(self, measured: Vector, position: Vector, velocity: Vector, now: float) -> None:
        """Finds a frozen state and an arm that does not follow."""
        if np.max(np.abs(velocity)) <= MOVING:
            # A robot at rest may repeat its measurements, and takes a moment to start.
            self.rest()
        elif self._reader.measured.still_for > FROZEN_STATE_SECONDS:
            raise LinkFault("state_frozen", f"for {FROZEN_STATE_SECONDS:g} s")
        far = np.abs(position - measured) > STALLED
        if not far.any():
            self._last_tracked = now
        elif now - self._last_tracked > STALLED_SECONDS:
            names = [n for n, is_far in zip(self._joints, far, strict=True) if is_far]
            raise LinkFault("arm_stalled", ", ".join(names))

    def _send(self, targets: Vector, fraction: float) -> None:
        self._sending = self._start(
            self._transport.call(
                "ALMotion", "setAngles", list(self._joints), targets.tolist(), float(fraction)
            )
        )
