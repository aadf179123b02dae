"""Joint commands that the robot may be given, and what happens at a stop.

A stop is a course of its own: the joints brake within their acceleration limits; after a contact
they go back to where they came from; whatever presses afterwards makes the command give way to the
measured position. All of it passes the one limiter (`planning.safety.command_limits`).
"""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.safety.command_check import StopReason
from pepper_drake.planning.safety.command_limits import track_joint_command
from pepper_drake.planning.safety.contact_detection import (
    ContactParams,
    excess_error,
    following_error,
)

Vector = npt.NDArray[np.float64]

_SAME = 1e-12
"""A command that is so near to what was wished for is that wish, to the last bit [rad]."""


@dataclass(frozen=True, eq=False)
class SafeCommand:
    """State of the commands to some joints.

    Attributes:
        position: The command (n,) [rad].
        velocity: Its velocity (n,) [rad/s].
        wish: What was wished for last (n,) [rad]; None before the first wish.
        known: Whether the position is more than a guess.
        reason: Why the robot stops, if it does; a stop lasts.
        joint: Index of the joint that the reason is about, -1 for none.
        target: Where a stopped robot goes (n,) [rad]; None to brake and stay.
        sent: The last commands, oldest first, as many as may be on their way.
        measured: The last measured positions, oldest first, for the way back.
        held: For how many control periods each joint has been off its command (n,); negative while
            it is being caught.
    """

    position: Vector
    velocity: Vector
    wish: Vector | None = None
    known: bool = True
    reason: StopReason = StopReason.NONE
    joint: int = -1
    target: Vector | None = None
    sent: tuple[Vector, ...] = ()
    measured: tuple[Vector, ...] = ()
    held: npt.NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    @classmethod
    def at_rest(cls, position: Vector, catching: int = 0) -> "SafeCommand":
        """A robot that is commanded to stand at measured positions.

        Args:
            position: (n,) [rad].
            catching: Control periods in which joints that still move may be caught.
        """
        held = np.full(len(position), -catching, dtype=np.intp)
        return cls(position, np.zeros(len(position)), held=held)

    def stopped(self, reason: StopReason, joint: int = -1) -> "SafeCommand":
        """The same robot, stopped for a reason; the first reason stays."""
        if self.reason != StopReason.NONE:
            return self
        return replace(self, reason=reason, joint=joint)

    def advanced(self, wish: Vector, limits: CommandLimits, time_step: float) -> "SafeCommand":
        """The commands one control period later, inside every limit.

        Args:
            wish: Positions wished for (n,) [rad]; a stopped robot does not listen.
            limits: Of the joints.
            time_step: The control period [s].
        """
        if self.reason == StopReason.NONE:
            before = wish if self.wish is None else self.wish
        else:
            wish = before = np.full(len(wish), np.nan) if self.target is None else self.target
        position, velocity = track_joint_command(
            self.position, self.velocity, wish, before, limits=limits, time_step=time_step
        )
        if self.reason == StopReason.NONE:
            position = np.where(np.abs(position - wish) < _SAME, wish, position)
        return replace(self, position=position, velocity=velocity, wish=wish)

    def compared(
        self, measured: Vector | None, params: ContactParams, time_step: float
    ) -> "SafeCommand":
        """The state after a measurement: a joint that is held stops the robot and sends it back.

        Args:
            measured: Joint positions at the end of the last command's period (n,) [rad]; None if
                not all were measured: then no joint is known to be off its command.
            params: What counts as held.
            time_step: The control period [s].
        """
        on_their_way, memory = _kept(params, time_step)
        sent = (*self.sent, self.position)[-on_their_way:]
        if measured is None:
            return replace(self, sent=sent, held=np.zeros_like(self.held))
        error = following_error(sent, measured)
        excess = excess_error(error, self.velocity, params)
        held = np.where((excess > 1.0) | (self.held < 0), self.held + 1, 0)
        known = (*self.measured, measured)[-memory:]
        state = replace(self, sent=sent, measured=known, held=held)
        if self.reason == StopReason.NONE:
            if np.any(held >= params.steps):
                joint = int(np.argmax(np.where(held >= params.steps, excess, 0.0)))
                stopped = state.stopped(StopReason.JOINT_HELD, joint)
                return replace(stopped, target=known[0], held=np.zeros_like(held))
            return state
        if np.any(held >= params.give_way_steps) and not self.velocity.any():
            # What still presses is not pressed against.
            return replace(state, target=measured, held=np.zeros_like(held))
        return state


@dataclass(frozen=True)
class SafeCommandLayout:
    """A `SafeCommand` as one vector of numbers, for discrete state.

    Discrete state changes at a tick together with that of the systems around. Abstract state
    changes before it, so that within a tick the command would be advanced twice.

    Attributes:
        joints: Number of joints n.
        sent: Most commands that are kept.
        measured: Most measurements that are kept.
    """

    joints: int
    sent: int = 0
    measured: int = 0

    @classmethod
    def of(cls, joints: int, params: ContactParams | None, time_step: float) -> "SafeCommandLayout":
        """The layout for what `SafeCommand.compared` keeps; see there."""
        if params is None:
            return cls(joints)
        return cls(joints, *_kept(params, time_step))

    def to_vector(self, command: SafeCommand) -> Vector:
        """Returns flags and counts (6), then rows of n: see `from_vector`."""
        unknown = np.full(self.joints, np.nan)
        numbers = [
            float(command.known),
            float(command.reason),
            float(command.joint),
            float(command.wish is not None) + 2.0 * float(command.target is not None),
            float(len(command.sent)),
            float(len(command.measured)),
        ]
        rows = [
            command.position,
            command.velocity,
            unknown if command.wish is None else command.wish,
            unknown if command.target is None else command.target,
            command.held if len(command.held) else np.zeros(self.joints),
            *command.sent,
            *[unknown] * (self.sent - len(command.sent)),
            *command.measured,
            *[unknown] * (self.measured - len(command.measured)),
        ]
        return np.concatenate((numbers, *rows))

    def from_vector(self, vector: Vector) -> SafeCommand:
        """Returns what `to_vector` was given."""
        known, reason, joint, given, sent, measured = map(int, vector[:6])
        rows = vector[6:].reshape(-1, self.joints).copy()
        position, velocity, wish, target, held = rows[:5]
        first = 5 + self.sent
        return SafeCommand(
            position,
            velocity,
            wish if given & 1 else None,
            bool(known),
            StopReason(reason),
            joint,
            target if given & 2 else None,
            tuple(rows[5 : 5 + sent]),
            tuple(rows[first : first + measured]),
            held.astype(np.intp),
        )


def _kept(params: ContactParams, time_step: float) -> tuple[int, int]:
    """Numbers of commands and of measurements that a comparison needs."""
    return 1 + round(params.latency / time_step), 1 + round(params.back_off / time_step)


def slowed(limits: CommandLimits, speed: float) -> CommandLimits:
    """The same limits with no joint faster than a speed [rad/s]."""
    return replace(limits, velocity=np.minimum(limits.velocity, speed))
