"""The command `pepper-drake NAME ...`: runs a script of `apps/` from any folder.

    pepper-drake reach --scene shelf
    pepper-drake --help

`pepper-drake completion bash` (or zsh, tcsh) prints a script that completes names and options.
"""

import argparse
import ast
import importlib
import importlib.util
import sys
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

from pepper_drake import cli
from pepper_drake.errors import InputError

PROGRAM = "pepper-drake"


def app_files() -> dict[str, Path]:
    """Paths of the apps by their names.

    Raises:
        InputError: The package was not installed, so it lacks the apps.
    """
    spec = importlib.util.find_spec("pepper_drake.apps")
    if spec is None or not spec.submodule_search_locations:
        raise InputError(
            "the apps are not installed with the package; run apps/NAME.py of a checkout, or "
            "install it: pip install pepper-drake"
        )
    folder = Path(next(iter(spec.submodule_search_locations)))
    return {path.stem: path for path in sorted(folder.glob("[a-z]*.py"))}


def load_app(name: str) -> ModuleType:
    """Imports an app; its module has `main`, and mostly `make_parser`."""
    return importlib.import_module(f"pepper_drake.apps.{name}")


def overview(files: dict[str, Path]) -> str:
    """Help text: one line for each app, from its docstring, without importing any."""
    lines = []
    for name, path in files.items():
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        lines.append(f"  {name:<12}{text.splitlines()[0] if text else ''}")
    return (
        f"usage: {PROGRAM} [--version] NAME ...\n\n"
        "Teach SoftBank's Pepper an arm movement by hand; it reaches moving goals around\n"
        "obstacles that it sees.\n\n" + "\n".join(lines) + f"\n\n"
        f"{PROGRAM} NAME --help tells more; {PROGRAM} completion bash prints a completion script."
    )


def print_completion(files: dict[str, Path], shell: str) -> int:
    """Prints the completion script of a shell: bash, zsh or tcsh.

    Raises:
        InputError: shtab, which writes the script, is not installed or does not support the shell.
    """
    try:
        import shtab
    except ImportError:
        raise InputError("completion needs the package shtab: pip install shtab") from None
    if shell not in shtab.SUPPORTED_SHELLS:
        raise InputError(f'"{shell}" is not one of {", ".join(shtab.SUPPORTED_SHELLS)}')
    parser = argparse.ArgumentParser(prog=PROGRAM)
    commands = parser.add_subparsers()
    for name in files:
        app: Any = load_app(name)
        has_own = getattr(app, "make_parser", cli.make_parser) is not cli.make_parser
        options = app.make_parser() if has_own else cli.make_parser(name, None)
        commands.add_parser(name, parents=[options], add_help=False, help=name)
    print(shtab.complete(parser, shell))
    return cli.EXIT_DONE


def main() -> int:
    """Runs the app that the first argument names."""
    name, *rest = sys.argv[1:] or ["--help"]
    if name in ("--version", "-V"):
        print(f"{PROGRAM} {version('pepper-drake')}")
        return cli.EXIT_DONE
    files = app_files()
    if name in ("--help", "-h"):
        print(overview(files))
        return cli.EXIT_DONE
    if name == "completion":
        return print_completion(files, rest[0] if rest else "bash")
    if name not in files:
        raise InputError(f'there is no "{name}"; choose one of {", ".join(files)}')
    sys.argv = [f"{PROGRAM} {name}", *rest]
    return int(load_app(name).main())


def run() -> None:
    """Entry point of the command."""
    cli.run(main)


if __name__ == "__main__":
    run()
