"""Boxes, cylinders, spheres and capsules, and which points of a cloud lie in or near them.

With these a robot or an object is cut out of a cloud by its own shape, not by a ball around it.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Capsule, Cylinder, Role, SceneGraph, Shape, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex

from pepper_drake.errors import InputError

Points = npt.NDArray[np.floating]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Solid:
    """A solid fixed in a frame F; its own frame S has the origin in its middle.

    Attributes:
        shape: Box, Cylinder (along its z), Sphere or Capsule (along its z).
        X_FS: Its pose in F.
    """

    shape: Shape
    X_FS: RigidTransform

    def __post_init__(self) -> None:
        if not isinstance(self.shape, Box | Cylinder | Sphere | Capsule):
            raise InputError(
                f"a {type(self.shape).__name__} cannot be cut out of a cloud; "
                "use a box, cylinder, sphere or capsule."
            )

    @functools.cached_property
    def bounding_radius(self) -> float:
        """Radius of the smallest ball around the origin of S that holds the solid [m]."""
        shape = self.shape
        if isinstance(shape, Box):
            return float(np.linalg.norm(shape.size())) / 2
        if isinstance(shape, Cylinder):
            return float(np.hypot(shape.radius(), shape.length() / 2))
        if isinstance(shape, Capsule):
            return shape.radius() + shape.length() / 2
        return shape.radius()

    def signed_distance(self, p_S: Points) -> Points:
        """Computes the signed distance of points to the surface, negative inside.

        Args:
            p_S: Points (N, 3) in the solid's own frame [m].

        Returns:
            (N,) [m].
        """
        shape = self.shape
        if isinstance(shape, Sphere):
            return np.linalg.norm(p_S, axis=1) - shape.radius()
        if isinstance(shape, Capsule):
            beyond = p_S.copy()
            half = shape.length() / 2
            beyond[:, 2] -= np.clip(p_S[:, 2], -half, half)
            return np.linalg.norm(beyond, axis=1) - shape.radius()
        if isinstance(shape, Box):
            excess = np.abs(p_S) - shape.size() / 2
        else:
            across = np.hypot(p_S[:, 0], p_S[:, 1]) - shape.radius()
            excess = np.stack([across, np.abs(p_S[:, 2]) - shape.length() / 2], axis=1)
        outside = np.linalg.norm(np.maximum(excess, 0), axis=1)
        return outside + np.minimum(excess.max(axis=1), 0)


def near_solids(
    p_W: Points,
    solids: Sequence[Solid],
    poses: Sequence[RigidTransform],
    margin: float,
) -> Mask:
    """Tells which points are in any of several solids, or closer to it than a margin.

    Args:
        p_W: Points (N, 3) [m].
        solids: The solids.
        poses: Pose X_WF of each solid's frame F.
        margin: m; negative to tell only what lies that deep inside.

    Returns:
        (N,).
    """
    near = np.zeros(len(p_W), dtype=bool)
    if len(p_W) == 0 or not solids:
        return near
    X_WS = [X_WF @ solid.X_FS for solid, X_WF in zip(solids, poses, strict=True)]
    centers = np.array([X.translation() for X in X_WS])
    reaches = np.maximum([solid.bounding_radius + margin for solid in solids], 0)
    # Column by column: numpy reduces along the short axis of an (N, 3) array ten times slower.
    lower = np.array([p_W[:, k].min() for k in range(3)])
    upper = np.array([p_W[:, k].max() for k in range(3)])
    beside = np.clip(centers, lower, upper) - centers
    close = np.flatnonzero(np.einsum("ij,ij->i", beside, beside) <= reaches**2).tolist()
    if not close:
        return near
    # Most points are far from all of them.
    low = (centers[close] - reaches[close, None]).min(axis=0)
    high = (centers[close] + reaches[close, None]).max(axis=0)
    boxed = np.ones(len(p_W), dtype=bool)
    for k in range(3):
        boxed &= (p_W[:, k] >= low[k]) & (p_W[:, k] <= high[k])
    indices = np.flatnonzero(boxed)
    points = p_W[indices]
    for k in close:
        offset = points - centers[k].astype(p_W.dtype)
        candidates = np.flatnonzero(np.einsum("ij,ij->i", offset, offset) <= reaches[k] ** 2)
        if not len(candidates):
            continue
        p_S = offset[candidates] @ X_WS[k].rotation().matrix().astype(p_W.dtype)
        near[indices[candidates[solids[k].signed_distance(p_S) <= margin]]] = True
    return near


class RobotSolids:
    """A robot's collision shapes, where its joints put them.

    Args:
        plant: A finalized plant that holds the robot, registered with `scene_graph`.
        scene_graph: Its geometry; collision shapes that are not primitives are not accepted.
        model: The robot's model instance; all of the plant when left out.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        model: ModelInstanceIndex | None = None,
    ) -> None:
        self._plant = plant
        inspector = scene_graph.model_inspector()
        bodies = (
            [BodyIndex(k) for k in range(plant.num_bodies())]
            if model is None
            else plant.GetBodyIndices(model)
        )
        self.solids: list[Solid] = []
        self._bodies: list[BodyIndex] = []
        for index in bodies:
            frame = plant.GetBodyFrameIdIfExists(index)
            if frame is None:
                continue
            for geometry in inspector.GetGeometries(frame, Role.kProximity):
                shape = inspector.GetShape(geometry)
                self.solids.append(Solid(shape, inspector.GetPoseInFrame(geometry)))
                self._bodies.append(index)
        self.num_positions: int = plant.num_positions()

    def poses(self, q: npt.NDArray[np.float64]) -> list[RigidTransform]:
        """Returns the pose X_WF of each solid's body at joint positions q (n,) of the plant."""
        context = self._plant.CreateDefaultContext()
        self._plant.SetPositions(context, q)
        unique = {
            index: self._plant.EvalBodyPoseInWorld(context, self._plant.get_body(index))
            for index in set(self._bodies)
        }
        return [unique[index] for index in self._bodies]

    def near(self, p_W: Points, q: npt.NDArray[np.float64], margin: float) -> Mask:
        """Tells which points (N, 3) are in the robot or closer to it than a margin [m]."""
        return near_solids(p_W, self.solids, self.poses(q), margin)
