"""MkDocs hook: generates a reference page for each room of the package."""

import ast
import textwrap
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
    "hardware",
    "robot_server",
)


def modules(room: str) -> list[str]:
    """Returns the names of a room's public modules."""
    paths = sorted((PACKAGE / room).rglob("*.py"))
    return [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for path in paths
        if not path.name.startswith("_")
    ]


def page(room: str) -> str:
    """Returns a room's page: its docstring, and all its modules."""
    source = (PACKAGE / room / "__init__.py").read_text(encoding="utf-8")
    about = ast.get_docstring(ast.parse(source)) or ""
    parts = [f"# {room}", about]
    for name in modules(room):
        parts.append(f"::: {name}")
        parts += templates(PACKAGE.parent.joinpath(*name.split(".")).with_suffix(".py"))
    return "\n\n".join([*parts, ""])


def templates(path: Path) -> list[str]:
    """Returns sections for systems made by functions of a scalar type, which MkDocs misses."""
    sections = []
    for maker in ast.parse(path.read_text(encoding="utf-8")).body:
        if not (isinstance(maker, ast.FunctionDef) and maker.name.endswith("_")):
            continue
        for made in maker.body:
            if isinstance(made, ast.ClassDef):
                text, _, example = (ast.get_docstring(made) or "").partition("\n\nExamples:\n")
                fenced = f"```pycon\n{textwrap.dedent(example)}\n```"
                sections += [f"## {maker.name.removesuffix('_')}", text, fenced]
    return sections


def on_files(files: Files, *, config: Any) -> Files:
    """Adds the pages; MkDocs calls it."""
    for room in ROOMS:
        files.append(File.generated(config, f"reference/{room}.md", content=page(room)))
    return files
