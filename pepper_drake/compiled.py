"""Compilation of numerical functions by numba."""

import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher

F = TypeVar("F", bound=Callable[..., object])
_PLAIN = (int, float, str, tuple, np.generic)
"""Types of the constants in a digest."""


def compiled(function: F) -> F:
    """Compiles a function on its first call for each kind of arguments.

    Compiled code is cached beside the function's file, in the user's cache folder or in
    $NUMBA_CACHE_DIR, until that file or a compiled function that it calls changes; if none is
    writable, as in a read-only container, it is compiled again in each process.
    """
    dispatcher: Any = njit(function)
    with suppress(RuntimeError):  # "cannot cache function ...: no locator available".
        dispatcher._cache = _Cache(function)
    return cast(F, dispatcher)


def load_compiled(*functions: Callable[..., object]) -> None:
    """Loads what earlier runs compiled of functions, which takes each of them some milliseconds.

    Otherwise their first calls would wait for it, in the midst of a movement.

    Args:
        functions: Compiled ones.
    """
    for function in functions:
        dispatcher: Any = function
        if isinstance(dispatcher._cache, _Cache):
            for signature in dispatcher._cache.signatures(dispatcher.targetctx.codegen()):
                dispatcher.compile(signature)


class _Cache(FunctionCache):
    """numba's cache, for functions that call those of other files.

    What cannot be read, as after an update of the package, is compiled anew.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            with suppress(OSError):
                self.flush()
            return None

    def signatures(self, codegen: Any) -> list[Any]:
        """Returns the signatures for which there is compiled code of the function as it is."""
        try:
            keys = list(self._cache_file._load_index())
        except Exception:
            return []
        return [key[0] for key in keys if key == self._index_key(key[0], codegen)]

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (*super()._index_key(sig, codegen), _digest(self._py_func))


def _digest(function: Any) -> str:
    """Returns a digest of a function, of all that it calls, and of the numbers that they use."""
    found: dict[str, str] = {}
    waiting = [function]
    while waiting:
        code, known = waiting[-1].__code__, waiting.pop().__globals__
        place = f"{code.co_filename} {code.co_firstlineno}"
        if place not in found:
            used = [known.get(name) for name in code.co_names]
            numbers = [value for value in (*code.co_consts, *used) if isinstance(value, _PLAIN)]
            found[place] = repr((code.co_code, numbers))
            waiting += [value.py_func for value in used if isinstance(value, Dispatcher)]
    return hashlib.sha256(repr(sorted(found.items())).encode()).hexdigest()


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
