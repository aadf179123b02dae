"""Parts that are chosen by a name: those of ours, and those that a user's file adds."""

from collections.abc import Mapping
from typing import TypeVar

from pepper_drake.errors import InputError

T = TypeVar("T")


def registered(kind: str, name: str, known: Mapping[str, T]) -> T:
    """Returns the part of a name.

    Args:
        kind: The word or the field that chooses it, for the sentence.
        name: Its name.
        known: Parts by their names.

    Raises:
        InputError: There is none; the message lists those that there are.
    """
    if name not in known:
        mend = f"use one of {', '.join(known)}"
        if ".py:" in name:
            mend = "files do not run code by themselves; name its file with --code FILE.py:NAME"
        raise InputError(f"{kind}: '{name}' is unknown; {mend}")
    return known[name]
