"""ALVideoDevice's data on the cameras, and their parameters."""

from collections.abc import Sequence

from pepper_drake.naoqi.constants import CAMERAS, DEPTH, RESOLUTIONS, TOP, Camera
from pepper_drake.robot_server.services.motion_arguments import numbers

# Parameters of the colour cameras (OV5640) by id: least, largest, default.
_PARAMETERS: dict[int, tuple[int, int, int]] = {
    0: (-255, 255, 0),  # brightness
    1: (0, 255, 32),  # contrast
    2: (0, 255, 64),  # saturation
    3: (-180, 180, 0),  # hue
    6: (0, 1023, 16),  # gain
    7: (0, 1, 0),  # horizontal flip
    8: (0, 1, 0),  # vertical flip
    11: (0, 1, 1),  # auto exposure
    12: (0, 1, 1),  # auto white balance
    14: (0, 8, 1),  # resolution
    15: (1, 30, 5),  # frame rate
    17: (0, 65535, 32),  # exposure
    18: (0, 4, 0),  # camera
    22: (0, 3, 1),  # auto-exposure algorithm
    24: (0, 9, 4),  # sharpness
    33: (-180, 180, 0),  # white balance
    34: (0, 4, 0),  # back-light compensation
    35: (0, 1, 0),  # keep alive
    39: (0, 255, 128),  # average luminance
    40: (0, 1, 0),  # auto focus
}


class CameraFacts:
    """Cameras and their parameters by camera id.

    Attributes:
        active: The camera of the old API.
    """

    def __init__(self) -> None:
        self.active = TOP
        self._parameters: dict[tuple[int, int], int] = {}

    def get_camera_indexes(self) -> list[int]:
        """Returns the cameras' ids."""
        return list(CAMERAS)

    def get_camera_name(self, camera: int) -> str:
        """Returns a camera's name."""
        return known_camera(camera).name

    def get_camera_model(self, camera: int) -> int:
        """Returns a camera's model."""
        return known_camera(camera).model

    def get_camera_model_id(self) -> int:
        """Returns the model of the active camera."""
        return CAMERAS[self.active].model

    def has_depth_camera(self) -> bool:
        """Returns whether there is a depth camera."""
        return DEPTH in CAMERAS

    def is_camera_open(self, camera: int) -> bool:
        """Returns whether a camera is open."""
        return camera in CAMERAS

    def open_camera(self, camera: int) -> bool:
        """Opens a camera; has no effect."""
        return camera in CAMERAS

    def close_camera(self, camera: int) -> bool:
        """Has no effect: subscriptions decide whether a camera takes images."""
        return camera in CAMERAS

    def reset_camera(self, camera: int) -> bool:
        """Resets a camera; has no effect."""
        return camera in CAMERAS

    stop_camera = close_camera

    def start_frame_grabber(self, camera: int = TOP) -> bool:
        """As `openCamera`, its former name."""
        return camera in CAMERAS

    stop_frame_grabber = start_frame_grabber

    def start_camera(self, camera: int) -> bool:
        """Has no effect: a subscription starts a camera."""
        return camera in CAMERAS

    def get_horizontal_fov(self, camera: int) -> float:
        """Returns the horizontal field of view [rad]."""
        return known_camera(camera).width_fov

    def get_vertical_fov(self, camera: int) -> float:
        """Returns the vertical field of view [rad]."""
        return known_camera(camera).height_fov

    def get_horizontal_aperture(self, camera: int) -> float:
        """As `getHorizontalFOV`, its former name."""
        return known_camera(camera).width_fov

    def get_vertical_aperture(self, camera: int) -> float:
        """As `getVerticalFOV`, its former name."""
        return known_camera(camera).height_fov

    def get_angular_position_from_image_position(
        self, camera: int, position: Sequence[float]
    ) -> list[float]:
        """Returns angles to the left and down [rad] of an image position from (0, 0) to (1, 1)."""
        known = known_camera(camera)
        x, y = numbers(position, 2, "a position")
        return [(0.5 - x) * known.width_fov, (y - 0.5) * known.height_fov]

    def get_image_position_from_angular_position(
        self, camera: int, angles: Sequence[float]
    ) -> list[float]:
        """Returns the image position, (0, 0) to (1, 1), of angles to the left and down [rad]."""
        known = known_camera(camera)
        left, down = numbers(angles, 2, "angles")
        return [0.5 - left / known.width_fov, 0.5 + down / known.height_fov]

    def get_angular_size_from_image_size(self, camera: int, size: Sequence[float]) -> list[float]:
        """Returns the angles [rad] of a size in shares of the image."""
        known = known_camera(camera)
        width, height = numbers(size, 2, "a size")
        return [width * known.width_fov, height * known.height_fov]

    def get_image_size_from_angular_size(self, camera: int, size: Sequence[float]) -> list[float]:
        """Returns the size in shares of the image of angles [rad]."""
        known = known_camera(camera)
        width, height = numbers(size, 2, "a size")
        return [width / known.width_fov, height / known.height_fov]

    def resolution_to_sizes(self, resolution: int) -> list[int]:
        """Returns width and height of a resolution [pixels]."""
        if resolution not in RESOLUTIONS:
            raise ValueError(f"there is no resolution {resolution}")
        return list(RESOLUTIONS[resolution])

    def sizes_to_resolution(self, width: int, height: int) -> int:
        """Returns the resolution of a width and height [pixels], -1 if there is none."""
        return next((k for k, size in RESOLUTIONS.items() if size == (width, height)), -1)

    # Parameters: stored, without effect on the images.

    def get_parameter(self, camera: int, parameter: int) -> int:
        """Returns a camera's parameter."""
        known_camera(camera)
        return self._parameters.get((camera, parameter), _parameter(parameter)[2])

    def set_parameter(self, camera: int, parameter: int, value: int) -> bool:
        """Sets a camera's parameter; returns whether the value is valid."""
        lower, upper, _ = _PARAMETERS.get(parameter, (0, -1, 0))
        if camera not in CAMERAS or not lower <= value <= upper:
            return False
        self._parameters[camera, parameter] = value
        return True

    def set_parameter_to_default(self, camera: int, parameter: int) -> bool:
        """Resets a camera's parameter to its default."""
        self._parameters.pop((camera, parameter), None)
        return camera in CAMERAS and parameter in _PARAMETERS

    def set_all_parameters_to_default(self, camera: int) -> bool:
        """Resets a camera's parameters to their defaults."""
        for key in [key for key in self._parameters if key[0] == camera]:
            del self._parameters[key]
        return camera in CAMERAS

    def get_parameter_range(self, camera: int, parameter: int) -> list[int]:
        """Returns the least and largest value of a parameter."""
        known_camera(camera)
        return list(_parameter(parameter)[:2])

    def get_parameter_info(self, camera: int, parameter: int) -> list[int]:
        """Returns value, least, largest and default value of a parameter."""
        lower, upper, default = _parameter(parameter)
        return [self.get_parameter(camera, parameter), lower, upper, default]

    def get_param(self, parameter: int, camera: int | None = None) -> int:
        """Returns a parameter (old API)."""
        return self.get_parameter(self.active if camera is None else camera, parameter)

    def set_param(self, parameter: int, value: int, camera: int | None = None) -> None:
        """Sets a parameter (old API); 18 is the active camera."""
        if parameter == 18:
            self._activate(value)
        self.set_parameter(self.active if camera is None else camera, parameter, value)

    def set_param_default(self, parameter: int) -> None:
        """Resets a parameter of the active camera to its default."""
        self.set_parameter_to_default(self.active, parameter)

    def _activate(self, camera: int) -> bool:
        if camera in CAMERAS:
            self.active = camera
        return camera in CAMERAS


def known_camera(camera: int) -> Camera:
    """Returns a camera by its id; ValueError if there is none."""
    if camera not in CAMERAS:
        raise ValueError(f"there is no camera {camera}")
    return CAMERAS[camera]


def _parameter(parameter: int) -> tuple[int, int, int]:
    if parameter not in _PARAMETERS:
        raise ValueError(f"there is no parameter {parameter}")
    return _PARAMETERS[parameter]
