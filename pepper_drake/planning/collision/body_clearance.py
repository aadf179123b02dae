"""Clearance of the robot's body to the obstacle cloud for any base pose."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.learning.dmp.point_cells import minimum_gaps
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel
from pepper_drake.planning.collision.sphere_model import arm_link_names, make_link_spheres

Vector = npt.NDArray[np.float64]


def body_links(model: ControlModel, without_arm: str | None = None) -> tuple[str, ...]:
    """Returns the names of Pepper's links, without those of one arm if given: "left" or "right"."""
    names = {
        model.plant.get_body(index).name()
        for index in model.plant.GetBodyIndices(model.model_instance)
    }
    left_out = set() if without_arm is None else set(arm_link_names(without_arm))
    return tuple(sorted(names - left_out))


class BodyClearance:
    """Distances of some of Pepper's links, as spheres, to a cloud.

    Args:
        model: Pepper.
        links: Names of the links.
    """

    def __init__(self, model: ControlModel, links: Sequence[str]) -> None:
        self._model = model
        self._spheres = make_link_spheres(model, tuple(links))
        self._frames = [model.plant.GetFrameByName(name) for name in self._spheres.link_names]
        self._context = model.create_context()
        self._cached_centers = lru_cache(maxsize=4)(self._centers)

    @property
    def radii(self) -> Vector:
        """Radii (S,) of the spheres [m]."""
        return self._spheres.radii

    def centers(self, joint_position: Vector) -> Vector:
        """Returns sphere centres (S, 3) in the base frame B for `BODY_JOINTS` angles (15,) [m].

        The array is cached and read-only.
        """
        return self._cached_centers(np.asarray(joint_position, dtype=float).tobytes())

    def _centers(self, joints: bytes) -> Vector:
        context = self._context.Clone()
        positions = self._model.positions(np.frombuffer(joints), np.zeros(3))
        self._model.plant.SetPositions(context, positions)
        poses = [frame.CalcPoseInWorld(context) for frame in self._frames]
        centers = self._spheres.place(
            np.array([X.rotation().matrix() for X in poses]),
            np.array([X.translation() for X in poses]),
        )
        centers.setflags(write=False)
        return centers

    def solid_points(self, joint_position: Vector, spacing: float) -> Vector:
        """Returns the points (N, 3) of a grid in the base frame B that are inside the links [m].

        Args:
            joint_position: The joints (15,) [rad].
            spacing: Grid spacing [m].
        """
        centers, radii = self.centers(joint_position), self.radii
        lower = (centers - radii[:, None]).min(axis=0)
        upper = (centers + radii[:, None]).max(axis=0)
        axes = [np.arange(*span, spacing) for span in zip(lower, upper, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        within = cKDTree(grid).query_ball_point(centers, radii)
        return np.asarray(grid[np.unique(np.concatenate(within).astype(int))])

    def __call__(
        self,
        base_poses: Vector,
        joint_position: Vector,
        field: PointCloudDistance,
        within: float = np.inf,
    ) -> Vector:
        """Returns the least distance (N,) [m] of the links to obstacles.

        Args:
            base_poses: x, y [m], yaw [rad] of the base in W (N, 3).
            joint_position: The joints (15,) [rad].
            field: The obstacles, in W.
            within: Larger distances are returned as infinite, which is much faster [m].

        Raises:
            ValueError: A pose or a joint is not finite.
        """
        if not (np.isfinite(base_poses).all() and np.isfinite(joint_position).all()):
            raise ValueError("base poses and joints must be finite")
        p_W = at_base_poses(self.centers(joint_position), base_poses)
        return minimum_gaps(p_W, self._spheres.radii, field.cells, within)


def at_base_poses(p_B: Vector, base_poses: Vector) -> Vector:
    """Returns points (S, 3) of the base frame B in W (N, S, 3) [m], for base poses (N, 3)."""
    cos, sin = np.cos(base_poses[:, 2, None]), np.sin(base_poses[:, 2, None])
    return np.stack(
        (
            base_poses[:, 0, None] + cos * p_B[:, 0] - sin * p_B[:, 1],
            base_poses[:, 1, None] + sin * p_B[:, 0] + cos * p_B[:, 1],
            np.broadcast_to(p_B[:, 2], (len(base_poses), len(p_B))),
        ),
        axis=-1,
    )


def drive_poses(start: Vector, goal: Vector, spacing: float = 0.03) -> Vector:
    """Returns base poses (N, 3) on the straight drive from one to another, turning evenly.

    Args:
        start: x, y [m], yaw [rad].
        goal: The same.
        spacing: Largest distance [m], or third of the angle [rad], between successive poses.
    """
    change = goal - start
    change[2] = (change[2] + np.pi) % (2.0 * np.pi) - np.pi
    length = max(float(np.hypot(change[0], change[1])), abs(float(change[2])) / 3.0)
    shares = np.linspace(0.0, 1.0, 2 + int(length / spacing))
    return start + shares[:, None] * change
