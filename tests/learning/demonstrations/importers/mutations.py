"""Damage to files: bytes lost, flipped and doubled, numbers that are none."""

NUMBERS = (
    b"nan", b"inf", b"-inf", b"1e400", b"1e300", b"-1e18", b"0", b"", b"x", b"0x10", b"1_000",
    b"1,5", b"9" * 400, b"\xff\xfe", b"\0", "٣".encode(),
)  # fmt: skip


def mutate(data: bytes, rng) -> bytes:
    """One to four random changes."""
    for _ in range(rng.integers(1, 5)):
        data = _change(data, rng)
    return data


def _change(data: bytes, rng) -> bytes:
    if not data:
        return data
    kind = rng.integers(9)
    a, b = sorted(int(v) for v in rng.integers(0, len(data) + 1, 2))
    if kind == 0:
        return data[:a]
    if kind == 1:
        return data[:a] + data[min(b, a + 40) :]
    if kind == 2:
        return data[:a] + data[a : a + 60] + data[a:]
    if kind == 3:
        return data[:a] + bytes(rng.integers(0, 256, 4, dtype="uint8")) + data[a + 4 :]
    if kind == 4:
        return data[:a] + bytes([data[a - 1] ^ (1 << int(rng.integers(8)))]) + data[a + 1 :]
    if kind == 5:
        return data[:a] + NUMBERS[int(rng.integers(len(NUMBERS)))] + data[a + 3 :]
    separators = [b",", b" ", b"\n", b";", b"\t"]
    if kind == 6:
        one, other = (separators[int(k)] for k in rng.integers(0, 5, 2))
        return data.replace(one, other)
    lines = data.split(b"\n")
    if kind == 7:
        k = int(rng.integers(len(lines)))
        words = lines[k].replace(b" ", b",").split(b",")
        j = int(rng.integers(len(words)))
        old, new = words[j], NUMBERS[int(rng.integers(len(NUMBERS)))]
        lines[k] = lines[k].replace(old, new, 1) if old else lines[k]
        return b"\n".join(lines)
    i, j = (int(v) for v in rng.integers(0, len(lines), 2))
    lines[i], lines[j] = lines[j], lines[i]
    return b"\n".join(lines)
