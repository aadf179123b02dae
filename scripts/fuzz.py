"""Corrupts files of every format that the program reads, and tells what came of it.

  fuzz.py --count 1000                 a thousand corrupted files of each format
  fuzz.py scene log --seed 3           of these formats, other ones
  fuzz.py scene --only 17              one of them again, with its traceback

Each file is read in a process that may take 10 s and 1 GiB for it. It must be accepted, or refused
by an InputError of one line with the file's name; all else is a finding. Exit code 1 if any.
"""

import argparse
import collections
import json
import multiprocessing
import os
import random
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from pepper_drake.errors import InputError

LONGEST, MEMORY = 10.0, 2**30
"""Limits for one file [s of the processor, bytes]."""

_PATIENCE = 300.0
"""How long a busy computer is waited for [s]."""

ACCEPTED, REFUSED = "accepted", "refused"

MODELS = Path(__file__).parents[1] / "pepper_drake" / "models"

_NUMBERS = "nan .nan inf -inf 1e999 -1 0 -0 1e-320 1e308 99999999999999999999 0x10 1:30 010 1_0"
_SYNTAX = "~ null true yes [] {} [[ }} - : # & * &a *a ! !!python/object:os.system | > ? % @ ` '"
_WORDS = [*(f'{_NUMBERS} {_SYNTAX} " , . .. / ../../etc/passwd /dev/zero'.split(" ")), "a\tb", ""]
_CONTROL = ["\0", "\x1b[2J", "\r", "\u202e", "\ufeff", "\x85"]


_CALIBRATION = """robot: worn, seed 3
date: '2026-11-28T23:15:00+00:00'
reason: routine
joints:
  RElbowRoll: {offset: 0.004, offset_sigma: 0.0001, slack: 0.017, slack_sigma: 0.0002}
cameras:
  camera_top: {position: [0.001, 0.0, -0.002], rotation: [0.01, 0.0, 0.002], focal: 1.004}
residuals: {position_before: 0.008, position_after: 0.0003, postures: 20, images: 21}
held: [RWristYaw offset]
"""


@dataclass(frozen=True)
class Format:
    """A format: how a good file is made, and how one is read.

    Attributes:
        make: Writes good files into a folder, and returns which one is corrupted.
        read: Reads what is in the folder.
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], object]


def formats() -> dict[str, Format]:
    """Returns the formats by name."""
    from pepper_drake.benchmarking.method_result import MethodResult
    from pepper_drake.learning import Demonstration, MovementPrimitive
    from pepper_drake.learning.dmp.bimanual import BimanualPrimitive
    from pepper_drake.learning.dmp.rhythmic import RhythmicPrimitive
    from pepper_drake.live.script import load_script
    from pepper_drake.models.guide import load_guide
    from pepper_drake.models.joint_script import load_joint_script
    from pepper_drake.models.marker_script import load_marker_script
    from pepper_drake.models.motion import load_path, path_trajectory
    from pepper_drake.models.obj_files import check_obj
    from pepper_drake.models.pad_script import load_pad_script
    from pepper_drake.models.robot_calibration import load_calibration
    from pepper_drake.models.scene import load_scene
    from pepper_drake.optimization.cost import load_cost
    from pepper_drake.optimization.history import History
    from pepper_drake.optimization.movement_problem import load_points
    from pepper_drake.optimization.ratings import load_scores
    from pepper_drake.playback.loading import load_motion

    demonstration = MODELS / "demonstrations" / "reach"

    def text(name: str, content: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            (folder / name).write_text(content)
            return folder / name

        return make

    def copy(source: Path) -> Callable[[Path], Path]:
        return text(source.name, source.read_text())

    def part(name: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            for file in demonstration.iterdir():
                lines = file.read_text().splitlines(keepends=True)
                (folder / file.name).write_text("".join(lines[:40]))
            return folder / name

        return make

    def primitive(folder: Path) -> Path:
        _primitive().save(folder / "primitive.yaml")
        return folder / "primitive.yaml"

    def rhythmic(folder: Path) -> Path:
        weights = np.arange(15.0).reshape(5, 3)
        RhythmicPrimitive(weights, 3.0, np.zeros(3), 2.0).save(folder / "circle.yaml")
        return folder / "circle.yaml"

    def bimanual(folder: Path) -> Path:
        for name in ("absolute", "relative"):
            _primitive().save(folder / f"{name}.yaml")
        return text("pair.yaml", "hold_rate: 60.0\n")(folder)

    def history(folder: Path) -> Path:
        samples = [np.ones((4, 3)), np.zeros((4, 3))]
        costs = [np.arange(4.0), np.ones((4, 5))]
        means = [np.zeros(3)] * 3
        History({"seed": 1}, samples, costs, means, [1.0, float("nan"), 3.0]).save(
            folder / "history.npz"
        )
        return folder / "history.npz"

    def run(name: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            _write_run(folder)
            return folder / name

        return make

    def reproduction(folder: Path) -> Path:
        _write_reproduction(folder)
        return folder / "log.npz"

    def mesh_scene(folder: Path) -> Path:
        shutil.copy(MODELS / "meshes" / "mug.obj", folder / "mug.obj")
        scene = (MODELS / "scenes" / "free.yaml").read_text().partition("obstacles:")[0]
        (folder / "scene.yaml").write_text(
            scene + "obstacles:\n- {name: mug, shape: mesh, mesh: mug.obj, size: [1.0],"
            " position: [2.0, 1.0, 0.5]}\n"
        )
        return folder / "mug.obj"

    result = MethodResult("scene_1", "d", "reached", clearance=0.02, wall_seconds=3.0)

    def method_result(folder: Path) -> Path:
        result.save(folder / "d.json")
        return folder / "d.json"

    return {
        "scene": Format(copy(MODELS / "scenes" / "clutter.yaml"), load_scene),
        "moving_scene": Format(
            text("scene.yaml", _moving_scene()), lambda path: load_scene(path).mirrored()
        ),
        "guide": Format(copy(MODELS / "guides" / "reach.yaml"), load_guide),
        "joints": Format(copy(MODELS / "guides" / "joints.yaml"), load_joint_script),
        "pad": Format(copy(MODELS / "guides" / "pad.yaml"), load_pad_script),
        "marker": Format(copy(MODELS / "guides" / "marker.yaml"), load_marker_script),
        "session": Format(
            copy(MODELS / "sessions" / "story.yaml"), lambda path: load_script(str(path))
        ),
        "calibration": Format(text("calibration.yaml", _CALIBRATION), load_calibration),
        "cost": Format(text("cost.yaml", "hand_to_goal: 1.0\njerk: 1e-3\nrating: 0\n"), load_cost),
        "primitive": Format(primitive, lambda path: MovementPrimitive.load(path).rollout()),
        "rhythmic": Format(rhythmic, RhythmicPrimitive.load),
        "bimanual": Format(bimanual, lambda path: BimanualPrimitive.load(path.parent)),
        "mesh": Format(mesh_scene, lambda path: load_scene(path.parent / "scene.yaml")),
        "mesh_alone": Format(copy(MODELS / "meshes" / "bottle.obj"), check_obj),
        "log": Format(run("log.npz"), lambda path: load_motion(path.parent)),
        "report": Format(run("report.json"), lambda path: load_motion(path.parent)),
        "run_scene": Format(run("scene.yaml"), lambda path: load_motion(path.parent)),
        "reproduction": Format(reproduction, lambda path: load_motion(path.parent)),
        "history": Format(history, lambda path: History.load(path).best()),
        "points_npz": Format(run("log.npz"), load_points),
        "points": Format(text("cloud.txt", "# m\n0.3 0.1 0.2\n0.4 -0.1 0.25\n"), load_points),
        "ratings": Format(text("scores.txt", "3\n7.5 # better\n10\n"), load_scores),
        "path": Format(
            text("path.txt", "0 0 0 0\n1 0 0 0.1\n2.5 0 0.1 0.1\n"),
            lambda path: path_trajectory(load_path(path)),
        ),
        "method_result": Format(method_result, MethodResult.load),
        "translation": Format(part("translation.txt"), lambda p: Demonstration.load(p.parent)),
        "rotation": Format(part("rotation.txt"), lambda p: Demonstration.load(p.parent)),
        "joints_csv": Format(part("joints.csv"), lambda p: Demonstration.load(p.parent)),
    }


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
    return content[:start] + piece * dice.choice((2, 3, 50, 5000)) + content[start:]


def _insert(content: bytearray, dice: random.Random) -> bytearray:
    start = _place(content, dice)
    word = dice.choice(_WORDS + _CONTROL)
    return content[:start] + word.encode() + content[start:]


def _zero(content: bytearray, dice: random.Random) -> bytearray:
    start = _place(content, dice)
    size = min(dice.choice((1, 16, 512)), len(content) - start)
    return content[:start] + bytes(size) + content[start + size :]


def _replace_number(content: bytearray, dice: random.Random) -> bytearray:
    import re

    found = list(re.finditer(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?", bytes(content)))
    if not found:
        return content
    one = dice.choice(found)
    value = dice.choice(_WORDS) if dice.random() < 0.5 else repr(dice.choice(_numbers(dice)))
    return content[: one.start()] + value.encode() + content[one.end() :]


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
    depth = dice.choice((10, 1000, 100_000))
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


def try_one(form: Format, seed: str, folder: Path) -> tuple[str, str]:
    """Corrupts and reads one file; returns what came of it, in a word and in words."""
    dice = random.Random(seed)
    path = form.make(folder)
    corrupt(path, dice)
    try:
        form.read(path)
    except InputError as error:
        words = str(error)
        if len(words.splitlines()) > 1 or not words.isprintable():
            return "not one line", words
        if not any(file.name in words for file in folder.iterdir()):
            return "no file's name", words
        return REFUSED, words
    except BaseException as error:
        return f"traceback {type(error).__name__}", traceback.format_exc()
    return ACCEPTED, ""


def _work(name: str, numbers: range, seed: int, channel: Connection) -> None:
    import logging

    logging.disable(logging.CRITICAL)
    form = formats()[name]
    with open("/proc/self/statm") as statm:
        used = int(statm.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    for number in numbers:
        channel.send((number, "begins", ""))
        with tempfile.TemporaryDirectory() as folder:
            began = time.process_time()
            outcome, words = try_one(form, f"{seed} {name} {number}", Path(folder))
            if time.process_time() - began > LONGEST:
                outcome = f"over {LONGEST:g} s"
            channel.send((number, outcome, words))


def fuzz(name: str, count: int, seed: int) -> collections.Counter[str]:
    """Reads corrupted files of a format; returns how often what came of it."""
    outcomes: collections.Counter[str] = collections.Counter()
    context = multiprocessing.get_context("spawn")
    number = 0
    while number < count:
        here, there = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(name, range(number, count), seed, there))
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
                    print(f"{name} {number}: {outcome}: {words.strip().splitlines()[-1][:200]}")
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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", help="default: all")
    parser.add_argument("--count", type=int, default=1000, help="of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="one of them, here")
    options = parser.parse_args()
    names = options.formats or list(formats())
    if options.only is not None:
        folder = Path(tempfile.mkdtemp())
        print(*try_one(formats()[names[0]], f"{options.seed} {names[0]} {options.only}", folder))
        print(f"see {folder}")
        return 0
    findings = 0
    for name in names:
        began = time.monotonic()
        outcomes = fuzz(name, options.count, options.seed)
        findings += sum(n for what, n in outcomes.items() if what not in (ACCEPTED, REFUSED))
        print(f"{name:15} {dict(outcomes)} {time.monotonic() - began:.0f} s", flush=True)
    return 1 if findings else 0


def _primitive():  # noqa: ANN202
    from pepper_drake.learning import Demonstration, MovementPrimitive

    demo = Demonstration.load(MODELS / "demonstrations" / "reach")
    return MovementPrimitive.fit(demo, num_basis=8)


def _moving_scene() -> str:
    text = (MODELS / "scenes" / "free.yaml").read_text().partition("obstacles:")[0]
    return (
        text
        + """obstacles:
- name: ball
  shape: sphere
  size: [0.05]
  position: [0.9, 1.0, 1.2]
  path: [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, -0.3, 0.0], [2.5, 0.1, -0.3, 0.1]]
"""
    )


def _write_run(folder: Path) -> None:
    from pepper_drake.models.scene import load_scene, save_scene
    from pepper_drake.results.reach_log import _COLUMNS

    rows = 30
    arrays = {
        name: np.zeros(rows if columns is None else (rows, columns))
        for name, columns in _COLUMNS.items()
    }
    arrays |= {
        "time_s": 0.01 * np.arange(rows),
        "object_offset_m": np.zeros((rows, 0)),
        "cloud_torso_m": np.ones((20, 3)),
        "demonstration_m": np.ones((20, 3)),
    }
    np.savez_compressed(folder / "log.npz", **arrays)
    save_scene(load_scene("free"), folder / "scene.yaml")
    report = {"outcome": "reached", "reason": "", "scene": "free", "minimum_clearance": 0.02}
    (folder / "report.json").write_text(json.dumps(report, indent=2))


def _write_reproduction(folder: Path) -> None:
    rows = 30
    np.savez_compressed(
        folder / "log.npz",
        time_s=0.01 * np.arange(rows),
        phase=np.linspace(1, 0.1, rows),
        slowdown=np.zeros(rows),
        hand_position_torso_m=np.zeros((rows, 3)),
        desired_position_torso_m=np.zeros((rows, 3)),
        joint_position_rad=np.zeros((rows, 5)),
        goal_position_torso_m=np.zeros(3),
    )
    (folder / "report.json").write_text('{"outcome": "reached", "arm": "right"}')


if __name__ == "__main__":
    sys.exit(main())
