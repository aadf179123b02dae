"""Makes the pictures and films of README and docs, each by the commands that a reader would run.

  pictures.py                                     all of them; takes a quarter of an hour
  pictures.py docs/reach.png docs/films/*.gif     some of them

Those of the tutorial come from running its commands. docs/benchmark.png is published with its
numbers, by scripts/publish_benchmark.py, as a benchmark takes hours.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
from headless import photograph_playback

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "pictures"
TUTORIAL = ROOT / "docs" / "tutorial.md"
LARGEST = 1_500_000
"""Largest size of a film [bytes]."""
PLAYED = 1.15
"""Playback time of the tutorial's picture [s]: one hand is at the post, the other passes it."""


def is_like(one: Path, other: Path) -> bool:
    """Returns whether two pictures differ in no more than some digits."""
    a, b = (cv2.imread(str(path)).astype(float) for path in (one, other))
    return a.shape == b.shape and float(np.abs(a - b).mean()) < 1.0  # Of 255.


def app(name: str, *arguments: str) -> None:
    """Runs an app; exits if it fails."""
    _run([sys.executable, f"apps/{name}.py", *arguments], ROOT)


def from_app(picture: Path, made: str, name: str, *arguments: str) -> None:
    """Copies a picture from an app's output folder."""
    folder = OUT / picture.stem
    app(name, *arguments, "--output", str(folder))
    shutil.copy(folder / made, picture)


def film(picture: Path, name: str, *arguments: str) -> None:
    """Films a run; exits if the film is too large."""
    run = OUT / picture.stem
    app(name, *arguments, "--output", str(run))
    app("play", str(run), "--from-arm", "--video", picture.name, "--output", str(picture.parent))
    size = picture.stat().st_size
    if size > LARGEST:
        sys.exit(f"{picture.name} has {size} bytes; make it shorter")


def gallery(picture: Path) -> None:
    """Runs an example of the gallery in its folder, where it saves its picture."""
    _run([sys.executable, str(picture.with_suffix(".py"))], picture.parent)


def teaching_page(picture: Path) -> None:
    """Copies the picture of the page's test, unless this machine is too slow."""
    os.environ["PEPPER_SCREENSHOTS"] = str(OUT / "teach")
    _run([sys.executable, "-m", "pytest", "-q", "tests/live/test_show.py", "-k", "browser"], ROOT)
    if "Slow" in (OUT / "teach" / "reached.txt").read_text():
        sys.exit("The page says that this computer is slow; try again while it has nothing to do.")
    shutil.copy(OUT / "teach" / "reached.png", picture)


@cache
def tutorial() -> Path:
    """Runs the tutorial's non-interactive commands; returns their folder."""
    folder = OUT / "tutorial"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in (".venv", "apps", "pepper_drake"):
        (folder / name).symlink_to(ROOT / name)
    blocks = re.findall(r"^```sh\n(.*?)^```$", TUTORIAL.read_text(), re.MULTILINE | re.DOTALL)
    for text in blocks:
        if "apps/teach.py" not in text:
            lines = text.replace("\\\n", " ").splitlines(keepends=True)
            kept = [line for line in lines if "apps/play.py" not in line or "--html" in line]
            # A run with a collision exits with 1, as the tutorial says.
            _run(["bash", "-euc", "".join(kept)], folder, codes=(0, 1))
    return folder


def of_tutorial(picture: Path, made: str) -> None:
    """Copies a picture that a command of the tutorial makes."""
    shutil.copy(tutorial() / "out" / made, picture)


def tutorial_playback(picture: Path) -> None:
    """Plays the tutorial's two runs back, and takes a picture of the page."""
    folder = tutorial() / "out"
    runs = [str(folder / "around"), str(folder / "into")]
    app("play", *runs, "--from-arm", "--html", "play.html", "--output", str(folder))
    photograph_playback(folder / "play.html", PLAYED, picture)


def _run(command: list[str], folder: Path, codes: tuple[int, ...] = (0,)) -> None:
    if subprocess.run(command, cwd=folder, check=False).returncode not in codes:
        sys.exit(f"this failed: {' '.join(command)}")


REACH = ("reach", "--no-recording")
PICTURES: dict[str, Callable[[Path], None]] = {
    "docs/reach.png": lambda p: from_app(p, "scene.png", *REACH, "--scene", "table"),
    "docs/reaching.svg": lambda p: from_app(p, "reaching.svg", "diagram"),
    "docs/teach.png": teaching_page,
    "docs/films/teaching.gif": lambda p: film(p, "record", "--guide", "reach"),
    "docs/films/reaching.gif": lambda p: film(p, *REACH, "--scene", "table"),
    "docs/films/moved_goal.gif": lambda p: film(
        p, *REACH, "--scene", "free", "--goal-motion", "up"
    ),
    "docs/films/arm_coming_in.gif": lambda p: film(p, *REACH, "--random-scene", "607", "--moving"),
    "docs/tutorial/learn.png": partial(of_tutorial, made="learned/learn.png"),
    "docs/tutorial/paths.png": partial(of_tutorial, made="smooth/paths.png"),
    "docs/tutorial/play.png": tutorial_playback,
    **{
        str(path.with_suffix(".png").relative_to(ROOT)): gallery
        for path in sorted((ROOT / "docs" / "gallery").glob("*.py"))
    },
}
"""Each picture's path from the repository's root, and its maker."""


if __name__ == "__main__":
    unknown = set(sys.argv[1:]) - set(PICTURES)
    if unknown:
        sys.exit(f"{', '.join(sorted(unknown))}: not one of {', '.join(PICTURES)}")
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name](ROOT / name)
        print(name)
