"""Files of unknown origin: read within limits, written as a whole or not at all.

All file reading goes through here, so that a pipe, a device, an endless file or a link out of its
folder is answered with one sentence, and never with a hang or exhausted memory.
"""

import dataclasses
import json
import os
import stat
import tempfile
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from pepper_drake.errors import InputError

TEXT_LIMIT = 64 * 2**20
"""Largest size of a text file [bytes]: an hour of demonstration at 100 Hz is 60 MB."""

LARGEST_NUMBER = 1e9
"""Largest number accepted, in SI units."""

MOST_DIGITS = 15
"""Most digits of a whole number: more would not be exact as a floating-point number."""

_LFS_POINTER = b"version https://git-lfs"

_DEEPEST = 100
"""Deepest nesting of lists and objects in a JSON file."""


def read_bytes(path: Path, limit: int = TEXT_LIMIT) -> bytes:
    """Returns the content of a regular file.

    Args:
        path: The file; it may be a link to one.
        limit: Largest size [bytes].

    Raises:
        InputError: There is no such file, it is not a regular file, it cannot be read, it is larger
            than the limit, or it is a pointer of Git LFS.
    """
    try:
        # Without O_NONBLOCK, opening a pipe would block until somebody writes to it.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError:
        raise InputError(f"{path}: no file can have this name; check the path") from None
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: not a regular file; give the path of a file")
        if status.st_size <= limit:
            with os.fdopen(handle, "rb", closefd=False) as file:
                content = file.read(limit + 1)
            if len(content) <= limit:
                refuse_pointer(path, content)
                return content
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    finally:
        os.close(handle)
    raise InputError(f"{path}: larger than {limit / 2**20:.3g} MiB; give a smaller file")


def refuse_pointer(path: Path, start: bytes) -> None:
    """Refuses the pointer that a clone without Git LFS has in place of a large file.

    Args:
        path: The file.
        start: Its first 64 bytes or more.

    Raises:
        InputError: It is such a pointer.
    """
    if start.startswith(_LFS_POINTER):
        raise InputError(f"{path}: a pointer of Git LFS, not the file; git lfs pull fetches it")


def read_text(path: Path, limit: int = TEXT_LIMIT) -> str:
    """Returns the text of a regular file in UTF-8, without a byte order mark.

    Args:
        path: The file.
        limit: Largest size [bytes].

    Raises:
        InputError: As in `read_bytes`, or the file is not text.
    """
    try:
        text = read_bytes(path, limit).decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path}: not a text file in UTF-8; give one")
    return text


def read_json(path: Path, limit: int = TEXT_LIMIT) -> Any:
    """Returns the value in a JSON file: objects, lists, texts and numbers within limits.

    Args:
        path: The file.
        limit: Largest size [bytes].

    Raises:
        InputError: As in `read_text`, or the file is not JSON (which has no NaN), repeats a name in
            an object, has a number beyond `LARGEST_NUMBER` or a whole number of more than
            `MOST_DIGITS`, or is nested too deeply.
    """
    return parse_json(read_text(path, limit), str(path))


def parse_json(text: str, name: str) -> Any:
    """Returns the value of JSON text; see `read_json`.

    Args:
        text: The JSON.
        name: Its source, for error messages.
    """
    try:
        value = json.loads(
            text,
            parse_constant=_refuse_constant,
            parse_float=_finite,
            parse_int=_whole,
            object_pairs_hook=_object,
        )
    except json.JSONDecodeError as error:
        raise InputError(f"{name} line {error.lineno}: not valid JSON ({error.msg})") from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else error
        raise InputError(f"{name}: not valid JSON ({reason})") from None
    if _depth(value) > _DEEPEST:
        raise InputError(f"{name}: not valid JSON (nested too deeply)")
    return value


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is not a number")


def _finite(text: str) -> float:
    number = float(text)
    if not abs(number) <= LARGEST_NUMBER:
        raise ValueError(f"{text[:20]} is too large")
    return number


def _whole(text: str) -> int:
    if len(text.lstrip("-")) > MOST_DIGITS:
        raise ValueError(f"a whole number of more than {MOST_DIGITS} digits")
    return int(text)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f'"{twice[:40]}" stands there twice')
    return found


def _depth(value: Any) -> int:
    """Levels of lists and objects around the innermost value."""
    depth, level = 0, [value]
    while level:
        below: list[Any] = []
        for item in level:
            if isinstance(item, dict):
                below += item.values()
            elif isinstance(item, list):
                below += item
        depth, level = depth + 1, below
    return depth


def check_fields(record: Any, name: str, mend: str) -> None:
    """Checks that the fields of a dataclass, read from a file, match their types.

    Args:
        record: The dataclass; nested ones are checked, too, but not the elements of lists.
        name: Its source, for error messages.
        mend: End of the message.

    Raises:
        InputError: A field has another type, or is a number beyond `LARGEST_NUMBER`.
    """
    for field, hint in get_type_hints(type(record)).items():
        value = getattr(record, field)
        options = {get_origin(option) or option for option in (get_args(hint) or (hint,))}
        kinds = {get_origin(hint)} if get_origin(hint) in (list, dict, tuple) else options
        if float in kinds:
            kinds.add(int)
        if not any(type(value) is kind for kind in kinds):
            raise InputError(f"{name}: {field} is of another kind; {mend}")
        if isinstance(value, int | float) and not abs(value) <= LARGEST_NUMBER:
            raise InputError(f"{name}: {field} is {value:g}; {mend}")
        if dataclasses.is_dataclass(value):
            check_fields(value, name, mend)


def path_inside(folder: Path, name: str | Path) -> Path:
    """Returns the path of a file in a folder.

    A folder of unknown origin must not make the program read files elsewhere.

    Args:
        folder: The folder.
        name: A path relative to it.

    Raises:
        InputError: The path leads out of the folder, by its name or by a link.
    """
    path = folder / name
    try:
        is_inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # A cycle of links is a RuntimeError.
        is_inside = False
    if not is_inside:
        raise InputError(f"{path}: leads out of its folder; put a copy of the file there")
    return path


def write_atomically(path: Path, content: str | bytes) -> None:
    """Writes a file so that others see the old or the new one, never a part.

    Args:
        path: The file; its folder is created if needed.
        content: New content; a text is written in UTF-8.

    Raises:
        InputError: The folder cannot be written to.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
