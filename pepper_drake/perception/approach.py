"""What has come to where nothing was: how it moves, and where it will be soon.

A cloud is old when it is acted upon: by the network, the period between images and the time that
an arm needs to brake. What moves at 0.3 m/s is by then a decimetre farther on. So what an image
shows where the one before it looked through is followed from image to image, and thought on along
its way. Near the robot a depth camera is blind: what is lost from sight there is supposed to be
there for a while.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pepper_drake.perception.camera import CameraIntrinsics
from pepper_drake.perception.voxel_map import VoxelMapParameters, looks_through, voxel_keys

Points = npt.NDArray[np.floating]


@dataclass(frozen=True)
class ApproachParameters:
    """How what moves is followed.

    Attributes:
        spacing: Of the points that are kept of it, m.
        gap: Points of one thing have neighbours nearer than this, m.
        least_points: Fewer are noise.
        fastest: Nothing is thought to be faster, m/s.
        horizon: How far its motion is thought on from the image, s: the age at which the image is
            acted upon, the period, and the time in which an arm brakes.
        memory: How long what was lost from sight is supposed to be there, s.
        visit: How long what came is supposed to be where it is not seen any more, s.
        contradicted: With this share of where it was seen to be empty, a thing has gone.
    """

    spacing: float = 0.025
    gap: float = 0.05
    least_points: int = 5
    fastest: float = 0.5
    horizon: float = 0.7
    memory: float = 6.0
    visit: float = 8.0
    contradicted: float = 0.7


@dataclass(frozen=True, eq=False)
class Approaching:
    """The front of something that moves.

    Attributes:
        points: (N, 3) where it came between two images, in W, m.
        velocity: (3,) m/s; zero until it is known.
        seen: When it was seen last, s.
    """

    points: Points
    velocity: npt.NDArray[np.float64]
    seen: float

    def moved(self, duration: float) -> Points:
        """Where its front (N, 3) is a duration [s] later, at the same velocity."""
        return self.points + (duration * self.velocity).astype(self.points.dtype)


@dataclass(frozen=True, eq=False)
class DepthView:
    """A depth image with where it was taken.

    Attributes:
        depth: (height, width), m, 0 where nothing was measured.
        X_WC: The camera's pose.
        time: s.
    """

    depth: npt.NDArray[np.float32]
    X_WC: RigidTransform
    time: float


def follow(
    things: Sequence[Approaching],
    come: Points,
    now: DepthView,
    intrinsics: CameraIntrinsics,
    memory: VoxelMapParameters,
    parameters: ApproachParameters,
) -> tuple[Approaching, ...]:
    """Takes one image into what is known of things that move.

    Args:
        things: What was known before.
        come: (P, 3) what the image shows where the one before it looked through, in W, m.
        now: The image.
        intrinsics: The camera.
        memory: Margins at which an image counts as looking through a place.
        parameters: How things are followed.

    Returns:
        What is known now.
    """
    fronts = _clusters(_thinned(come, 0.5 * parameters.spacing), parameters)
    left = list(things)
    known = []
    for front in fronts:
        velocity = np.zeros(3)
        k = _same(front, left, now.time, parameters)
        if k is not None:
            thing = left.pop(k)
            step = front.mean(axis=0) - thing.points.mean(axis=0)
            velocity = step.astype(float) / (now.time - thing.seen)
            if thing.velocity.any():
                velocity = 0.5 * (velocity + thing.velocity)
        known.append(Approaching(front, velocity, now.time))
    for thing in left:
        empty = looks_through(thing.points, now.depth, intrinsics, now.X_WC, memory)
        lost = now.time - thing.seen
        if lost <= parameters.memory and empty.mean() < parameters.contradicted:
            known.append(thing)
    return tuple(known)


def expected(
    things: Sequence[Approaching],
    veil: Points,
    now: DepthView,
    intrinsics: CameraIntrinsics,
    memory: VoxelMapParameters,
    parameters: ApproachParameters,
) -> npt.NDArray[np.float64]:
    """Points (Q, 3) at which things that move may be soon, in W, m.

    What the last image sees to be empty is still to be come to by what was seen in that image; what
    was lost from sight before is not there.

    Args:
        things: That move.
        veil: (P, 3) where something too near to be measured may be now, m.
        now: The last image.
        intrinsics: The camera.
        memory: Margins at which an image counts as looking through a place.
        parameters: How far motion is thought on.
    """
    ways: list[Points] = [veil]
    for thing in things:
        lost = now.time - thing.seen
        end = min(lost, parameters.horizon) + parameters.horizon
        length = float(np.linalg.norm(thing.velocity)) * end
        steps = np.linspace(0.0, end, int(np.ceil(length / parameters.spacing)) + 1)
        way = _thinned(np.concatenate([thing.moved(step) for step in steps]), parameters.spacing)
        if lost > 0.0:
            way = way[~looks_through(way, now.depth, intrinsics, now.X_WC, memory)]
        ways.append(way)
    return _thinned(np.concatenate(ways), parameters.spacing).astype(float)


def _same(
    front: Points, things: Sequence[Approaching], time: float, parameters: ApproachParameters
) -> int | None:
    """Which of the things a front belongs to: the nearest to where it should be, if one is near."""
    middle = front.mean(axis=0)
    best, least = None, np.inf
    for number, thing in enumerate(things):
        age = time - thing.seen
        off = float(np.linalg.norm(thing.moved(age).mean(axis=0) - middle))
        moved = float(np.linalg.norm(thing.points.mean(axis=0) - middle))
        if off < least and moved <= parameters.fastest * age + parameters.gap:
            best, least = number, off
    return best


def _thinned(points: Points, spacing: float) -> Points:
    """One point of each voxel of that size."""
    return points[np.unique(voxel_keys(points, spacing), return_index=True)[1]]


def _clusters(points: Points, parameters: ApproachParameters) -> list[Points]:
    """The things that points belong to, without those of too few."""
    if len(points) < parameters.least_points:
        return []
    one, other = cKDTree(points).query_pairs(parameters.gap, output_type="ndarray").T
    near = coo_array((np.ones(len(one), np.int8), (one, other)), (len(points), len(points)))
    labels = connected_components(near, directed=False)[1]
    sizes = np.bincount(labels)
    return [points[labels == k] for k in np.flatnonzero(sizes >= parameters.least_points)]
