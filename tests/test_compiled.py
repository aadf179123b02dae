"""Changes in other files go unnoticed by what numba keeps of a compiled function."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "pepper_drake"


def is_compiled(node):
    return isinstance(node, ast.FunctionDef) and any(
        "njit" in ast.unparse(decorator) for decorator in node.decorator_list
    )


def test_compiled_code_takes_nothing_from_other_files_of_the_package():
    compiled, taken = 0, []
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(path.read_text())
        ours = {
            alias.asname or alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pepper_drake")
            for alias in node.names
        }
        for function in filter(is_compiled, tree.body):
            compiled += 1
            names = {
                node.id
                for statement in function.body
                for node in ast.walk(statement)
                if isinstance(node, ast.Name)
            }
            taken += [f"{path.name}: {function.name} uses {name}" for name in names & ours]
    assert compiled > 20
    assert not taken
