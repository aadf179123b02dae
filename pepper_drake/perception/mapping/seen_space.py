"""Space as free, occupied or unknown, with the time of observation.

Unmeasured is not free: a place is free if an image saw through it, occupied if a surface was seen
there, and otherwise unknown. The images themselves are kept, a few for each view, so that free
space can be queried at any place with their full resolution.
"""

import enum
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.dmp.point_cells import nearest_distances
from pepper_drake.perception.mapping.dynamic_obstacles import DepthFrame, cluster_labels
from pepper_drake.perception.mapping.voxel_map import VoxelMap, VoxelMapParameters, one_per_voxel
from pepper_drake.short_repr import short_repr

Points = npt.NDArray[np.floating]


class SpaceState(enum.IntEnum):
    """State of a place: free, occupied or unknown."""

    UNKNOWN = 0
    FREE = 1
    OCCUPIED = 2


@dataclass(frozen=True, eq=False)
class SeenSpace:
    """Immutable map of observed space.

    Attributes:
        voxels: The occupied voxels.
        views: Images that determine free space, the newest last.
        parameters: Parameters of the voxel map, with the margins of free space.
    """

    voxels: VoxelMap
    views: tuple[DepthFrame, ...] = ()
    parameters: VoxelMapParameters = field(default_factory=VoxelMapParameters)

    __repr__ = short_repr

    def __deepcopy__(self, memo: dict) -> "SeenSpace":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self

    def with_view(self, view: DepthFrame, voxels: VoxelMap) -> "SeenSpace":
        """Returns the space after one more image.

        Of similar views only the newest few are kept: more than one, since each has other dropouts.

        Args:
            view: The image; one without pixels is ignored.
            voxels: The map, updated with the image.
        """
        if view.depth.size == 0:
            return replace(self, voxels=voxels)
        max_similar_views, most = self.parameters.max_similar_views, self.parameters.max_views
        alike = [one for one in self.views if view.is_like(one, self.parameters)]
        alike = alike[: max(len(alike) + 1 - max_similar_views, 0)]
        others = tuple(one for one in self.views if not any(one is old for old in alike))
        return replace(self, voxels=voxels, views=(*others, view)[-most:])

    def states(
        self, p_W: Points, time: float
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float64]]:
        """Returns the states of places.

        A place nearer to a seen surface than an image can resolve counts as occupied.

        Args:
            p_W: Places (N, 3) in W [m].
            time: Present time [s].

        Returns:
            `SpaceState` of each (N,), and the time since that was seen (N,) [s], infinite where
            unknown.
        """
        p_W = np.asarray(p_W, dtype=float).reshape(-1, 3)
        age = self._free_age(p_W, time, np.inf)
        state = np.where(np.isfinite(age), SpaceState.FREE, SpaceState.UNKNOWN).astype(np.uint8)
        distance, nearest = self.voxels.tree.query(p_W, distance_upper_bound=self._reach)
        near = np.isfinite(distance)
        state[near] = SpaceState.OCCUPIED
        age[near] = time - self.voxels.hit_times[np.asarray(nearest)[near]]
        return state, age

    def unseen(self, p_W: Points, time: float, *, oldest: float | Points) -> npt.NDArray[np.bool_]:
        """Tells which places were not seen recently: unknown, or free but seen too long ago.

        Occupied places count as seen, however long ago: obstacles are remembered.

        Args:
            p_W: Places (N, 3) in W [m].
            time: Present time [s].
            oldest: Largest age at which a free place counts as seen [s]; a scalar or (N,).
        """
        places = np.array(p_W, dtype=float).reshape(-1, 3)
        age = self._free_age(places, time, float(np.max(oldest, initial=-np.inf)))
        unseen = np.asarray((age > oldest) | np.isinf(age))
        left = np.flatnonzero(unseen)
        distance = nearest_distances(places[left], self.voxels.cells, self._reach)
        unseen[left[np.isfinite(distance)]] = False
        return unseen

    def hidden_below(self, p_W: Points, spacing: float) -> Points:
        """Returns unknown places (K, 3) below seen ones (N, 3), in W, down to the floor [m].

        Of an object standing on the floor, a camera above and near sees only the upper part. The
        places end above the first free or occupied place.

        Args:
            p_W: Seen places [m].
            spacing: Spacing of places, also of the seen ones used [m].
        """
        p_W = np.asarray(p_W, dtype=float).reshape(-1, 3)
        below = p_W[one_per_voxel(p_W, spacing)]
        # Nearer places count as occupied by the seen place itself.
        below = below - [0.0, 0.0, self.parameters.voxel_size + self.parameters.carve_margin]
        hidden = []
        while len(below := below[below[:, 2] > 0.0]):
            below = below[self.unseen(below, 0.0, oldest=np.inf)]
            hidden.append(below)
            below = below - [0.0, 0.0, spacing]
        return np.concatenate(hidden) if hidden else np.zeros((0, 3))

    def hanging(
        self, p_W: Points, gap: float, above: float, least: int, share: float
    ) -> npt.NDArray[np.bool_]:
        """Tells which seen places (N, 3) are on objects hanging in the air, such as an arm.

        Only such objects move by themselves. Some of the space below their lowest visible part was
        seen to be free, the rest may be hidden; objects standing on a table do not count, nor those
        all of whose lower part is hidden.

        Args:
            p_W: Seen places [m].
            gap: Largest distance of neighbouring points of one object [m].
            above: Height of the free space below the lowest part [m].
            least: Smallest number of points of an object.
            share: Least share of the space below the lowest part that was seen to be free.
        """
        p_W = np.asarray(p_W, dtype=float).reshape(-1, 3)
        if not len(p_W):
            return np.zeros(0, dtype=bool)
        labels = cluster_labels(p_W, gap)
        sizes = np.bincount(labels)
        bottom = np.full(len(sizes), np.inf)
        np.minimum.at(bottom, labels, p_W[:, 2])
        lowest = (sizes[labels] >= least) & (p_W[:, 2] < bottom[labels] + gap)
        state, _ = self.states(p_W[lowest] - [0.0, 0.0, above], 0.0)
        free = np.bincount(labels[lowest], state == SpaceState.FREE, len(sizes))
        of_lowest = np.bincount(labels[lowest], minlength=len(sizes))
        hangs = free > share * of_lowest
        return np.asarray(hangs[labels])

    def end_hidden(self, p_W: Points, gap: float, beyond: float) -> npt.NDArray[np.bool_]:
        """Tells which seen places (N, 3) are on objects that may reach farther than it is seen.

        An object that slides along its longest axis shows that only at its ends. The space beyond
        one of them was not seen to be free.

        Args:
            p_W: Seen places [m].
            gap: Largest distance of neighbouring points of one object [m].
            beyond: How far beyond an end the space has to be free [m].
        """
        p_W = np.asarray(p_W, dtype=float).reshape(-1, 3)
        if not len(p_W):
            return np.zeros(0, dtype=bool)
        labels = cluster_labels(p_W, gap)
        ends = np.concatenate([_beyond_ends(p_W[labels == k], beyond) for k in np.unique(labels)])
        state, _ = self.states(ends, 0.0)
        hidden = (state != SpaceState.FREE).reshape(-1, 2).any(axis=1)
        return np.asarray(hidden[labels])

    def _free_age(self, p_W: Points, time: float, longest: float) -> npt.NDArray[np.float64]:
        """Returns the time (N,) since images up to an age `longest` saw places (N, 3) free [s]."""
        age = np.full(len(p_W), np.inf)
        left = np.arange(len(p_W))
        for view in reversed(self.views):
            if len(left) and time - view.time <= longest:
                free = view.sees_free_space(p_W, self.parameters)
                if free.any():
                    age[left[free]] = time - view.time
                    left, p_W = left[~free], p_W.compress(~free, axis=0)
        return age

    @property
    def _reach(self) -> float:
        """Distance from a voxel within which places count as occupied [m]."""
        return self.parameters.voxel_size + self.parameters.carve_margin


def _beyond_ends(points: Points, beyond: float) -> Points:
    """Returns the places (2, 3) beyond both ends of points (N, 3) along their longest axis [m]."""
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    along = (points - middle) @ axis
    ends = []
    for end, sign in ((along.min(), -1.0), (along.max(), 1.0)):
        tip = points[np.abs(along - end) <= beyond].mean(axis=0)
        tip = tip + (end - (tip - middle) @ axis) * axis
        ends.append(tip + sign * beyond * axis)
    return np.array(ends)


def describe_place(p_T: Points) -> str:
    """Describes a place in words, relative to the robot.

    Args:
        p_T: The place (3,) in the torso frame (x ahead, y to the left, z up) [m].

    Returns:
        Such as "0.42 m ahead, 0.10 m to the right, 0.05 m below the torso's middle".
    """
    x, y, z = (float(value) for value in np.asarray(p_T))
    along = f"{abs(x):.2f} m {'ahead' if x >= 0 else 'behind'}"
    aside = f"{abs(y):.2f} m to the {'left' if y >= 0 else 'right'}"
    up = f"{abs(z):.2f} m {'above' if z >= 0 else 'below'} the torso's middle"
    return f"{along}, {aside}, {up}"
