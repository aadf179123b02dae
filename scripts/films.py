"""Makes the README's films: teaching, reaching, a moved goal, a person's arm coming in.

  films.py            all four, into docs/films/
  films.py reaching   one of them

Each is the app that a reader would run, and `play.py --video FILE.gif` of its run. It takes some
minutes.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
OUT, DOCS = ROOT / "out" / "films", ROOT / "docs" / "films"
LARGEST = 1_500_000
"""A film is no larger [bytes]."""

FILMS: dict[str, list[str]] = {
    "teaching": ["record.py", "--guide", "reach"],
    "reaching": ["reach.py", "--scene", "table", "--no-recording"],
    "moved_goal": ["reach.py", "--scene", "free", "--goal-motion", "up", "--no-recording"],
    "arm_coming_in": ["reach.py", "--random-scene", "607", "--moving", "--no-recording"],
}


def make(name: str) -> None:
    """Runs the app of a film and films its run; exits if an app fails or a film is too large."""
    run = OUT / name
    app, *arguments = FILMS[name]
    _app(app, *arguments, "--output", str(run))
    _app("play.py", str(run), "--from-arm", "--video", f"{name}.gif", "--output", str(DOCS))
    size = (DOCS / f"{name}.gif").stat().st_size
    if size > LARGEST:
        sys.exit(f"{name}.gif has {size} bytes; make it shorter")
    print(f"docs/films/{name}.gif: {size / 1e6:.2f} MB")


def _app(name: str, *arguments: str) -> None:
    command = [sys.executable, str(ROOT / "apps" / name), *arguments]
    if subprocess.run(command, cwd=ROOT, check=False).returncode != 0:
        sys.exit(f"this failed: {' '.join(command)}")


if __name__ == "__main__":
    unknown = set(sys.argv[1:]) - set(FILMS)
    if unknown:
        sys.exit(f"{', '.join(unknown)}: no film; there are {', '.join(FILMS)}")
    for film in sys.argv[1:] or FILMS:
        make(film)
