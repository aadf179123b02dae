import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.naoqi.wire import (
    HEADER,
    LARGEST_PAYLOAD,
    Message,
    MessageType,
    Reader,
    Typed,
    WireError,
    decode,
    encode,
    fit,
    parse_signature,
    read_header,
)

INTEGERS = {
    letter: st.integers(*bounds)
    for letter, bounds in {
        "c": (-(2**7), 2**7 - 1),
        "C": (0, 2**8 - 1),
        "w": (-(2**15), 2**15 - 1),
        "W": (0, 2**16 - 1),
        "i": (-(2**31), 2**31 - 1),
        "I": (0, 2**32 - 1),
        "l": (-(2**63), 2**63 - 1),
        "L": (0, 2**64 - 1),
    }.items()
}
SCALARS = INTEGERS | {
    "b": st.booleans(),
    "f": st.floats(width=32, allow_nan=False),
    "d": st.floats(allow_nan=False),
    "s": st.text(max_size=20),
    "r": st.binary(max_size=20),
}
DYNAMIC = st.recursive(
    st.none() | st.booleans() | INTEGERS["l"] | SCALARS["f"] | SCALARS["s"] | SCALARS["r"],
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=4).map(tuple)
        | st.dictionaries(st.text(max_size=5), inner, max_size=4)
    ),
    max_leaves=12,
)


@st.composite
def typed_values(draw, depth=3):
    """A signature, and a value that has it."""
    kinds = ["scalar", "dynamic"] + (["list", "map", "tuple"] if depth else [])
    kind = draw(st.sampled_from(kinds))
    if kind == "scalar":
        letter = draw(st.sampled_from(sorted(SCALARS)))
        return letter, draw(SCALARS[letter])
    if kind == "dynamic":
        return "m", draw(DYNAMIC)
    if kind == "tuple":
        items = draw(st.lists(typed_values(depth=depth - 1), max_size=3))
        return f"({''.join(s for s, _ in items)})", tuple(v for _, v in items)
    signature, value = draw(typed_values(depth=depth - 1))
    if kind == "list":
        return f"[{signature}]", [value] * draw(st.integers(0, 3))
    keys = draw(st.lists(INTEGERS["i"], max_size=3, unique=True))
    return f"{{i{signature}}}", dict.fromkeys(keys, value)


@given(typed_values())
def test_what_is_encoded_is_decoded(case):
    signature, value = case
    assert decode(signature, encode(signature, value)) == value
    assert fit(parse_signature(signature), value) == value


@pytest.mark.parametrize(
    ("signature", "value", "hexadecimal"),
    [
        ("i", -2, "feffffff"),
        ("b", True, "01"),
        ("f", 1.5, "0000c03f"),
        ("s", "Né", "03000000 4ec3a9"),
        ("[w]", [1, -1], "02000000 0100 ffff"),
        ("{sI}", {"a": 7}, "01000000 01000000 61 07000000"),
        ("(bs)", (False, ""), "00 00000000"),
        ("m", 3, "01000000 69 03000000"),
        ("m", [0.5], "03000000 5b6d5d 01000000 01000000 66 0000003f"),
        ("m", Typed("d", 1.0), "01000000 64 000000000000f03f"),
        ("m", None, "01000000 76"),
        ("m", b"\x80", "01000000 72 01000000 80"),
        ("v", None, ""),
    ],
)
def test_bytes_are_those_of_the_protocol(signature, value, hexadecimal):
    assert encode(signature, value) == bytes.fromhex(hexadecimal)


def test_an_array_goes_out_as_raw_bytes():
    image = np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert decode("m", encode("m", [image])) == [image.tobytes()]


def test_an_array_of_whole_numbers_goes_out_as_a_dynamic_list_at_once():
    array = np.array([0, 50, -100, 2**31 - 1])
    assert encode("m", Typed("[m]", array)) == encode("m", array.tolist())
    with pytest.raises(WireError):
        encode("m", Typed("[m]", np.array([0.5])))


def test_a_message_is_its_header_and_payload():
    message = Message(MessageType.CALL, 3, 1, 1, 100, b"abc")
    data = message.to_bytes()
    assert data[:28] == bytes.fromhex(
        "42dead42 03000000 03000000 0000 01 00 01000000 01000000 64000000"
    )
    header, size = read_header(data[: HEADER.size])
    assert (header.type, header.id, header.action, size) == (1, 3, 100, 3)


def test_annotations_of_a_signature_are_left_out():
    annotated = "({I(Iss)<MetaSignal,uid,name<x>,signature>}s)<Meta,signals,text>"
    assert str(parse_signature(annotated)) == "({I(Iss)}s)"


@pytest.mark.parametrize(
    "signature", ["", "q", "[", "[i", "[ii]", "{s}", "(i", "i)", "i<a", "[" * 50 + "]" * 50, "ii"]
)
def test_what_is_no_signature_is_refused(signature):
    with pytest.raises(WireError):
        parse_signature(signature)


@pytest.mark.parametrize(
    ("signature", "value"),
    [("i", 2**31), ("C", -1), ("s", 5), ("(ii)", (1,)), ("[i]", 3), ("o", object()), ("r", "text")],
)
def test_a_value_that_does_not_fit_is_refused(signature, value):
    with pytest.raises(WireError):
        encode(signature, value)


@pytest.mark.parametrize(
    ("signature", "data"),
    [
        ("i", b"\0\0"),
        ("s", struct.pack("<I", 2**32 - 1)),
        ("[i]", struct.pack("<I", 2**31) + b"1234"),
        ("[v]", struct.pack("<I", 2**32 - 1)),
        ("[()]", struct.pack("<I", 2**32 - 1)),
        ("{s[m]}", struct.pack("<I", 2**30)),
        ("m", struct.pack("<I", 1) + b"?"),
        ("m", (struct.pack("<I", 1) + b"m") * 100),
        ("i", b"\0" * 5),
    ],
)
def test_bytes_that_are_no_such_value_are_refused(signature, data):
    with pytest.raises(WireError):
        decode(signature, data)


@given(st.text("bcCwWiIlLfdsrmvoX[]{}()", min_size=1, max_size=12), st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(signature, data):
    reader = Reader(data)
    try:
        reader.read(signature)
    except WireError:
        return
    assert 0 <= reader.left <= len(data)


@pytest.mark.parametrize(
    "header",
    [
        b"\0" * 28,
        HEADER.pack(b"\x42\xde\xad\x42", 1, LARGEST_PAYLOAD + 1, 0, 1, 0, 1, 1, 1),
        HEADER.pack(b"\x42\xde\xad\x42", 1, 0, 9, 1, 0, 1, 1, 1),
    ],
)
def test_a_header_that_is_none_is_refused(header):
    with pytest.raises(WireError):
        read_header(header)
