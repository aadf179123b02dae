"""Shapes of obstacles, the goal object and Pepper, their overlaps and distances."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
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
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from pepper_drake.errors import InputError
from pepper_drake.models.obj_files import check_obj
from pepper_drake.models.pepper import MODELS_DIR, add_pepper, set_joint_positions

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
    for number, placed in enumerate(shapes):
        frame = scene_graph.RegisterFrame(source, GeometryFrame(f"{number}"))
        instance = GeometryInstance(RigidTransform(), placed.shape, f"{number}")
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


@lru_cache(maxsize=1)
def _pepper() -> tuple[MultibodyPlant, SceneGraph, ModelInstanceIndex]:
    """Returns Pepper alone, with its shapes."""
    plant, scene_graph = MultibodyPlant(time_step=0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    pepper = add_pepper(plant)
    plant.Finalize()
    return plant, scene_graph, pepper


def pepper_shapes(positions: Mapping[str, float]) -> list[PlacedShape]:
    """Returns Pepper's collision shapes, with the names of their bodies.

    Args:
        positions: Positions of all joints by name [rad, m], the base's included.
    """
    plant, scene_graph, pepper = _pepper()
    context, inspector = plant.CreateDefaultContext(), scene_graph.model_inspector()
    set_joint_positions(plant, context, pepper, positions)
    return [
        PlacedShape(
            body.name(),
            inspector.GetShape(geometry),
            plant.EvalBodyPoseInWorld(context, body) @ inspector.GetPoseInFrame(geometry),
        )
        for body in map(plant.get_body, plant.GetBodyIndices(pepper))
        for geometry in plant.GetCollisionGeometriesForBody(body)
    ]


def position_limits(joint: str) -> tuple[float, float]:
    """Returns the lower and upper limit of one of Pepper's joints [rad], the base's [rad, m]."""
    plant, _, pepper = _pepper()
    found = plant.GetJointByName(joint, pepper)
    return float(found.position_lower_limits()[0]), float(found.position_upper_limits()[0])
