"""Compilation of numerical functions by numba."""

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

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
