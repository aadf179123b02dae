"""Typed YAML files: Drake's loader, with clear messages about errors in a file."""

import dataclasses
import logging
import math
import re
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydrake.common.yaml import yaml_dump_typed, yaml_load_typed

from pepper_drake.errors import InputError
from pepper_drake.files import LARGEST_NUMBER, read_text, write_atomically
from pepper_drake.yaml_files import compose, construct, number_of

T = TypeVar("T")

YAML_LIMIT = 2**18
"""Largest YAML file of settings or scenes that is read [bytes]."""

_SCALARS: dict[type, tuple[str, ...]] = {
    float: ("tag:yaml.org,2002:float", "tag:yaml.org,2002:int"),
    int: ("tag:yaml.org,2002:int",),
    bool: ("tag:yaml.org,2002:bool",),
    str: ("tag:yaml.org,2002:str",),
}
_LOG = logging.getLogger(__name__)
_LINES = str.maketrans("\n\t", "  ")
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


def load_yaml(
    schema: type[T],
    path: Path,
    defaults: T | None = None,
    *,
    moved: Mapping[str, str] = types.MappingProxyType({}),
) -> T:
    """Loads a dataclass from a YAML file.

    Fields that the file leaves out keep their defaults; every field of the dataclass needs one.

    Args:
        schema: A dataclass of numbers, strings, lists, dictionaries and other such dataclasses.
        path: The file.
        defaults: Values of the fields that the file leaves out; the schema's own if None.
        moved: New names of renamed fields by their former names, such as `head.speed`; the former
            names are still accepted, with a warning.

    Raises:
        InputError: If the file is missing, is no YAML, has an unknown field, or a value of the
            wrong type; the message names the file, the line and the field.
    """
    return parse_yaml(schema, read_text(path, YAML_LIMIT), str(path), defaults, moved=moved)


def parse_yaml(
    schema: type[T],
    text: str,
    name: str,
    defaults: T | None = None,
    *,
    moved: Mapping[str, str] = types.MappingProxyType({}),
) -> T:
    """Reads a dataclass from YAML text; see `load_yaml`.

    Args:
        schema: A dataclass.
        text: The YAML.
        name: Name of its source, for error messages.
        defaults: Values of the fields that the text leaves out; the schema's own if None.
        moved: See `load_yaml`.

    Raises:
        InputError: See `load_yaml`.
    """
    root = compose(text, name)
    if root is None:
        raise InputError(f"{name} is empty; it must hold the fields of a {schema.__name__}")
    found = [(former, now) for former, now in moved.items() if _move_field(root, former, now, name)]
    if found:
        many = f"{len(found)} fields have former names; for example, " if len(found) > 1 else ""
        _LOG.warning("%s: %s%s is now %s; this release reads both", name, many, *found[0])
    _check_node(root, schema, "", name)
    # Drake reads YAML 1.1: it gets the checked values in an unambiguous form.
    plain = yaml.dump(construct(root, name), Dumper=_DUMPER)
    return yaml_load_typed(schema=schema, data=plain, defaults=defaults)


def with_settings(
    config: T,
    settings: Sequence[str],
    *,
    moved: Mapping[str, str] = types.MappingProxyType({}),
) -> T:
    """Returns a copy of a dataclass with some fields set, as for `--set FIELD=VALUE`.

    Args:
        config: The dataclass.
        settings: Such as `planner.clearance.want=0.02`; later ones win.
        moved: See `load_yaml`.

    Raises:
        InputError: There is no such field, or the value has the wrong type.

    Example:
        >>> from dataclasses import dataclass, field
        >>> @dataclass
        ... class Inner:
        ...     size: float = 1.0
        >>> @dataclass
        ... class Outer:
        ...     inner: Inner = field(default_factory=Inner)
        >>> with_settings(Outer(), ["inner.size=2"])
        Outer(inner=Inner(size=2.0))
    """
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not equals or not re.fullmatch(r"\w+(\.\w+)*", name) or not value.strip():
            raise InputError(f'--set "{setting}": give it as FIELD=VALUE, such as seed=3')
        text = "".join(f"{'  ' * k}{key}:\n" for k, key in enumerate(name.split(".")))
        try:
            config = parse_yaml(
                type(config),
                f"{text.rstrip()} {value.strip()}",
                f"--set {name}",
                config,
                moved=moved,
            )
        except InputError as error:  # A setting has no line numbers.
            raise InputError(re.sub(r" line \d+", "", str(error), count=1)) from None
    return config


def save_yaml(data: Any, path: Path) -> None:
    """Writes a dataclass to a YAML file that `load_yaml` reads back.

    Raises:
        InputError: The folder cannot be written to.
    """
    write_atomically(path, yaml_dump_typed(data, schema=type(data)))


def line_of_field(path: Path, field: str) -> int:
    """Returns the line of a YAML file where a field such as `obstacles[2].size` begins.

    If the file leaves the field out, the line of the innermost enclosing field.
    """
    node = compose(read_text(path, YAML_LIMIT), str(path))
    line = 1
    for key, index in re.findall(r"(\w+)|\[(\d+)\]", field):
        if isinstance(node, yaml.MappingNode) and key:
            children = {name.value: (name, value) for name, value in node.value}
            if key not in children:
                break
            name, node = children[key]
            line = name.start_mark.line + 1
        elif isinstance(node, yaml.SequenceNode) and index and int(index) < len(node.value):
            node = node.value[int(index)]
            line = node.start_mark.line + 1
        else:
            break
    return line


def _move_field(root: yaml.Node, former: str, now: str, name: str) -> bool:
    """Moves a field to its new name; returns False if the former one is not there.

    Raises:
        InputError: Both names are present.
    """

    def child(mapping: yaml.Node | None, key: str) -> yaml.Node | None:
        entries = mapping.value if isinstance(mapping, yaml.MappingNode) else ()
        return next((value for given, value in entries if given.value == key), None)

    *groups, key = former.split(".")
    parent: yaml.Node | None = root
    for group in groups:
        parent = child(parent, group)
    value = child(parent, key)
    if parent is None or value is None:
        return False
    parent.value = [entry for entry in parent.value if entry[0].value != key]
    *groups, key = now.split(".")
    text = "tag:yaml.org,2002:str"
    marks = value.start_mark, value.end_mark
    parent = root
    for group in groups:
        found = child(parent, group)
        if found is None:
            found = yaml.MappingNode("tag:yaml.org,2002:map", [], *marks)
            parent.value.append((yaml.ScalarNode(text, group, *marks), found))
        if not isinstance(found, yaml.MappingNode):
            return False  # Reported by the subsequent check.
        parent = found
    if child(parent, key) is not None:
        raise InputError(f"{name}: {former} is now {now}, which it has, too; leave {former} out")
    parent.value.append((yaml.ScalarNode(text, key, *marks), value))
    return True


def _check_node(node: yaml.Node, schema: Any, field: str, path: str) -> None:
    """Raises InputError at the first node that does not fit the schema."""
    where = f"{path} line {node.start_mark.line + 1}: "
    name = field or "the file"
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if origin in (typing.Union, types.UnionType):
        if node.tag == "tag:yaml.org,2002:null":
            return
        schema = next(argument for argument in arguments if argument is not type(None))
        origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if dataclasses.is_dataclass(schema):
        hints = typing.get_type_hints(schema)
        if not isinstance(node, yaml.MappingNode):
            raise InputError(f"{where}{name} must hold the fields {', '.join(hints)}")
        for key, value in _items(node, path):
            if key.value not in hints:
                raise InputError(
                    f'{path} line {key.start_mark.line + 1}: {name} has no field "{key.value}"; '
                    f"its fields are {', '.join(hints)}"
                )
            _check_node(value, hints[key.value], f"{field}.{key.value}".lstrip("."), path)
    elif origin is list:
        if not isinstance(node, yaml.SequenceNode):
            raise InputError(f"{where}{name} must be a list")
        for index, value in enumerate(node.value):
            _check_node(value, arguments[0], f"{field}[{index}]", path)
    elif origin is dict:
        if not isinstance(node, yaml.MappingNode):
            raise InputError(f"{where}{name} must be lines of the form `name: value`")
        for key, value in _items(node, path):
            _check_node(value, arguments[1], f"{field}.{key.value}", path)
    else:
        if not isinstance(node, yaml.ScalarNode):
            raise InputError(f"{where}{name} is a list or a mapping; it must be {_WORDS[schema]}")
        if node.tag not in _SCALARS[schema]:
            raise InputError(f'{where}{name} is "{node.value}"; it must be {_WORDS[schema]}')
        if schema is float:
            number = number_of(node.value)
            if not math.isfinite(number):
                raise InputError(f"{where}{name} is {node.value}; it must be a finite number")
            if abs(number) > LARGEST_NUMBER:
                raise InputError(f"{where}{name} is {node.value}, more than {LARGEST_NUMBER:g}")
        if schema is str and not node.value.translate(_LINES).isprintable():
            raise InputError(f"{where}{name} has control characters; write plain text")


def _items(node: yaml.MappingNode, path: str) -> list[tuple[yaml.ScalarNode, yaml.Node]]:
    """Returns the entries of a mapping, whose keys must be strings."""
    for key, _ in node.value:
        if key.tag not in _SCALARS[str]:
            where = f"{path} line {key.start_mark.line + 1}: "
            raise InputError(f"{where}{key.value} is not a text to YAML; quote it")
    return list(node.value)
