"""Images to geometry, as plain functions: cameras, markers, goal, clouds, memory, stereo."""

from pepper_drake.perception.camera import (
    CAMERA_BOTTOM,
    CAMERA_DEPTH,
    CAMERA_TOP,
    CameraIntrinsics,
    HeadCamera,
)
from pepper_drake.perception.cloud import CloudParameters, SurfacePoints, to_point_cloud
from pepper_drake.perception.cloud_points import cloud_points, make_cloud
from pepper_drake.perception.evaluate import CloudReport, TrueSurfaces, evaluate_cloud
from pepper_drake.perception.gaze import choose_camera, look_at, share_gaze
from pepper_drake.perception.goal import MarkedObject, measure_goal
from pepper_drake.perception.goal_filter import (
    GoalFilterParameters,
    GoalMeasurement,
    GoalState,
    filter_goal,
)
from pepper_drake.perception.marker import detect_markers, marker_poses
from pepper_drake.perception.noise import ColorNoise, DepthNoise, degrade_color, degrade_depth
from pepper_drake.perception.obstacles import NoObstacle, ObstacleParameters, update_obstacles
from pepper_drake.perception.solids import RobotSolids, Solid
from pepper_drake.perception.stereo import StereoParameters, make_stereo_cameras
from pepper_drake.perception.voxel_map import VoxelMap, VoxelMapParameters
from pepper_drake.perception.watch import Watch, keep_watch

__all__ = [
    "CAMERA_BOTTOM",
    "CAMERA_DEPTH",
    "CAMERA_TOP",
    "CameraIntrinsics",
    "CloudParameters",
    "CloudReport",
    "ColorNoise",
    "DepthNoise",
    "GoalFilterParameters",
    "GoalMeasurement",
    "GoalState",
    "HeadCamera",
    "MarkedObject",
    "NoObstacle",
    "ObstacleParameters",
    "RobotSolids",
    "Solid",
    "StereoParameters",
    "SurfacePoints",
    "TrueSurfaces",
    "VoxelMap",
    "VoxelMapParameters",
    "Watch",
    "choose_camera",
    "cloud_points",
    "degrade_color",
    "degrade_depth",
    "detect_markers",
    "evaluate_cloud",
    "filter_goal",
    "keep_watch",
    "look_at",
    "make_cloud",
    "make_stereo_cameras",
    "marker_poses",
    "measure_goal",
    "share_gaze",
    "to_point_cloud",
    "update_obstacles",
]
