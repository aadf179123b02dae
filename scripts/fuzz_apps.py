"""Fuzzes the apps with corrupted input files.

  fuzz_apps.py                         five corrupted files of each format
  fuzz_apps.py scene log --count 20    of these formats

As `fuzz.py` for the readers alone, for whole apps: an app must refuse the file, with exit code 2
and one line that names it, or work; one that still works after 20 s is ended by SIGTERM, and must
end in order. Exit code 1 at a finding.
"""

import argparse
import collections
import os
import random
import signal
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from app_process import ROOT, run_each_apart
from fuzz import corrupt
from fuzz_formats import formats
from kills import lines_of, start, wait

from pepper_drake import cli
from pepper_drake.__main__ import load_app

_LONGEST, _TIMEOUT = 20.0, 120.0
"""Timeouts of an app's work, and of its end after SIGTERM [s]."""

_DEMONSTRATION = str(ROOT / "pepper_drake/models/demonstrations/reach")


class Door(NamedTuple):
    """An app that reads a format.

    Attributes:
        app: Its name.
        words: Its options, with {0} for the file, {1} for its folder, {2} for that one's folder,
            and so on, {camera} and {depth} for intact files of a camera and a depth image.
        output: The output folder in the same terms; a new one if empty.
        place: Path in that folder at which the app expects the file; if empty, it is not moved.
    """

    app: str
    words: str
    output: str = ""
    place: str = ""


_CAMERA_OF_IMAGES = """\
image_width: 32
image_height: 24
camera_matrix: {rows: 3, cols: 3, data: [30.0, 0.0, 15.5, 0.0, 30.0, 11.5, 0.0, 0.0, 1.0]}
distortion_coefficients: []
"""
"""Camera of the images in `fuzz_formats_perception.py`; its camera files are of 640x480 pixels."""

_SCENE = Door("reach", "--scene {0} --no-recording --set station.cameras=false")
_PLAY = Door("play", "{1} --html page.html")
_LEARN = Door("learn", "{1}")
_PERFORM = Door("reproduce", "--primitive {0}")
_IMAGE = Door("perceive", "--image {0} --camera {camera} --marker 1 --size 0.1")
_DEPTH = Door("perceive", "--depth {0} --camera {camera}")
_CLOUD = Door("perceive", "--cloud {0}")
_CAMERA = Door("perceive", "--depth {depth} --camera {0}")
_OPTIMIZE = f"{_DEMONSTRATION} --goal-offset 0 0.05 0.05 --updates 1 --samples 4"

DOORS: dict[str, Door] = {
    "scene": _SCENE,
    "moving_scene": _SCENE,
    "mesh": Door("reach", _SCENE.words.replace("{0}", "{1}/scene.yaml")),
    "guide": Door("record", "--guide {0}"),
    "joints": Door("record", "--way joints --guide {0}"),
    "pad": Door("record", "--way gamepad --guide {0}"),
    "marker": Door("record", "--way marker --guide {0}"),
    "session": Door("teach", "--script {0} --no-cameras"),
    "calibration": Door("reach", "--robot worn --no-recording --calibration {0}"),
    "cost": Door("optimize", _OPTIMIZE + " --cost {0}"),
    "ratings": Door("optimize", _OPTIMIZE + " --cost rating --ratings {0}"),
    "points": Door("optimize", _OPTIMIZE + " --obstacles {0}"),
    "points_npz": Door("optimize", _OPTIMIZE + " --obstacles {0}"),
    "history": Door("optimize", _OPTIMIZE + " --resume", "{1}"),
    "primitive": _PERFORM,
    "joint_primitive": _PERFORM,
    "log": _PLAY,
    "report": _PLAY,
    "run_scene": _PLAY,
    "reproduction": _PLAY,
    "path": Door("reach", "--goal-motion {0} --no-recording --set station.cameras=false"),
    "tasks": Door("reach", "--tasks {0} --no-recording --set station.cameras=false"),
    "scenario": Door("reach", "--scenario {0} --no-recording"),
    "method_result": Door(
        "benchmark", "--methods d --scenes 1 --seed 1", "{1}/run", "results/random_1/d.json"
    ),
    "baseline": Door("benchmark", "--gate --baseline {0}"),
    "faults": Door("faults", "--scenes free --signals depth --starts 0", "{1}"),
    "session_folder": Door("teach", "--no-cameras --script story", "{1}"),
    "translation": _LEARN,
    "rotation": _LEARN,
    "joints_csv": _LEARN,
    "partial": Door("record", "--recover {1}"),
    "pose": Door("learn", "{0}"),
    "depth_npy": _DEPTH,
    "depth_npz": _DEPTH,
    "depth_image": _DEPTH,
    "recording_lasa": Door("import", "{0} --track 1 --plane 0.2 -0.2 0 0 0 0"),
    "recording_lerobot": Door("import", "{3}"),
    "recording_lerobot_info": Door("import", "{2}"),
}
"""Apps of the formats other than clouds, images, cameras and recordings."""

NO_APP = (
    "mesh_alone", "rhythmic", "bimanual", "stereo", "floor_map", "reach_report",
)  # fmt: skip
"""Formats that no app takes from a user: only the Python API, other readers, or the run that wrote
them, read them."""


def door_of(name: str) -> Door:
    """Returns the app that reads a format."""
    if name in DOORS:
        return DOORS[name]
    kind = name.partition("_")[0]
    doors = {"image": _IMAGE, "camera": _CAMERA, "cloud": _CLOUD, "pcd": _CLOUD, "ply": _CLOUD}
    if kind in doors:
        return doors[kind]
    is_bag = name.startswith("recording_rosbag2") and not name.endswith("mcap")
    return Door("import", "{1}" if is_bag else "{0}")


def try_app(name: str, number: int, seed: int, folder: Path) -> str:
    """Runs an app on a corrupted file; returns the outcome in a word and a line."""
    known = formats()
    door = door_of(name)
    data, results = folder / "data", folder / "results"
    data.mkdir()
    path = known[name].make(data)
    corrupt(path, random.Random(f"{seed} {name} {number}"))
    camera, depth = folder / "small.yaml", folder / "large.npy"
    camera.write_text(_CAMERA_OF_IMAGES)
    np.save(depth, np.ones((480, 640), np.float32))
    output = Path(door.output.format(path, *path.parents)) if door.output else results
    if door.place:
        (output / door.place).parent.mkdir(parents=True)
        path = path.rename(output / door.place)
    words = [
        word.format(path, *path.parents, camera=camera, depth=depth) for word in door.words.split()
    ]
    process, errors = start(door.app, output, tuple(words))
    code = wait(process, _LONGEST)
    if code is None:
        os.kill(process, signal.SIGTERM)
        code = wait(process, _TIMEOUT)
        if code is None:
            os.kill(process, signal.SIGKILL)
            wait(process, _TIMEOUT)
    lines = lines_of(errors)
    told = lines[-1] if lines else ""
    names = {file.name for file in data.rglob("*")} | {path.name}
    if code not in (cli.EXIT_DONE, cli.EXIT_FAILED, cli.EXIT_BAD_INPUT, cli.EXIT_INTERRUPTED):
        return f"exit code {code}: {told}"
    if len(lines) > (1 if code == cli.EXIT_BAD_INPUT else 2) or not told.isprintable():
        return f"{len(lines)} lines: {told}"
    if code != cli.EXIT_BAD_INPUT:
        return f"worked, {code}"
    return "refused" if any(file in told for file in names) else f"no file's name: {told}"


def _try_format(name: str, count: int, seed: int) -> None:
    """Tries a format in a process that has imported no other app; exits with 1 at a finding."""
    cv2.setNumThreads(0)
    load_app(door_of(name).app)
    outcomes: collections.Counter[str] = collections.Counter()
    findings = 0
    for number in range(count):
        with tempfile.TemporaryDirectory() as folder:
            outcome = try_app(name, number, seed, Path(folder))
        if not outcome.startswith(("refused", "worked")):
            findings += 1
            print(f"{name} {number}: {outcome[:300]}", flush=True)
            outcome = "finding"
        outcomes[outcome] += 1
    print(f"{name:24} {door_of(name).app:10} {dict(outcomes)}", flush=True)
    sys.exit(1 if findings else 0)


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("formats", nargs="*", help="default: all that an app reads")
    parser.add_argument("--count", type=int, default=5, help="of each format")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    cli.quiet_resource_tracker()
    known = [name for name in formats() if name not in NO_APP]
    for name in options.formats:
        if name not in known:
            parser.error(f'"{name}" is unknown; there are {", ".join(known)}')
    return run_each_apart(_try_format, options.formats or known, options.count, options.seed)


if __name__ == "__main__":
    sys.exit(main())
