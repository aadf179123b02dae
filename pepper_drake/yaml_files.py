"""YAML of unknown origin: read within limits, with one notation of numbers.

Plain data, no aliases, no tags, one document per file. Numbers are read in their common notation:
YAML 1.1 also reads `1:30` as 90, `0x10` as 16, `010` as 8 and `1_0` as 10; here these are texts,
which are refused for a number.
"""

import re
from pathlib import Path
from typing import Any, ClassVar

import yaml

from pepper_drake.errors import InputError
from pepper_drake.files import MOST_DIGITS, read_text

_DEEPEST = 20
"""Deepest nesting of lists and mappings in a file; ours have at most eight levels."""

_MOST_NODES = 400_000
"""Largest number of values in a file: a hundred times a large primitive's."""

_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_DIGIT = r"[0-9]"
_TAGS = {
    "tag:yaml.org,2002:null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "tag:yaml.org,2002:bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    "tag:yaml.org,2002:int": (
        rf"[-+]?(?:0|[1-9]{_DIGIT}{{0,{MOST_DIGITS - 1}}})",
        list("-+0123456789"),
    ),
    "tag:yaml.org,2002:float": (
        rf"[-+]?(?:(?:0|[1-9]{_DIGIT}*)(?:\.{_DIGIT}*)?|\.{_DIGIT}+)(?:[eE][-+]?{_DIGIT}{{1,3}})?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
}
"""Meaning of plain words, as in YAML 1.2."""


class Loader(_PARSER):  # type: ignore[misc, valid-type]
    """Loads plain data, as YAML 1.2 reads words and numbers."""

    yaml_implicit_resolvers: ClassVar[dict[str, list[tuple[str, re.Pattern[str]]]]] = {}


for _tag, (_pattern, _first) in _TAGS.items():
    Loader.add_implicit_resolver(_tag, re.compile(f"(?:{_pattern})\\Z"), _first)
Loader.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(node.value))
Loader.add_constructor("tag:yaml.org,2002:float", lambda loader, node: number_of(node.value))


def number_of(text: str) -> float:
    """Returns the number of a YAML scalar, including `.nan` and `-.inf`."""
    word = text.lower()
    return float(word.replace(".inf", "inf").replace(".nan", "nan"))


def compose(text: str, name: str) -> yaml.Node | None:
    """Returns the nodes of YAML text; None if there is nothing in it.

    Args:
        text: The YAML.
        name: Its source, for error messages.

    Raises:
        InputError: It is not YAML, has aliases, tags or a repeated key, or is too deep or too long.
    """
    try:
        _check_events(text, name)
        loader = Loader(text)
        try:
            root = loader.get_single_node()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        has_tab = any("\t" in row for row in text.split("\n")[line - 1 : line])
        mend = "; there is a tab in it, write blanks" if has_tab else ""
        raise InputError(f"{name} line {line}: not valid YAML ({error.problem}){mend}") from None
    except yaml.YAMLError as error:
        raise InputError(f"{name}: not valid YAML ({error})") from None
    except ValueError as error:  # Escapes of no character.
        raise InputError(f"{name}: not valid YAML ({error})") from None
    if root is not None:
        _check_keys(root, name)
    return root


def construct(root: yaml.Node, name: str) -> Any:
    """Returns the plain data of nodes that `compose` returned."""
    loader = Loader("")
    try:
        return loader.construct_document(root)
    except (yaml.YAMLError, ValueError, TypeError) as error:
        raise InputError(f"{name}: not valid YAML ({error})") from None
    finally:
        loader.dispose()


def read_yaml(path: Path, limit: int) -> Any:
    """Returns the plain data of a YAML file.

    Args:
        path: The file.
        limit: Largest size [bytes].

    Raises:
        InputError: As `read_text` and `compose`.
    """
    root = compose(read_text(path, limit), str(path))
    return None if root is None else construct(root, str(path))


def _check_events(text: str, name: str) -> None:
    """Checks the parser's events one by one, before any data are built."""
    depth = documents = 0
    for count, event in enumerate(yaml.parse(text, Loader=_PARSER)):
        line = event.start_mark.line + 1 if event.start_mark else 1
        if isinstance(event, yaml.AliasEvent):
            raise InputError(f"{name} line {line}: aliases (*) are not read; write it out")
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > _DEEPEST:
                raise InputError(f"{name} line {line}: nested too deeply to be a file of settings")
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise InputError(f"{name} line {line}: a second document; a file has one")
        if getattr(event, "tag", None) is not None:
            raise InputError(f"{name} line {line}: tags (!) are not read; leave it out")
        if count > _MOST_NODES:
            raise InputError(f"{name}: more than {_MOST_NODES} values; give a smaller file")


def _check_keys(root: yaml.Node, name: str) -> None:
    """Checks that keys are texts, each once."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, yaml.SequenceNode):
            waiting += node.value
        elif isinstance(node, yaml.MappingNode):
            seen = set()
            for key, value in node.value:
                line = key.start_mark.line + 1
                if not isinstance(key, yaml.ScalarNode):
                    raise InputError(
                        f"{name} line {line}: a list or mapping stands where a field's name should"
                    )
                if key.value in seen:
                    raise InputError(
                        f'{name} line {line}: "{key.value}" is there twice; leave one out'
                    )
                seen.add(key.value)
                waiting.append(value)
