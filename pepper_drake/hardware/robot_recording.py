"""Recording on a robot (algorithm 1 of the report): the arm goes limp and a person guides it.

The arm's stiffness is ramped down, its joints are read at 50 Hz with the robot's time stamps, and
the hand's pose is computed with our kinematics. The chest button, a touch on the head or on the
back of the other hand, or the user ends the recording; then the arm is held.
"""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.preflight import PreflightOptions, check_robot
from pepper_drake.hardware.transport import RobotAccess, Transport, make_transport
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.recording import (
    RecordingWriter,
    recorded_demonstration,
)
from pepper_drake.models.control_model import arm_joints, body_indices, shared_control_model
from pepper_drake.models.pepper import BODY_JOINTS, hand_frame
from pepper_drake.naoqi.clock import join_time
from pepper_drake.naoqi.constants import BODY, CYCLE

Array = npt.NDArray[np.float64]

RELAXING = 0.5
"""Time in which the arm goes limp, and later becomes stiff again [s]."""
LONGEST = 300.0
"""Longest recording [s]."""
SILENT = 1.0
"""Timeout of an answer, after which the robot counts as frozen [s]."""
CLOCK_JUMP = 2.0
"""Time between samples that shows a jump of the robot's clock, or a restart [s]."""
_WRITE_PERIOD = 0.5
_CLOCK_KEY = "Device/SubDeviceList/HeadYaw/Position/Sensor/Value"
_HEAD = ("FrontTactilTouched", "MiddleTactilTouched", "RearTactilTouched")


@dataclass(frozen=True)
class RobotRecordOptions:
    """Options of a recording on a robot.

    Attributes:
        folder: Of the demonstration.
        arm: "left" or "right": the guided one.
        disable_life: Whether to switch off autonomous life.
        should_stop: Asked at each sample.
        say: Prints a line for the user.
        clock_rate: Rate of the robot's clock; 1 except for a served robot with another rate.
    """

    folder: Path
    arm: str = "right"
    disable_life: bool = False
    should_stop: Callable[[], bool] = lambda: False
    say: Callable[[str], None] = lambda _: None
    clock_rate: float = 1.0


@dataclass(frozen=True)
class RobotRecording:
    """A recorded demonstration and how it ended.

    Attributes:
        demonstration: The motion, without the rest at both ends.
        ended_by: The event that ended it, "" for the user or the time limit.
        samples: Number of samples that were read.
    """

    demonstration: Demonstration
    ended_by: str
    samples: int


def record_robot(access: RobotAccess, options: RobotRecordOptions) -> RobotRecording:
    """Records a demonstration on a robot.

    Args:
        access: Address and credentials of the robot.
        options: Of the recording.

    Raises:
        LinkFault: The robot cannot be reached, is not ready, or was lost; the recording so far
            stays in the folder and can be recovered.
        StoppedError: It ended before the hand had moved.
        InputError: The folder cannot be written to.
    """
    return asyncio.run(_record(make_transport(access), options))


async def _record(transport: Transport, options: RobotRecordOptions) -> RobotRecording:
    await transport.connect()
    try:
        checks = PreflightOptions(needs_stiffness=False, disable_life=options.disable_life)
        await check_robot(transport, options.arm, checks)
        names = list(arm_joints(options.arm))
        with RecordingWriter(options.folder, names) as writer:
            sampling = _Sampling(transport, options, writer)
            await sampling.listen()
            await transport.call("ALMotion", "stiffnessInterpolation", names, 0.0, RELAXING)
            options.say(f"the {options.arm} arm is limp: lead it; the chest button ends it")
            try:
                await sampling.run()
            finally:
                await _hold(transport, names)
            options.say("the arm is held")
            _, motion = writer.finish_motion(
                lambda: recorded_demonstration(
                    sampling.times, sampling.samples, names, name=options.folder.name
                )
            )
            return RobotRecording(motion, sampling.ended_by, len(sampling.times))
    finally:
        await transport.close()


async def _hold(transport: Transport, names: list[str]) -> None:
    """Makes the arm stiff in its position, if the robot can still be reached."""
    with contextlib.suppress(LinkFault, TimeoutError):
        async with asyncio.timeout(2 * SILENT + RELAXING):
            await transport.call("ALMotion", "stiffnessInterpolation", names, 1.0, RELAXING)


@dataclass
class _Sampling:
    """Collects the samples of a recording."""

    transport: Transport
    options: RobotRecordOptions
    writer: RecordingWriter
    times: list[float] = field(default_factory=list)
    samples: list[Array] = field(default_factory=list)
    ended_by: str = ""

    async def listen(self) -> None:
        """Subscribes to the events that end the recording."""
        other = "Left" if self.options.arm == "right" else "Right"
        for event in ("ChestButtonPressed", *_HEAD, f"Hand{other}BackTouched"):
            await self.transport.on_event(event, partial(self._end, event))

    def _end(self, event: str, value: object) -> None:
        if value and not self.ended_by:
            self.ended_by = event

    async def run(self) -> None:
        """Reads samples every 20 ms until the recording ends."""
        clock = LinkClock(self.options.clock_rate)
        model = shared_control_model()
        context = model.create_context()
        columns = [BODY.index(name) for name in BODY_JOINTS]
        rows = body_indices(arm_joints(self.options.arm))
        frame = hand_frame(self.options.arm)
        begin, due, written = None, clock.now(), 0.0
        while not self.ended_by and not self.options.should_stop():
            now, angles = await self._read()
            begin = now if begin is None else begin
            time = now - begin
            gap = time - self.times[-1] if self.times else CYCLE
            if gap < 0.0 or gap > CLOCK_JUMP:
                raise LinkFault("clock_jump", f"by {gap:.1f} s within a moment")
            if gap > 0.0:
                body = angles[columns]
                model.plant.SetPositions(context, model.positions(body, np.zeros(3)))
                X_TH = model.pose(context, frame, "torso")
                quaternion = X_TH.rotation().ToQuaternion().wxyz()
                self.times.append(time)
                self.samples.append(np.concatenate((X_TH.translation(), quaternion, body[rows])))
            if time - written > _WRITE_PERIOD:
                self.writer.write(self.times, self.samples)
                written = time
            if time > LONGEST:
                self.options.say(f"the recording ends: it took {LONGEST:g} s")
                return
            due = max(due + CYCLE, clock.now())
            await clock.pause(max(due - clock.now(), 0.0))

    async def _read(self) -> tuple[float, Array]:
        """Returns the robot's time [s] and the joints of its body."""
        try:
            async with asyncio.timeout(SILENT / self.options.clock_rate):
                stamp, angles = await asyncio.gather(
                    self.transport.call("ALMemory", "getTimestamp", _CLOCK_KEY),
                    self.transport.call("ALMotion", "getAngles", "Body", True),
                )
        except TimeoutError:
            raise LinkFault("link_frozen", f"no answer for {SILENT:g} s") from None
        return join_time(stamp[1], stamp[2]), np.array(angles, dtype=float)
