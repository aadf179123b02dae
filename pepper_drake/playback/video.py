"""A video of recorded motions, rendered from Drake's forward kinematics; no simulation."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import PIL.Image
from tqdm import tqdm

from pepper_drake.errors import InputError
from pepper_drake.playback.bodies import FRAME_RATE, Frames, RecordedModel
from pepper_drake.playback.drawing import run_color
from pepper_drake.reporting.scene_picture import ExternalCamera

Image = npt.NDArray[np.uint8]

_SIZE = (960, 600)
_SMALL_SIZE = (640, 480)
_GIF_STRIDE = 3
"""Video frames per frame of a GIF."""
_GIF_COLORS = 64
_INK = (48, 39, 29)
_SHIFT = 4  # Fractional bits of a point that OpenCV draws.
_FONT = cv2.FONT_HERSHEY_SIMPLEX
# MPEG-4 part 2: every player reads it, and all of OpenCV's FFmpeg builds write it fast. Browsers
# need H.264, which none of these builds may include.
_CODEC = cv2.VideoWriter.fourcc(*"mp4v")


def write_video(runs: Sequence[Frames], path: Path, *, progress: bool = False) -> None:
    """Writes a video of motions side by side, each with its hand path so far.

    Args:
        runs: The motions' frames.
        path: A file that ends in .mp4, or in .gif for web pages: at half the resolution, with a
            tenth of a second between frames.
        progress: Whether to show a progress bar.

    Raises:
        InputError: The file cannot be written.
    """
    kind = path.suffix.lower()
    if kind not in (".mp4", ".gif"):
        raise InputError(f'--video is "{path.name}"; it must end in .mp4 or .gif')
    size = _SIZE if len(runs) == 1 else _SMALL_SIZE
    columns = int(np.ceil(np.sqrt(len(runs))))
    rows = -(-len(runs) // columns)
    path.parent.mkdir(parents=True, exist_ok=True)
    scenes = [_FilmedRun(run, index, size) for index, run in enumerate(runs)]
    blank = np.full((size[1], size[0], 3), 240, np.uint8)

    def pictures(stride: int) -> Iterator[Image]:
        for frame in tqdm(
            range(0, max(len(run.times) for run in runs), stride),
            desc="filming",
            unit=" frames",
            disable=not progress,
            leave=False,
        ):
            tiles = [scene.picture(frame) for scene in scenes]
            tiles += [blank] * (rows * columns - len(tiles))
            yield np.vstack(
                [np.hstack(tiles[k : k + columns]) for k in range(0, len(tiles), columns)]
            )

    if kind == ".gif":
        _write_gif(pictures(_GIF_STRIDE), path)
        return
    film = cv2.VideoWriter(str(path), _CODEC, FRAME_RATE, (size[0] * columns, size[1] * rows), True)
    if not film.isOpened():
        raise InputError(f"{path}: cannot be written; choose another --output")
    for picture in pictures(1):
        film.write(picture)
    film.release()


def _write_gif(pictures: Iterator[Image], path: Path) -> None:
    """Writes pictures (BGR) as a GIF that repeats for ever.

    Raises:
        InputError: The file cannot be written.
    """
    small = [
        PIL.Image.fromarray(
            cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)[:, :, ::-1]
        ).quantize(_GIF_COLORS, dither=PIL.Image.Dither.NONE)
        for picture in pictures
    ]
    milliseconds = round(1000 * _GIF_STRIDE / FRAME_RATE)
    # The last picture is shown longer.
    durations = [milliseconds] * (len(small) - 1) + [1500]
    try:
        small[0].save(
            path, save_all=True, append_images=small[1:], duration=durations, loop=0, optimize=True
        )
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error}); choose another --output") from None


class _FilmedRun:
    """A motion and the camera that films it."""

    def __init__(self, run: Frames, index: int, size: tuple[int, int]) -> None:
        self._run, motion = run, run.motion
        model = RecordedModel(motion)
        self._positions = model.positions(run.clock)
        base = [
            float(model.positions(np.array([motion.times[-1]]))[0, model.column(name)])
            for name in ("BaseX", "BaseY", "BaseYaw")
        ]
        self._camera = ExternalCamera(
            motion.scene,
            motion.arm,
            np.array(base),
            width=size[0],
            height=size[1],
            shadows=False,
        )
        red, green, blue = (round(255 * value) for value in run_color(index))
        self._color = (blue, green, red)
        self._shown = self._on_image(run.shown_W)
        self._path = self._on_image(run.hand_W)

    def _on_image(self, points_W: npt.NDArray[np.float64]) -> npt.NDArray[np.int32]:
        """Projects points (N, 3) in W to the image (N, 2), in OpenCV's fixed-point pixels."""
        if not len(points_W):
            return np.zeros((0, 2), np.int32)
        return np.round(self._camera.project(points_W) * 2**_SHIFT).astype(np.int32)

    def picture(self, frame: int) -> Image:
        """Returns the picture (height, width, 3) of a frame, or of the last one."""
        frame = min(frame, len(self._run.times) - 1)
        time = float(self._run.clock[frame])
        motion = self._run.motion
        image = self._camera.picture(self._positions[frame])
        progress = (time - motion.arm_starts) / max(motion.times[-1] - motion.arm_starts, 1e-9)
        count = round(float(np.clip(progress, 0.0, 1.0)) * len(self._path))
        if len(self._shown) > 1 and time >= motion.arm_starts:
            cv2.polylines(image, [self._shown], False, (0, 0, 0), 1, cv2.LINE_AA, shift=_SHIFT)
        if count > 1:
            path = self._path[:count]
            cv2.polylines(image, [path], False, self._color, 2, cv2.LINE_AA, shift=_SHIFT)
        stage = [name for begin, name in motion.stages if begin <= time][-1:]
        caption = "   ".join([motion.name, *stage, f"{self._run.times[frame]:.2f} s"])
        cv2.putText(image, caption, (16, 32), _FONT, 0.65, _INK, 1, cv2.LINE_AA)
        return image
