"""A session's folder: demonstrations, movement and objects' places, written as they change.

`session.yaml` names the valid demonstrations (folders of `demonstrations/`), the last one that
`primitive.yaml` was learned from, and the objects' places. A session resumes from it after a
restart, and a teacher can prepare with it what a class begins with: a lesson.
"""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.motion import FARTHEST
from pepper_drake.models.pepper import MODELS_DIR
from pepper_drake.models.typed_yaml import load_yaml, save_yaml

Offset = tuple[float, float, float]

SESSION, DEMONSTRATIONS, PRIMITIVE = "session.yaml", "demonstrations", "primitive.yaml"
LESSONS_DIR = MODELS_DIR / "lessons"
LESSONS = tuple(sorted(path.parent.name for path in LESSONS_DIR.glob(f"*/{SESSION}")))
"""Names of the lessons shipped with the package."""


@dataclass(frozen=True)
class Taught:
    """The state that Undo restores.

    Attributes:
        shown: The demonstrations, oldest first; each is stored in a folder of its name.
        primitive: The movement learned last.
        learned: The last of the demonstrations that `primitive` was learned from.
        offsets: Offsets of the movable objects from their places in the scene [m].
    """

    shown: tuple[Demonstration, ...] = ()
    primitive: MovementPrimitive | None = None
    learned: Demonstration | None = None
    offsets: Mapping[str, Offset] = field(default_factory=dict)

    @property
    def demonstration(self) -> Demonstration | None:
        """The last demonstration."""
        return self.shown[-1] if self.shown else None

    def taught_the_same(self, other: "Taught") -> bool:
        """Tells whether all but the objects' places equals that of another."""
        same = self.primitive is other.primitive and self.learned is other.learned
        return same and self.shown == other.shown


@dataclass
class SessionRecord:
    """The fields of `session.yaml`."""

    title: str = ""  # Title of a lesson, shown on the page with ...
    tasks: list[str] = field(default_factory=list)  # ... the tasks of the class.
    lesson: str = ""  # Name or folder of the lesson that the session began with.
    script: str = ""  # Script that guided the hand, if any.
    scene: str = ""  # Name or file of the scene; empty: the one for teaching.
    arm: str = ""  # left or right; empty: the scene's.
    move: list[str] = field(default_factory=list)  # Additional movable obstacles.
    demonstrations: list[str] = field(default_factory=list)
    learned: str = ""  # Empty: nothing was learned, and primitive.yaml is ignored.
    offsets: dict[str, list[float]] = field(default_factory=dict)  # x, y, z in W [m].

    def check(self) -> None:
        """Raises InputError, in a sentence that names the field, for an invalid value."""
        if self.arm not in ("", "left", "right"):
            raise InputError(f'arm is "{self.arm}"; it must be left or right')
        for name, offset in self.offsets.items():
            if len(offset) != 3 or not all(abs(value) <= FARTHEST for value in offset):
                raise InputError(f"offsets.{name} must be three finite numbers, x, y, z")


class SessionFolder:
    """A folder that holds a session, or will hold one.

    Attributes:
        path: The folder.
        record: Content of `session.yaml`; the defaults if there is none yet.
    """

    def __init__(self, path: Path) -> None:
        """Reads `session.yaml`, if there is one.

        Raises:
            InputError: It cannot be read.
        """
        self.path, self._last = path, 0
        self.record = SessionRecord()
        if self.exists():
            self.record = load_yaml(SessionRecord, path_inside(path, SESSION))
            try:
                self.record.check()
            except InputError as error:
                raise InputError(f"{path / SESSION}: {error}") from None

    def exists(self) -> bool:
        """Tells whether there is a session in the folder."""
        return (self.path / SESSION).exists()

    def taught(self, arm: str) -> Taught:
        """Reads the taught movement of an arm, "left" or "right".

        Raises:
            InputError: A file is missing, broken, or of the other arm.
        """
        record = self.record
        names = list(dict.fromkeys([*record.demonstrations, *filter(None, [record.learned])]))
        motions = {name: self._demonstration(name, arm) for name in names}
        primitive = None
        if record.learned:
            primitive = MovementPrimitive.load(path_inside(self.path, PRIMITIVE))
        return Taught(
            tuple(motions[name] for name in record.demonstrations),
            primitive,
            motions.get(record.learned),
            {name: (x, y, z) for name, (x, y, z) in record.offsets.items()},
        )

    def _demonstration(self, name: str, arm: str) -> Demonstration:
        path = path_inside(self.path, f"{DEMONSTRATIONS}/{name}")
        motion = Demonstration.load(path)
        if tuple(motion.joint_names) != tuple(arm_joints(arm)):
            known = ", ".join(motion.joint_names) or "none"
            raise InputError(f"{path}: joints of the {arm} arm are needed; it has {known}")
        return replace(motion, name=name)

    def named(self, motion: Demonstration) -> Demonstration:
        """Returns a demonstration named by the next free number; `write` saves it."""
        folder = self.path / DEMONSTRATIONS
        taken = [int(path.name) for path in folder.glob("*") if path.name.isdecimal()]
        self._last = max([self._last, *taken]) + 1
        return replace(motion, name=f"{self._last:02d}")

    def write(self, taught: Taught) -> None:
        """Writes new demonstrations, `primitive.yaml`, and last `session.yaml`.

        Raises:
            InputError: They cannot be written.
        """
        learned = () if taught.learned is None else (taught.learned,)
        for motion in (*taught.shown, *learned):
            folder = self.path / DEMONSTRATIONS / motion.name
            if not folder.exists():
                motion.save(folder)
        if taught.primitive is not None:
            taught.primitive.save(self.path / PRIMITIVE)
        self.record.demonstrations = [motion.name for motion in taught.shown]
        self.record.learned = taught.learned.name if taught.learned is not None else ""
        self.record.offsets = {
            name: [round(value, 4) for value in offset]
            for name, offset in taught.offsets.items()
            if any(offset)
        }
        save_yaml(self.record, self.path / SESSION)

    def begin_anew(self) -> Path | None:
        """Clears the folder for a new session; a person's teaching is moved to a subfolder.

        Returns:
            The subfolder, which is a session's folder as well; None if nothing was moved.

        Raises:
            InputError: It cannot be moved.
        """
        if not self.exists():
            return None
        record, self.record = self.record, SessionRecord()
        number = 1
        while (aside := self.path / f"earlier-{number}").exists():
            number += 1
        try:
            if record.script:  # The script can be repeated.
                (self.path / SESSION).unlink()
                return None
            aside.mkdir()
            for name in (DEMONSTRATIONS, PRIMITIVE, SESSION):
                if (self.path / name).exists():
                    shutil.move(self.path / name, aside / name)
        except OSError as error:
            raise InputError(f"{aside}: cannot be written ({error.strerror})") from None
        return aside


def find_lesson(name_or_folder: str) -> SessionFolder:
    """Finds a shipped lesson, by its name, or a folder with a session.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    shipped = name_or_folder in LESSONS
    folder = SessionFolder(LESSONS_DIR / name_or_folder if shipped else Path(name_or_folder))
    if not folder.exists():
        raise InputError(
            f"{name_or_folder}: is neither a lesson that ships ({', '.join(LESSONS)}) nor a folder"
            f" with a {SESSION}"
        )
    return folder
