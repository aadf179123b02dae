"""The link to a robot: it runs ALMotion's cycle, measures, streams commands and detects faults.

It runs in its own process (`link_process`), since a thread beside a simulation is late by tens of
milliseconds. All its calls are made from one asyncio loop.
"""

import asyncio
import contextlib
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.hardware.arm_stream import ArmStream
from pepper_drake.hardware.arm_watch import watch_arm
from pepper_drake.hardware.base_driver import drive_base
from pepper_drake.hardware.camera_reader import CameraReader
from pepper_drake.hardware.dead_man import DeadManKey, dead_man_key
from pepper_drake.hardware.hand_driver import drive_hands
from pepper_drake.hardware.hand_over import hand_over
from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_config import LinkConfig
from pepper_drake.hardware.link_fault import HANDED_OVER, LinkFault
from pepper_drake.hardware.mailbox import (
    CAMERA_NAMES,
    END,
    HAND_OVER,
    HOLD,
    STREAM,
    Mailbox,
)
from pepper_drake.hardware.state_reader import FRESH, FROZEN, StateReader
from pepper_drake.hardware.transport import Transport, identity
from pepper_drake.models.control_model import arm_joints, body_indices
from pepper_drake.naoqi.constants import CYCLE

Vector = npt.NDArray[np.float64]

_PROTECTION = "setExternalCollisionProtectionEnabled"
_SLOWED_SECONDS = 0.5
PROBE_SECONDS = 2.0
"""Time for which a lost robot is probed for a restart [s]."""
_PROBE_PERIOD = 0.2
SILENT = 30.0
"""Timeout of the station's commands [s]: no plan takes this long."""


class RobotLink:
    """One robot, driven by the mailbox's commands until END or a fault.

    A fault ends the streaming for good: the arm holds, and the state reports the fault.
    """

    def __init__(
        self,
        transport: Transport,
        mailbox: Mailbox,
        config: LinkConfig,
        clock: LinkClock | None = None,
        reconnect: Callable[[], Transport] | None = None,
    ) -> None:
        """Makes a link; `run` starts it.

        Args:
            transport: A connected one.
            mailbox: Shared with the station.
            config: Of the link.
            clock: Of the robot; the machine's if left out.
            reconnect: Makes another transport, to find out whether a lost robot was restarted.
        """
        self._transport, self._mailbox, self._config = transport, mailbox, config
        self._reconnect = reconnect
        self._identity: tuple[Any, ...] = ()
        self._probe: asyncio.Task[None] | None = None
        self._time = clock or LinkClock()
        self._clock = self._time.now
        self._commanded = mailbox.command.read()
        self._reader = StateReader(transport, self._time)
        self._arm = ArmStream(transport, config.joints, self._reader, self._time, self._start)
        self._late = 0
        self._fault: LinkFault | None = None
        self._slowed_until = -np.inf
        self._ended = False
        self._key: DeadManKey | None = dead_man_key(config.dead_man)
        self._is_held = self._key is None

    def end(self) -> None:
        """Ends `run` from within its process, as END in the mailbox does."""
        self._ended = True

    @property
    def fault(self) -> LinkFault | None:
        """Fault of the link, if there is one."""
        return self._fault

    async def run(self) -> None:
        """Runs until the mailbox says END; then removes everything of ours from the robot."""
        tasks: list[asyncio.Task[None]] = []
        try:
            self._identity = await identity(self._transport)
            await self._protect(self._config.protects_arms)
            await self._transport.on_event("ALMotion/Safety/ChainVelocityClipped", self._slow)
            for number, name in enumerate(CAMERA_NAMES):
                if name in self._config.cameras:
                    reader = CameraReader(
                        self._transport,
                        number,
                        self._config.name,
                        self._config.camera_rate,
                        self._take_image,
                        self._time,
                    )
                    tasks.append(self._start(reader.run(partial(self._wants, number))))
            tasks += [
                self._start(
                    watch_arm(self._transport, self._config, self._arm, self._streams, self._time)
                ),
                self._start(drive_base(self._transport, self._wanted_drive, self._time)),
                self._start(drive_hands(self._transport, self._command, self._time)),
            ]
            await self._run_cycles()
        except LinkFault as fault:
            self._fail(fault)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self._release()
            if self._key is not None:
                self._key.close()

    def _start(self, work: Any) -> asyncio.Task[None]:
        async def guarded() -> None:
            try:
                await work
            except LinkFault as fault:
                self._fail(fault)
            except Exception as error:
                # Any answer of a robot must end in a held arm, not in a silently dead task.
                self._fail(LinkFault("call_failed", f"{type(error).__name__}: {error}"))

        return asyncio.ensure_future(guarded())

    def _command(self) -> npt.NDArray[np.void]:
        """Returns the newest command, or the previous one while it is being written."""
        newest = self._mailbox.command.read_at_once()
        if newest is not None:
            self._commanded = newest
        return self._commanded

    async def _run_cycles(self) -> None:
        """Runs one cycle every 20 ms; late cycles are skipped, never caught up."""
        due = self._clock()
        while True:
            command = self._command()
            mode = int(command["mode"])
            if mode == END or self._ended:
                return
            self._check_link()
            self._reader.ask(self._start)
            self._check_people(mode, float(command["time"]))
            if mode != STREAM:
                self._arm.rest()
            if mode == HAND_OVER and (self._fault is None or self._fault.word in HANDED_OVER):
                await self._hand_arm_over()
            elif mode == STREAM:
                self._follow(command)
            elif mode == HOLD or self._fault is not None:
                self._arm.hold()
            self._publish()
            due += CYCLE
            now = self._clock()
            if now > due + CYCLE:
                skipped = int((now - due) / CYCLE)
                self._late += skipped
                due += skipped * CYCLE
                if skipped > self._config.late_cycles and mode == STREAM:
                    self._fail(LinkFault("loop_late", f"by {skipped} cycles of 20 ms"))
            await self._time.pause(max(due - now, 0.0))

    # Measuring.

    def _check_link(self) -> None:
        if self._transport.is_lost:
            self._fail(LinkFault("link_lost"))
            if self._probe is None and self._reconnect is not None:
                self._probe = self._start(self._probe_restart(self._reconnect()))
            return
        try:
            self._reader.check()
        except LinkFault as fault:
            self._fail(fault)

    async def _probe_restart(self, transport: Transport) -> None:
        """Finds out whether a lost robot was restarted, if it answers soon."""
        end = time.monotonic() + PROBE_SECONDS
        while time.monotonic() < end and self._fault is not None:
            with contextlib.suppress(LinkFault, TimeoutError):
                async with asyncio.timeout(FROZEN):
                    await transport.connect()
                    if await identity(transport) != self._identity:
                        self._fault = LinkFault("robot_rebooted", "it has another session")
                    break
            await asyncio.sleep(_PROBE_PERIOD)
        await transport.close()
        self._publish()

    def _check_people(self, mode: int, commanded: float) -> None:
        """Checks the dead man's switch and the timeout of the station's commands."""
        if self._key is not None:
            held, self._is_held = self._is_held, self._key.is_held(time.monotonic())
            if mode == STREAM and held and not self._is_held:
                self._fail(LinkFault("dead_man"))
        if mode == STREAM and self._clock() - commanded > SILENT:
            self._fail(LinkFault("planner_silent", f"for {SILENT:g} s"))

    def _streams(self) -> bool:
        return int(self._command()["mode"]) == STREAM

    def _slow(self, value: Any) -> None:
        self._slowed_until = self._clock() + _SLOWED_SECONDS

    # Commanding.

    def _follow(self, command: Any) -> None:
        """Streams the newest command; after a fault the arm holds."""
        if self._fault is not None:
            self._arm.hold()
            return
        try:
            self._arm.follow(command, may_move=self._is_held)
        except LinkFault as fault:
            self._fail(fault)

    def _wanted_drive(self) -> Vector | None:
        """Returns the base's wanted velocity: zeros to stop, None if it is unknown."""
        command = self._command()
        if int(command["mode"]) != STREAM or self._fault is not None:
            return np.zeros(3)
        if self._clock() - command["time"] > FRESH:
            return None
        return np.array(command["base_velocity"])

    # Images.

    def _wants(self, camera: int) -> bool:
        command = self._command()
        return bool(command["enabled"][camera]) and int(command["mode"]) not in (END, HAND_OVER)

    async def _take_image(self, camera: int, stamp: float, pixels: npt.NDArray[Any]) -> bool:
        """Publishes an image with the joints at its capture; returns whether they are known."""
        taken = await self._reader.at(stamp)
        if taken is None:
            return False
        self._mailbox.write_image(camera, taken.time, pixels, taken.positions, taken.base_pose)
        return True

    # The end.

    async def _hand_arm_over(self) -> None:
        """Hands the arm over; if cancelled, the arm is held and left stiff."""
        self._publish("handing over")
        hand_over_task = asyncio.ensure_future(
            hand_over(self._transport, self._config.arm, self._measured_arm, self._time.pause)
        )
        while not hand_over_task.done():
            self._check_link()
            self._reader.ask(self._start)
            self._publish("handing over")
            await self._time.pause(CYCLE)
            if not self._is_handing_over():
                hand_over_task.cancel()
                await asyncio.gather(hand_over_task, return_exceptions=True)
                self._arm.is_holding = False
                self._arm.hold()
                names = list(arm_joints(self._config.arm))
                await self._transport.call("ALMotion", "setStiffnesses", names, 1.0)
                return
        self._arm.is_holding = True
        try:
            hand_over_task.result()
            phase = "handed over"
        except LinkFault as fault:
            # The first fault stays reported; this one tells the arm's final state.
            self._fail(fault)
            phase = "left stiff"
        while self._is_handing_over():
            self._publish(phase)
            await self._time.pause(CYCLE)

    def _is_handing_over(self) -> bool:
        return int(self._command()["mode"]) == HAND_OVER and not self._ended

    def _measured_arm(self) -> Vector:
        newest = self._reader.measured.newest
        assert newest is not None
        return newest.positions[body_indices(arm_joints(self._config.arm))]

    async def _release(self) -> None:
        """Stops the base and restores protection, if possible; a lost robot's base stops itself."""
        self._publish("ended")
        if self._transport.is_lost:
            return
        with contextlib.suppress(LinkFault, TimeoutError):
            async with asyncio.timeout(FROZEN):
                await self._transport.call("ALMotion", "stopMove")
                await self._protect(True)

    async def _protect(self, is_on: bool) -> None:
        """Switches the arms' protection, unless the configuration leaves it on."""
        if not self._config.protects_arms:
            await self._transport.call("ALMotion", _PROTECTION, "Arms", is_on)

    def _fail(self, fault: LinkFault) -> None:
        """Records the first fault, and holds."""
        if self._fault is None:
            self._fault = fault
            self._publish()
            self._arm.hold()

    def _publish(self, phase: str = "running") -> None:
        reader, newest = self._reader, self._reader.measured.newest
        fields: dict[str, Any] = {"phase": phase, "states": reader.answers, "late": self._late}
        fields |= {"round_trip": reader.round_trip, "clock_bound": reader.shortest_trip / 2}
        fields |= {"slowed": self._clock() < self._slowed_until, "held": self._is_held}
        if newest is not None:
            fields |= {
                "time": newest.time,
                "positions": newest.positions,
                "base_pose": newest.base_pose,
                "hands": reader.hands,
            }
        if self._fault is not None:
            fields |= {"fault": self._fault.word, "detail": str(self._fault)[:240]}
        self._mailbox.state.write(**fields)
