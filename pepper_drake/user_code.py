"""A user's own parts, named on the command line as FILE.py:NAME.

They are couplings, approximators and planners; `optimization.cost` handles costs.

Saved files name a part by its file's name and its own, never by a folder. Code runs only when a
command names its file: loading a primitive or a scenario never runs any.
"""

import importlib.util
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from traceback import extract_tb
from typing import Any

from pepper_drake.errors import InputError
from pepper_drake.learning.approximators.registry import Approximator, register
from pepper_drake.learning.dmp.obstacle_coupling import register_coupling

_COUPLING = ("clearance", "push", "zero_beyond")
"""Methods of a coupling."""


def names_code(text: str) -> bool:
    """True if a text has the form FILE.py:NAME."""
    return text.rpartition(":")[0].endswith(".py")


def named_part(text: str) -> str:
    """Returns the registered name of a part; FILE.py:NAME is registered first.

    Raises:
        InputError: See `register_code`.
    """
    return register_code(text) if names_code(text) else text


def load_object(text: str) -> Any:
    """Runs a file and returns its object FILE.py:NAME.

    Raises:
        InputError: There is no such file or name, or the file cannot be run.
    """
    file, _, name = text.rpartition(":")
    path = Path(file).resolve()
    if not path.is_file():
        raise InputError(f"{file}: no such file; check the path")
    return _load(path, name)


@lru_cache(maxsize=32)
def _load(path: Path, name: str) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        lines = [at.lineno for at in extract_tb(error.__traceback__) if at.filename == str(path)]
        where = f", line {lines[-1]}" if lines else ""
        raise InputError(f"{path}{where}: {type(error).__name__}: {error}") from None
    if not hasattr(module, name):
        raise InputError(f"{path} defines no {name or 'name'}; write FILE.py:NAME")
    return getattr(module, name)


def register_code(text: str) -> str:
    """Registers the part FILE.py:NAME, and returns its name in files.

    A coupling is a class without arguments, or an object, that follows `learning.Coupling`; an
    approximator is a `learning.Approximator`; a planner is a subclass of `planning.ReachPlanner`.

    Raises:
        InputError: It cannot be loaded, or is not one of these.
    """
    # Imported here: it compiles the arm's kinematics, and most commands need no planner.
    from pepper_drake.planning import ReachPlanner, register_planner

    part = load_object(text)
    file, _, name = text.rpartition(":")
    known_as = f"{Path(file).name}:{name}"
    if isinstance(part, Approximator):
        register(replace(part, name=known_as))
    elif isinstance(part, type) and issubclass(part, ReachPlanner):
        register_planner(known_as, part)
    elif all(callable(getattr(part, method, None)) for method in _COUPLING):
        register_coupling(known_as, part if isinstance(part, type) else lambda: part)
    else:
        raise InputError(
            f"{text} has to be an Approximator object, a subclass of ReachPlanner, or a coupling: "
            f"a class or an object with the methods {', '.join(_COUPLING)}"
        )
    return known_as
