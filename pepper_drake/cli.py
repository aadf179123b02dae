"""Shared by all apps: options, exit codes, and one clear sentence for bad input."""

import argparse
import contextlib
import errno
import importlib.util
import io
import logging
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType, TracebackType
from typing import NoReturn

from threadpoolctl import threadpool_limits

from pepper_drake.errors import InputError, PepperDrakeError, StoppedError, one_line
from pepper_drake.files import MOST_DIGITS
from pepper_drake.results.folder import check_writable

EXIT_DONE = 0
EXIT_FAILED = 1
"""The robot did not do its job; the app's report says why."""
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
"""Ctrl-C or SIGTERM ended the app before it was done; what it had done is kept."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""Errors of writing to a full or broken disk, to which the output is redirected."""
_IMPORTING = 0.02
"""Delay after which an interrupt that came during an import is sent again [s]."""


_COMMAND = "pepper-drake "
_SCRIPT = re.compile(r"(?<![\w./-])(?:apps/)?([a-z_]+)\.py(?!:?\w)")
_CONTINUED = re.compile(r"^(?= {24})", re.MULTILINE)
"""Start of a line that goes on with what an example's command does."""


def as_run(text: str) -> str:
    """Names apps as they are run now: `reach.py`, or `pepper-drake reach` of the installed package.

    Args:
        text: Text that names them as scripts.
    """

    def named(script: re.Match[str]) -> str:
        is_app = importlib.util.find_spec(f"pepper_drake.apps.{script[1]}") is not None
        return _COMMAND + script[1] if is_app else script[0]

    return _SCRIPT.sub(named, text) if sys.argv[0].startswith(_COMMAND) else text


class OneLineParser(argparse.ArgumentParser):
    """A parser that reports errors in one line."""

    def format_help(self) -> str:
        """Returns the help text, with apps named as they are run now."""
        return as_run(super().format_help())

    def error(self, message: str) -> NoReturn:
        """Exits with the exit code of bad input."""
        self.exit(EXIT_BAD_INPUT, f"error: {one_line(message)}; see {self.prog} --help\n")


def seed(text: str) -> int:
    """Reads a seed from the command line: a whole number of at least 0, which a file may hold."""
    if not (text.isascii() and text.isdigit() and len(text) <= MOST_DIGITS):
        raise argparse.ArgumentTypeError(
            f'"{text}" is not a seed; give a whole number, 0 or above, of at most {MOST_DIGITS}'
            " digits"
        )
    return int(text)


def _folder(text: str) -> Path:
    """Reads a folder from the command line; an empty text, as of a variable not set, is none."""
    if not text.strip():
        raise argparse.ArgumentTypeError("it is empty; give a folder")
    return Path(text)


def make_parser(
    name: str, description: str | None, *, seed_of_scenario: bool = False
) -> argparse.ArgumentParser:
    """Makes a parser with the options that every app takes.

    Args:
        name: The app's name; its default output folder is `out/<name>`.
        description: The help text, usually the module's docstring.
        seed_of_scenario: Whether the default seed is the scenario's; the option is then None.
    """
    program = sys.argv[0]
    if is_command := program.startswith(_COMMAND):
        # What is said of an example stays under one another beside the longer names.
        description = _CONTINUED.sub((len(_COMMAND) - len(".py")) * " ", description or "")
    parser = OneLineParser(
        prog=program if is_command else f"{name}.py",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--output",
        type=_folder,
        default=Path("out") / name,
        metavar="DIR",
        help="folder for the results (default: %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=seed,
        default=None if seed_of_scenario else 0,
        help="seed of all randomness (default: "
        + ("the scenario's, 0 if it names none)" if seed_of_scenario else "%(default)s)"),
    )
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.add_argument(
        "--code",
        action="append",
        default=[],
        metavar="FILE.py:NAME",
        help="allow code of your own that a stored file names (approximator, coupling, planner) to "
        "be run",
    )
    return parser


def add_host_option(parser: argparse.ArgumentParser) -> None:
    """Adds `--host`, for apps with a web page."""
    parser.add_argument(
        "--host",
        metavar="ADDRESS",
        help="show the page to other computers, too: an address of this one, or 0.0.0.0 for all; "
        "who opens it needs the token in the address that is printed (default: this computer only)",
    )


def parse(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Reads the command line, and checks that the results can be written.

    Args:
        parser: From `make_parser`.

    Raises:
        InputError: Nothing can be written to `--output`.
    """
    options = parser.parse_args()
    try:
        check_writable(options.output)
    except InputError as error:
        raise InputError(f"--output {error}") from None
    if options.code:
        # Imported here: most commands do not need it.
        from pepper_drake.user_code import register_code

        for text in options.code:
            register_code(text)
    return options


def shows_progress(options: argparse.Namespace) -> bool:
    """Tells whether a progress bar is shown: in a terminal, unless `--quiet` is given."""
    return not options.quiet and sys.stderr.isatty()


def run(main: Callable[[], int]) -> None:
    """Runs an app's `main` and exits with its code; errors that a user can fix become one line.

    SIGTERM has the effect of Ctrl-C.
    """
    try:
        signal.signal(signal.SIGTERM, _interrupt)
        _take_interrupts()
        quiet_resource_tracker()
        limit_linear_algebra()
        _open_streams()
        code = main()
        sys.stdout.flush()
    except InputError as error:
        print(f"error: {as_run(str(error))}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except StoppedError as error:
        print(f"interrupted: {error}", file=sys.stderr)
        code = EXIT_INTERRUPTED
    except PepperDrakeError as error:
        print(f"error: {as_run(str(error))}", file=sys.stderr)
        code = EXIT_FAILED
    except BrokenPipeError:  # The reader of the output, such as `head`, has gone.
        _print_to_nowhere()
        code = EXIT_DONE
    except PermissionError as error:
        if error.filename is None:
            raise
        print(f"error: {one_line(f'{error.filename}: {error.strerror}')}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except OSError as error:
        if error.filename is not None or error.errno not in _FULL:
            raise
        print(f"error: what is printed cannot be written ({error.strerror})", file=sys.stderr)
        _print_to_nowhere()
        code = EXIT_BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        code = EXIT_INTERRUPTED
    sys.exit(code)


def _open_streams() -> None:
    """Opens streams that are closed (`>&-`, a daemon), and lets them print any name.

    The next file that is opened would be in the place of a closed one, and what libraries print in
    it. What the terminal has no character for, as in a file's name, is shown by its code.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            nowhere = os.open(os.devnull, os.O_RDWR)  # The lowest number that is free: this one.
            setattr(sys, name, os.fdopen(nowhere, "w" if number else "r", closefd=False))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")
    warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # In a figure: a box.


def _print_to_nowhere() -> None:
    """Drops what is still to be printed: Python would try once more at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raises KeyboardInterrupt, but postpones it during an import.

    An interrupted import may turn it into another error, and print lines of its own.
    """
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            again = threading.Timer(_IMPORTING, os.kill, (os.getpid(), number))
            again.daemon = True
            again.start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _take_interrupts() -> None:
    """Makes Ctrl-C one line from now on, also while an app still imports what it needs."""
    is_main = threading.current_thread() is threading.main_thread()
    if is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)


def _show_uncaught(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Shows an exception that ends the program; Ctrl-C before `run` as it is shown in it."""
    if issubclass(kind, KeyboardInterrupt):
        print("interrupted", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


def limit_linear_algebra() -> None:
    """Limits linear algebra to one thread, regardless of the machine and `OMP_NUM_THREADS`.

    Several threads sum in another order, and a run could not be repeated to the last bit. Our
    matrices are too small to gain from them.
    """
    for library in ("OPENBLAS", "MKL", "BLIS"):  # For libraries and processes loaded later.
        os.environ[f"{library}_NUM_THREADS"] = "1"
    threadpool_limits(limits=1, user_api="blas")


def quiet_resource_tracker() -> None:
    """Lets Python clean up silently after a killed program.

    A process of `multiprocessing` outlives it and removes leaked shared memory and semaphores. Its
    warning would reach the terminal when the program is long gone. It takes its options from this
    list when it starts, with the first shared object.
    """
    option = "ignore:resource_tracker:UserWarning"
    if option not in sys.warnoptions:
        sys.warnoptions.append(option)


def quiet_libraries() -> None:
    """Keeps the terminal for the app: Drake logs only warnings, and its solver prints nothing.

    The quadratic-program solver in Drake's inverse kinematics prints to C's standard output, which
    Python cannot redirect; Python's own output moves to a copy of the terminal.
    """
    logging.getLogger("drake").setLevel(logging.WARNING)
    sys.stdout.flush()
    terminal = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    encoding, errors = sys.stdout.encoding, sys.stdout.errors
    sys.stdout = os.fdopen(terminal, "w", buffering=1, encoding=encoding, errors=errors)


@contextlib.contextmanager
def stop_on_interrupt() -> Iterator[Callable[[], bool]]:
    """Requests an orderly end at the first Ctrl-C; the second interrupts.

    Yields:
        A function that tells whether the end was requested.
    """
    asked = False

    def ask(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def wait_for_interrupt(message: str) -> None:
    """Prints a message and waits until Ctrl-C."""
    print(message, flush=True)
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            time.sleep(1)


# Imports take seconds, in which a user may find a mistake in the line just typed.
if sys.excepthook is sys.__excepthook__:
    sys.excepthook = _show_uncaught
    _take_interrupts()
