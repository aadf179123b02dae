"""ALPhotoCapture and ALVideoRecorder: pictures and videos of the robot's cameras, in files.

A robot writes on its own disk. The served robot writes into its own folder only, in which a path
such as `/home/nao/recordings` is a subfolder.
"""

import asyncio
from pathlib import Path, PurePosixPath
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pepper_drake.naoqi.constants import DEPTH, RESOLUTIONS
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.video import Video
from pepper_drake.robot_server.services.waiting import Module, RobotTimer
from pepper_drake.robot_server.wire.service import Caller

_PICTURES = ("bmp", "dib", "jpeg", "jpg", "jpe", "png", "pbm", "pgm", "ppm", "sr", "ras", "tif")
_YUV, _BGR = 0, 13
_FPS = 10
_MOST_PICTURES = 100
_LONGEST = 600.0
"""Longest video [s]."""

Image = npt.NDArray[np.uint8]

_ROBOT = Caller(0)
"""The subscriber, the robot itself: a video continues when its client disconnects."""


class RobotDisk:
    """The folder of the robot's files."""

    def __init__(self, folder: Path | None) -> None:
        """Sets the folder.

        Args:
            folder: Folder on this machine, created when needed; None for a robot that cannot write.
        """
        self._folder = folder

    def place(self, folder: str, name: str) -> tuple[str, Path]:
        """Returns the path of a file on the robot, and its path on this machine."""
        if self._folder is None:
            raise ValueError("this robot has no disk to write to")
        path = PurePosixPath("/") / folder / name
        if not name or ".." in path.parts or "\0" in str(path) or len(str(path)) > 400:
            raise ValueError(f"{str(path)!r:.80} is not a path")
        here = self._folder / path.relative_to("/")
        here.parent.mkdir(parents=True, exist_ok=True)
        return str(path), here


class _Recorder(Module):
    def __init__(self, name: str, video: Video, disk: RobotDisk, timer: RobotTimer) -> None:
        super().__init__(name)
        self._video, self._disk, self._timer = video, disk, timer
        keep_settings(
            self,
            {
                "set_camera_id": ("get_camera_id", 0),
                "set_resolution": ("get_resolution", 1),
                "set_color_space": ("get_color_space", _BGR),
            },
        )

    def _subscribe(self, fps: int) -> str:
        camera, resolution, space = (
            int(self._setting(name)) for name in ("camera_id", "resolution", "color_space")
        )
        if camera == DEPTH or space not in (_YUV, _BGR):
            raise ValueError("a colour camera and the colour space 0 or 13 are needed")
        handle = self._video.subscribe_camera(_ROBOT, self.name, camera, resolution, space, fps)
        if not handle:
            raise ValueError(f"camera {camera} has no images of resolution {resolution}")
        return handle

    def _setting(self, name: str) -> Any:
        return getattr(self, f"get_{name}")()

    async def _image(self, handle: str) -> Image:
        reply = await self._video.get_image_remote(handle)
        if reply is None:
            raise ValueError("the camera gives no image")
        width, height, layers = reply[:3]
        data = getattr(reply[6], "value", reply[6])
        pixels = np.frombuffer(data, np.uint8).reshape(height, width, layers)
        return np.array(pixels)


class PhotoCapture(_Recorder):
    """ALPhotoCapture."""

    def __init__(self, video: Video, disk: RobotDisk, timer: RobotTimer) -> None:
        super().__init__("ALPhotoCapture", video, disk, timer)
        keep_settings(
            self,
            {
                "set_capture_interval": ("get_capture_interval", 200),
                "set_picture_format": ("get_picture_format", "jpg"),
            },
        )
        keep_settings(
            self, {"set_half_press_enabled": ("is_half_press_enabled", False)}, returns=True
        )

    def half_press(self) -> bool:
        """Toggles half press (old API)."""
        self.set_half_press_enabled(not self.is_half_press_enabled())  # type: ignore[attr-defined]
        return True

    def is_half_pressed(self) -> bool:
        """As `isHalfPressEnabled`, its former name."""
        return bool(self.is_half_press_enabled())  # type: ignore[attr-defined]

    async def take_picture(self, folder: str, name: str, overwrite: bool = True) -> list[str]:
        """Takes a picture; returns the path of its file in a list."""
        return await self._take(folder, [name], overwrite)

    async def take_pictures(
        self, count: int, folder: str, name: str, overwrite: bool = True
    ) -> list[list[str]]:
        """Takes pictures; returns the paths of their files, as the one item of a list."""
        if not 1 <= count <= _MOST_PICTURES:
            raise ValueError(f"{count} pictures; it must be 1 to {_MOST_PICTURES}")
        names = [name] if count == 1 else [f"{name}_{k}" for k in range(count)]
        return [await self._take(folder, names, overwrite)]

    async def _take(self, folder: str, names: list[str], overwrite: bool) -> list[str]:
        ending = str(self._setting("picture_format"))
        if ending not in _PICTURES and ending != "tiff":
            raise ValueError(f"there is no picture format {ending!r}")
        interval = max(float(self._setting("capture_interval")), 1.0) / 1000
        handle = self._subscribe(15)
        taken = []
        try:
            for number, name in enumerate(names):
                if number:
                    await self._timer.sleep(interval)
                on_robot, path = self._disk.place(folder, f"{name}.{ending}")
                if path.exists() and not overwrite:
                    raise ValueError(f"{on_robot} already exists")
                if not cv2.imwrite(str(path), await self._image(handle)):
                    raise ValueError(f"a picture cannot be written as {ending}")
                taken.append(on_robot)
        finally:
            self._video.unsubscribe(handle)
        return taken


class VideoRecorder(_Recorder):
    """ALVideoRecorder: videos as MJPG in AVI files."""

    def __init__(self, video: Video, disk: RobotDisk, timer: RobotTimer) -> None:
        super().__init__("ALVideoRecorder", video, disk, timer)
        keep_settings(
            self,
            {
                "set_video_format": ("get_video_format", "MJPG"),
            },
        )
        self._fps = _FPS
        self._task: asyncio.Task[int] | None = None
        self._path, self._stop = "", False

    def set_frame_rate(self, fps: float) -> None:
        """Sets the frame rate [1/s]."""
        if not 1 <= fps <= 30:
            raise ValueError(f"the frame rate is {fps:g}; it must be in [1, 30]")
        self._fps = int(fps)

    def get_frame_rate(self) -> int:
        """Returns the frame rate [1/s]."""
        return self._fps

    def is_recording(self) -> bool:
        """Returns whether it is recording."""
        return self._task is not None

    def start_recording(self, folder: str, name: str, overwrite: bool = True) -> None:
        """Starts a video."""
        if self._task is not None:
            raise ValueError("it is already recording")
        on_robot, path = self._disk.place(folder, name if name.endswith(".avi") else f"{name}.avi")
        if path.exists() and not overwrite:
            raise ValueError(f"{on_robot} already exists")
        fps = self._fps
        handle = self._subscribe(fps)
        self._path, self._stop = on_robot, False
        loop = asyncio.get_running_loop()
        self._task = loop.create_task(self._film(handle, path, fps))

    async def stop_recording(self) -> list[Any]:
        """Ends a video; returns its number of images and the path of its file."""
        if self._task is None:
            raise ValueError("it is not recording")
        task, self._task = self._task, None
        # Not cancelled: an image may be in the process of being written.
        self._stop = True
        return [await task, self._path]

    async def _film(self, handle: str, path: Path, fps: int) -> int:
        size = RESOLUTIONS[int(self._setting("resolution"))]
        fourcc = cv2.VideoWriter.fourcc(*"MJPG")
        color = self._setting("color_space") == _BGR
        film = cv2.VideoWriter(str(path), fourcc, float(fps), size, isColor=color)
        frames = 0
        try:
            while frames < fps * _LONGEST and not self._stop:
                await asyncio.to_thread(film.write, await self._image(handle))
                frames += 1
                await self._timer.sleep(1.0 / fps)
        except ValueError:
            return frames  # The camera gives no more images.
        finally:
            film.release()
            self._video.unsubscribe(handle)
        return frames
