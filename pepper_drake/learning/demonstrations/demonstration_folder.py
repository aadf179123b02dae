"""All demonstrations below a folder, in any format."""

from collections.abc import Sequence
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside, read_text
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.demonstrations.demonstration_files import (
    JOINTS,
    POSE_SUFFIX,
    ROTATION,
    TRANSLATION,
)
from pepper_drake.learning.demonstrations.importers.bags import is_bag
from pepper_drake.learning.demonstrations.importers.table import check_file
from pepper_drake.learning.demonstrations.recording import PARTIAL


def load_all(paths: Sequence[str | Path]) -> list[Demonstration]:
    """Reads demonstrations: each path is one, or a folder that is searched recursively.

    A text file in a folder whose first row is not numbers (a licence, a note) is skipped; a
    `NAME_pose.txt` belongs to the `NAME.txt` beside it where there is one.

    Raises:
        InputError: A demonstration is broken, or a path holds none.
    """
    return [Demonstration.load(path) for given in paths for path in _find(Path(given))]


def _find(path: Path) -> list[Path]:
    check_file(path)
    own = (TRANSLATION, PARTIAL, JOINTS)
    if not path.is_dir() or any((path / name).exists() for name in own) or is_bag(path):
        return [path]
    folders = {file.parent for name in own for file in path.rglob(name)}
    texts = [
        path_inside(path, file.relative_to(path))
        for file in path.rglob("*.txt")
        if file.name not in (TRANSLATION, ROTATION, JOINTS)
    ]
    files = [file for file in texts if not _is_companion(file) and _starts_with_numbers(file)]
    found = sorted([*folders, *files])
    if not found:
        raise InputError(
            f"{path}: no demonstration in or below this folder; it takes text files with rows "
            f"of numbers, or folders with {TRANSLATION}."
        )
    return found


def _is_companion(file: Path) -> bool:
    main = file.name.removesuffix(POSE_SUFFIX) + ".txt"
    return file.name.endswith(POSE_SUFFIX) and file.with_name(main).exists()


def _starts_with_numbers(file: Path) -> bool:
    for line in read_text(file).splitlines():
        content = line.partition("#")[0].split()
        if content:
            try:
                float(content[0])
            except ValueError:
                return False
            return True
    return False
