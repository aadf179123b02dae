"""ALVideoDevice: subscriptions to cameras, and their images in all formats."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pepper_drake.naoqi.constants import CAMERAS, DEPTH, QQQVGA, RESOLUTIONS, VGA
from pepper_drake.naoqi.images import encode_color, encode_depth, encode_reply
from pepper_drake.robot_server.robot.robot_port import CameraImage, RobotPort
from pepper_drake.robot_server.services.video_cameras import CameraFacts, known_camera
from pepper_drake.robot_server.services.waiting import Module, RobotTimer
from pepper_drake.robot_server.wire.service import Caller
from pepper_drake.robot_server.wire.signatures import with_caller

SUBSCRIPTIONS = 6
"""Largest number of subscriptions of one name."""

_FIRST_IMAGE = 1.0
"""Timeout of `getImageRemote` for a camera's first image [s]."""

_POLL = 0.02
"""Polling period of the first image [s]."""

_LARGE = 640 * 480
"""Number of pixels above which an image is encoded on another thread."""


@dataclass(frozen=True)
class Stream:
    """One camera of a subscription: its id, resolution id and colour-space id."""

    camera: int
    resolution: int
    color_space: int


@dataclass(frozen=True)
class Subscription:
    """The content of a handle.

    Attributes:
        streams: Its cameras.
        fps: Frame rate [1/s].
        client: Connection of the client that subscribed.
    """

    streams: tuple[Stream, ...]
    fps: int
    client: int


class Video(CameraFacts, Module):
    """ALVideoDevice."""

    def __init__(self, port: RobotPort, timer: RobotTimer) -> None:
        Module.__init__(self, "ALVideoDevice")
        self._port = port
        self._timer = timer
        self._subscriptions: dict[str, Subscription] = {}
        CameraFacts.__init__(self)

    # Subscriptions.

    @with_caller
    def subscribe_camera(
        self, caller: Caller, name: str, camera: int, resolution: int, color_space: int, fps: int
    ) -> str:
        """Subscribes to a camera; returns the handle, empty if impossible."""
        return self._subscribe(caller, name, [Stream(camera, resolution, color_space)], fps)

    @with_caller
    def subscribe_cameras(
        self,
        caller: Caller,
        name: str,
        cameras: Sequence[int],
        resolutions: Sequence[int],
        color_spaces: Sequence[int],
        fps: int,
    ) -> str:
        """Subscribes to several cameras at once; returns the handle, empty if impossible."""
        lists = (cameras, resolutions, color_spaces)
        if not all(isinstance(v, list | tuple) and all(map(_is_int, v)) for v in lists):
            raise ValueError("cameras, resolutions and colour spaces must be lists of integers")
        if not len(cameras) == len(resolutions) == len(color_spaces) > 0:
            raise ValueError("cameras, resolutions and colour spaces must be of one length")
        streams = list(map(Stream, *lists))
        return self._subscribe(caller, name, streams, fps)

    @with_caller
    def subscribe(
        self, caller: Caller, name: str, resolution: int, color_space: int, fps: int
    ) -> str:
        """Subscribes to the active camera (old API)."""
        return self._subscribe(caller, name, [Stream(self.active, resolution, color_space)], fps)

    def unsubscribe(self, handle: str) -> bool:
        """Ends a subscription; returns whether there was one."""
        found = self._subscriptions.pop(handle, None)
        self._request_images()
        return found is not None

    def unsubscribe_all_instances(self, name: str) -> None:
        """Ends all subscriptions of a name."""
        for handle in _handles(name):
            self._subscriptions.pop(handle, None)
        self._request_images()

    def get_subscribers(self) -> list[str]:
        """Returns the handles."""
        return sorted(self._subscriptions)

    def client_left(self, caller: Caller) -> None:
        """Ends the subscriptions of a disconnected client."""
        for handle in [h for h, s in self._subscriptions.items() if s.client == caller.client]:
            del self._subscriptions[handle]
        self._request_images()

    # Images.

    async def get_image_remote(self, handle: str) -> list[Any] | None:
        """Returns the newest image: size, layers, space, time, bytes, camera, four angles.

        None if the camera has no image within a second, or nobody has the handle.
        """
        found = self._subscriptions.get(handle)
        return None if found is None else await self._reply(found.streams[0])

    async def get_direct_raw_image_remote(self, handle: str) -> list[Any] | None:
        """As `getImageRemote`: there is no other copy of an image."""
        return await self.get_image_remote(handle)

    async def get_images_remote(self, handle: str) -> list[Any]:
        """Returns the newest image of each camera."""
        return [await self._reply(stream) for stream in self._subscription(handle).streams]

    async def get_direct_raw_images_remote(self, handle: str) -> list[Any]:
        """As `getImagesRemote`."""
        return await self.get_images_remote(handle)

    def release_image(self, handle: str) -> bool:
        """Releases an image; has no effect."""
        return handle in self._subscriptions

    def release_direct_raw_image(self, handle: str) -> bool:
        """As `releaseImage`."""
        return self.release_image(handle)

    def release_images(self, handle: str) -> list[bool]:
        """Releases images; has no effect."""
        return [True] * len(self._subscription(handle).streams)

    def release_direct_raw_images(self, handle: str) -> list[bool]:
        """As `releaseImages`."""
        return self.release_images(handle)

    # Settings of a handle, or of a camera by its id.

    def get_active_camera(self, handle: str = "") -> int:
        """Returns a subscription's camera, or the one that `subscribe` takes."""
        return self._first(handle).camera if handle else self.active

    def set_active_camera(self, *arguments: Any) -> bool:
        """Changes a subscription's camera, or the one that `subscribe` takes."""
        if len(arguments) == 1:
            return self._activate(arguments[0])
        return self._change(arguments[0], camera=arguments[1])

    def get_resolution(self, which: Any) -> int:
        """Returns the resolution of a subscription, or the largest of a camera's subscriptions."""
        if isinstance(which, str):
            return self._first(which).resolution
        return max((s.resolution for s in self._streams(which)), default=-1)

    def set_resolution(self, handle: str, resolution: int) -> bool:
        """Changes a subscription's resolution."""
        return self._change(handle, resolution=resolution)

    def get_color_space(self, which: Any) -> int:
        """Returns the colour space of a subscription or of a camera."""
        if isinstance(which, str):
            return self._first(which).color_space
        return next((s.color_space for s in self._streams(which)), -1)

    def set_color_space(self, handle: str, color_space: int) -> bool:
        """Changes a subscription's colour space."""
        return self._change(handle, color_space=color_space)

    def get_frame_rate(self, which: Any) -> int:
        """Returns the frame rate of a subscription, or a camera's largest subscribed one [1/s]."""
        if isinstance(which, str):
            return self._subscription(which).fps
        known_camera(which)
        rates = [
            s.fps for s in self._subscriptions.values() if which in {t.camera for t in s.streams}
        ]
        return max(rates, default=-1)

    def set_frame_rate(self, handle: str, fps: int) -> bool:
        """Changes a subscription's frame rate [1/s]."""
        found = self._subscription(handle)
        if not 1 <= fps <= CAMERAS[found.streams[0].camera].fps:
            return False
        self._subscriptions[handle] = replace(found, fps=fps)
        self._request_images()
        return True

    def get_active_cameras(self, handle: str) -> list[int]:
        """Returns the cameras of a subscription."""
        return [stream.camera for stream in self._subscription(handle).streams]

    def get_resolutions(self, handle: str) -> list[int]:
        """Returns the resolutions of a subscription."""
        return [stream.resolution for stream in self._subscription(handle).streams]

    def get_color_spaces(self, handle: str) -> list[int]:
        """Returns the colour spaces of a subscription."""
        return [stream.color_space for stream in self._subscription(handle).streams]

    def set_active_cameras(self, handle: str, cameras: Sequence[int]) -> list[bool]:
        """Changes the cameras of a subscription; returns the success of each."""
        return self._change_each(handle, "camera", cameras)

    def set_resolutions(self, handle: str, resolutions: Sequence[int]) -> list[bool]:
        """Changes the resolutions of a subscription; returns the success of each."""
        return self._change_each(handle, "resolution", resolutions)

    def set_color_spaces(self, handle: str, color_spaces: Sequence[int]) -> list[bool]:
        """Changes the colour spaces of a subscription; returns the success of each."""
        return self._change_each(handle, "color_space", color_spaces)

    def is_frame_grabber_off(self, *camera: int) -> bool | int:
        """Returns whether a camera, or the active one (then 1 or 0), takes no images."""
        off = not self.is_camera_started(*camera or (self.active,))
        return off if camera else int(off)

    # A subscription's camera.

    def is_camera_started(self, camera: int) -> bool:
        """Returns whether a camera takes images."""
        return bool(self._streams(camera))

    def get_camera_parameter(self, handle: str, parameter: int) -> int:
        """Returns a parameter of a subscription's camera."""
        return self.get_parameter(self._first(handle).camera, parameter)

    def set_camera_parameter(self, handle: str, parameter: int, value: int) -> bool:
        """Sets a parameter of a subscription's camera."""
        return self.set_parameter(self._first(handle).camera, parameter, value)

    def set_camera_parameter_to_default(self, handle: str, parameter: int) -> bool:
        """Resets a parameter of a subscription's camera to its default."""
        return self.set_parameter_to_default(self._first(handle).camera, parameter)

    def set_all_camera_parameters_to_default(self, handle: str) -> bool:
        """Resets the parameters of a subscription's camera to their defaults."""
        return self.set_all_parameters_to_default(self._first(handle).camera)

    def get_cameras_parameter(self, handle: str, parameter: int) -> list[int]:
        """Returns a parameter of each of a subscription's cameras."""
        return [self.get_parameter(c, parameter) for c in self.get_active_cameras(handle)]

    def set_cameras_parameter(self, handle: str, parameter: int, values: Any) -> list[bool]:
        """Sets a parameter of each camera (one value for all or each); returns each success."""
        cameras = self.get_active_cameras(handle)
        each = list(values) if isinstance(values, list | tuple) else [values] * len(cameras)
        if len(each) != len(cameras) or not all(map(_is_int, each)):
            raise ValueError(f"{len(cameras)} integers are needed, one for each camera")
        return [self.set_parameter(c, parameter, v) for c, v in zip(cameras, each, strict=True)]

    def set_cameras_parameter_to_default(self, handle: str, parameter: int) -> list[bool]:
        """Resets a parameter of each camera to its default."""
        cameras = self.get_active_cameras(handle)
        return [self.set_parameter_to_default(camera, parameter) for camera in cameras]

    def get_camera_parameter_range(self, handle: str, parameter: int) -> list[int]:
        """Returns the least and largest value of a parameter."""
        return self.get_parameter_range(self._first(handle).camera, parameter)

    def get_camera_parameter_info(self, handle: str, parameter: int) -> list[int]:
        """Returns value, least, largest and default value of a parameter."""
        return self.get_parameter_info(self._first(handle).camera, parameter)

    def _subscribe(self, caller: Caller, name: str, streams: list[Stream], fps: int) -> str:
        served = [_served(stream) for stream in streams]
        free = [handle for handle in _handles(name) if handle not in self._subscriptions]
        if None in served or not free or fps < 1:
            return ""
        known = tuple(stream for stream in served if stream is not None)
        limit = min(CAMERAS[stream.camera].fps for stream in known)
        handle = free[0]
        self._subscriptions[handle] = Subscription(known, min(fps, limit), caller.client)
        self._request_images()
        return handle

    def _subscription(self, handle: str) -> Subscription:
        if handle not in self._subscriptions:
            raise ValueError(f"{handle!r} has not subscribed")
        return self._subscriptions[handle]

    def _first(self, handle: str) -> Stream:
        return self._subscription(handle).streams[0]

    def _streams(self, camera: int) -> list[Stream]:
        known_camera(camera)
        streams = (stream for s in self._subscriptions.values() for stream in s.streams)
        return [stream for stream in streams if stream.camera == camera]

    def _change(self, handle: str, **changes: int) -> bool:
        found = self._subscription(handle)
        changed = _served(replace(found.streams[0], **changes))
        if changed is None:
            return False
        self._subscriptions[handle] = replace(found, streams=(changed, *found.streams[1:]))
        self._request_images()
        return True

    def _change_each(self, handle: str, what: str, values: Sequence[int]) -> list[bool]:
        found = self._subscription(handle)
        if not isinstance(values, list | tuple) or len(values) != len(found.streams):
            raise ValueError(f"{len(found.streams)} values are needed, one for each camera")
        if not all(map(_is_int, values)):
            raise ValueError("the values must be integers")
        changed = [
            _served(replace(stream, **{what: value}))
            for stream, value in zip(found.streams, values, strict=True)
        ]
        streams = tuple(
            new if new is not None else old for new, old in zip(changed, found.streams, strict=True)
        )
        self._subscriptions[handle] = replace(found, streams=streams)
        self._request_images()
        return [stream is not None for stream in changed]

    def _request_images(self) -> None:
        """Requests of each camera the largest size and rate of its subscriptions."""
        for camera in CAMERAS:
            sizes = [RESOLUTIONS[stream.resolution] for stream in self._streams(camera)]
            width, height = max(sizes, default=(0, 0))
            self._port.want_image(camera, width, height, max(self.get_frame_rate(camera), 0))

    async def _reply(self, stream: Stream) -> list[Any] | None:
        image = self._port.image(stream.camera)
        waited = 0.0
        while image is None and waited < _FIRST_IMAGE:
            await self._timer.sleep(_POLL)
            waited += _POLL
            image = self._port.image(stream.camera)
        if image is None:
            return None
        width, height = RESOLUTIONS[stream.resolution]
        if width * height > _LARGE:
            # Slow enough to delay other clients.
            return await asyncio.to_thread(encode_image, image, stream)
        return encode_image(image, stream)


def _is_int(value: Any) -> bool:
    return isinstance(value, int)


def _handles(name: str) -> list[str]:
    """Returns the possible handles of a name, as a Pepper's `getSubscribers` lists them."""
    return [f"{name}_{k}" for k in range(SUBSCRIPTIONS)]


def encode_image(image: CameraImage, stream: Stream) -> list[Any]:
    """Makes the reply of `getImageRemote` from an image of any size."""
    width, height = RESOLUTIONS[stream.resolution]
    pixels = _resized(image.pixels, width, height)
    if pixels.ndim == 2:
        data = encode_depth(pixels, stream.color_space)
    else:
        data = encode_color(pixels, stream.color_space)
    return encode_reply(data, width, height, stream.color_space, image.time, stream.camera)


def _resized(pixels: npt.NDArray[Any], width: int, height: int) -> npt.NDArray[Any]:
    """Scales without averaging, like the camera: depths of different objects must not mix."""
    if pixels.shape[:2] == (height, width):
        return np.ascontiguousarray(pixels)
    return cv2.resize(pixels, (width, height), interpolation=cv2.INTER_NEAREST)


def _served(stream: Stream) -> Stream | None:
    """Returns the stream that a camera delivers for a requested one, or None."""
    if stream.camera not in CAMERAS:
        return None
    camera = CAMERAS[stream.camera]
    if stream.camera == DEPTH and stream.resolution == VGA:
        # A Pepper delivers this size for a request of VGA depth.
        stream = replace(stream, resolution=QQQVGA)
    known = stream.resolution in camera.resolutions and stream.color_space in camera.color_spaces
    return stream if known else None
