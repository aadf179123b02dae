"""Conversion between pixels and NAOqi's image replies, in all colour spaces of Pepper.

Colour arrays are (height, width, 3) RGB of uint8; depth arrays are (height, width) of float32:
distance along the optical axis [m], 0 where unknown.

Byte orders are as documented for NAOqi 2.5, the first byte of a little-endian word first: YUV
4:2:2 is U Y V Y', YUV is Y U V, HSY is H S Y. Not documented but assumed: luma and chroma
are BT.601's at full range (as in JPEG), hue and saturation are HSV's, scaled to 0..255.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pepper_drake.naoqi.clock import join_time, split_time
from pepper_drake.naoqi.constants import (
    BGR,
    CAMERAS,
    DEPTH,
    DEPTH_MM,
    DISTANCE,
    H2RGB,
    HS_MIXED,
    HSY,
    LAYERS,
    RAW_DEPTH,
    RGB,
    XYZ,
    YUV,
    YUV422,
    YYCBCR,
)

Pixels = npt.NDArray[np.uint8]
DepthMap = npt.NDArray[np.float32]

GREY_DEPTHS = (0.4, 3.68)
"""Distances of grey values 0 and 255 of the depth camera [m]."""

_MILLIMETRES = (DEPTH_MM, DISTANCE, RAW_DEPTH)


@dataclass(frozen=True)
class ImageReply:
    """A decoded reply of `getImageRemote`.

    Attributes:
        pixels: In the colour space: (height, width, channels) or (height, width) of
            uint8, uint16 [mm] or float32 [m].
        color_space: Colour-space id.
        time: Capture time by the robot's clock [s].
        camera: Camera id.
    """

    pixels: npt.NDArray[Any]
    color_space: int
    time: float
    camera: int

    def rgb(self) -> Pixels:
        """Returns the image as RGB (height, width, 3); grey for a single channel.

        Raises:
            ValueError: It holds distances.
        """
        return to_rgb(self.pixels, self.color_space)

    def depth(self) -> DepthMap:
        """Returns the distance along the optical axis (height, width) [m], 0 where unknown.

        Raises:
            ValueError: It holds no distances.
        """
        if self.color_space in (DEPTH_MM, RAW_DEPTH):
            return self.pixels.astype(np.float32) / np.float32(1000)
        if self.color_space == XYZ:
            return np.ascontiguousarray(self.pixels[:, :, 0])
        if self.color_space == DISTANCE:
            distances = self.pixels.astype(np.float32) / np.float32(1000)
            return distances / _ray_lengths(*_size(self.pixels))
        raise ValueError(f"colour space {self.color_space} holds no distances")


def encode_color(rgb: Pixels, color_space: int) -> bytes:
    """Encodes a colour image.

    Args:
        rgb: (height, width, 3) RGB; an even width for the two 4:2:2 spaces.
        color_space: Colour-space id from 0 to 16.

    Returns:
        The bytes, row by row.

    Raises:
        ValueError: The colour space is not one of a colour camera, or the width is odd.
    """
    if color_space == RGB:
        return rgb.tobytes()
    if color_space == BGR:
        return np.ascontiguousarray(rgb[:, :, ::-1]).tobytes()
    if 3 <= color_space <= 5:
        return np.ascontiguousarray(rgb[:, :, color_space - 3]).tobytes()
    if color_space in (0, 1, 2, YUV, YUV422, YYCBCR):
        return _encode_luma(_yuv(rgb), color_space)
    if 6 <= color_space <= 8 or color_space in (HSY, H2RGB, HS_MIXED):
        return _encode_hue(rgb, color_space)
    raise ValueError(f"colour space {color_space} is not one of a colour camera")


def encode_depth(depth: DepthMap, color_space: int) -> bytes:
    """Encodes an image of distances.

    Args:
        depth: (height, width) along the optical axis [m]; not finite or 0 where unknown.
        color_space: Colour-space id: 0, 11, 17, 19, 21 or 23.

    Returns:
        The bytes, row by row; 0 where the distance is unknown.

    Raises:
        ValueError: The colour space is not one of the depth camera.
    """
    depth = np.where(np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)
    if color_space in (DEPTH_MM, RAW_DEPTH):
        return _millimetres(depth).tobytes()
    if color_space == DISTANCE:
        return _millimetres(depth * _ray_lengths(*_size(depth))).tobytes()
    if color_space == XYZ:
        across, down = _rays(*_size(depth))
        # Adding 0 turns -0 into the 0 of unknown points.
        points = np.stack([depth, -depth * across, -depth * down], axis=2) + np.float32(0)
        return points.tobytes()
    near, far = GREY_DEPTHS
    grey = np.clip((depth - near) / (far - near) * 255, 0, 255).round().astype(np.uint8)
    grey[depth == 0] = 0
    if color_space == 0:
        return grey.tobytes()
    if color_space == RGB:
        color = cv2.applyColorMap(grey, cv2.COLORMAP_JET)[:, :, ::-1].copy()
        color[depth == 0] = 0
        return color.tobytes()
    raise ValueError(f"colour space {color_space} is not one of the depth camera")


def encode_reply(
    data: bytes, width: int, height: int, color_space: int, time: float, camera: int
) -> list[Any]:
    """Makes a reply of `getImageRemote` from encoded pixels.

    Returns:
        width, height, layers, colour space, seconds, microseconds, bytes, camera, and the angles
        of the left, top, right and bottom border from the centre [rad].
    """
    known = CAMERAS[camera]
    across, down = known.width_fov / 2, known.height_fov / 2
    return [
        width,
        height,
        LAYERS[color_space],
        color_space,
        *split_time(time),
        data,
        camera,
        across,
        -down,
        -across,
        down,
    ]


def decode_reply(reply: Sequence[Any] | None) -> ImageReply:
    """Decodes a reply of `getImageRemote`; sizes are the reply's, not the requested ones.

    Raises:
        ValueError: There is no image, or the reply is not one.
    """
    if reply is None:
        raise ValueError("the camera has no image yet")
    if len(reply) < 8:
        raise ValueError(f"an image's reply has 12 values, not {len(reply)}")
    width, height, _, color_space, seconds, microseconds, data, camera = reply[:8]
    if color_space not in LAYERS:
        raise ValueError(f"colour space {color_space} is unknown")
    expected = width * height * LAYERS[color_space]
    if len(data) != expected:
        raise ValueError(
            f"an image of {width}x{height} in colour space {color_space} has {expected} bytes, "
            f"not {len(data)}"
        )
    if color_space == XYZ:
        pixels: npt.NDArray[Any] = np.frombuffer(data, "<f4").reshape(height, width, 3)
    elif color_space in _MILLIMETRES:
        pixels = np.frombuffer(data, "<u2").reshape(height, width)
    else:
        pixels = np.frombuffer(data, np.uint8).reshape(height, width, LAYERS[color_space])
        pixels = pixels[:, :, 0] if LAYERS[color_space] == 1 else pixels
    return ImageReply(pixels, color_space, join_time(seconds, microseconds), camera)


def to_rgb(pixels: npt.NDArray[Any], color_space: int) -> Pixels:
    """Returns pixels of a colour space as RGB (height, width, 3).

    Raises:
        ValueError: The colour space holds no colour or grey.
    """
    if color_space in (RGB, H2RGB, HS_MIXED):
        return np.ascontiguousarray(pixels)
    if color_space == BGR:
        return np.ascontiguousarray(pixels[:, :, ::-1])
    if LAYERS.get(color_space) == 1:
        return np.repeat(pixels[:, :, None], 3, axis=2)
    if color_space == YUV:
        return _rgb(pixels)
    if color_space in (YUV422, YYCBCR):
        pairs = pixels.reshape(pixels.shape[0], -1, 4)
        order = (1, 3, 0, 2) if color_space == YUV422 else (0, 1, 2, 3)
        y0, y1, u, v = (pairs[:, :, k] for k in order)
        full = np.empty((*pixels.shape[:2], 3), np.uint8)
        full[:, ::2, 0], full[:, 1::2, 0] = y0, y1
        full[:, :, 1], full[:, :, 2] = np.repeat(u, 2, axis=1), np.repeat(v, 2, axis=1)
        return _rgb(full)
    raise ValueError(f"colour space {color_space} cannot be shown as RGB")


def _yuv(rgb: Pixels) -> Pixels:
    return cv2.cvtColor(rgb, cv2.COLOR_RGB2YCrCb)[:, :, [0, 2, 1]]


def _rgb(yuv: Pixels) -> Pixels:
    return cv2.cvtColor(np.ascontiguousarray(yuv[:, :, [0, 2, 1]]), cv2.COLOR_YCrCb2RGB)


def _encode_luma(yuv: Pixels, color_space: int) -> bytes:
    if color_space <= 2:
        return np.ascontiguousarray(yuv[:, :, color_space]).tobytes()
    if color_space == YUV:
        return yuv.tobytes()
    height, width, _ = yuv.shape
    if width % 2:
        raise ValueError(f"colour space {color_space} needs an even width, not {width}")
    pairs = yuv.reshape(height, width // 2, 2, 3).astype(np.uint16)
    y0, y1 = pairs[:, :, 0, 0], pairs[:, :, 1, 0]
    u, v = ((pairs[:, :, 0, k] + pairs[:, :, 1, k] + 1) // 2 for k in (1, 2))
    channels = [u, y0, v, y1] if color_space == YUV422 else [y0, y1, u, v]
    return np.stack(channels, axis=2).astype(np.uint8).tobytes()


def _encode_hue(rgb: Pixels, color_space: int) -> bytes:
    hsv = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV_FULL)
    hsy = np.dstack([hsv[:, :, :2], cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)])
    if color_space == HSY:
        return hsy.tobytes()
    if 6 <= color_space <= 8:
        return np.ascontiguousarray(hsy[:, :, color_space - 6]).tobytes()
    if color_space == HS_MIXED:
        mean = ((hsy[:, :, 0].astype(np.uint16) + hsy[:, :, 1]) // 2).astype(np.uint8)
        return np.dstack([hsy[:, :, :2], mean]).tobytes()
    full = np.full_like(hsv, 255)
    full[:, :, 0] = hsv[:, :, 0]
    return cv2.cvtColor(full, cv2.COLOR_HSV2RGB_FULL).tobytes()


def _millimetres(metres: DepthMap) -> npt.NDArray[np.uint16]:
    return np.clip(np.round(metres * 1000), 0, 65535).astype("<u2")


def _size(pixels: npt.NDArray[Any]) -> tuple[int, int]:
    return pixels.shape[1], pixels.shape[0]


def _rays(width: int, height: int) -> tuple[DepthMap, DepthMap]:
    """Returns each pixel's ray: its displacement right and down per unit of depth."""
    camera = CAMERAS[DEPTH]
    right = np.linspace(-1, 1, 2 * width + 1)[1::2] * math.tan(camera.width_fov / 2)
    down = np.linspace(-1, 1, 2 * height + 1)[1::2] * math.tan(camera.height_fov / 2)
    across, below = np.meshgrid(right.astype(np.float32), down.astype(np.float32))
    return across, below


def _ray_lengths(width: int, height: int) -> DepthMap:
    across, down = _rays(width, height)
    return np.sqrt(1 + across**2 + down**2)
