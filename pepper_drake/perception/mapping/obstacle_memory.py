"""Memory of the depth images used so far: voxels, clouds, moving obstacles."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud

from pepper_drake.perception.mapping.cloud import SurfacePoints, to_point_cloud
from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.perception.mapping.dynamic_obstacle_tracker import DynamicObstacleTracker
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.voxel_map import VoxelMap, VoxelMapParameters


@dataclass(frozen=True)
class ObstacleMemory:
    """Immutable state of the `DepthPointCloudSource`.

    Attributes:
        voxels: The voxel map.
        time: Time stamp of the last image used [s].
        stamp: Time stamp of the last image received [s].
        image: That image.
        X_WC: The camera's pose for it.
        fault: Reason why it was not used.
        X_WO: The goal object's last known pose.
        surface: The map's points.
        cloud: The same as a PointCloud in W.
        X_WT: The torso's pose, for the cloud in T.
        tracker: Tracker of moving obstacles.
        space: Free, occupied and unknown space.
    """

    voxels: VoxelMap
    time: float
    stamp: float
    image: npt.NDArray[np.uint16]
    X_WC: RigidTransform
    fault: DepthFault
    X_WO: RigidTransform | None
    surface: SurfacePoints
    cloud: PointCloud
    X_WT: RigidTransform
    tracker: DynamicObstacleTracker
    space: SeenSpace

    @classmethod
    def empty(cls, parameters: VoxelMapParameters) -> "ObstacleMemory":
        """Returns the memory before the first image."""
        voxels = VoxelMap.empty()
        surface = voxels.surface()
        return cls(
            voxels=voxels,
            time=-np.inf,
            stamp=-np.inf,
            image=np.zeros((0, 0), np.uint16),
            X_WC=RigidTransform(),
            fault=DepthFault.MISSING,
            X_WO=None,
            surface=surface,
            cloud=to_point_cloud(surface),
            X_WT=RigidTransform(),
            tracker=DynamicObstacleTracker(),
            space=SeenSpace(voxels, parameters=parameters),
        )

    def settled_points(self, parameters: VoxelMapParameters) -> npt.NDArray[np.float32]:
        """Returns the points (P, 3) of static surfaces that were seen often, in W [m]."""
        settled = self.voxels.scores >= parameters.settled_score
        if len(self.tracker.transient_keys):
            settled &= ~np.isin(self.voxels.keys, self.tracker.transient_keys)
        return self.voxels.positions[settled]

    def __deepcopy__(self, memo: dict) -> "ObstacleMemory":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self
