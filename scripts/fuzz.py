"""Fuzzes the reader of every file format with corrupted files.

  fuzz.py --count 1000                 a thousand corrupted files of each format
  fuzz.py scene log --seed 3           of these formats, other ones
  fuzz.py scene --only 17              one of them again, with its traceback

Each file is read in a process limited to 10 s and 1 GiB. It must be accepted with finite numbers
only, or refused by an InputError of one line with the file's name; anything else is a finding.
Exit code 1 if there is one.
"""

import argparse
import collections
import contextlib
import logging
import multiprocessing
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import numpy as np
from fuzz_formats import Format, formats, meaningless

from pepper_drake.errors import InputError

LONGEST, MEMORY = 10.0, 2**30
"""Limits for one file: processor time [s], memory [bytes]."""

_TIMEOUT = 300.0
"""Timeout of a result on a busy computer [s]."""

_PART = 20_000
"""Length of the part of a file searched for a number [bytes]."""

ACCEPTED, REFUSED = "accepted", "refused"

_NUMBERS = "nan .nan inf -inf 1e999 -1 0 -0 1e-320 1e308 99999999999999999999 0x10 1:30 010 1_0"
_SYNTAX = "~ null true yes [] {} [[ }} - : # & * &a *a ! !!python/object:os.system | > ? % @ ` '"
_WORDS = [*(f'{_NUMBERS} {_SYNTAX} " , . .. / ../../etc/passwd /dev/zero'.split(" ")), "a\tb", ""]
_CONTROL = ["\0", "\x1b[2J", "\r", "\u202e", "\ufeff", "\x85"]


def corrupt(path: Path, rng: random.Random) -> None:
    """Corrupts a file at random."""
    if path.suffix == ".npz" and rng.random() < 0.6:
        _corrupt_arrays(path, rng)
        return
    content = bytearray(path.read_bytes())
    mutations = [_flip, _cut, _repeat, _insert, _zero]
    if path.suffix != ".npz":
        mutations += [_replace_number] * 4 + [_replace_word] * 2 + [_swap_lines, _drop_line, _nest]
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        content = rng.choice(mutations)(content, rng)
    path.write_bytes(content)


def _offset(content: bytearray, rng: random.Random) -> int:
    return rng.randrange(len(content) + 1)


def _flip(content: bytearray, rng: random.Random) -> bytearray:
    if content:
        content[rng.randrange(len(content))] = rng.randrange(256)
    return content


def _cut(content: bytearray, rng: random.Random) -> bytearray:
    start = _offset(content, rng)
    if rng.random() < 0.5:
        return content[:start]
    return content[:start] + content[start + rng.choice((1, 2, 8, 64)) :]


def _repeat(content: bytearray, rng: random.Random) -> bytearray:
    start = _offset(content, rng)
    piece = content[start : start + rng.choice((1, 8, 200))]
    return content[:start] + piece * rng.choice((2, 2, 3, 3, 3, 50, 50, 5000)) + content[start:]


def _insert(content: bytearray, rng: random.Random) -> bytearray:
    start = _offset(content, rng)
    word = rng.choice(_WORDS + _CONTROL)
    return content[:start] + word.encode() + content[start:]


def _zero(content: bytearray, rng: random.Random) -> bytearray:
    start = _offset(content, rng)
    size = min(rng.choice((1, 16, 512)), len(content) - start)
    return content[:start] + bytes(size) + content[start + size :]


def _replace_number(content: bytearray, rng: random.Random) -> bytearray:
    # Only in a part: a file may have grown by a megabyte.
    first = rng.randrange(max(1, len(content) - _PART))
    found = list(re.finditer(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?", content[first : first + _PART]))
    if not found:
        return content
    start, end = (first + place for place in rng.choice(found).span())
    value = rng.choice(_WORDS) if rng.random() < 0.5 else repr(rng.choice(_numbers(rng)))
    return content[:start] + value.encode() + content[end:]


def _numbers(rng: random.Random) -> tuple[float, ...]:
    return (
        0.0,
        -1.0,
        1e-9,
        1e6,
        -1e6,
        1e9,
        1e15,
        10.0 ** rng.uniform(-320, 308),
        rng.uniform(-10, 10),
        float(rng.randrange(-(10**6), 10**6)),
    )


def _replace_word(content: bytearray, rng: random.Random) -> bytearray:
    words = content.split(b" ")
    words[rng.randrange(len(words))] = bytearray(rng.choice(_WORDS).encode())
    return bytearray(b" ".join(words))


def _swap_lines(content: bytearray, rng: random.Random) -> bytearray:
    lines = content.split(b"\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return bytearray(b"\n".join(lines))


def _drop_line(content: bytearray, rng: random.Random) -> bytearray:
    lines = content.split(b"\n")
    del lines[rng.randrange(len(lines))]
    return bytearray(b"\n".join(lines))


def _nest(content: bytearray, rng: random.Random) -> bytearray:
    start = _offset(content, rng)
    depth = rng.choice((10, 10, 1000, 1000, 100_000))
    return content[:start] + rng.choice((b"[", b"{a: ", b"- ", b'{"a":')) * depth + content[start:]


def _corrupt_arrays(path: Path, rng: random.Random) -> None:
    """Writes an npz file with other shapes, elements or names."""
    with np.load(path) as data:
        arrays = {name: data[name] for name in data.files}
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(sorted(arrays))
        array = arrays[name]
        case = rng.randrange(9)
        if case == 0:
            del arrays[name]
            if not arrays:
                break
        elif case == 1 and array.dtype.kind in "fi" and array.size:
            flat = array.astype(float).ravel()
            flat[rng.randrange(array.size)] = rng.choice((*_numbers(rng), np.nan, np.inf))
            arrays[name] = flat.reshape(array.shape)
        elif case == 2:
            arrays[name] = array.ravel()[: rng.randrange(array.size + 1)]
        elif case == 3:
            arrays[name] = array[None]
        elif case == 4:
            arrays[name] = np.array(rng.choice(("text", "{}", "[[", '{"a": NaN}', "")))
        elif case == 5:
            kinds = ("complex128", "bool", "uint8", "float16", "int64", "datetime64[s]", "S4")
            kind = rng.choice(kinds)
            arrays[name] = np.zeros(array.shape, dtype=kind)
        elif case == 6 and array.ndim:
            arrays[name] = array[: rng.randrange(len(array) + 1)]
        elif case == 7:
            arrays[rng.choice(("costs_9", "pending_x", "pending_-1", "samples_0"))] = array
        else:
            arrays[name] = np.zeros((rng.choice((0, 1, 3_000_000)), rng.choice((1, 3))))
    (np.savez_compressed if rng.random() < 0.7 else np.savez)(path, **arrays)


def try_one(form: Format, seed: str, folder: Path, good: Path | None = None) -> tuple[str, str]:
    """Corrupts and reads one file; returns the outcome in a word, and its details.

    Args:
        form: The format.
        seed: Of the corruption.
        folder: An empty one, for the format's files.
        good: A folder with the format's intact files; if None, they are made anew.
    """
    rng = random.Random(seed)
    if good is None:
        path = form.make(folder)
    else:
        shutil.copytree(good, folder, dirs_exist_ok=True)
        path = folder / (good.parent / "path").read_text()
    corrupt(path, rng)
    try:
        found = meaningless(form.read(path))
    except InputError as error:
        words = str(error)
        if len(words.splitlines()) > 1 or not words.isprintable():
            return "not one line", words
        if not any(file.name in words for file in folder.iterdir()):
            return "no file's name", words
        return REFUSED, words
    except BaseException as error:
        return f"traceback {type(error).__name__}", traceback.format_exc()
    return ("meaningless", found) if found else (ACCEPTED, "")


@contextlib.contextmanager
def made_files(form: Format) -> Iterator[Path]:
    """Makes a format's files once, for `try_one` to copy."""
    with tempfile.TemporaryDirectory() as folder:
        good = Path(folder) / "good"
        good.mkdir()
        (good.parent / "path").write_text(str(form.make(good).relative_to(good)))
        yield good


def _work(form: Format, seed: str, numbers: range, channel: Connection) -> None:
    with open("/proc/self/statm") as statm:
        used = int(statm.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    with made_files(form) as good:
        for number in numbers:
            channel.send((number, "begins", ""))
            with tempfile.TemporaryDirectory() as folder:
                began = time.process_time()
                # A reader that hangs is ended by the limit, with exit code -24.
                soft = int(began + 2.0 * LONGEST) + 1
                resource.setrlimit(resource.RLIMIT_CPU, (soft, resource.RLIM_INFINITY))
                outcome, words = try_one(form, f"{seed} {number}", Path(folder), good)
                if time.process_time() - began > LONGEST:
                    outcome = f"over {LONGEST:g} s"
                channel.send((number, outcome, words))


def fuzz(name: str, form: Format, count: int, seed: int) -> collections.Counter[str]:
    """Reads corrupted files of a format; returns the counts of the outcomes."""
    outcomes: collections.Counter[str] = collections.Counter()
    # A fork has all libraries loaded, so a crashed process is soon replaced.
    context = multiprocessing.get_context("fork")
    number = 0
    while number < count:
        here, there = context.Pipe(duplex=False)
        work = (form, f"{seed} {name}", range(number, count), there)
        process = context.Process(target=_work, args=work)
        process.start()
        there.close()
        reading = -1
        try:
            while here.poll(_TIMEOUT):
                number, outcome, words = here.recv()
                if outcome == "begins":
                    reading = number
                    continue
                outcomes[outcome] += 1
                if outcome not in (ACCEPTED, REFUSED):
                    line = (words.strip() or "accepted").splitlines()[-1][:200]
                    print(f"{name} {number}: {outcome}: {line}", flush=True)
                reading = -1
                number += 1
                if number == count:
                    break
            else:
                outcomes["hangs"] += 1
                print(f"{name} {reading}: hangs", flush=True)
                number = reading + 1
        except EOFError:
            outcomes["crash"] += 1
            process.join()
            print(f"{name} {reading}: ends with exit code {process.exitcode}", flush=True)
            number = max(reading, number) + 1
        process.kill()
        process.join()
    return outcomes


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("formats", nargs="*", help="default: all")
    parser.add_argument("--count", type=int, default=1000, help="of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="one of them, here")
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    cv2.setNumThreads(0)  # Threads do not survive a fork.
    known = formats()
    names = options.formats or list(known)
    for name in names:
        if name not in known:
            parser.error(f'"{name}" is unknown; there are {", ".join(known)}')
    if options.only is not None:
        folder = Path(tempfile.mkdtemp())
        print(*try_one(known[names[0]], f"{options.seed} {names[0]} {options.only}", folder))
        print(f"see {folder}")
        return 0
    findings = 0
    for name in names:
        began = time.monotonic()
        outcomes = fuzz(name, known[name], options.count, options.seed)
        findings += sum(n for what, n in outcomes.items() if what not in (ACCEPTED, REFUSED))
        print(f"{name:15} {dict(outcomes)} {time.monotonic() - began:.0f} s", flush=True)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
