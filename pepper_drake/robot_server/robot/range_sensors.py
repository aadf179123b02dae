"""Sonars and lasers of the base: rays cast against the scene.

Positions are those of Pepper's description (ROS `pepper_description`), rates and cones the maker's.
A laser has 15 rays over 60 degrees, given as hit points in the sensor's frame, from left to right.
A ray without a hit ends beyond the laser's range, which is assumed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import (
    Box,
    Cylinder,
    GeometryId,
    QueryObject,
    Role,
    SceneGraphInspector,
    Sphere,
)
from pydrake.math import RigidTransform

from pepper_drake.robot_server.robot.floor_map import LaserScan, transformed

Vector = npt.NDArray[np.float64]

PERIOD = 0.16
"""Time between two scans [s]."""

_LASERS = {"Front": (0.0562, 0.0, 0.0), "Left": (-0.018, 0.0899, 1.757),
           "Right": (-0.018, -0.0899, -1.757)}  # fmt: skip
"""Position x, y [m] and direction [rad] of each laser in the base."""
_LASER_HEIGHT = 0.0333
_LASER_RAYS = 15
_LASER_CONE = math.radians(60.0)
_LASER_FAR = 5.0

_SONARS = {"Front": (0.0687, 0.0, 0.0), "Back": (-0.0587, 0.0, math.pi)}
_SONAR_HEIGHT = 0.2336
_SONAR_CONE = math.radians(60.0)
_SONAR_RAYS = 13
_SONAR_RANGE = (0.3, 5.0)

_SEGMENTS = [
    f"Platform/LaserSensor/{side}/Horizontal/Seg{number:02d}/{axis}"
    for side in _LASERS
    for number in range(1, _LASER_RAYS + 1)
    for axis in "XY"
]
MEASURED: tuple[str, ...] = (*_SEGMENTS, *(f"Platform/{side}/Sonar" for side in _SONARS))
"""Devices whose distances are measured, in the order of `RangeSensors.measure`."""


@dataclass(frozen=True)
class _Solid:
    """A solid in its own frame G: a box unless it has a radius.

    Attributes:
        half_size: Half of its extent along x, y, z of G [m].
        round_axes: Number of axes of its round cross-section: 3 for a sphere, 2 for a cylinder
            along z.
        X_GS: Pose of the frame of the extent.
    """

    half_size: Vector
    round_axes: int
    X_GS: RigidTransform


class RangeSensors:
    """Distances to everything that is not Pepper."""

    def __init__(self, inspector: SceneGraphInspector, robot: set[GeometryId]) -> None:
        """Looks up the solids of the scene.

        Args:
            inspector: Of the scene.
            robot: Pepper's own geometries.
        """
        self._solids = {
            geometry: _solid(inspector, geometry)
            for geometry in inspector.GetAllGeometryIds(Role.kProximity)
            if geometry not in robot and _has_surface(inspector, geometry)
        }
        fan = np.linspace(_LASER_CONE / 2, -_LASER_CONE / 2, _LASER_RAYS)
        cone = np.linspace(_SONAR_CONE / 2, -_SONAR_CONE / 2, _SONAR_RAYS)
        rays = [(*place, _LASER_HEIGHT, angle) for place in _LASERS.values() for angle in fan]
        rays += [(*place, _SONAR_HEIGHT, angle) for place in _SONARS.values() for angle in cone]
        x, y, yaw, z, angle = np.array(rays).T
        self._fan = fan
        self._p_BR = np.stack([x, y, z], axis=1)
        self._angles = yaw + angle

    def measure(self, query: QueryObject, base_pose: Vector) -> Vector:
        """Returns the values of `MEASURED` [m].

        Args:
            query: Of the scene's current state.
            base_pose: x, y [m] and yaw [rad] of the base in the world.
        """
        x, y, yaw = base_pose
        c, s = math.cos(yaw), math.sin(yaw)
        R_WB = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        p_WR = self._p_BR @ R_WB.T + (x, y, 0.0)
        angles = self._angles + yaw
        d_W = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
        distances = np.full(len(angles), np.inf)
        for geometry, solid in self._solids.items():
            X_SW = (query.GetPoseInWorld(geometry) @ solid.X_GS).inverse()
            R_SW = X_SW.rotation().matrix()
            origins = p_WR @ R_SW.T + X_SW.translation()
            np.minimum(distances, cast_rays(origins, d_W @ R_SW.T, solid), out=distances)
        beams = len(_LASERS) * _LASER_RAYS
        far = np.minimum(distances[:beams], _LASER_FAR).reshape(len(_LASERS), _LASER_RAYS)
        places = np.stack([far * np.cos(self._fan), far * np.sin(self._fan)], axis=2)
        echoes = distances[beams:].reshape(len(_SONARS), _SONAR_RAYS).min(axis=1)
        return np.concatenate([places.ravel(), np.clip(echoes, *_SONAR_RANGE)])


def laser_scan(ranges: Mapping[str, float]) -> LaserScan | None:
    """Returns the lasers' scan from the values by name, or None without measurements."""
    if any(name not in ranges for name in _SEGMENTS):
        return None
    places = np.array([ranges[name] for name in _SEGMENTS]).reshape(-1, _LASER_RAYS, 2)
    mounts = np.array(list(_LASERS.values()))
    ends = [transformed(mount, rays) for mount, rays in zip(mounts, places, strict=True)]
    starts = np.repeat(mounts[:, :2], _LASER_RAYS, axis=0)
    hits = np.linalg.norm(places, axis=2).ravel() < _LASER_FAR - 1e-3
    return LaserScan(starts, np.concatenate(ends), hits)


def cast_rays(origins: Vector, directions: Vector, solid: _Solid) -> Vector:
    """Returns the distance of each ray to a solid [m], infinite without a hit.

    A ray is inside the solid between its largest entry and its smallest exit distance of the
    bounding slabs and the round cross-section.

    Args:
        origins: In the solid's frame (N, 3) [m].
        directions: Of length 1 (N, 3).
        solid: The solid.
    """
    enters = np.full(len(origins), -np.inf)
    leaves = np.full(len(origins), np.inf)
    if solid.round_axes:
        across = slice(0, solid.round_axes)
        o, d = origins[:, across], directions[:, across]
        a = (d * d).sum(axis=1)
        b = (o * d).sum(axis=1)
        c = (o * o).sum(axis=1) - solid.half_size[0] ** 2
        inside = b * b - a * c
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(np.maximum(inside, 0.0))
            hits = (inside > 0.0) & (a > 0.0)
            enters = np.where(hits, (-b - root) / a, np.where(c < 0.0, -np.inf, np.inf))
            leaves = np.where(hits, (-b + root) / a, np.where(c < 0.0, np.inf, -np.inf))
    for axis in range(solid.round_axes, 3):
        o, d, h = origins[:, axis], directions[:, axis], solid.half_size[axis]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            first, second = (-h - o) / d, (h - o) / d
        within = np.abs(o) < h
        parallel = d == 0.0
        near = np.where(parallel, np.where(within, -np.inf, np.inf), np.minimum(first, second))
        far = np.where(parallel, np.where(within, np.inf, -np.inf), np.maximum(first, second))
        enters, leaves = np.maximum(enters, near), np.minimum(leaves, far)
    return np.where((enters < leaves) & (leaves > 0.0), np.maximum(enters, 0.0), np.inf)


def _has_surface(inspector: SceneGraphInspector, geometry: GeometryId) -> bool:
    """Returns whether a ray can hit a geometry: not the floor, a half space below all rays."""
    shape = inspector.GetShape(geometry)
    return isinstance(shape, Box | Cylinder | Sphere) or (
        inspector.GetObbInGeometryFrame(geometry) is not None
    )


def _solid(inspector: SceneGraphInspector, geometry: GeometryId) -> _Solid:
    shape = inspector.GetShape(geometry)
    if isinstance(shape, Sphere):
        return _Solid(np.full(3, shape.radius()), 3, RigidTransform())
    if isinstance(shape, Cylinder):
        half = np.array([shape.radius(), shape.radius(), shape.length() / 2])
        return _Solid(half, 2, RigidTransform())
    if isinstance(shape, Box):
        return _Solid(np.array(shape.size()) / 2, 0, RigidTransform())
    # A mesh is its bounding box.
    box = inspector.GetObbInGeometryFrame(geometry)
    return _Solid(np.array(box.half_width()), 0, box.pose())
