"""The dead man's switch: the robot only moves while the space bar or a pad button is held."""

import contextlib
import os
import struct
import termios
import tty
from typing import Protocol

from pepper_drake.errors import InputError

KEYBOARD = "keyboard"
"""Name of the space bar of the program's terminal."""
_TERMINAL = "/dev/tty"
_FIRST = 0.8
"""Time for which a key counts as held after the first press, until it repeats [s]."""
_REPEATED = 0.25
"""The same while it repeats [s]; the slowest keyboards repeat eleven times per second."""
_EVENT = struct.Struct("IhBB")
"""An event of Linux's joystick interface: time, value, type, number."""
_BUTTON = 0x01


class DeadManKey(Protocol):
    """A key or button of a dead man's switch."""

    def is_held(self, now: float) -> bool:
        """Returns whether it is held at a time of the machine's clock [s]."""

    def close(self) -> None:
        """Releases the device."""


class SpaceBar:
    """The space bar of a terminal, which reports no release: a key is held while it repeats."""

    def __init__(self, terminal: str = _TERMINAL) -> None:
        """Switches the terminal to unbuffered input.

        Raises:
            InputError: There is no terminal.
        """
        try:
            self._file = os.open(terminal, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
            self._settings = termios.tcgetattr(self._file)
            tty.setcbreak(self._file, termios.TCSANOW)
        except (OSError, termios.error):
            raise InputError(
                "there is no terminal for a dead man's switch, the held space bar: start in one, "
                "or give --pad /dev/input/js0 to hold a button, or --unattended to do without"
            ) from None
        self._until = -1.0

    def is_held(self, now: float) -> bool:
        """Returns whether it is held; see `DeadManKey`."""
        if b" " in _available(self._file):
            self._until = now + (_REPEATED if now < self._until else _FIRST)
        return now < self._until

    def close(self) -> None:
        """Restores the terminal."""
        with contextlib.suppress(termios.error):
            termios.tcsetattr(self._file, termios.TCSANOW, self._settings)
        os.close(self._file)


class PadButton:
    """Any button of a game pad, by Linux's joystick interface."""

    def __init__(self, device: str) -> None:
        """Opens the pad.

        Raises:
            InputError: There is none.
        """
        try:
            self._file = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise InputError(f"--pad {device}: {error.strerror}") from None
        self._held: set[int] = set()
        self._unparsed = b""

    def is_held(self, now: float) -> bool:
        """Returns whether a button is held; see `DeadManKey`. False if the pad is gone."""
        try:
            data = self._unparsed + _available(self._file)
        except OSError:
            self._held.clear()
            return False
        whole = len(data) - len(data) % _EVENT.size
        self._unparsed = data[whole:]
        for _, value, kind, number in _EVENT.iter_unpack(data[:whole]):
            if kind & _BUTTON:
                (self._held.add if value else self._held.discard)(number)
        return bool(self._held)

    def close(self) -> None:
        """Closes the pad."""
        os.close(self._file)


def _available(file: int) -> bytes:
    """Returns the bytes that can be read without blocking."""
    try:
        return os.read(file, 4096)
    except BlockingIOError:
        return b""


def dead_man_key(name: str) -> DeadManKey | None:
    """Returns a key.

    Args:
        name: `KEYBOARD`, the path of a pad, or "" for none.

    Raises:
        InputError: There is no terminal, or no such pad.
    """
    if not name:
        return None
    return SpaceBar() if name == KEYBOARD else PadButton(name)
