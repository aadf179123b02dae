"""Typed YAML files: Drake's own loader, with one clear sentence for what is wrong in a file."""

import dataclasses
import math
import re
import typing
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydrake.common.yaml import yaml_dump_typed, yaml_load_typed

from pepper_drake.errors import InputError

T = TypeVar("T")

_SCALARS: dict[type, tuple[str, ...]] = {
    float: ("tag:yaml.org,2002:float", "tag:yaml.org,2002:int"),
    int: ("tag:yaml.org,2002:int",),
    bool: ("tag:yaml.org,2002:bool",),
    str: ("tag:yaml.org,2002:str",),
}
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


def load_yaml(schema: type[T], path: Path) -> T:
    """Loads a dataclass from a YAML file.

    Fields that the file leaves out keep their defaults; every field of the dataclass needs one.

    Args:
        schema: A dataclass of numbers, texts, lists, dictionaries and other such dataclasses.
        path: The file.

    Raises:
        InputError: If the file is missing, is no YAML, has a field that the schema lacks, or a
            value of the wrong type; the sentence names the file, the line and the field.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path} does not exist") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as a text file ({error})") from None
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise InputError(f"{path} line {line}: not valid YAML ({error.problem})") from None
    except yaml.YAMLError as error:
        raise InputError(f"{path}: not valid YAML ({error})") from None
    if root is None:
        raise InputError(f"{path} is empty; it must hold the fields of a {schema.__name__}")
    _check_node(root, schema, "", path)
    return yaml_load_typed(schema=schema, data=text)


def save_yaml(data: Any, path: Path) -> None:
    """Writes a dataclass to a YAML file that `load_yaml` reads back."""
    path.write_text(yaml_dump_typed(data, schema=type(data)), encoding="utf-8")


def line_of_field(path: Path, field: str) -> int:
    """Returns the line of a YAML file where a field such as `obstacles[2].size` begins.

    If the file leaves the field out, the line of the innermost field around it that is there.
    """
    node = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
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


def _check_node(node: yaml.Node, schema: Any, field: str, path: Path) -> None:
    """Raises InputError at the first node that does not fit the schema."""
    where = f"{path} line {node.start_mark.line + 1}: "
    name = field or "the file"
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if dataclasses.is_dataclass(schema):
        hints = typing.get_type_hints(schema)
        if not isinstance(node, yaml.MappingNode):
            raise InputError(f"{where}{name} must hold the fields {', '.join(hints)}")
        for key, value in node.value:
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
        for key, value in node.value:
            _check_node(value, arguments[1], f"{field}.{key.value}", path)
    else:
        if not isinstance(node, yaml.ScalarNode):
            raise InputError(f"{where}{name} is a list or a mapping; it must be {_WORDS[schema]}")
        if not _fits(node, schema):
            raise InputError(f'{where}{name} is "{node.value}"; it must be {_WORDS[schema]}')
        if schema is float and not math.isfinite(_number(node.value)):
            raise InputError(f"{where}{name} is {node.value}; it must be a finite number")


def _fits(node: yaml.ScalarNode, schema: type) -> bool:
    if node.tag in _SCALARS[schema]:
        return True
    if schema is float and node.tag == "tag:yaml.org,2002:str":
        # YAML 1.1 reads 1e-3 (without a dot) as a text; Drake's loader takes it as a number.
        try:
            float(node.value)
        except ValueError:
            return False
        return True
    return False


def _number(text: str) -> float:
    """Returns the number that a YAML scalar stands for, including `.nan` and `-.inf`."""
    word = text.lower().replace("_", "")
    return float(word.replace(".inf", "inf").replace(".nan", "nan"))
