"""Sphere approximation of links, for fast distances to obstacles."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Capsule, Cylinder, Shape, Sphere

from pepper_drake.models.control_model import ControlModel
from pepper_drake.perception.mapping.solids import collision_solids

Vector = npt.NDArray[np.float64]

_CELL = 0.045
"""Largest side of the cells into which a shape is cut [m]."""
_ROUNDING = 0.9
"""Sphere radius over half a cell's diagonal: does not cover the shape's sharp corners."""

ARM_LINKS = ("Bicep", "Elbow", "ForeArm")
"""The arm's links without the side's initial; the wrist (with the hand) is added to them."""


def arm_link_names(arm: str) -> tuple[str, ...]:
    """Returns the names of an arm's moving links, upper arm to hand."""
    side = arm[0].upper()
    return (*(side + link for link in ARM_LINKS), f"{arm[0]}_wrist")


@dataclass(frozen=True)
class SphereModel:
    """Spheres fixed to some links.

    Attributes:
        link_names: Names of the L links.
        link: Index of each sphere's link (S,).
        centers: Centres (S, 3) in the link's frame [m].
        radii: Radii (S,) [m].
    """

    link_names: tuple[str, ...]
    link: npt.NDArray[np.intp]
    centers: Vector
    radii: Vector

    def selected(self, chosen: npt.NDArray[np.bool_]) -> "SphereModel":
        """Returns the spheres of a mask (S,)."""
        return SphereModel(
            self.link_names, self.link[chosen], self.centers[chosen], self.radii[chosen]
        )

    def place(self, R_TL: Vector, p_TL: Vector) -> Vector:
        """Returns the sphere centres in T.

        Args:
            R_TL: (..., L, 3, 3) orientations of the links.
            p_TL: (..., L, 3) positions of the links [m].

        Returns:
            (..., S, 3) [m].
        """
        R = R_TL[..., self.link, :, :]
        return np.einsum("...ij,...j->...i", R, self.centers) + p_TL[..., self.link, :]


def _cells(size: Vector) -> tuple[Vector, float]:
    """Returns the cell centres of a box about the origin, and the radius of a cell's sphere."""
    counts = np.maximum(np.ceil(size / _CELL).astype(int), 1)
    axes = [(np.arange(n) + 0.5) / n * s - s / 2 for n, s in zip(counts, size, strict=True)]
    centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return centers, _ROUNDING * float(np.linalg.norm(size / counts)) / 2


def approximate_with_spheres(shape: Shape) -> tuple[Vector, Vector]:
    """Covers a shape with spheres.

    Args:
        shape: A Sphere, Capsule or Cylinder along z, or Box.

    Returns:
        Centres (S, 3) in the shape's frame and radii (S,) [m].
    """
    if isinstance(shape, Sphere):
        return np.zeros((1, 3)), np.array([shape.radius()])
    if isinstance(shape, Box):
        centers, radius = _cells(np.asarray(shape.size(), dtype=float))
        return centers, np.full(len(centers), radius)
    if isinstance(shape, Capsule | Cylinder):
        reach = shape.length() / 2
        radius = shape.radius()
        if isinstance(shape, Cylinder):
            # The end spheres protrude by a quarter of the radius; the rims by as much from them.
            reach = max(reach - 0.75 * radius, 0.0)
        # Spheres 0.6 radii apart leave dents of 5 % of the radius in the side.
        count = int(np.ceil(2 * reach / (0.6 * radius))) + 1
        z = np.linspace(-reach, reach, count) if count > 1 else np.zeros(1)
        return np.stack([0 * z, 0 * z, z], axis=1), np.full(len(z), radius)
    raise TypeError(f"no spheres for a collision shape of type {type(shape).__name__}")


def make_link_spheres(model: ControlModel, link_names: tuple[str, ...]) -> SphereModel:
    """Covers the collision shapes of some of Pepper's links with spheres."""
    plant, scene_graph = model.plant, model.diagram.scene_graph()
    links, centers, radii = [], [], []
    for number, name in enumerate(link_names):
        for solid in collision_solids(plant, scene_graph, plant.GetBodyByName(name).index()):
            X_LG = solid.X_FS
            p_G, r = approximate_with_spheres(solid.shape)
            centers.append((X_LG.rotation().matrix() @ p_G.T).T + X_LG.translation())
            radii.append(r)
            links.append(np.full(len(r), number))
    return SphereModel(
        link_names, np.concatenate(links), np.concatenate(centers), np.concatenate(radii)
    )
