"""The rooms of the package: an import points down the list, or stays in its room."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "pepper_drake"

FLOORS = (
    ("errors", "_former_names"),
    ("compiled", "files", "signals", "web", "short_repr", "registry"),
    ("yaml_files", "array_files", "naoqi"),
    ("learning",),
    ("models",),
    ("perception",),
    ("planning",),
    ("systems", "results", "user_code"),
    ("cli",),
    ("cli_scene", "cli_robot", "cli_demonstration"),
    ("diagrams",),
    ("scenario_ranges",),
    ("scenario",),
    ("robot_server", "evaluation", "cli_scenario"),
    ("hardware",),
    ("optimization", "benchmarking", "live"),
    ("reporting",),
    ("playback",),
    ("__main__",),
)
"""Rooms from the ground up; those on one floor do not import one another."""


def imports():
    """Yields (file, its room, the imported room, whether it stands at module level)."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pepper_drake"):
                names = node.module.split(".")[1:]
                rooms = names[:1] or [alias.name for alias in node.names]
                for room in rooms:
                    yield path.relative_to(PACKAGE), parts[0], room


def test_no_import_points_up():
    floor = {room: k for k, rooms in enumerate(FLOORS) for room in rooms}
    up = [
        f"{path}: {room} imports {other}"
        for path, room, other in imports()
        if room not in ("__init__", other) and floor[other] >= floor[room]
    ]
    assert not up
