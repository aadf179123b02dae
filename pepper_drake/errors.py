"""Errors that a user can fix."""

_LONGEST = 1000


class PepperDrakeError(Exception):
    """Base of all errors that the package raises on purpose.

    Its text is one line, safe to print on a terminal: it may quote a file of unknown origin.
    """

    def __str__(self) -> str:
        return one_line(super().__str__())


class InputError(PepperDrakeError):
    """Bad input: a file, a field or an option. Apps print its one sentence and exit with 2."""


class StoppedError(PepperDrakeError):
    """The user stopped it before there was anything to keep. Apps print that and exit with 130."""


def one_line(text: str) -> str:
    """Returns a text as one line of at most 1000 characters.

    Control characters, which could move the cursor, colour the terminal or change the direction of
    writing, are shown by their codes.

    Args:
        text: Any text.
    """
    shown = "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in text[: 2 * _LONGEST]
    )
    if len(shown) > _LONGEST or len(text) > 2 * _LONGEST:
        half = _LONGEST // 2
        shown = f"{shown[:half]} ... {shown[-half // 2 :]}"
    return shown
