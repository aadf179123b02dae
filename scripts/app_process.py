"""An app of `apps/` as a process of its own, for scripts that watch how it behaves."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def start_app(
    app: str, folder: Path | str, *options: str, stdout: int = subprocess.DEVNULL
) -> subprocess.Popen[str]:
    """Starts an app that writes into a folder; its errors can be read.

    Args:
        app: Its name.
        folder: For its results.
        options: Other options, and arguments.
        stdout: As `subprocess.Popen` takes it.
    """
    return subprocess.Popen(
        [sys.executable, "-u", f"apps/{app}.py", *options, "--output", str(folder)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
    )
