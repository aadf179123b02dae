"""The link to a robot: it keeps ALMotion's beat, measures, streams commands and guards both sides.

It runs in a process of its own (`link_process`), since a thread beside a simulation is late by
tens of milliseconds. All its calls are made from one asyncio loop.
"""

import asyncio
import contextlib
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

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
from pepper_drake.hardware.measurements import Measurement, Measurements
from pepper_drake.hardware.robot_commands import streamed_targets, within_limits
from pepper_drake.hardware.transport import Transport, identity
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    CommandLimits,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.naoqi.clock import join_time
from pepper_drake.naoqi.constants import BODY, CYCLE, HANDS
from pepper_drake.naoqi.streaming import lookahead

Vector = npt.NDArray[np.float64]

FRESH = 0.1
"""Age above which neither a state nor a command counts any more [s]."""
FROZEN = 1.0
"""Time without an answer after which the robot is taken for frozen [s]."""
HOLD_FRACTION = 0.1
"""Fraction of the largest speed with which the arm goes back to where it is, to hold."""
_BEHIND = 0.05
"""Distance from the path at which a joint may catch up, with the same fraction [rad]."""
STALLED = 0.2
"""Distance of a joint from its command that it does not close [rad]."""
STALLED_SECONDS = 1.0
FROZEN_STATE_SECONDS = 0.2
_REACTION = 0.1
"""Time from a command until a robot at rest is measured to move [s]."""
MOVING = 0.05
"""Rate of a command above which a measurement must change [rad/s]."""
_PROTECTION = "setExternalCollisionProtectionEnabled"
_CLOCK_KEY = "Device/SubDeviceList/HeadYaw/Position/Sensor/Value"
_WATCH_PERIOD = 0.25
TAKEN_OVER = 0.15
"""Distance of the robot's own command from ours, in two looks, that another program must have
made [rad]."""
_SLOWED_SECONDS = 0.5
FIRST_STATES = 3
"""Answers before the round trip is judged."""
PROBE_SECONDS = 2.0
"""Time for which a lost robot is asked whether it was started anew [s]."""
_PROBE_PERIOD = 0.2
SILENT = 30.0
"""Time without a command after which the run is over [s]: no plan takes this long."""


class RobotLink:
    """One robot, led by what the mailbox says until it says END or something is wrong.

    A fault ends the streaming for good: the arm holds, and the fault stands in the state.
    """

    def __init__(
        self,
        transport: Transport,
        mailbox: Mailbox,
        config: LinkConfig,
        clock: LinkClock | None = None,
        reconnect: Callable[[], Transport] | None = None,
    ) -> None:
        """Makes a link that does nothing yet.

        Args:
            transport: A connected one.
            mailbox: Shared with the station.
            config: How the robot is led.
            clock: The clock by which the robot is led; the machine's if left out.
            reconnect: Makes another transport, by which a lost robot is asked whether it is the
                same as before.
        """
        self._transport, self._mailbox, self._config = transport, mailbox, config
        self._reconnect = reconnect
        self._identity: tuple[Any, ...] = ()
        self._probe: asyncio.Task[None] | None = None
        self._time = clock or LinkClock()
        self._clock = self._time.now
        self._rows = body_indices(config.joints)
        self._limits: CommandLimits = shared_control_model().command_limits(config.joints)
        self._columns = [BODY.index(name) for name in BODY_JOINTS]
        self._commanded = mailbox.command.read()
        self._measured = Measurements()
        self._shortest_trip = np.inf
        self._round_trip = 0.0
        self._reading: asyncio.Task[None] | None = None
        self._asked = 0.0
        self._sending: asyncio.Task[None] | None = None
        self._sent: Vector | None = None
        self._states = self._late = 0
        self._hands = [np.nan] * len(HANDS)
        self._followed = self._clock()
        self._fault: LinkFault | None = None
        self._slowed_until = -np.inf
        self._holding = False
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
        """Runs until the mailbox says END; then nothing of ours is left in the robot."""
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
                self._start(self._watch_arm()),
                self._start(drive_base(self._transport, self._wanted_drive, self._time)),
                self._start(drive_hands(self._transport, self._command, self._time)),
            ]
            await self._beat()
        except LinkFault as fault:
            self._fail(fault)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self._let_go()
            if self._key is not None:
                self._key.close()

    def _start(self, work: Any) -> asyncio.Task[None]:
        async def guarded() -> None:
            try:
                await work
            except LinkFault as fault:
                self._fail(fault)
            except Exception as error:
                # Whatever a robot answers must end in a held arm, not in a silent task.
                self._fail(LinkFault("call_failed", f"{type(error).__name__}: {error}"))

        return asyncio.ensure_future(guarded())

    def _command(self) -> npt.NDArray[np.void]:
        """Returns the newest command, or while it is being written the one before."""
        newest = self._mailbox.command.read_at_once()
        if newest is not None:
            self._commanded = newest
        return self._commanded

    async def _beat(self) -> None:
        """Does one cycle each 20 ms; one that is late is left out, and never made up for."""
        due = self._clock()
        while True:
            command = self._command()
            mode = int(command["mode"])
            if mode == END or self._ended:
                return
            self._check_link()
            self._ask_state()
            self._check_people(mode, float(command["time"]))
            if mode != STREAM:
                self._measured.excuse(_REACTION)
            if mode == HAND_OVER and (self._fault is None or self._fault.word in HANDED_OVER):
                await self._let_down()
            elif mode == STREAM:
                self._follow(command)
            elif mode == HOLD or self._fault is not None:
                self._hold()
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
                self._probe = self._start(self._tell_reboot(self._reconnect()))
            return
        is_asking = self._reading is not None and not self._reading.done()
        silent = self._clock() - self._asked if is_asking else 0.0
        newest = self._measured.newest
        if silent > FROZEN:
            self._fail(LinkFault("link_frozen", f"no answer for {FROZEN:g} s"))
        elif silent < FRESH and newest and self._clock() - newest.time > FROZEN:
            self._fail(LinkFault("state_stale", f"its clock stood still for {FROZEN:g} s"))
        elif self._states > FIRST_STATES and lookahead(self._round_trip) is None:
            self._fail(LinkFault("link_slow", f"{self._round_trip * 1000:.0f} ms to an answer"))

    async def _tell_reboot(self, transport: Transport) -> None:
        """Finds out whether a robot that was lost was started anew, if it answers soon."""
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
        """Sees that somebody holds the key, and that the station has not fallen silent."""
        if self._key is not None:
            held, self._is_held = self._is_held, self._key.is_held(time.monotonic())
            if mode == STREAM and held and not self._is_held:
                self._fail(LinkFault("dead_man"))
        if mode == STREAM and self._clock() - commanded > SILENT:
            self._fail(LinkFault("planner_silent", f"for {SILENT:g} s"))

    def _ask_state(self) -> None:
        """Asks for joints and odometry, unless the last answer is still to come."""
        if self._reading is None or self._reading.done():
            self._asked = self._clock()
            self._reading = self._start(self._read_state())

    async def _read_state(self) -> None:
        call = self._transport.call
        stamp, angles, base = await asyncio.gather(
            call("ALMemory", "getTimestamp", _CLOCK_KEY),
            call("ALMotion", "getAngles", "Body", True),
            call("ALMotion", "getRobotPosition", True),
        )
        answered = self._clock()
        trip = answered - self._asked
        if self._states < FIRST_STATES:
            # The first answers take longer: services are looked up.
            self._round_trip = min(trip, self._round_trip or trip)
        else:
            self._round_trip += 0.1 * (trip - self._round_trip)
        self._shortest_trip = min(self._shortest_trip, trip)
        if len(angles) != len(BODY):
            raise LinkFault("wrong_robot", f"its body has {len(angles)} joints, not {len(BODY)}")
        positions, base_pose = np.array(angles)[self._columns], np.array(base)
        self._hands = [float(angles[BODY.index(name)]) for name in HANDS]
        if not (np.isfinite(positions).all() and np.isfinite(base_pose).all()):
            raise LinkFault("wrong_robot", "it measures what is not a number")
        # It answers in the middle, with what it measured half a cycle before, on average.
        measured = (self._asked + answered) / 2 - CYCLE / 2
        self._states += 1
        robot_time = join_time(stamp[1], stamp[2])
        self._measured.add(Measurement(robot_time, measured, positions, base_pose))

    async def _watch_arm(self) -> None:
        """Sees that the commanded arm's motors stay stiff, and that nobody else commands it."""
        names = list(arm_joints(self._config.arm))
        rows = [self._config.joints.index(name) for name in names]
        call, foreign = self._transport.call, 0
        while True:
            await self._time.pause(_WATCH_PERIOD)
            if not self._streams():
                foreign = 0
                continue
            stiffnesses = await call("ALMotion", "getStiffnesses", names)
            limp = [n for n, s in zip(names, stiffnesses, strict=True) if s < 0.05]
            if limp and self._streams():
                raise LinkFault("stiffness_lost", ", ".join(limp))
            commanded = np.array(await call("ALMotion", "getAngles", names, False))
            if self._sent is None or self._holding or not self._streams():
                foreign = 0
                continue
            far = np.abs(commanded - self._sent[rows]) > TAKEN_OVER
            foreign = foreign + 1 if far.any() else 0
            if foreign > 1:
                who = [n for n, is_far in zip(names, far, strict=True) if is_far]
                raise LinkFault("taken_over", ", ".join(who))

    def _streams(self) -> bool:
        return int(self._command()["mode"]) == STREAM

    def _slow(self, value: Any) -> None:
        self._slowed_until = self._clock() + _SLOWED_SECONDS

    # Commanding.

    def _follow(self, command: Any) -> None:
        """Streams the newest command, or holds where something is not as it must be."""
        newest = self._measured.newest
        now = self._clock()
        ahead = lookahead(self._round_trip)
        if self._fault is not None or newest is None or ahead is None:
            self._hold()
            return
        is_fresh = now - newest.time <= FRESH and now - command["time"] <= FRESH
        if not is_fresh or not self._is_held:
            # The station, the robot or a person may come back; until then the arm stands.
            self._measured.excuse(_REACTION)
            self._followed = now
            self._hold()
            return
        position = np.array(command["positions"])[self._rows]
        velocity = np.array(command["velocities"])[self._rows]
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            self._fail(LinkFault("planner_silent", "a command that is not a number"))
            return
        self._judge(newest.positions[self._rows], position, velocity, now)
        if self._fault is not None or (self._sending is not None and not self._sending.done()):
            return
        self._holding = False
        targets, fraction = streamed_targets(
            self._config.joints, position, velocity, ahead, self._limits
        )
        if np.max(np.abs(position - newest.positions[self._rows])) > _BEHIND:
            # After a pause; the path's own speed, which may be zero, would never close the gap.
            fraction = max(fraction, HOLD_FRACTION)
        self._send(targets, fraction)

    def _judge(self, measured: Vector, position: Vector, velocity: Vector, now: float) -> None:
        """Finds a frozen state and an arm that does not follow."""
        if np.max(np.abs(velocity)) <= MOVING:
            # A robot at rest may measure the same again and again; once moved it takes a moment.
            self._measured.excuse(_REACTION)
        elif self._measured.still_for > FROZEN_STATE_SECONDS:
            self._fail(LinkFault("state_frozen", f"for {FROZEN_STATE_SECONDS:g} s"))
        far = np.abs(position - measured) > STALLED
        if not far.any():
            self._followed = now
        elif now - self._followed > STALLED_SECONDS:
            names = [n for n, is_far in zip(self._config.joints, far, strict=True) if is_far]
            self._fail(LinkFault("arm_stalled", ", ".join(names)))

    def _hold(self) -> None:
        """Sends the arm, once, to where it is."""
        newest = self._measured.newest
        is_free = self._sending is None or self._sending.done()
        if self._holding or newest is None or not is_free or self._transport.is_lost:
            return
        self._holding = True
        here = newest.positions[self._rows]
        self._send(within_limits(self._config.joints, here, self._limits), HOLD_FRACTION)

    def _send(self, targets: Vector, fraction: float) -> None:
        self._sent = targets
        self._sending = self._start(
            self._transport.call(
                "ALMotion",
                "setAngles",
                list(self._config.joints),
                targets.tolist(),
                float(fraction),
            )
        )

    def _wanted_drive(self) -> Vector | None:
        """Returns the base's velocity that is wanted now, zeros to stand, None if it is unknown."""
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
        """Publishes an image with the joints of its capture; returns whether they are known."""
        taken = self._measured.at(stamp)
        if taken is None:
            # The state of that moment may still be under way.
            await self._time.pause(2 * CYCLE + self._round_trip)
            taken = self._measured.at(stamp)
        if taken is None:
            return False
        self._mailbox.write_image(camera, taken.time, pixels, taken.positions, taken.base_pose)
        return True

    # The end.

    async def _let_down(self) -> None:
        """Hands the arm over; where that is called off, the arm is held and left stiff."""
        self._publish("handing over")
        hand_over_task = asyncio.ensure_future(
            hand_over(self._transport, self._config.arm, self._measured_arm, self._time.pause)
        )
        while not hand_over_task.done():
            self._check_link()
            self._ask_state()
            self._publish("handing over")
            await self._time.pause(CYCLE)
            if not self._is_handing_over():
                hand_over_task.cancel()
                await asyncio.gather(hand_over_task, return_exceptions=True)
                self._holding = False
                self._hold()
                names = list(arm_joints(self._config.arm))
                await self._transport.call("ALMotion", "setStiffnesses", names, 1.0)
                return
        self._holding = True
        try:
            hand_over_task.result()
            phase = "handed over"
        except LinkFault as fault:
            # The first fault keeps its word; this one says how the arm was left.
            self._fail(fault)
            phase = "left stiff"
        while self._is_handing_over():
            self._publish(phase)
            await self._time.pause(CYCLE)

    def _is_handing_over(self) -> bool:
        return int(self._command()["mode"]) == HAND_OVER and not self._ended

    def _measured_arm(self) -> Vector:
        newest = self._measured.newest
        assert newest is not None
        return newest.positions[body_indices(arm_joints(self._config.arm))]

    async def _let_go(self) -> None:
        """Holds if it can and stops the base; a lost robot's base stops by itself."""
        self._publish("ended")
        if self._transport.is_lost:
            return
        with contextlib.suppress(LinkFault, TimeoutError):
            async with asyncio.timeout(FROZEN):
                await self._transport.call("ALMotion", "stopMove")
                await self._protect(True)

    async def _protect(self, is_on: bool) -> None:
        """Switches the arms' protection, unless it is on as the robot has it by itself."""
        if not self._config.protects_arms:
            await self._transport.call("ALMotion", _PROTECTION, "Arms", is_on)

    def _fail(self, fault: LinkFault) -> None:
        """Keeps the first fault, and holds."""
        if self._fault is None:
            self._fault = fault
            self._publish()
            self._hold()

    def _publish(self, phase: str = "running") -> None:
        newest = self._measured.newest
        fields: dict[str, Any] = {"phase": phase, "states": self._states, "late": self._late}
        fields |= {"round_trip": self._round_trip, "clock_bound": self._shortest_trip / 2}
        fields |= {"slowed": self._clock() < self._slowed_until, "held": self._is_held}
        if newest is not None:
            fields |= {
                "time": newest.time,
                "positions": newest.positions,
                "base_pose": newest.base_pose,
                "hands": self._hands,
            }
        if self._fault is not None:
            fields |= {"fault": self._fault.word, "detail": str(self._fault)[:240]}
        self._mailbox.state.write(**fields)
