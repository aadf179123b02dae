"""Perception as plain functions: cameras, markers, goal, point clouds, obstacle map, stereo."""

from pepper_drake.perception.cameras.camera import (
    CAMERA_BOTTOM,
    CAMERA_DEPTH,
    CAMERA_TOP,
    CameraIntrinsics,
    HeadCamera,
)
from pepper_drake.perception.cameras.camera_files import (
    StereoCalibration,
    load_intrinsics,
    load_stereo,
    make_intrinsics,
)
from pepper_drake.perception.cameras.image_files import read_depth, read_image
from pepper_drake.perception.cameras.noise import (
    ColorNoise,
    DepthNoise,
    apply_color_noise,
    apply_depth_noise,
)
from pepper_drake.perception.cloud_evaluation import CloudReport, TrueSurfaces, evaluate_cloud
from pepper_drake.perception.gaze.head_aiming import aim_for_two_cameras, choose_camera, look_at
from pepper_drake.perception.goal.detection import MarkedObject, detect_goal
from pepper_drake.perception.goal.imm_filter import (
    GoalFilterParameters,
    GoalMeasurement,
    GoalState,
    update_goal,
)
from pepper_drake.perception.goal.marker import detect_markers, marker_poses
from pepper_drake.perception.goal.photo import MarkerSighting, find_in_photo, markers_shown
from pepper_drake.perception.mapping.cloud import (
    CloudParameters,
    SurfacePoints,
    depth_in_metres,
    to_point_cloud,
)
from pepper_drake.perception.mapping.cloud_files import load_cloud
from pepper_drake.perception.mapping.cloud_points import cloud_points, make_cloud
from pepper_drake.perception.mapping.depth_validity import DepthFault, ValidityParameters
from pepper_drake.perception.mapping.dynamic_obstacle_tracker import (
    DynamicObstacleTracker,
    update_tracker,
)
from pepper_drake.perception.mapping.obstacle_map import (
    ExcludedSolids,
    ObstacleParameters,
    update_obstacles,
)
from pepper_drake.perception.mapping.seen_space import SeenSpace, SpaceState
from pepper_drake.perception.mapping.solids import RobotSolids, Solid
from pepper_drake.perception.mapping.voxel_map import VoxelMap, VoxelMapParameters
from pepper_drake.perception.stereo.matching import (
    StereoParameters,
    make_stereo_cameras,
    rectify_pair,
)

# Names of release 0.1, kept for one release.
measure_goal = detect_goal
degrade_color = apply_color_noise
degrade_depth = apply_depth_noise
Watch = DynamicObstacleTracker
keep_watch = update_tracker

__all__ = [
    "CAMERA_BOTTOM",
    "CAMERA_DEPTH",
    "CAMERA_TOP",
    "CameraIntrinsics",
    "CloudParameters",
    "CloudReport",
    "ColorNoise",
    "DepthFault",
    "DepthNoise",
    "DynamicObstacleTracker",
    "ExcludedSolids",
    "GoalFilterParameters",
    "GoalMeasurement",
    "GoalState",
    "HeadCamera",
    "MarkedObject",
    "MarkerSighting",
    "ObstacleParameters",
    "RobotSolids",
    "SeenSpace",
    "Solid",
    "SpaceState",
    "StereoCalibration",
    "StereoParameters",
    "SurfacePoints",
    "TrueSurfaces",
    "ValidityParameters",
    "VoxelMap",
    "VoxelMapParameters",
    "Watch",
    "aim_for_two_cameras",
    "apply_color_noise",
    "apply_depth_noise",
    "choose_camera",
    "cloud_points",
    "degrade_color",
    "degrade_depth",
    "depth_in_metres",
    "detect_goal",
    "detect_markers",
    "evaluate_cloud",
    "find_in_photo",
    "keep_watch",
    "load_cloud",
    "load_intrinsics",
    "load_stereo",
    "look_at",
    "make_cloud",
    "make_intrinsics",
    "make_stereo_cameras",
    "marker_poses",
    "markers_shown",
    "measure_goal",
    "read_depth",
    "read_image",
    "rectify_pair",
    "to_point_cloud",
    "update_goal",
    "update_obstacles",
    "update_tracker",
]
