"""A hook of MkDocs: a page of the reference for each room of the package, made when it is built."""

import ast
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

PACKAGE = Path(__file__).parents[1] / "pepper_drake"

ROOMS = (
    "learning",
    "perception",
    "planning",
    "systems",
    "diagrams",
    "models",
    "optimization",
    "robot_server",
)


def modules(room: str) -> list[str]:
    """Names of a room's public modules."""
    paths = sorted((PACKAGE / room).rglob("*.py"))
    return [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for path in paths
        if not path.name.startswith("_")
    ]


def page(room: str) -> str:
    """A room's page: its docstring, and all its modules."""
    source = (PACKAGE / room / "__init__.py").read_text(encoding="utf-8")
    about = ast.get_docstring(ast.parse(source)) or ""
    return "\n\n".join((f"# {room}", about, *(f"::: {name}" for name in modules(room)), ""))


def on_files(files: Files, *, config: Any) -> Files:
    """Adds the pages; MkDocs calls it."""
    for room in ROOMS:
        files.append(File.generated(config, f"reference/{room}.md", content=page(room)))
    return files
