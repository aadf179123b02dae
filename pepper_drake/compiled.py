"""Compilation of numerical functions by numba."""

import sys
from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit
from numba.core import event

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compiles a function at its first call for each kind of arguments.

    What was compiled is kept beside the function's file, in the user's cache folder or in
    $NUMBA_CACHE_DIR, until that file changes; where none of them can be written to, as in a
    container that is read-only, it is compiled anew in each process. Changes in other files go
    unnoticed: compiled functions call only those of their own file.
    """
    try:
        return cast(F, njit(cache=True)(function))
    except RuntimeError:  # "cannot cache function ...: no locator available".
        return cast(F, njit(function))


def announce_compilation() -> None:
    """Tells in the terminal that functions are compiled, once they are: nothing moves meanwhile."""
    event.register("numba:compile", _Announcement())


class _Announcement(event.Listener):
    """A sentence when the first function is compiled, and is not just read from its cache."""

    def on_start(self, event_: Any) -> None:
        event.unregister("numba:compile", self)
        print(
            "Compiling numerical functions for this computer; later runs find them ready.",
            file=sys.stderr,
        )

    def on_end(self, event_: Any) -> None:
        """Does nothing."""
