"""Safe joint commands, and the reaction to a stop.

In a stop the joints brake within their acceleration limits; after a contact they back off along
their motion; when something still presses on them, the command yields to the measured position. A
joint whose motor or encoder is off by an angle deviates as much, but moves along with its command,
which must not follow it; a small test step distinguishes the two. All commands pass the limiter in
`planning.safety.command_limits`.
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
"""A command this close to the desired position is set to it exactly [rad]."""


@dataclass(frozen=True, eq=False)
class SafeCommand:
    """State of the commands to some joints.

    Attributes:
        position: The command (n,) [rad].
        velocity: Its velocity (n,) [rad/s].
        desired: Last desired position (n,) [rad]; None before the first one.
        known: Whether the position was measured rather than assumed.
        reason: Reason of a stop; a stop is permanent.
        joint: Index of the joint that caused it, -1 for none.
        target: Target of a stopped robot (n,) [rad]; None to brake and stay.
        sent: The last commands within the latency, oldest first.
        measured: The last measured positions, oldest first, for backing off.
        held: Number of control periods for which each joint has deviated from its command (n,);
            negative during the grace period after the start.
        deviation: Mean deviation of each joint in the present test period (n,) [rad].
        tested: The mean deviation before the step that tests whether something presses on a joint
            (n,) [rad]; NaN without a test, infinite once one has failed.
    """

    position: Vector
    velocity: Vector
    desired: Vector | None = None
    known: bool = True
    reason: StopReason = StopReason.NONE
    joint: int = -1
    target: Vector | None = None
    sent: tuple[Vector, ...] = ()
    measured: tuple[Vector, ...] = ()
    held: npt.NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    deviation: Vector = field(default_factory=lambda: np.zeros(0))
    tested: Vector = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def at_rest(cls, position: Vector, catching: int = 0) -> "SafeCommand":
        """Returns the command to stand at measured positions.

        Args:
            position: (n,) [rad].
            catching: Grace period for joints that still move, in control periods.
        """
        held = np.full(len(position), -catching, dtype=np.intp)
        zero, unknown = np.zeros(len(position)), np.full(len(position), np.nan)
        return cls(position, zero, held=held, deviation=zero, tested=unknown)

    def stopped(self, reason: StopReason, joint: int = -1) -> "SafeCommand":
        """Returns the state stopped for a reason; an earlier reason is kept."""
        if self.reason != StopReason.NONE:
            return self
        return replace(self, reason=reason, joint=joint)

    def advanced(self, desired: Vector, limits: CommandLimits, time_step: float) -> "SafeCommand":
        """Returns the commands one control period later, inside every limit.

        Args:
            desired: Desired positions (n,) [rad]; ignored after a stop.
            limits: Limits of the joints.
            time_step: The control period [s].
        """
        if self.reason == StopReason.NONE:
            before = desired if self.desired is None else self.desired
        else:
            desired = before = np.full(len(desired), np.nan) if self.target is None else self.target
        position, velocity = track_joint_command(
            self.position, self.velocity, desired, before, limits=limits, time_step=time_step
        )
        if self.reason == StopReason.NONE:
            position = np.where(np.abs(position - desired) < _SAME, desired, position)
        return replace(self, position=position, velocity=velocity, desired=desired)

    def compared(
        self, measured: Vector | None, params: ContactParams, time_step: float
    ) -> "SafeCommand":
        """Returns the state after a measurement: a held joint stops the robot, which backs off.

        Args:
            measured: Joint positions at the end of the last command's period (n,) [rad]; None if
                not all were measured: then the deviations count as unknown.
            params: Criteria of a held joint.
            time_step: The control period [s].
        """
        num_sent, num_measured = _history_lengths(params, time_step)
        sent = (*self.sent, self.position)[-num_sent:]
        if measured is None:
            return replace(self, sent=sent, held=np.zeros_like(self.held))
        error = following_error(sent, measured)
        excess = excess_error(error, self.velocity, params)
        is_off = (excess > 1.0) | (self.held < 0) | np.isfinite(self.tested)
        held = np.where(is_off, self.held + 1, 0)
        # The mean begins anew with each period of `give_way_steps`.
        count = np.maximum((held - 1) % params.give_way_steps + 1, 1)
        deviation = np.where(count == 1, error, self.deviation + (error - self.deviation) / count)
        tested = np.where(is_off, self.tested, np.nan)
        history = (*self.measured, measured)[-num_measured:]
        state = replace(
            self, sent=sent, measured=history, held=held, deviation=deviation, tested=tested
        )
        if self.reason == StopReason.NONE:
            if np.any(held >= params.steps):
                joint = int(np.argmax(np.where(held >= params.steps, excess, 0.0)))
                stopped = state.stopped(StopReason.JOINT_HELD, joint)
                return replace(stopped, target=history[0], held=np.zeros_like(held))
            return state
        return state if self.velocity.any() else state.yielding(params)

    def yielding(self, params: ContactParams) -> "SafeCommand":
        """Returns the state of joints at rest that yield to what presses on them.

        A joint that deviates for `give_way_steps` periods first yields by a small step. If its mean
        deviation has become less by half of that, something presses on it, and it yields to its
        measured position. If not, it moves with its command, which goes back and stays, until the
        deviation has gone: nothing adds up, whatever the joint is off by. Something softer than the
        joint, or a person who pushes with a constant force, is not told from such a joint.

        Args:
            params: Criteria of a held joint.
        """
        period, is_tested = params.give_way_steps, np.isfinite(self.tested)
        due = (self.held >= period) & (self.held % period == 0)
        fresh = due & np.isnan(self.tested)
        answered = due & is_tested & (self.held >= 2 * period)
        if not (fresh | answered).any():
            return self
        largest = params.give_way_angle
        step = np.clip(np.where(fresh, self.deviation, self.tested), -largest, largest)
        less = np.sign(step) * (self.tested - self.deviation)
        gave = answered & (less > 0.5 * np.abs(step))
        failed = answered & ~gave
        change = np.where(gave, self.deviation, np.where(failed, -step, np.where(fresh, step, 0.0)))
        return replace(
            self,
            target=self.position + change,
            held=np.where(fresh | answered, 0, self.held),
            tested=np.where(
                fresh, self.deviation, np.where(gave, np.nan, np.where(failed, np.inf, self.tested))
            ),
        )


@dataclass(frozen=True)
class SafeCommandLayout:
    """A `SafeCommand` as one vector of numbers, for discrete state.

    Discrete state is updated at a tick together with that of the surrounding systems. Abstract
    state is updated before it, so that the command would advance twice within a tick.

    Attributes:
        joints: Number of joints n.
        sent: Largest number of stored commands.
        measured: Largest number of stored measurements.
    """

    joints: int
    sent: int = 0
    measured: int = 0

    @classmethod
    def of(cls, joints: int, params: ContactParams | None, time_step: float) -> "SafeCommandLayout":
        """Returns the layout with the history that `SafeCommand.compared` needs."""
        if params is None:
            return cls(joints)
        return cls(joints, *_history_lengths(params, time_step))

    def to_vector(self, command: SafeCommand) -> Vector:
        """Returns a vector of 6 flags and counts, then rows of n; see `from_vector`."""
        unknown = np.full(self.joints, np.nan)
        numbers = [
            float(command.known),
            float(command.reason),
            float(command.joint),
            float(command.desired is not None) + 2.0 * float(command.target is not None),
            float(len(command.sent)),
            float(len(command.measured)),
        ]
        rows = [
            command.position,
            command.velocity,
            unknown if command.desired is None else command.desired,
            unknown if command.target is None else command.target,
            command.held if len(command.held) else np.zeros(self.joints),
            command.deviation if len(command.deviation) else np.zeros(self.joints),
            command.tested if len(command.tested) else unknown,
            *command.sent,
            *[unknown] * (self.sent - len(command.sent)),
            *command.measured,
            *[unknown] * (self.measured - len(command.measured)),
        ]
        return np.concatenate((numbers, *rows))

    def from_vector(self, vector: Vector) -> SafeCommand:
        """Returns the command of a vector from `to_vector`."""
        known, reason, joint, given, sent, measured = map(int, vector[:6])
        rows = vector[6:].reshape(-1, self.joints).copy()
        position, velocity, desired, target, held, deviation, tested = rows[:7]
        first = 7 + self.sent
        return SafeCommand(
            position,
            velocity,
            desired if given & 1 else None,
            bool(known),
            StopReason(reason),
            joint,
            target if given & 2 else None,
            tuple(rows[7 : 7 + sent]),
            tuple(rows[first : first + measured]),
            held.astype(np.intp),
            deviation,
            tested,
        )


def _history_lengths(params: ContactParams, time_step: float) -> tuple[int, int]:
    """Returns the numbers of commands and of measurements that a comparison needs."""
    return 1 + round(params.latency / time_step), 1 + round(params.back_off / time_step)


def slowed(limits: CommandLimits, speed: float) -> CommandLimits:
    """Returns the limits with velocities capped at a speed [rad/s]."""
    return replace(limits, velocity=np.minimum(limits.velocity, speed))
