"""Shapes of obstacles and the goal object, their overlaps and distances."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydrake.geometry import (
    Convex,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.models.obj_files import check_obj
from pepper_drake.models.pepper import MODELS_DIR

MESHES_DIR = MODELS_DIR / "meshes"
"""Folder of the meshes that a scene names without a folder."""


@dataclass(frozen=True)
class PlacedShape:
    """A named solid at its pose in the world."""

    name: str
    shape: Shape
    X_WS: RigidTransform


def mesh_path(mesh: str) -> Path:
    """Returns the file of a mesh; a shipped one if `mesh` has no folder.

    Raises:
        InputError: There is no such OBJ file, or it is not the mesh of a solid.
    """
    path = Path(mesh)
    if path.parent == Path():
        path = MESHES_DIR / path
    try:
        is_there = path.is_file()
    except (OSError, ValueError):  # An impossible file name.
        is_there = False
    if path.suffix.lower() != ".obj" or not is_there:
        shipped = ", ".join(sorted(p.name for p in MESHES_DIR.glob("*.obj")))
        raise InputError(f'mesh is "{mesh}", which is not an OBJ file here; shipped are {shipped}')
    check_obj(path)
    return path


def convex_hull(mesh: str, scale: float) -> Convex:
    """Returns the convex hull of a mesh, used for collisions."""
    return Convex(mesh_path(mesh), scale)


def overlaps(shapes: Sequence[PlacedShape], tolerance: float = 1e-3) -> list[tuple[str, str]]:
    """Returns the names of all pairs of shapes that penetrate by more than `tolerance` [m].

    Objects standing on one another touch, which is no overlap.
    """
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("overlaps")
    poses = FramePoseVector()
    names = {}
    for placed in shapes:
        frame = scene_graph.RegisterFrame(source, GeometryFrame(placed.name))
        instance = GeometryInstance(RigidTransform(), placed.shape, placed.name)
        instance.set_proximity_properties(ProximityProperties())
        names[scene_graph.RegisterGeometry(source, frame, instance)] = placed.name
        poses.set_value(frame, placed.X_WS)
    context = scene_graph.CreateDefaultContext()
    scene_graph.get_source_pose_port(source).FixValue(context, poses)
    query = scene_graph.get_query_output_port().Eval(context)
    return [
        (names[pair.id_A], names[pair.id_B])
        for pair in query.ComputePointPairPenetration()
        if pair.depth > tolerance
    ]


def distances(
    shape: Shape, poses: Sequence[RigidTransform], others: Sequence[PlacedShape]
) -> npt.NDArray[np.float64]:
    """Returns the signed distances [m] of a shape, at each of some poses, to other shapes.

    Args:
        shape: The moving shape.
        poses: N of its poses in the world.
        others: M static shapes.

    Returns:
        (N, M).
    """
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("distances")
    frame = scene_graph.RegisterFrame(source, GeometryFrame("moving"))

    def instance(solid: Shape, X: RigidTransform, name: str) -> GeometryInstance:
        made = GeometryInstance(X, solid, name)
        made.set_proximity_properties(ProximityProperties())
        return made

    moving = scene_graph.RegisterGeometry(
        source, frame, instance(shape, RigidTransform(), "moving")
    )
    still = [
        scene_graph.RegisterAnchoredGeometry(source, instance(one.shape, one.X_WS, f"{k}"))
        for k, one in enumerate(others)
    ]
    context = scene_graph.CreateDefaultContext()
    gaps = np.empty((len(poses), len(others)))
    for row, X_WS in enumerate(poses):
        placed = FramePoseVector()
        placed.set_value(frame, X_WS)
        scene_graph.get_source_pose_port(source).FixValue(context, placed)
        query = scene_graph.get_query_output_port().Eval(context)
        for column, other in enumerate(still):
            gaps[row, column] = query.ComputeSignedDistancePairClosestPoints(moving, other).distance
    return gaps
