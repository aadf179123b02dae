"""Corrupts files of every format that the program reads, and tells what came of it.

  fuzz.py --count 1000                 a thousand corrupted files of each format
  fuzz.py scene log --seed 3           of these formats, other ones
  fuzz.py scene --only 17              one of them again, with its traceback

Each file is read in a process that may take 10 s and 1 GiB for it. It must be accepted with finite
numbers only, or refused by an InputError of one line with the file's name; all else is a finding.
Exit code 1 if any.
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
"""Limits for one file [s of the processor, bytes]."""

_PATIENCE = 300.0
"""Longest wait for a busy computer [s]."""

_PART = 20_000
"""Length of the part of a file in which a number is looked for [bytes]."""

ACCEPTED, REFUSED = "accepted", "refused"

_NUMBERS = "nan .nan inf -inf 1e999 -1 0 -0 1e-320 1e308 99999999999999999999 0x10 1:30 010 1_0"
_SYNTAX = "~ null true yes [] {} [[ }} - : # & * &a *a ! !!python/object:os.system | > ? % @ ` '"
_WORDS = [*(f'{_NUMBERS} {_SYNTAX} " , . .. / ../../etc/passwd /dev/zero'.split(" ")), "a\tb", ""]
_CONTROL = ["\0", "\x1b[2J", "\r", "\u202e", "\ufeff", "\x85"]


def corrupt(path: Path, dice: random.Random) -> None:
    """Corrupts a file in some way."""
    if path.suffix == ".npz" and dice.random() < 0.6:
        _corrupt_arrays(path, dice)
        return
    content = bytearray(path.read_bytes())
    ways = [_flip, _cut, _repeat, _insert, _zero]
    if path.suffix != ".npz":
        ways += [_replace_number] * 4 + [_replace_word] * 2 + [_swap_lines, _drop_line, _deepen]
    for _ in range(dice.choice((1, 1, 1, 2, 3, 8))):
        content = dice.choice(ways)(content, dice)
    path.write_bytes(content)


def _place(content: bytearray, dice: random.Random) -> int:
    return dice.randrange(len(content) + 1)


def _flip(content: bytearray, dice: random.Random) -> bytearray:
    if content:
        content[dice.randrange(len(content))] = dice.randrange(256)
    return content


def _cut(content: bytearray, dice: random.Random) -> bytearray:
    start = _place(content, dice)
    if dice.random() < 0.5:
        return content[:start]
    return content[:start] + content[start + dice.choice((1, 2, 8, 64)) :]


def _repeat(content: bytearray, dice: random.Random) -> bytearray:
    start = _place(content, dice)
    piece = content[start : start + dice.choice((1, 8, 200))]
    return content[:start] + piece * dice.choice((2, 2, 3, 3, 3, 50, 50, 5000)) + content[start:]


def _insert(content: bytearray, dice: random.Random) -> bytearray:
    start = _place(content, dice)
    word = dice.choice(_WORDS + _CONTROL)
    return content[:start] + word.encode() + content[start:]


def _zero(content: bytearray, dice: random.Random) -> bytearray:
    start = _place(content, dice)
    size = min(dice.choice((1, 16, 512)), len(content) - start)
    return content[:start] + bytes(size) + content[start + size :]


def _replace_number(content: bytearray, dice: random.Random) -> bytearray:
    # In a part, for a file may have grown by a megabyte.
    first = dice.randrange(max(1, len(content) - _PART))
    found = list(re.finditer(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?", content[first : first + _PART]))
    if not found:
        return content
    start, end = (first + place for place in dice.choice(found).span())
    value = dice.choice(_WORDS) if dice.random() < 0.5 else repr(dice.choice(_numbers(dice)))
    return content[:start] + value.encode() + content[end:]


def _numbers(dice: random.Random) -> tuple[float, ...]:
    return (
        0.0,
        -1.0,
        1e-9,
        1e6,
        -1e6,
        1e9,
        1e15,
        10.0 ** dice.uniform(-320, 308),
        dice.uniform(-10, 10),
        float(dice.randrange(-(10**6), 10**6)),
    )


def _replace_word(content: bytearray, dice: random.Random) -> bytearray:
    words = content.split(b" ")
    words[dice.randrange(len(words))] = bytearray(dice.choice(_WORDS).encode())
    return bytearray(b" ".join(words))


def _swap_lines(content: bytearray, dice: random.Random) -> bytearray:
    lines = content.split(b"\n")
    one, other = dice.randrange(len(lines)), dice.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return bytearray(b"\n".join(lines))


def _drop_line(content: bytearray, dice: random.Random) -> bytearray:
    lines = content.split(b"\n")
    del lines[dice.randrange(len(lines))]
    return bytearray(b"\n".join(lines))


def _deepen(content: bytearray, dice: random.Random) -> bytearray:
    start = _place(content, dice)
    depth = dice.choice((10, 10, 1000, 1000, 100_000))
    return content[:start] + dice.choice((b"[", b"{a: ", b"- ", b'{"a":')) * depth + content[start:]


def _corrupt_arrays(path: Path, dice: random.Random) -> None:
    """Writes an npz file with other shapes, elements or names."""
    with np.load(path) as data:
        arrays = {name: data[name] for name in data.files}
    for _ in range(dice.choice((1, 1, 2))):
        name = dice.choice(sorted(arrays))
        array = arrays[name]
        way = dice.randrange(9)
        if way == 0:
            del arrays[name]
            if not arrays:
                break
        elif way == 1 and array.dtype.kind in "fi" and array.size:
            flat = array.astype(float).ravel()
            flat[dice.randrange(array.size)] = dice.choice((*_numbers(dice), np.nan, np.inf))
            arrays[name] = flat.reshape(array.shape)
        elif way == 2:
            arrays[name] = array.ravel()[: dice.randrange(array.size + 1)]
        elif way == 3:
            arrays[name] = array[None]
        elif way == 4:
            arrays[name] = np.array(dice.choice(("text", "{}", "[[", '{"a": NaN}', "")))
        elif way == 5:
            kinds = ("complex128", "bool", "uint8", "float16", "int64", "datetime64[s]", "S4")
            kind = dice.choice(kinds)
            arrays[name] = np.zeros(array.shape, dtype=kind)
        elif way == 6 and array.ndim:
            arrays[name] = array[: dice.randrange(len(array) + 1)]
        elif way == 7:
            arrays[dice.choice(("costs_9", "pending_x", "pending_-1", "samples_0"))] = array
        else:
            arrays[name] = np.zeros((dice.choice((0, 1, 3_000_000)), dice.choice((1, 3))))
    (np.savez_compressed if dice.random() < 0.7 else np.savez)(path, **arrays)


def try_one(form: Format, seed: str, folder: Path, good: Path | None = None) -> tuple[str, str]:
    """Corrupts and reads one file; returns what came of it, in a word and in words.

    Args:
        form: The format.
        seed: Of how it is corrupted.
        folder: An empty one, for the file and those beside it.
        good: A folder in which the format has made its files; left out, they are made anew.
    """
    dice = random.Random(seed)
    if good is None:
        path = form.make(folder)
    else:
        shutil.copytree(good, folder, dirs_exist_ok=True)
        path = folder / (good.parent / "path").read_text()
    corrupt(path, dice)
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
def _made_once(form: Format) -> Iterator[Path]:
    """Makes a format's files, for `try_one` to copy."""
    with tempfile.TemporaryDirectory() as folder:
        good = Path(folder) / "good"
        good.mkdir()
        (good.parent / "path").write_text(str(form.make(good).relative_to(good)))
        yield good


def _work(form: Format, seed: str, numbers: range, channel: Connection) -> None:
    with open("/proc/self/statm") as statm:
        used = int(statm.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    with _made_once(form) as good:
        for number in numbers:
            channel.send((number, "begins", ""))
            with tempfile.TemporaryDirectory() as folder:
                began = time.process_time()
                # Whatever does not come back is ended, which shows as exit code -24.
                soft = int(began + 2.0 * LONGEST) + 1
                resource.setrlimit(resource.RLIMIT_CPU, (soft, resource.RLIM_INFINITY))
                outcome, words = try_one(form, f"{seed} {number}", Path(folder), good)
                if time.process_time() - began > LONGEST:
                    outcome = f"over {LONGEST:g} s"
                channel.send((number, outcome, words))


def fuzz(name: str, form: Format, count: int, seed: int) -> collections.Counter[str]:
    """Reads corrupted files of a format; returns how often what came of it."""
    outcomes: collections.Counter[str] = collections.Counter()
    # A fork has all libraries loaded, so that one that ends is soon replaced.
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
            while here.poll(_PATIENCE):
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
    cv2.setNumThreads(0)  # Threads would not come along into a forked process.
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
