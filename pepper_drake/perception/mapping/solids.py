"""Boxes, cylinders, spheres and capsules: distances of points to them, points on them.

They serve to remove a robot or an object from a cloud by its exact shape.
"""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Capsule, Cylinder, Role, SceneGraph, Shape, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex

from pepper_drake.compiled import compiled
from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.point_cells import PointCells
from pepper_drake.short_repr import short_repr

Points = npt.NDArray[np.floating]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Solid:
    """A solid fixed in a frame F; its own frame S has the origin at its centre.

    Attributes:
        shape: Box, Cylinder (along its z), Sphere or Capsule (along its z).
        X_FS: Its pose in F.
    """

    shape: Shape
    X_FS: RigidTransform

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if not isinstance(self.shape, Box | Cylinder | Sphere | Capsule):
            raise InputError(
                f"a {type(self.shape).__name__} cannot be cut out of a cloud; "
                "use a box, cylinder, sphere or capsule."
            )

    def grown(self, margin: float) -> "Solid":
        """Returns the solid that is larger by a margin [m] on all sides, with its edges sharp."""
        shape = self.shape
        if isinstance(shape, Box):
            larger: Shape = Box(shape.size() + 2.0 * margin)
        elif isinstance(shape, Cylinder):
            larger = Cylinder(shape.radius() + margin, shape.length() + 2.0 * margin)
        elif isinstance(shape, Capsule):
            larger = Capsule(shape.radius() + margin, shape.length())
        else:
            larger = Sphere(shape.radius() + margin)
        return Solid(larger, self.X_FS)

    @functools.cached_property
    def kind(self) -> int:
        """Returns 0 for a box, 1 for a cylinder, 2 for a sphere or a capsule."""
        return 0 if isinstance(self.shape, Box) else 1 if isinstance(self.shape, Cylinder) else 2

    @functools.cached_property
    def dimensions(self) -> npt.NDArray[np.float64]:
        """Returns a box's half edges, else radius, half the straight length and 0 (3,) [m]."""
        shape = self.shape
        if isinstance(shape, Box):
            return np.asarray(shape.size()) / 2
        half = 0.0 if isinstance(shape, Sphere) else shape.length() / 2
        return np.array([shape.radius(), half, 0.0])

    @functools.cached_property
    def bounding_radius(self) -> float:
        """Returns the radius of the bounding sphere around the origin of S [m]."""
        if self.kind < 2:
            return float(np.linalg.norm(self.dimensions))
        return float(np.sum(self.dimensions))

    @functools.cached_property
    def width(self) -> float:
        """Returns the largest distance of its points from the z axis of F, with S upright [m]."""
        own = np.hypot(*self.dimensions[:2]) if self.kind == 0 else self.dimensions[0]
        return float(np.hypot(*self.X_FS.translation()[:2]) + own)

    def signed_distance(self, p_S: Points) -> Points:
        """Computes the signed distance of points to the surface, negative inside.

        Args:
            p_S: Points (N, 3) in the solid's own frame [m].

        Returns:
            (N,) [m].
        """
        return np.asarray(_signed_distances(self.kind, self.dimensions, np.array(p_S, order="C")))


class SolidArrays(NamedTuple):
    """S solids as plain arrays, for compiled code; see `Solid`.

    Attributes:
        kinds: (S,).
        dimensions: (S, 3) [m].
        radii: Radii of their bounding spheres (S,) [m].
        rotations: Rotation of each in its frame F (S, 3, 3).
        positions: (S, 3) [m].
    """

    kinds: npt.NDArray[np.int64]
    dimensions: npt.NDArray[np.float64]
    radii: npt.NDArray[np.float64]
    rotations: npt.NDArray[np.float64]
    positions: npt.NDArray[np.float64]

    @classmethod
    def of(cls, solids: Sequence[Solid]) -> "SolidArrays":
        """Returns the arrays of at least one solid."""
        return cls(
            np.array([solid.kind for solid in solids]),
            np.array([solid.dimensions for solid in solids]),
            np.array([solid.bounding_radius for solid in solids]),
            np.array([solid.X_FS.rotation().matrix() for solid in solids]),
            np.array([solid.X_FS.translation() for solid in solids]),
        )

    def posed(self, poses: Sequence[RigidTransform]) -> "SolidArrays":
        """Returns the solids in a frame F, given the poses X_FG (S) of their frames G."""
        R_FG = np.array([X_FG.rotation().matrix() for X_FG in poses])
        p_FG = np.array([X_FG.translation() for X_FG in poses])
        turned = np.einsum("sij,sj->si", R_FG, self.positions)
        return self._replace(rotations=R_FG @ self.rotations, positions=p_FG + turned)


@compiled
def _signed_distance(
    kind: int, dimensions: npt.NDArray[np.float64], x: float, y: float, z: float
) -> float:
    """Returns the signed distance of one point in a solid's own frame [m]; see `Solid`."""
    if kind == 2:
        beyond = max(abs(z) - dimensions[1], 0.0)
        return math.sqrt(x * x + y * y + beyond * beyond) - dimensions[0]
    if kind == 1:
        a, b, c = math.sqrt(x * x + y * y) - dimensions[0], abs(z) - dimensions[1], -math.inf
    else:
        a, b, c = abs(x) - dimensions[0], abs(y) - dimensions[1], abs(z) - dimensions[2]
    inside = min(max(a, b, c), 0.0)
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    return math.sqrt(a * a + b * b + c * c) + inside


@compiled
def _signed_distances(kind: int, dimensions: npt.NDArray[np.float64], points: Points) -> Points:
    distances = np.empty(len(points), points.dtype)
    for n in range(len(points)):
        distances[n] = _signed_distance(kind, dimensions, points[n, 0], points[n, 1], points[n, 2])
    return distances


@dataclass(frozen=True)
class ExcludedSolids:
    """Visible solids that are no obstacles: the robot itself, the goal object.

    Attributes:
        solids: The solids.
        poses: Pose X_WF of each solid's frame.
        margin: Points closer than this belong to them [m].
        keep_known_voxels: Whether known voxels within the margin, but not inside the solids, are
            kept: an obstacle must not be forgotten because the hand comes close to it.
    """

    solids: Sequence[Solid]
    poses: Sequence[RigidTransform]
    margin: float
    keep_known_voxels: bool = False

    __repr__ = short_repr

    @functools.cached_property
    def placed(self) -> "SolidSet":
        """Returns the solids in W."""
        return SolidSet.posed(self.solids, self.poses)


class SolidSet:
    """Solids at fixed poses in a frame F, for distance queries.

    Args:
        solids: The solids, posed in F.
    """

    def __init__(self, solids: Sequence[Solid] | SolidArrays) -> None:
        self._arrays = solids if isinstance(solids, SolidArrays) else SolidArrays.of(solids)

    @classmethod
    def posed(cls, solids: Sequence[Solid], poses: Sequence[RigidTransform]) -> "SolidSet":
        """Returns solids in a frame F, given the poses X_FG of their frames G."""
        return cls(SolidArrays.of(solids).posed(poses) if solids else [])

    def __len__(self) -> int:
        """Returns the number of solids."""
        return len(self._arrays.kinds)

    def distance(self, positions: Points, cap: float = np.inf) -> npt.NDArray[np.float64]:
        """Returns the signed distance (...) [m] of positions (..., 3) to the nearest solid.

        It is at most `cap` [m]; points beyond the cap cost almost nothing.
        """
        points = np.ascontiguousarray(positions.reshape(-1, 3))
        least = np.full(len(points), float(cap))
        if len(points) and len(self):
            _lower_distances(least, points, self._arrays)
        return least.reshape(positions.shape[:-1])

    def near(self, p_F: Points, margin: float) -> Mask:
        """Tells which points (N, 3) are in a solid, or closer to one than a margin.

        Args:
            p_F: The points [m].
            margin: Distance [m]; negative for points at least that deep inside.
        """
        # The next larger number, so that a distance equal to the margin counts.
        distances = self.distance(p_F, float(np.nextafter(margin, np.inf)))
        return np.asarray(distances <= margin)


@compiled
def _lower_distances(least: npt.NDArray[np.float64], points: Points, solids: SolidArrays) -> None:
    """Lowers distances (N,) of points (N, 3) to those from solids, where smaller."""
    kinds, dimensions, radii, rotations, positions = solids
    for s in range(len(kinds)):
        R = rotations[s]
        for n in range(len(points)):
            a = np.float64(points[n, 0]) - positions[s, 0]
            b = np.float64(points[n, 1]) - positions[s, 1]
            c = np.float64(points[n, 2]) - positions[s, 2]
            reach = radii[s] + least[n]
            if reach < 0.0 or a * a + b * b + c * c > reach * reach:
                continue
            distance = _signed_distance(
                kinds[s],
                dimensions[s],
                a * R[0, 0] + b * R[1, 0] + c * R[2, 0],
                a * R[0, 1] + b * R[1, 1] + c * R[2, 1],
                a * R[0, 2] + b * R[1, 2] + c * R[2, 2],
            )
            least[n] = min(least[n], distance)


@compiled
def minimum_link_distances(
    rotations: npt.NDArray[np.float64],
    positions: npt.NDArray[np.float64],
    links: npt.NDArray[np.int64],
    solids: SolidArrays,
    cells: PointCells,
    most: float,
) -> npt.NDArray[np.float64]:
    """Returns the smallest signed distances (M,) of solids on links to points [m].

    Args:
        rotations: Rotation of each link in the frame of the points (M, L, 3, 3).
        positions: (M, L, 3) [m].
        links: Index of each solid's link (S,).
        solids: The solids in the frames of their links.
        cells: The points.
        most: Upper bound of the result [m].
    """
    points, first, lower, counts, size = cells
    least = np.full(len(rotations), most)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    R, p = np.empty((3, 3)), np.empty(3)
    for m in range(len(least)):
        for s in range(len(links)):
            R_L, p_L = rotations[m, links[s]], positions[m, links[s]]
            kind, dimensions, radius = solids.kinds[s], solids.dimensions[s], solids.radii[s]
            for i in range(3):
                p[i] = p_L[i]
                for j in range(3):
                    p[i] += R_L[i, j] * solids.positions[s, j]
                    R[i, j] = 0.0
                    for k in range(3):
                        R[i, j] += R_L[i, k] * solids.rotations[s, k, j]
                reach = _half_width(kind, dimensions, R[i]) + least[m]
                low[i] = max(math.floor((p[i] - reach - lower[i]) / size), 0)
                high[i] = min(math.floor((p[i] + reach - lower[i]) / size), counts[i] - 1)
            if low[2] > high[2]:
                continue
            for i in range(low[0], high[0] + 1):
                for j in range(low[1], high[1] + 1):
                    row = (i * counts[1] + j) * counts[2]
                    for n in range(first[row + low[2]], first[row + high[2] + 1]):
                        x, y, z = points[n, 0] - p[0], points[n, 1] - p[1], points[n, 2] - p[2]
                        reach = radius + least[m]
                        if x * x + y * y + z * z > reach * reach:
                            continue
                        distance = _signed_distance(
                            kind,
                            dimensions,
                            x * R[0, 0] + y * R[1, 0] + z * R[2, 0],
                            x * R[0, 1] + y * R[1, 1] + z * R[2, 1],
                            x * R[0, 2] + y * R[1, 2] + z * R[2, 2],
                        )
                        least[m] = min(least[m], distance)
    return least


@compiled
def _half_width(
    kind: int, dimensions: npt.NDArray[np.float64], axis: npt.NDArray[np.float64]
) -> float:
    """Returns half of a solid's width along an axis (3,) in its own frame [m]; see `Solid`."""
    x, y, z = abs(axis[0]), abs(axis[1]), abs(axis[2])
    if kind == 0:
        return x * dimensions[0] + y * dimensions[1] + z * dimensions[2]
    across = math.sqrt(x * x + y * y) if kind == 1 else 1.0
    return across * dimensions[0] + z * dimensions[1]


def near_solids(
    p_W: Points,
    solids: Sequence[Solid],
    poses: Sequence[RigidTransform],
    margin: float,
) -> Mask:
    """Tells which points are in any of several solids, or closer to one than a margin.

    Args:
        p_W: Points (N, 3) [m].
        solids: The solids.
        poses: Pose X_WF of each solid's frame F.
        margin: Distance [m]; negative for points at least that deep inside.

    Returns:
        (N,).
    """
    return SolidSet.posed(solids, poses).near(p_W, margin)


def collision_solids(
    plant: MultibodyPlant, scene_graph: SceneGraph, body: BodyIndex
) -> list[Solid]:
    """Returns the collision shapes of a body, in its frame."""
    frame, inspector = plant.GetBodyFrameIdIfExists(body), scene_graph.model_inspector()
    shapes = [] if frame is None else inspector.GetGeometries(frame, Role.kProximity)
    return [Solid(inspector.GetShape(g), inspector.GetPoseInFrame(g)) for g in shapes]


class RobotSolids:
    """A robot's collision shapes, posed by its joints.

    Args:
        plant: A finalized plant with the robot, registered with `scene_graph`.
        scene_graph: Its geometry; all collision shapes must be primitives.
        model: The robot's model instance; the whole plant if omitted.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        model: ModelInstanceIndex | None = None,
    ) -> None:
        self._plant = plant
        bodies = (
            [BodyIndex(k) for k in range(plant.num_bodies())]
            if model is None
            else plant.GetBodyIndices(model)
        )
        self.solids: list[Solid] = []
        self._bodies: list[BodyIndex] = []
        for index in bodies:
            own = collision_solids(plant, scene_graph, index)
            self.solids += own
            self._bodies += [index] * len(own)
        self.num_positions: int = plant.num_positions()
        self._context = plant.CreateDefaultContext()

    def poses(self, q: npt.NDArray[np.float64]) -> list[RigidTransform]:
        """Returns the pose X_WF of each solid's body at joint positions q (n,) of the plant."""
        context = self._context.Clone()
        self._plant.SetPositions(context, q)
        unique = {
            index: self._plant.EvalBodyPoseInWorld(context, self._plant.get_body(index))
            for index in set(self._bodies)
        }
        return [unique[index] for index in self._bodies]

    def near(self, p_W: Points, q: npt.NDArray[np.float64], margin: float) -> Mask:
        """Tells which points (N, 3) are in the robot or closer to it than a margin [m]."""
        return near_solids(p_W, self.solids, self.poses(q), margin)


def sample_surface(solids: Sequence[Solid], spacing: float = 0.01) -> npt.NDArray[np.float64]:
    """Returns points (P, 3) on the surfaces of boxes and cylinders, in their frame F.

    Args:
        solids: Boxes and cylinders with their poses X_FS.
        spacing: Largest spacing of the points [m].
    """
    points = [np.zeros((0, 3))]
    for solid in solids:
        shape = solid.shape
        if isinstance(shape, Cylinder):
            turns = int(np.ceil(2.0 * np.pi * shape.radius() / spacing))
            angle = 2.0 * np.pi * np.arange(turns) / turns
            rim = shape.radius() * np.stack((np.cos(angle), np.sin(angle)), axis=1)
            rings = np.concatenate([rim * r for r in _even(0.0, 1.0, spacing / shape.radius())])
            half = shape.length() / 2.0
            side = [_at_height(rim, z) for z in _even(-half, half, spacing)]
            local = np.concatenate([*side, _at_height(rings, -half), _at_height(rings, half)])
        elif isinstance(shape, Box):
            half_size = np.asarray(shape.size()) / 2.0
            axes = [_even(-h, h, spacing) for h in half_size]
            nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
            local = nodes[np.any(np.abs(nodes) >= half_size - 1e-9, axis=1)]
        else:
            raise TypeError(f"no points on a shape of type {type(shape).__name__}")
        points.append(local @ solid.X_FS.rotation().matrix().T + solid.X_FS.translation())
    return np.concatenate(points)


def _even(lower: float, upper: float, spacing: float) -> npt.NDArray[np.float64]:
    """Returns evenly spaced numbers, no farther apart than the spacing."""
    return np.linspace(lower, upper, int(np.ceil((upper - lower) / spacing)) + 1)


def _at_height(points: npt.NDArray[np.float64], z: float) -> npt.NDArray[np.float64]:
    """Returns points (N, 2) at a height as (N, 3)."""
    return np.column_stack((points, np.full(len(points), z)))
