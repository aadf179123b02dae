"""Obstacle map, updated with each depth image."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.mapping.cloud import (
    CloudParameters,
    depth_in_metres,
    observe_surfaces,
    remove_solids,
)
from pepper_drake.perception.mapping.depth_holes import HoleParameters
from pepper_drake.perception.mapping.depth_validity import (
    FAULT_SENTENCES,
    DepthFault,
    ValidityParameters,
    lies_below_floor,
)
from pepper_drake.perception.mapping.dynamic_obstacles import ApproachParameters
from pepper_drake.perception.mapping.near_field_occlusion import NearFieldParameters
from pepper_drake.perception.mapping.solids import ExcludedSolids
from pepper_drake.perception.mapping.voxel_map import (
    VoxelMap,
    VoxelMapParameters,
    add_points,
    carve_free_space,
    prune,
)
from pepper_drake.short_repr import short_repr, short_signature


@dataclass(unsafe_hash=True)
class ObstacleParameters:
    """Parameters of the obstacle map.

    Attributes:
        cloud: Points from a depth image.
        memory: Memory of voxels and views.
        approach: Tracking of moving obstacles.
        validity: Checks of depth images.
        near_field: Obstacles inside the camera's near limit.
        holes: Explanation of holes by the sensor or the surface.
        treat_holes_as_near: Whether unexplained holes mean obstacles too near to be measured;
            otherwise holes are ignored.
        projector_baseline: Distance of the camera from its pattern projector [m]; 0 without one.
    """

    cloud: CloudParameters = field(default_factory=CloudParameters)
    memory: VoxelMapParameters = field(default_factory=VoxelMapParameters)
    approach: ApproachParameters = field(default_factory=ApproachParameters)
    validity: ValidityParameters = field(default_factory=ValidityParameters)
    near_field: NearFieldParameters = field(default_factory=NearFieldParameters)
    holes: HoleParameters = field(default_factory=HoleParameters)
    treat_holes_as_near: bool = True
    projector_baseline: float = 0.075

    __repr__ = short_repr
    __signature__ = short_signature


def update_obstacles(
    voxels: "VoxelMap",
    image: "npt.NDArray[np.generic]",
    time: "float",
    X_WC: "RigidTransform",
    intrinsics: "CameraIntrinsics",
    ignored: "Sequence[ExcludedSolids]",
    parameters: "ObstacleParameters",
    p_WO: "npt.NDArray[np.floating] | None" = None,
) -> "VoxelMap":
    """Updates the map with one depth image.

    Args:
        voxels: The previous map.
        image: Depth image, see `depth_in_metres`; one without any measurement changes nothing.
        time: Capture time [s].
        X_WC: The camera's pose at that time.
        intrinsics: The camera.
        ignored: Solids that are no obstacles, at that time.
        parameters: Detection and memory of obstacles.
        p_WO: The goal object's position (3,), around which voxels are small [m]; None if unknown.

    Returns:
        The new map.

    Raises:
        InputError: If the image cannot be read (see `depth_in_metres`) or lies below the floor.
    """
    depth = depth_in_metres(image, intrinsics)
    if lies_below_floor(depth, X_WC, intrinsics, parameters.validity):
        raise InputError(
            f"depth image: {FAULT_SENTENCES[DepthFault.BELOW_FLOOR]}; check its unit and the "
            "camera's pose."
        )
    surface = observe_surfaces(depth, intrinsics, X_WC, parameters.cloud)
    for each in ignored:
        surface = remove_solids(surface, each.placed, each.margin)
    voxels = add_points(voxels, surface, time, parameters.memory, p_WO)
    spared = np.zeros(len(voxels), dtype=bool)
    gone = np.zeros(len(voxels), dtype=bool)
    for each in ignored:
        near = each.placed.near(voxels.positions, each.margin)
        spared |= near
        if each.keep_known_voxels:
            depth_inside = -parameters.memory.voxel_size / 2
            near[near] = each.placed.near(voxels.positions[near], depth_inside)
        gone |= near
    voxels, spared = voxels.select(~gone), spared[~gone]
    voxels = carve_free_space(voxels, depth, intrinsics, X_WC, time, parameters.memory, spared)
    return prune(voxels, X_WC.translation(), time, parameters.memory)
