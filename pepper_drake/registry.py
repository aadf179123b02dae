"""Parts chosen by name: built-in ones, and those that a user's file adds."""

from collections.abc import Mapping
from typing import TypeVar

from pepper_drake.errors import InputError

T = TypeVar("T")


def registered(kind: str, name: str, known: Mapping[str, T]) -> T:
    """Returns the part of that name.

    Args:
        kind: The option or field that chooses it, for the message.
        name: Its name.
        known: Parts by their names.

    Raises:
        InputError: There is none; the message lists the known names.
    """
    if name not in known:
        mend = f"use one of {', '.join(known)}"
        if ".py:" in name:
            mend = "files do not run code by themselves; name its file with --code FILE.py:NAME"
        raise InputError(f"{kind}: '{name}' is unknown; {mend}")
    return known[name]
