"""The docs name what there is: pages, apps with their options, modules, and links."""

import ast
import importlib
import importlib.util
import re
import shlex
from functools import cache
from pathlib import Path

import pytest
import yaml
from pictures import PICTURES

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
GUIDES = sorted((DOCS / "howto").glob("*.md")) + [DOCS / "your_robot.md"]
APP = re.compile(r"(?:apps/|pepper-drake )(\w+)(?:\.py)?")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")


class Config(yaml.SafeLoader):
    """YAML as MkDocs has it, without its Python tags."""


CONFIG = yaml.load((ROOT / "mkdocs.yml").read_text(), Config)


def nav(entries):
    """The pages of the navigation, as paths under docs/."""
    for entry in entries:
        for target in entry.values():
            yield from nav(target) if isinstance(target, list) else [target]


@pytest.fixture(scope="module")
def reference():
    pytest.importorskip("mkdocs", reason="the reference's pages are made by a hook of MkDocs")
    path = ROOT / "scripts" / "reference_pages.py"
    spec = importlib.util.spec_from_file_location("reference_pages", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_page_of_the_navigation_is_there(reference):
    made = {f"reference/{room}.md" for room in reference.ROOMS}
    named = set(nav(CONFIG["nav"]))
    assert made <= named
    assert [page for page in named - made if not (DOCS / page).is_file()] == []


def test_the_reference_names_every_public_module_once(reference):
    named = [
        name
        for room in reference.ROOMS
        for name in re.findall(r"^::: (\S+)$", reference.page(room), flags=re.MULTILINE)
    ]
    files = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for room in reference.ROOMS
        for path in (ROOT / "pepper_drake" / room).rglob("*.py")
        if not path.name.startswith("_")
    }
    assert len(named) == len(set(named))
    assert set(named) == files


def test_systems_made_for_a_scalar_type_have_their_section(reference):
    page = reference.page("systems")
    for name in ("CanonicalSystem", "TransformationSystem"):
        assert re.search(rf"^## {name}\n\nThe ", page, flags=re.MULTILINE)
    assert page.count("```pycon\n>>> ") == 2


@cache
def parsed(path):
    return ast.parse(path.read_text())


def options_declared(body, path):
    """The options that some code adds to a parser, itself or by functions that it imports.

    Args:
        body: The syntax tree of the code.
        path: The file that it is in.
    """
    imported = {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pepper_drake")
        for alias in node.names
    }
    options = set()
    for call in (node for node in ast.walk(body) if isinstance(node, ast.Call)):
        function = call.func
        name = getattr(function, "attr", getattr(function, "id", ""))
        if name in ("add", "add_argument"):
            words = (word.value for word in call.args if isinstance(word, ast.Constant))
            options |= {word for word in words if str(word).startswith("--")}
        elif re.fullmatch(r"add_\w+_options?", name):
            module, taken = imported.get(name, ("pepper_drake.cli", name))
            other = ROOT.joinpath(*module.split(".")).with_suffix(".py")
            options |= options_declared(function_of(other, taken), other)
    return options


def function_of(path, name):
    (found,) = (node for node in parsed(path).body if getattr(node, "name", "") == name)
    return found


@cache
def options_of(app):
    """The options of an app, read from its source."""
    path, cli = ROOT / "apps" / f"{app}.py", ROOT / "pepper_drake" / "cli.py"
    assert path.exists(), f"there is no app {app}"
    common = options_declared(function_of(cli, "make_parser"), cli)
    return options_declared(parsed(path), path) | common | {"--help"}


def named_options(text, *, whole_page=False):
    """Yields (app, option): what follows an app on its line is the app's.

    On a whole page, all else belongs to the app that is named first.
    """
    first = APP.search(text) if whole_page else None
    for line in text.replace("\\\n", " ").splitlines():
        before, *words = re.split(APP, line)
        if first:
            yield from ((first[1], option) for option in OPTION.findall(before))
        for app, rest in zip(words[::2], words[1::2], strict=True):
            yield from ((app, option) for option in OPTION.findall(rest))


@pytest.mark.parametrize(
    "path", [ROOT / "README.md", *PAGES], ids=lambda path: str(path.relative_to(ROOT))
)
def test_each_option_that_is_named_is_the_apps(path):
    named = set(named_options(path.read_text(), whole_page=path in GUIDES))
    wrong = {
        f"{app} {option}"
        for app, option in named
        if app != "completion" and option not in options_of(app)
    }
    assert not wrong


def test_options_are_found_where_they_are_named():
    text = "`pepper-drake reach --scene x` or\n`--arm left`, then apps/learn.py a/ --joints"
    expected = {("reach", "--scene"), ("reach", "--arm"), ("learn", "--joints")}
    assert set(named_options(text, whole_page=True)) == expected
    assert ("reach", "--arm") not in set(named_options(text))
    assert "--no-such-option" not in options_of("reach")
    assert {"--scene", "--host", "--seed", "--goal-motion", "--station"} <= options_of("reach")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path):
    for link in re.findall(r"\]\(([^)#]+)", path.read_text()):
        assert link.startswith("https://") or (path.parent / link).exists(), link


def test_each_picture_is_shown_and_made_by_a_command():
    shown = {
        str((path.parent / link).resolve().relative_to(ROOT))
        for path in [ROOT / "README.md", *PAGES]
        for link in re.findall(r"!\[[^]]+\]\(([^)]+)\)", path.read_text())
    }
    kept = {
        str(path.relative_to(ROOT))
        for kind in ("png", "svg", "gif", "jpg")
        for path in DOCS.rglob(f"*.{kind}")
    }
    assert kept == shown == {*PICTURES, "docs/benchmark.png"}


def test_the_places_that_a_change_is_made_in_are_there():
    named = re.findall(r"`(pepper_drake/[^`]+)`", (ROOT / "CONTRIBUTING.md").read_text())
    assert len(named) > 15
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_what_the_report_page_names_is_there():
    names = re.findall(
        r"`((?:learning|systems|optimization|perception|planning|evaluation|reporting)\.[\w.]+)`",
        (DOCS / "report.md").read_text(),
    )
    assert len(names) > 10
    for name in names:
        module = f"pepper_drake.{name}"
        room, _, attribute = module.rpartition(".")
        assert is_module(module) or hasattr(importlib.import_module(room), attribute), name


def is_module(name):
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


@pytest.mark.parametrize("path", GUIDES, ids=lambda path: path.name)
def test_commands_and_python_can_be_read(path):
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", path.read_text(), re.MULTILINE | re.DOTALL)
    assert blocks
    for language, text in blocks:
        if language == "sh":
            for line in text.splitlines():
                assert shlex.split(line)[0] == "pepper-drake"
        elif language == "python":
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.ImportFrom) and node.module.startswith("pepper_drake"):
                    module = importlib.import_module(node.module)
                    assert all(hasattr(module, alias.name) for alias in node.names)
