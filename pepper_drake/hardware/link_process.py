"""The link's process, and the station's side of it."""

import asyncio
import contextlib
import gc
import os
import signal
import time
from functools import partial
from multiprocessing.process import parent_process
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.hardware.link import PROBE_SECONDS, RobotLink
from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_config import LinkConfig
from pepper_drake.hardware.link_fault import LINK_FAULTS, LinkFault
from pepper_drake.hardware.mailbox import END, HAND_OVER, HOLD, Mailbox, MailboxNames
from pepper_drake.hardware.preflight import PreflightOptions, check_robot
from pepper_drake.hardware.transport import RobotAccess, make_transport
from pepper_drake.robot_server.robot.child_process import ChildProcess

_START_SECONDS = 30.0
_END_SECONDS = 5.0
_HAND_OVER_SECONDS = 20.0
_PARENT_PERIOD = 0.5
_NICENESS = -10


def run_link(
    access: RobotAccess, config: LinkConfig, options: PreflightOptions, names: MailboxNames
) -> None:
    """Checks the robot and runs the link; the target of the process."""
    # Ctrl-C reaches all processes of the terminal; the station tells this one when to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    mailbox = Mailbox(names)
    _raise_priority()
    try:
        asyncio.run(_linked(access, config, options, mailbox))
    except (LinkFault, InputError) as error:
        word = error.word if isinstance(error, LinkFault) else "robot_unreachable"
        mailbox.state.write(fault=word, detail=str(error)[:240], phase="ended")
    finally:
        mailbox.close()


def _raise_priority() -> None:
    """Raises the priority of this process, as far as the system allows."""
    gc.freeze()
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))


async def _linked(
    access: RobotAccess, config: LinkConfig, options: PreflightOptions, mailbox: Mailbox
) -> None:
    transport = make_transport(access)
    await transport.connect()
    try:
        await check_robot(transport, config.arm, options)
        clock, again = LinkClock(config.clock_rate), partial(make_transport, access)
        link = RobotLink(transport, mailbox, config, clock, again)
        watch = asyncio.ensure_future(_watch_parent(link))
        try:
            await link.run()
        finally:
            watch.cancel()
    finally:
        await transport.close()


async def _watch_parent(link: RobotLink) -> None:
    """Ends the link when the station's process has died."""
    parent = parent_process()
    while parent is None or parent.is_alive():
        await asyncio.sleep(_PARENT_PERIOD)
    link.end()


class LinkProcess(ChildProcess):
    """A robot behind a process; a context manager that ends it.

    Attributes:
        mailbox: Shared with the process.
        clock: Of the link.
    """

    def __init__(
        self, access: RobotAccess, config: LinkConfig, options: PreflightOptions | None = None
    ) -> None:
        """Starts the process.

        Args:
            access: Address and credentials of the robot.
            config: Of the link.
            options: Of the preflight checks.
        """
        self.mailbox = Mailbox()
        self.clock = LinkClock(config.clock_rate)
        arguments = (access, config, options or PreflightOptions(), self.mailbox.names)
        self.start(run_link, arguments, "robot link")

    def wait_until_ready(self) -> None:
        """Waits for the first state.

        Raises:
            LinkFault: The robot cannot be reached, or is not ready.
        """
        end = time.monotonic() + _START_SECONDS / self.clock.rate
        while int(self.state()["states"]) == 0:
            self.check()
            if time.monotonic() > end:
                raise LinkFault("link_frozen", f"no state within {_START_SECONDS:g} s")
            time.sleep(0.02)

    def state(self) -> npt.NDArray[np.void]:
        """Returns the newest state, a record of `mailbox.STATE`."""
        return self.mailbox.state.read()

    def check(self) -> None:
        """Raises the current fault, if any.

        Raises:
            LinkFault: There is a fault; the arm holds.
        """
        state = self.state()
        if str(state["fault"]):
            raise given_fault(state)
        if not self._process.is_alive():
            raise LinkFault("link_lost", f"its process ended ({self._process.exitcode})")

    def command(self, **fields: Any) -> None:
        """Writes a command; see `mailbox.COMMAND`."""
        self.mailbox.command.write(time=self.clock.now(), **fields)

    def hold(self) -> None:
        """Holds the arm where it is."""
        self.command(mode=HOLD)

    def hand_over(self) -> bool:
        """Holds, lowers and relaxes the arm, and waits until that is done.

        Returns:
            Whether the arm is soft now; otherwise it was left stiff.
        """
        self.command(mode=HAND_OVER)
        end = time.monotonic() + _HAND_OVER_SECONDS / self.clock.rate
        while time.monotonic() < end and self._process.is_alive():
            phase = str(self.state()["phase"])
            if phase in ("handed over", "left stiff", "ended"):
                return phase == "handed over"
            time.sleep(0.05)
        return False

    def last_fault(self) -> LinkFault | None:
        """Returns the current fault, if any, after a probe for a restart if the robot is lost."""
        end = time.monotonic() + PROBE_SECONDS + 0.5
        while str(self.state()["fault"]) == "link_lost" and time.monotonic() < end:
            time.sleep(0.05)
        state = self.state()
        return given_fault(state) if str(state["fault"]) else None

    def close(self) -> None:
        """Holds, ends the process and releases the memory."""
        self.command(mode=HOLD)
        self.clock.sleep(0.1)
        self.command(mode=END)
        self.end(_END_SECONDS)
        self.mailbox.close()


def given_fault(state: npt.NDArray[np.void]) -> LinkFault:
    """Returns the fault in a state."""
    word, sentence = str(state["fault"]), str(state["detail"])
    return LinkFault(word, sentence.removeprefix(LINK_FAULTS[word]).removeprefix(": "))
