"""Drake's shapes as meshcat's objects."""

import base64
from typing import Any

import meshcat.geometry as mg
import numpy as np
from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, Mesh, Shape, Sphere

from pepper_drake.playback.motion import Vector

# Three.js' cylinders and lathes stand along y, Drake's along z.
_Z_FROM_Y = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
_ARC_STEPS = 8
_SEGMENTS = 24


def meshcat_object(
    shape: Shape, color: tuple[float, float, float, float]
) -> tuple[mg.Object, Vector]:
    """Makes the object that draws a shape, and its pose (4, 4) in the shape's frame, with scale.

    Args:
        shape: A box, capsule, cylinder, ellipsoid, sphere, or a mesh of an OBJ file; a mesh in
            memory has its own material.
        color: RGBA, from 0 to 1.
    """
    if isinstance(shape, Mesh):
        scale = np.diag([*shape.scale3(), 1.0])
        source = shape.source()
        if source.is_in_memory():
            return _TexturedMesh(source.in_memory()), scale
        return mg.Mesh(mg.ObjMeshGeometry.from_file(source.path()), material(color)), scale
    if isinstance(shape, Cylinder):
        return mg.Mesh(mg.Cylinder(shape.length(), shape.radius()), material(color)), _Z_FROM_Y
    if isinstance(shape, Capsule):
        return mg.Mesh(_capsule(shape.radius(), shape.length()), material(color)), _Z_FROM_Y
    if isinstance(shape, Box):
        geometry = mg.Box(shape.size().tolist())
    elif isinstance(shape, Sphere):
        geometry = mg.Sphere(shape.radius())
    elif isinstance(shape, Ellipsoid):
        scale = np.diag([shape.a(), shape.b(), shape.c(), 1.0])
        return mg.Mesh(mg.Sphere(1.0), material(color)), scale
    else:
        raise TypeError(f"no picture of a {type(shape).__name__}")
    return mg.Mesh(geometry, material(color)), np.eye(4)


def material(color: tuple[float, float, float, float]) -> mg.MeshPhongMaterial:
    """Makes a material of one colour (RGBA): two-sided if opaque, else only its front is drawn."""
    opaque = bool(color[3] >= 1.0)
    return mg.MeshPhongMaterial(
        color=hex_color(color),
        opacity=color[3],
        side=2 if opaque else 0,
        # Transparent faces do not write depth: else far ones would flicker as the view turns.
        depthWrite=opaque,
        # Where a transparent face coincides with an opaque one, the opaque one is visible.
        polygonOffset=not opaque,
        polygonOffsetFactor=2.0,
        polygonOffsetUnits=4.0,
        shininess=20,
    )


def hex_color(color: tuple[float, ...]) -> int:
    """Returns RGB(A) in three.js' form, 0xrrggbb."""
    red, green, blue = (round(255 * float(value)) for value in color[:3])
    return (red << 16) | (green << 8) | blue


class _Lathe(mg.Geometry):
    """A surface of revolution: a line in the x-y plane, rotated about y."""

    def __init__(self, points: Vector) -> None:
        super().__init__()
        self._points = points

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        """Returns three.js' description."""
        return {
            "uuid": self.uuid,
            "type": "LatheGeometry",
            "points": [{"x": x, "y": y} for x, y in self._points.tolist()],
            "segments": _SEGMENTS,
            "phiStart": 0.0,
            "phiLength": 2.0 * np.pi,
        }


def _capsule(radius: float, length: float) -> _Lathe:
    angles = np.linspace(0.0, np.pi / 2, _ARC_STEPS)
    top = np.column_stack((radius * np.cos(angles), length / 2 + radius * np.sin(angles)))
    bottom = (top * [1.0, -1.0])[::-1]
    return _Lathe(np.vstack((bottom, top)))


class Tube(mg.Geometry):
    """A smooth tube through points: WebGL draws lines no wider than a pixel."""

    def __init__(self, points: Vector, radius: float) -> None:
        """Makes the tube through points (N, 3) [m]."""
        super().__init__()
        self._points, self._radius = points, radius

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        """Returns three.js' description."""
        return {
            "uuid": self.uuid,
            "type": "TubeGeometry",
            "path": {
                "type": "CatmullRomCurve3",
                "closed": False,
                "curveType": "catmullrom",
                "tension": 0.5,
                "arcLengthDivisions": 200,
                "points": self._points.tolist(),
            },
            "tubularSegments": 2 * len(self._points),
            "radius": self._radius,
            "radialSegments": 8,
            "closed": False,
        }


class _TexturedMesh(mg.Object):
    """An OBJ file in memory with its material and texture."""

    def __init__(self, mesh: Any) -> None:
        mg.SceneElement.__init__(self)
        self._mesh = mesh

    def lower(self) -> dict[str, Any]:
        """Returns meshcat's description of a mesh with a material."""
        files = self._mesh.supporting_files
        library = [files[name].contents() for name in files if name.endswith(".mtl")]
        textures = {
            name: "data:image/png;base64," + base64.b64encode(files[name].contents()).decode()
            for name in files
            if name.endswith(".png")
        }
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [],
            "materials": [],
            "object": {
                "uuid": self.uuid,
                "type": "_meshfile_object",
                "format": "obj",
                "data": self._mesh.mesh_file.contents().decode(),
                "mtl_library": library[0].decode() if library else "",
                "resources": textures,
            },
        }
