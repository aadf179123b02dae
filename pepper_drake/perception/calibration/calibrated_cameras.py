"""The head's cameras after calibration."""

from pepper_drake.models.robot_calibration import RobotCalibration
from pepper_drake.perception.cameras.camera import (
    CAMERA_BOTTOM,
    CAMERA_DEPTH,
    CAMERA_TOP,
    HeadCamera,
    moved_camera,
)

HEAD_CAMERA_MODELS = {
    "camera_top": CAMERA_TOP,
    "camera_bottom": CAMERA_BOTTOM,
    "camera_depth": CAMERA_DEPTH,
}
"""The model's cameras by the station's name."""


def calibrated_cameras(calibration: RobotCalibration | None) -> dict[str, HeadCamera]:
    """Returns the calibrated cameras by the station's name; none without a calibration."""
    if calibration is None:
        return {}
    cameras = {}
    for name, found in calibration.cameras.items():
        (x, y, z), (roll, pitch, yaw) = found.position, found.rotation
        cameras[name] = moved_camera(
            HEAD_CAMERA_MODELS[name], (x, y, z), (roll, pitch, yaw), found.focal
        )
    return cameras
