"""Primitives as YAML files: readable, editable, and exact to the last bit.

Numbers are written in the shortest form that reads back the same; rows of a matrix stay on one
line. `version` counts changes of the layout.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from pepper_drake.errors import InputError
from pepper_drake.files import write_atomically
from pepper_drake.learning.approximators.registry import get_approximator
from pepper_drake.learning.dmp.orientation import ORIENTATIONS, OrientationAttractor
from pepper_drake.learning.dmp.posture import PostureProfile
from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.learning.dmp.primitive_check import check_movement
from pepper_drake.learning.dmp.scaling import MotionFrame, check_scaling
from pepper_drake.learning.dmp.transformation import TransformationModel
from pepper_drake.yaml_files import read_yaml

Array = npt.NDArray[np.float64]

VERSION = 1

FILE_LIMIT = 4 * 2**20
"""Largest size of a primitive's file [bytes]."""


def write_primitive(primitive: MovementPrimitive, path: Path) -> None:
    """Writes a primitive.

    Raises:
        InputError: The path cannot be written to.
    """
    data: dict[str, Any] = {
        "version": VERSION,
        "name": primitive.name,
        "approximator": primitive.approximator,
        "duration": primitive.duration,
        "path_length": primitive.path_length,
        "translation": transformation_data(primitive.translation),
    }
    if primitive.orientation is not None:
        data["orientation"] = {
            "mode": primitive.orientation.mode,
            "start": primitive.orientation.start.tolist(),
            "goal": primitive.orientation.goal.tolist(),
            **transformation_data(primitive.orientation.attractor, prefix="coordinates_"),
        }
    if primitive.posture is not None:
        data["posture"] = primitive.posture.to_data()
    header = "# A movement primitive of pepper_drake. Units: s, m, rad.\n"
    write_atomically(path, header + "".join(yaml_lines(data, 0)))


def read_primitive(path: Path) -> MovementPrimitive:
    """Reads a primitive.

    Raises:
        InputError: With file, line or field, and what to do.
    """
    fields = read_fields(path)
    version = fields.value("version", int)
    if version != VERSION:
        raise InputError(f"{path}: version {version} is not known; this program reads {VERSION}")
    if "joints" in fields.data:
        raise InputError(f"{path}: a primitive of joints; its class is JointPrimitive")
    approximator = fields.name_of("approximator", get_approximator)
    orientation = posture = None
    if "orientation" in fields.data:
        inner = fields.inner("orientation")
        mode = inner.value("mode", str)
        if mode not in ORIENTATIONS:
            raise InputError(f"{path}: orientation.mode: '{mode}' is not one of {ORIENTATIONS}")
        orientation = OrientationAttractor(
            read_transformation(inner, approximator, "coordinates_"),
            mode,
            inner.vector("start", 4),
            inner.vector("goal", 4),
        )
    if "posture" in fields.data:
        posture = fields.inner("posture").build(PostureProfile.from_data)
    primitive = MovementPrimitive(
        translation=read_transformation(fields.inner("translation"), approximator),
        duration=fields.positive("duration"),
        path_length=fields.value("path_length", float),
        orientation=orientation,
        posture=posture,
        approximator=approximator,
        name=str(fields.value("name", str)),
    )
    return check_movement(primitive, path)


def read_fields(path: Path) -> "Fields":
    """Returns the fields of a primitive's YAML file.

    Raises:
        InputError: With file and line.
    """
    data = read_yaml(path, FILE_LIMIT)
    return Fields(data, path)


def transformation_data(attractor: TransformationModel, prefix: str = "") -> dict[str, Any]:
    """Returns a transformation system as plain data."""
    return {
        "scaling": attractor.scaling,
        "alpha_z": attractor.alpha_z,
        f"{prefix}start": attractor.frame.start.tolist(),
        f"{prefix}goal": attractor.frame.goal.tolist(),
        "extent": attractor.frame.extent.tolist(),
        "start_rate": attractor.start_rate.tolist(),
        "forcing": attractor.model.to_data(),
    }


def read_transformation(
    fields: "Fields", approximator: str, prefix: str = "", size: int = 3
) -> TransformationModel:
    """Makes a transformation system of `size` coordinates from `transformation_data`.

    Raises:
        InputError: With file and field.
    """
    scaling = fields.name_of("scaling", check_scaling)
    return TransformationModel(
        model=fields.inner("forcing").build(get_approximator(approximator).load),
        scaling=scaling,
        frame=MotionFrame(
            fields.vector(f"{prefix}start", size),
            fields.vector(f"{prefix}goal", size),
            fields.vector("extent", size),
        ),
        start_rate=fields.vector("start_rate", size),
        alpha_z=fields.positive("alpha_z"),
    )


class Fields:
    """A mapping of the file, with errors that name the field."""

    def __init__(self, data: object, path: Path, name: str = "") -> None:
        if not isinstance(data, dict):
            raise InputError(f"{path}: {name or 'the file'} must be a mapping of fields")
        self.data: dict[str, Any] = data
        self._path = path
        self._name = name

    def value(self, field: str, kind: type) -> Any:
        """Returns a field of the given type; a number must be finite."""
        if field not in self.data:
            raise InputError(f"{self._path}: {self._label(field)} is missing; add it")
        value = self.data[field]
        if kind is float and isinstance(value, int):
            value = float(value)
        if not isinstance(value, kind) or (isinstance(value, float) and not math.isfinite(value)):
            raise InputError(
                f"{self._path}: {self._label(field)}: {value!r} is not a"
                f" {'finite number' if kind is float else kind.__name__}"
            )
        return value

    def name_of(self, field: str, check: Callable[[str], object]) -> str:
        """Returns a name that `check` accepts."""
        name: str = self.value(field, str)
        try:
            check(name)
        except InputError as error:
            raise InputError(f"{self._path}: {error}") from None
        return name

    def positive(self, field: str) -> float:
        """Returns a number above zero."""
        value: float = self.value(field, float)
        if value <= 0.0:
            raise InputError(f"{self._path}: {self._label(field)}: {value} is not positive")
        return value

    def vector(self, field: str, size: int) -> Array:
        """Returns finite numbers (size,)."""
        values = self.value(field, list)
        try:
            vector = np.array(values, dtype=float)
        except (TypeError, ValueError, OverflowError):
            vector = np.empty(0)
        if vector.shape != (size,) or not np.all(np.abs(vector) <= 1e6):
            raise InputError(
                f"{self._path}: {self._label(field)}: {values} must be {size} finite numbers"
            )
        return vector

    def inner(self, field: str) -> "Fields":
        """Returns a field that is itself a mapping."""
        return Fields(self.value(field, dict), self._path, self._label(field))

    def build(self, load: Any) -> Any:
        """Returns `load` of the mapping, with errors that name the field."""
        try:
            return load(self.data)
        except KeyError as error:
            raise InputError(
                f"{self._path}: {self._name}.{error.args[0]} is missing; add it"
            ) from None
        except (TypeError, ValueError, OverflowError, AttributeError) as error:
            raise InputError(f"{self._path}: {self._name}: {error}") from None

    def _label(self, field: str) -> str:
        return f"{self._name}.{field}" if self._name else field


def yaml_lines(data: Mapping[str, Any], indent: int = 0) -> list[str]:
    """Returns YAML lines; vectors and rows of matrices on one line each."""
    pad = " " * indent
    lines = []
    for key, value in data.items():
        if isinstance(value, Mapping):
            lines += [f"{pad}{key}:\n", *yaml_lines(value, indent + 2)]
        elif isinstance(value, list) and value and isinstance(value[0], list):
            lines.append(f"{pad}{key}:\n")
            lines += [f"{pad}  - {_flow(row)}\n" for row in value]
        else:
            lines.append(f"{pad}{key}: {_flow(value)}\n")
    return lines


def _flow(value: Any) -> str:
    """Returns a value on one line. YAML needs a dot in 1e-05, which repr leaves out."""
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = repr(value)
        return text if "." in text or "e" not in text else text.replace("e", ".0e")
    if isinstance(value, int):
        return str(value)
    text = str(value)
    # Quoted: what may be a number to one reader and a text to another.
    style = '"' if text[:1] in tuple("+-.0123456789") else None
    dumped = yaml.safe_dump(text, default_flow_style=True, default_style=style, width=10**6)
    return dumped.splitlines()[0]
