"""The joint commands that a robot is sent: the station's, ahead of time, or to stay where it is."""

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
"""Fraction of the largest speed with which the arm goes back to where it is, to hold."""
_BEHIND = 0.05
"""Distance from the path at which a joint may catch up, with the same fraction [rad]."""
STALLED = 0.2
"""Distance of a joint from its command that it does not close [rad]."""
STALLED_SECONDS = 1.0
ON_ITS_WAY = 1.5
"""Time for which a robot may be on its way to a target [s]: one that takes longer is stalled."""
FROZEN_STATE_SECONDS = 0.2
_REACTION = 0.1
"""Time from a command until a robot at rest is measured to move [s]."""
MOVING = 0.05
"""Rate of a command above which a measurement must change [rad/s]."""


class ArmStream:
    """Streams commands to the joints of a link, one after the other has been taken.

    Attributes:
        is_holding: True if that is where the joints were measured.
        limits: Of the joints.

    Args:
        transport: The robot.
        joints: Names of the n joints.
        reader: Measures them.
        clock: The link's.
        start: Starts a task; what it raises is the link's to handle.
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
        self._followed = clock.now()
        self._sending: asyncio.Task[None] | None = None
        self.limits: CommandLimits = shared_control_model().command_limits(joints)
        self.is_holding = False
        self._targets: deque[tuple[float, Vector]] = deque()

    @property
    def _is_sending(self) -> bool:
        return self._sending is not None and not self._sending.done()

    def range_of_targets(self) -> tuple[Vector, Vector] | None:
        """Returns the least and the largest target (n,) of each joint lately [rad].

        The robot's own command is on its way between them. None before the first.
        """
        if not self._targets:
            return None
        targets = np.array([target for _, target in self._targets])
        return targets.min(axis=0), targets.max(axis=0)

    def rest(self) -> None:
        """Takes the joints for resting: what is measured need not change for a moment."""
        self._reader.measured.excuse(_REACTION)

    def follow(self, command: Any, *, may_move: bool) -> None:
        """Streams the newest command, or holds where something is not as it must be.

        Args:
            command: Of dtype `mailbox.COMMAND`.
            may_move: False to hold.

        Raises:
            LinkFault: The command is no number, or the joints are not measured to follow.
        """
        newest, now = self._reader.measured.newest, self._clock.now()
        ahead = lookahead(self._reader.round_trip)
        if newest is None or ahead is None:
            self.hold()
            return
        if not may_move or now - newest.time > FRESH or now - command["time"] > FRESH:
            # The station, the robot or a person may come back; until then the arm stands.
            self.rest()
            self._followed = now
            self.hold()
            return
        position = np.array(command["positions"])[self._rows]
        velocity = np.array(command["velocities"])[self._rows]
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            raise LinkFault("planner_silent", "a command that is not a number")
        self._judge(newest.positions[self._rows], position, velocity, now)
        if self._is_sending:
            return
        self.is_holding = False
        targets, fraction = streamed_targets(self._joints, position, velocity, ahead, self.limits)
        if np.max(np.abs(position - newest.positions[self._rows])) > _BEHIND:
            # After a pause; the path's own speed, which may be zero, would never close the gap.
            fraction = max(fraction, HOLD_FRACTION)
        self._send(targets, fraction)

    def hold(self) -> None:
        """Sends the joints, once, to where they are."""
        newest = self._reader.measured.newest
        if self.is_holding or newest is None or self._is_sending or self._transport.is_lost:
            return
        self.is_holding = True
        here = newest.positions[self._rows]
        self._send(within_limits(self._joints, here, self.limits), HOLD_FRACTION)

    def _judge(self, measured: Vector, position: Vector, velocity: Vector, now: float) -> None:
        """Finds a frozen state and an arm that does not follow."""
        if np.max(np.abs(velocity)) <= MOVING:
            # A robot at rest may measure the same again and again; once moved it takes a moment.
            self.rest()
        elif self._reader.measured.still_for > FROZEN_STATE_SECONDS:
            raise LinkFault("state_frozen", f"for {FROZEN_STATE_SECONDS:g} s")
        far = np.abs(position - measured) > STALLED
        if not far.any():
            self._followed = now
        elif now - self._followed > STALLED_SECONDS:
            names = [n for n, is_far in zip(self._joints, far, strict=True) if is_far]
            raise LinkFault("arm_stalled", ", ".join(names))

    def _send(self, targets: Vector, fraction: float) -> None:
        now = self._clock.now()
        self._targets.append((now, targets))
        while len(self._targets) > 1 and self._targets[1][0] < now - ON_ITS_WAY:
            self._targets.popleft()
        self._sending = self._start(
            self._transport.call(
                "ALMotion", "setAngles", list(self._joints), targets.tolist(), float(fraction)
            )
        )
