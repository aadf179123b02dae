"""Encoding of QiMessaging: values by their signatures, and message framing.

The format is libqi's (binaryencoder.cxx, message.hpp, "QiMessaging, network protocol"): little
endian throughout, strings, raw bytes, lists and maps preceded by their length as 32 bits, a dynamic
value preceded by its signature. A message is a header of 28 bytes and a payload.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np

MAGIC = b"\x42\xde\xad\x42"
HEADER = struct.Struct("<4sIIHBBIII")
LARGEST_PAYLOAD = 16 * 2**20
"""Largest payload of a message [bytes]; the largest image has 15 MB."""
_DEEPEST = 32
"""Deepest nesting of a value."""
_NUMBERS = {
    "b": "?",
    "c": "b",
    "C": "B",
    "w": "h",
    "W": "H",
    "i": "i",
    "I": "I",
    "l": "q",
    "L": "Q",
    "f": "f",
    "d": "d",
}
_LENGTH = struct.Struct("<I")
_DYNAMIC_INTEGER = np.dtype([("length", "<u4"), ("letter", "S1"), ("number", "<i4")])


@dataclass(frozen=True)
class Typed:
    """A value for a dynamic value, with its signature."""

    signature: str
    value: Any


class WireError(Exception):
    """Bytes that are not a message, or a value that does not fit its signature."""


class MessageType(IntEnum):
    """Kinds of message."""

    CALL = 1
    REPLY = 2
    ERROR = 3
    POST = 4
    EVENT = 5
    CAPABILITY = 6
    CANCEL = 7
    CANCELED = 8


class MessageFlag(IntEnum):
    """Flags of a message."""

    DYNAMIC_PAYLOAD = 1
    RETURN_TYPE = 2


@dataclass(frozen=True)
class Message:
    """A message.

    Attributes:
        type: A `MessageType`, or another number that a client sent.
        id: Number of a call, which its reply repeats.
        service: Number of the service.
        object: Number of the object.
        action: Uid of the method, signal or property.
        payload: Encoded value.
        flags: Sum of `MessageFlag`.
    """

    type: int
    id: int
    service: int
    object: int
    action: int
    payload: bytes = b""
    flags: int = 0

    def to_bytes(self) -> bytes:
        """Returns header and payload."""
        header = HEADER.pack(
            MAGIC,
            self.id,
            len(self.payload),
            0,
            self.type,
            self.flags,
            self.service,
            self.object,
            self.action,
        )
        return header + self.payload


def read_header(header: bytes) -> tuple[Message, int]:
    """Returns a message without its payload, and the payload's size [bytes].

    Raises:
        WireError: The header is not QiMessaging's, or announces more than `LARGEST_PAYLOAD`.
    """
    magic, number, size, version, kind, flags, service, obj, action = HEADER.unpack(header)
    if magic != MAGIC:
        raise WireError("no QiMessaging header")
    if version != 0:
        raise WireError(f"protocol version {version}; only 0 is known")
    if size > LARGEST_PAYLOAD:
        raise WireError(f"a payload of {size} bytes")
    return Message(kind, number, service, obj, action, flags=flags), size


@dataclass(frozen=True)
class Signature:
    """A parsed signature: its letter and its items.

    Attributes:
        letter: One of the letters of `pepper_drake.robot_server.wire.service`.
        items: Signatures inside a list, map or tuple.
    """

    letter: str
    items: tuple["Signature", ...] = ()

    def __str__(self) -> str:
        inner = "".join(map(str, self.items))
        return {"[": f"[{inner}]", "{": f"{{{inner}}}", "(": f"({inner})"}.get(
            self.letter, self.letter
        )


@lru_cache(maxsize=4096)
def parse_signature(text: str) -> Signature:
    """Parses a signature; annotations in angle brackets are ignored.

    Raises:
        WireError: It is not a signature.

    Example:
        >>> str(parse_signature("(s[m])<Pair,name,values>"))
        '(s[m])'
    """
    signature, end = _parse(text, 0, 0)
    if end != len(text):
        raise WireError(f"signature {text[:80]!r}")
    return signature


def _parse(text: str, start: int, depth: int) -> tuple[Signature, int]:
    if start >= len(text) or depth > _DEEPEST:
        raise WireError(f"signature {text[:80]!r}")
    letter, end = text[start], start + 1
    items: list[Signature] = []
    if letter in "[{(":
        closing = {"[": "]", "{": "}", "(": ")"}[letter]
        while end < len(text) and text[end] != closing:
            item, end = _parse(text, end, depth + 1)
            items.append(item)
        if end >= len(text) or len(items) != {"[": 1, "{": 2}.get(letter, len(items)):
            raise WireError(f"signature {text[:80]!r}")
        end += 1
    elif letter not in _NUMBERS and letter not in "vsrmoX":
        raise WireError(f"signature {text[:80]!r}")
    if end < len(text) and text[end] == "<":
        depth_of_brackets = 0
        while end < len(text):
            depth_of_brackets += {"<": 1, ">": -1}.get(text[end], 0)
            end += 1
            if depth_of_brackets == 0:
                break
        else:
            raise WireError(f"signature {text[:80]!r}")
    return Signature(letter, tuple(items)), end


WriteObject = Callable[[Any], bytes]
ReadObject = Callable[["Reader"], Any]


def no_object(value: Any) -> Any:
    """Refuses objects outside of a connection."""
    raise WireError("an object outside of a connection")


def encode(signature: str, value: Any, write_object: WriteObject = no_object) -> bytes:
    """Encodes a value.

    Args:
        signature: Its signature.
        value: Plain Python, of the types in `pepper_drake.robot_server.wire.service`.
        write_object: Encodes an object.

    Raises:
        WireError: The value does not fit the signature.
    """
    out = bytearray()
    try:
        _write(out, parse_signature(signature), value, write_object, 0)
    except (struct.error, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise WireError(f"{value!r:.80} is no {signature}: {error}") from None
    return bytes(out)


def _write(
    out: bytearray, signature: Signature, value: Any, write_object: WriteObject, depth: int
) -> None:
    if depth > _DEEPEST:
        raise WireError("a value nested too deeply")
    letter = signature.letter
    if letter in _NUMBERS:
        number = bool(value) if letter == "b" else float(value) if letter in "fd" else int(value)
        out += struct.pack("<" + _NUMBERS[letter], number)
    elif letter == "s":
        text = value if isinstance(value, bytes) else value.encode("utf-8", "surrogateescape")
        out += _LENGTH.pack(len(text)) + text
    elif letter == "r":
        view = memoryview(value).cast("B")
        out += _LENGTH.pack(len(view))
        out += view
    elif letter == "m":
        inner = _dynamic_signature(value)
        plain = value.value if isinstance(value, Typed) else value
        text = inner.encode()
        out += _LENGTH.pack(len(text)) + text
        _write(out, parse_signature(inner), plain, write_object, depth + 1)
    elif letter == "[":
        out += _LENGTH.pack(len(value))
        if isinstance(value, np.ndarray) and signature.items[0].letter == "m":
            out += _integers(value)
            return
        for item in value:
            _write(out, signature.items[0], item, write_object, depth + 1)
    elif letter == "{":
        out += _LENGTH.pack(len(value))
        for key, item in value.items():
            _write(out, signature.items[0], key, write_object, depth + 1)
            _write(out, signature.items[1], item, write_object, depth + 1)
    elif letter == "(":
        for inner_signature, item in zip(signature.items, value, strict=True):
            _write(out, inner_signature, item, write_object, depth + 1)
    elif letter == "o":
        out += write_object(value)
    elif letter == "X":
        raise WireError("a value of unknown type")


def _integers(values: Any) -> bytes:
    """Encodes integers (n,) as dynamic values in one step: a map of the floor has a million."""
    rows = np.empty(len(values), _DYNAMIC_INTEGER)
    rows["length"], rows["letter"] = 1, b"i"
    rows["number"] = values.astype(np.int32, casting="same_kind")
    return rows.tobytes()


def _dynamic_signature(value: Any) -> str:
    """Returns the signature of a value inside a dynamic value."""
    if isinstance(value, Typed):
        return value.signature
    if value is None:
        return "v"
    if isinstance(value, bool):
        return "b"
    if isinstance(value, int):
        return "i" if -(2**31) <= value < 2**31 else "l"
    if isinstance(value, float):
        return "f"
    if isinstance(value, str):
        return "s"
    if isinstance(value, list):
        return "[m]"
    if isinstance(value, tuple):
        return f"({'m' * len(value)})"
    if isinstance(value, dict):
        return "{sm}" if all(isinstance(key, str) for key in value) else "{mm}"
    if isinstance(value, bytes | bytearray | memoryview) or hasattr(value, "__array_interface__"):
        return "r"
    return "o"


class Reader:
    """Reads values from bytes, one after the other."""

    def __init__(self, data: bytes, read_object: ReadObject = no_object) -> None:
        """Starts at the first byte.

        Args:
            data: The bytes.
            read_object: Reads an object at the reader's position.
        """
        self._data = data
        self._position = 0
        self._read_object = read_object

    @property
    def left(self) -> int:
        """Number of bytes not yet read."""
        return len(self._data) - self._position

    def read(self, signature: str) -> Any:
        """Returns the next value.

        Raises:
            WireError: The bytes end before the value, or do not encode such a value.
        """
        try:
            return self._value(parse_signature(signature), 0)
        except (struct.error, TypeError) as error:
            raise WireError(f"no {signature[:80]}: {error}") from None

    def _take(self, size: int) -> bytes:
        if size > self.left:
            raise WireError(f"{size} bytes announced, {self.left} there")
        self._position += size
        return self._data[self._position - size : self._position]

    def _number(self, code: str) -> Any:
        layout = struct.Struct("<" + code)
        return layout.unpack(self._take(layout.size))[0]

    def _count(self, items: tuple[Signature, ...]) -> int:
        """Returns the length of a list or map, checked against the remaining bytes."""
        count: int = self._number("I")
        least = sum(_least_size(item) for item in items)
        if count * least > self.left or (least == 0 and count > 1000):
            raise WireError(f"{count} items announced, {self.left} bytes there")
        return count

    def _value(self, signature: Signature, depth: int) -> Any:
        if depth > _DEEPEST:
            raise WireError("a value nested too deeply")
        letter = signature.letter
        if letter in _NUMBERS:
            return self._number(_NUMBERS[letter])
        if letter == "s":
            return self._take(self._number("I")).decode("utf-8", "surrogateescape")
        if letter == "r":
            return self._take(self._number("I"))
        if letter == "m":
            text = self._take(self._number("I")).decode("ascii", "replace")
            return self._value(parse_signature(text), depth + 1)
        if letter == "[":
            item = signature.items[0]
            return [self._value(item, depth + 1) for _ in range(self._count(signature.items))]
        if letter == "{":
            key, item = signature.items
            pairs = (
                (self._value(key, depth + 1), self._value(item, depth + 1))
                for _ in range(self._count(signature.items))
            )
            return dict(pairs)
        if letter == "(":
            return tuple(self._value(item, depth + 1) for item in signature.items)
        if letter == "o":
            return self._read_object(self)
        if letter == "v":
            return None
        raise WireError("a value of unknown type")


@lru_cache(maxsize=4096)
def _least_size(signature: Signature) -> int:
    """Returns the least encoded size of a value [bytes]."""
    if signature.letter in _NUMBERS:
        return struct.calcsize("<" + _NUMBERS[signature.letter])
    if signature.letter == "(":
        return sum(_least_size(item) for item in signature.items)
    return 0 if signature.letter == "v" else 4


def decode(signature: str, data: bytes, read_object: ReadObject = no_object) -> Any:
    """Decodes a value that takes up all bytes.

    Raises:
        WireError: The bytes do not encode such a value, or are too many.

    Example:
        >>> decode("(sf)", encode("(sf)", ("HeadYaw", 0.5)))
        ('HeadYaw', 0.5)
    """
    reader = Reader(data, read_object)
    value = reader.read(signature)
    if reader.left:
        raise WireError(f"{reader.left} bytes after the {signature[:80]}")
    return value


def fit(signature: Signature, value: Any) -> Any:
    """Returns a value as a signature has it; what is dynamic, and objects, stay as they are.

    Raises:
        WireError: The value does not fit.
    """
    letter, items = signature.letter, signature.items
    if letter in "moX":
        return value
    kinds: dict[str, Any] = {"(": (tuple, list), "[": (tuple, list), "{": dict}
    kind: Any = (int, float) if letter in _NUMBERS else kinds.get(letter, object)
    if not isinstance(value, kind) or (letter == "(" and len(value) != len(items)):
        raise WireError(f"{value!r:.80} is no {signature}")
    if letter == "(":
        return tuple(fit(item, part) for item, part in zip(items, value, strict=True))
    if letter == "[":
        return [fit(items[0], part) for part in value]
    if letter == "{":
        return {fit(items[0], key): fit(items[1], part) for key, part in value.items()}
    return decode(letter, encode(letter, value))
