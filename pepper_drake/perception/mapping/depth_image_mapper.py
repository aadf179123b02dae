"""Updates the memory of obstacles with a depth image, or skips an invalid one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Cylinder
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.mapping.cloud import depth_in_metres, to_point_cloud
from pepper_drake.perception.mapping.depth_scale import depth_scale
from pepper_drake.perception.mapping.depth_validity import (
    DepthFault,
    ValidityParameters,
    depth_fault,
    image_fault,
)
from pepper_drake.perception.mapping.dynamic_obstacle_tracker import (
    DynamicObstacleTracker,
    reset_while_driving,
    update_tracker,
    without_object,
)
from pepper_drake.perception.mapping.dynamic_obstacles import DepthFrame
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters, update_obstacles
from pepper_drake.perception.mapping.obstacle_memory import ObstacleMemory
from pepper_drake.perception.mapping.solids import ExcludedSolids, RobotSolids, Solid

_POSES = 5
"""Number of interpolated poses of the goal object between two sightings."""


@dataclass(frozen=True)
class DepthImage:
    """A depth image with the state at its capture time.

    Attributes:
        pixels: (height, width) depth [mm], uint16.
        stamp: Capture time [s].
        X_WC: The camera's pose.
        X_WO: The goal object's pose; None while it is not seen.
        object_speed: The goal object's speed [m/s].
        position: The robot's joints; None if unknown.
        drives: True while the robot drives.
    """

    pixels: npt.NDArray[np.uint16]
    stamp: float
    X_WC: RigidTransform
    X_WO: RigidTransform | None = None
    object_speed: float = 0.0
    position: npt.NDArray[np.float64] | None = None
    drives: bool = False


@dataclass(frozen=True)
class DepthImageMapper:
    """Updates a memory of obstacles with depth images.

    Attributes:
        intrinsics: The depth camera.
        parameters: Detection and memory of obstacles.
        robot: The robot's collision shapes, which are removed; None removes nothing.
        object_solids: Shapes of the goal object, which are removed.
    """

    intrinsics: CameraIntrinsics
    parameters: ObstacleParameters
    robot: RobotSolids | None = None
    object_solids: Sequence[Solid] = ()

    def with_image(self, memory: ObstacleMemory, image: DepthImage) -> ObstacleMemory:
        """Returns the memory after an image; after an invalid one, only the fault is new."""
        fault = image_fault(
            image.pixels,
            memory.image,
            self.intrinsics,
            moved=has_moved(memory.X_WC, image.X_WC, self.parameters.validity),
            parameters=self.parameters.validity,
        )
        received = replace(
            memory, stamp=image.stamp, image=image.pixels.copy(), X_WC=image.X_WC, fault=fault
        )
        if fault != DepthFault.NONE:
            return received
        try:
            depth = depth_in_metres(image.pixels, self.intrinsics)
        except InputError:
            return replace(received, fault=DepthFault.WRONG_UNIT)
        known, validity = memory.settled_points(self.parameters.memory), self.parameters.validity
        fault = depth_fault(depth, image.X_WC, known, self.intrinsics, validity)
        if fault == DepthFault.NONE and abs(self._scale(depth, image) - 1.0) > validity.scale_error:
            fault = DepthFault.WRONG_SCALE
        if fault != DepthFault.NONE:
            return replace(received, fault=fault)
        view = DepthFrame(
            depth, image.X_WC, image.stamp, self.intrinsics, self.parameters.approach.pointing_error
        )
        return self._with_view(received, image, view)

    def _scale(self, depth: npt.NDArray[np.float32], image: DepthImage) -> float:
        """Returns measured depths as a multiple of what the goal object's marker says."""
        if image.X_WO is None or not self.object_solids:
            return np.nan
        robot = self._excluded(image, None)
        return depth_scale(
            depth,
            self.intrinsics,
            image.X_WC,
            image.X_WO,
            self.object_solids,
            robot[0].placed if robot else None,
            robot_margin=self.parameters.cloud.robot_margin,
            spread=self.parameters.validity.scale_error_spread,
        )

    def _with_view(
        self, memory: ObstacleMemory, image: DepthImage, view: DepthFrame
    ) -> ObstacleMemory:
        X_WO = memory.X_WO if image.X_WO is None else image.X_WO
        excluded = self._excluded(image, X_WO)
        voxels = update_obstacles(
            memory.voxels,
            image.pixels,
            view.time,
            view.X_WC,
            self.intrinsics,
            excluded,
            self.parameters,
            None if X_WO is None else X_WO.translation(),
        )
        if image.drives:
            tracker = reset_while_driving(memory.tracker, view, self.parameters)
        else:
            # The goal object stands on the table: its height is the table's.
            table = -np.inf if X_WO is None else float(X_WO.translation()[2])
            occluding = [*excluded, *self._support(X_WO)]
            tracker, voxels = update_tracker(
                self._without_object(memory, X_WO), voxels, view, occluding, self.parameters, table
            )
        surface = voxels.surface()
        return replace(
            memory,
            voxels=voxels,
            time=view.time,
            X_WO=X_WO,
            surface=surface,
            cloud=to_point_cloud(surface),
            tracker=tracker,
            space=memory.space.with_view(view, voxels),
        )

    def _without_object(
        self, memory: ObstacleMemory, X_WO: RigidTransform | None
    ) -> DynamicObstacleTracker:
        """Returns the tracker without the goal object if that has moved."""
        before, solids = memory.X_WO, self.object_solids
        if before is None or X_WO is None or not solids:
            return memory.tracker
        if not has_moved(before, X_WO, self.parameters.validity):
            return memory.tracker
        step = X_WO.translation() - before.translation()
        poses = [
            RigidTransform(X_WO.rotation(), before.translation() + share * step)
            for share in np.linspace(0.0, 1.0, _POSES)
        ]
        return without_object(memory.tracker, solids, poses, self.parameters)

    def _excluded(self, image: DepthImage, X_WO: RigidTransform | None) -> list[ExcludedSolids]:
        """Returns the robot and the goal object at the image's capture time."""
        excluded = []
        cloud = self.parameters.cloud
        if self.robot is not None and image.position is not None:
            poses = self.robot.poses(image.position)
            excluded.append(
                ExcludedSolids(self.robot.solids, poses, cloud.robot_margin, keep_known_voxels=True)
            )
        if X_WO is not None and self.object_solids:
            margin = cloud.object_margin + min(
                cloud.object_lag * image.object_speed, cloud.largest_object_lag
            )
            poses = [X_WO] * len(self.object_solids)
            excluded.append(ExcludedSolids(self.object_solids, poses, margin))
        return excluded

    def _support(self, X_WO: RigidTransform | None) -> list[ExcludedSolids]:
        """Returns the goal object's support, which leaves a hole if too near to be measured."""
        if X_WO is None or not self.object_solids:
            return []
        near_field = self.parameters.near_field
        radius = max(solid.width for solid in self.object_solids) + near_field.support_rim
        thickness = near_field.support_thickness
        disc = Solid(Cylinder(radius, thickness), RigidTransform([0.0, 0.0, -0.5 * thickness]))
        return [ExcludedSolids([disc], [X_WO], near_field.on_table)]


def has_moved(X_WF: RigidTransform, X_WG: RigidTransform, parameters: ValidityParameters) -> bool:
    """Tells whether two poses of a frame differ by more than the noise of measured joints."""
    moved = X_WF.InvertAndCompose(X_WG)
    distance = float(np.linalg.norm(moved.translation()))
    angle = abs(moved.rotation().ToAngleAxis().angle())
    return distance > parameters.moved or angle > parameters.turned
