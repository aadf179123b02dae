"""Compilation of numerical functions by numba."""

import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar, cast

from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compiles a function on its first call for each kind of arguments.

    Compiled code is cached beside the function's file, in the user's cache folder or in
    $NUMBA_CACHE_DIR, until that file changes; if none is writable, as in a read-only container, it
    is compiled again in each process. Changes in other files go unnoticed: compiled functions only
    call those of their own file.
    """
    dispatcher: Any = njit(function)
    with suppress(RuntimeError):  # "cannot cache function ...: no locator available".
        dispatcher._cache = _Cache(function)
    return cast(F, dispatcher)


class _Cache(FunctionCache):
    """numba's cache; what cannot be read, as after an update of the package, is compiled anew."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            with suppress(OSError):
                self.flush()
            return None


def announce_compilation() -> None:
    """Announces on the terminal the first compilation of functions, which takes a while."""
    event.register("numba:compile", _Announcement())


class _Announcement(event.Listener):
    """Prints a sentence when a function is compiled instead of read from the cache."""

    def on_start(self, event_: Any) -> None:
        event.unregister("numba:compile", self)
        print(
            "Compiling numerical functions for this computer; later runs find them ready.",
            file=sys.stderr,
        )

    def on_end(self, event_: Any) -> None:
        """Does nothing."""
