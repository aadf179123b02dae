"""Errors that a user can mend."""


class PepperDrakeError(Exception):
    """Base of all errors that the package raises on purpose."""


class InputError(PepperDrakeError):
    """Bad input: a file, a field or an option. Apps print its one sentence and exit with 2."""
