"""Model of a real camera: frame rate, lens, noise, latency and time stamps."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import (
    BasicVector,
    Context,
    EventStatus,
    InputPort,
    OutputPort,
    State,
)
from pydrake.systems.sensors import ImageDepth16U, ImageDepth32F, ImageRgba8U

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.image_future import (
    ImageFuture,
    Pixels,
    completed_image,
    empty_image,
)
from pepper_drake.perception.cameras.noise import (
    ColorNoise,
    DepthNoise,
    apply_color_noise,
    apply_depth_noise,
    drop_dark_patches,
)
from pepper_drake.systems.framework import LeafSystem


@dataclass(frozen=True)
class Frame:
    """A captured image with the measurements made at the same time; immutable.

    Attributes:
        image: Pixels (height, width, channels), empty before the first capture.
        time: Capture time [s]; minus infinity before the first capture.
        number: Number of frames up to and including this one; 0 before the first capture.
        X_WC: The camera's measured pose.
        position: The robot's measured joint positions, (n,).
    """

    image: ImageFuture
    time: float
    number: int
    X_WC: RigidTransform
    position: npt.NDArray[np.float64]

    def __deepcopy__(self, memo: dict) -> Frame:
        """Returns itself: Drake copies the state at each event, and a frame never changes."""
        return self


@dataclass(frozen=True)
class _Frames:
    """The published frame, and the one captured last, which may not be published yet."""

    out: Frame
    captured: Frame

    def __deepcopy__(self, memo: dict) -> _Frames:
        return self


class CameraModel(LeafSystem):
    """Captures rendered images at the camera's rate and degrades them as the real sensor does.

    .. pydrake_system::

        name: CameraModel
        input_ports:
        - image
        - X_WC (optional)
        - position (optional)
        - enabled (optional)
        output_ports:
        - color_image or depth_image
        - time_stamp
        - X_WC
        - position

    `image` is an RgbdSensor's `color_image` (ImageRgba8U) or `depth_image_32f` (ImageDepth32F), or
    an AsyncRgbdSensor's ImageFuture. It is evaluated at captures only, and not at all while
    `enabled` is zero, so that no unused image is rendered. `X_WC` (RigidTransform) and `position`
    (the robot's measured joints) are captured and published with the image, so that consumers know
    the camera's pose at the time of capture. If `X_WC` is unconnected, it is the identity.

    `color_image` is an ImageRgba8U, `depth_image` an ImageDepth16U in whole millimetres with 0
    for holes. Before the first capture they are empty (0x0) and `time_stamp` is minus infinity. An
    empty image at the input counts as a dropped frame: the last one stays.

    An image is published `latency` after its capture, the time that a real camera needs for readout
    and transmission; a background renderer has this time to finish.

    State: the frame published and the one captured last (abstract). Events: two periodic
    unrestricted updates, one to capture and one to publish.

    Args:
        intrinsics: The camera; its distortion is applied to colour images.
        kind: "color" or "depth".
        period: Time between images [s].
        offset: Time of the first image [s].
        latency: Time from an image's capture to its publication [s]; less than the period.
        background: Whether the input `image` is an ImageFuture.
        noise: The sensor's noise; a ColorNoise or DepthNoise with its defaults if omitted.
        seed: Seed of the noise, together with the frame's number.
        num_positions: Size of the input `position`.
    """

    def __init__(
        self,
        intrinsics: CameraIntrinsics,
        *,
        kind: str,
        period: float = 0.2,
        offset: float = 0.0,
        latency: float = 0.0,
        background: bool = False,
        noise: ColorNoise | DepthNoise | None = None,
        seed: int = 0,
        num_positions: int = 0,
    ) -> None:
        super().__init__()
        if kind not in ("color", "depth"):
            raise InputError(f'CameraModel: kind {kind!r} must be "color" or "depth".')
        expected = ColorNoise if kind == "color" else DepthNoise
        noise = expected() if noise is None else noise
        if not isinstance(noise, expected):
            raise InputError(f"CameraModel: a {kind} camera takes {expected.__name__} as noise.")
        if not 0.0 <= latency < period:
            raise InputError(
                f"CameraModel: latency {latency} s must be within its period, {period} s."
            )
        self.intrinsics = intrinsics
        self._noise = noise
        self._seed = seed
        is_color = isinstance(noise, ColorNoise)
        self._image_type = ImageRgba8U if is_color else ImageDepth16U

        self._background = background
        self._latency = latency
        rendered = ImageRgba8U() if is_color else ImageDepth32F()
        self._image = self.DeclareAbstractInputPort(
            "image", Value(empty_image()) if background else Value(rendered)
        )
        self._X_WC = self.DeclareAbstractInputPort("X_WC", Value(RigidTransform()))
        self._position = self.DeclareVectorInputPort("position", num_positions)
        self._enabled = self.DeclareVectorInputPort("enabled", 1)

        none = Frame(
            empty_image(),
            -np.inf,
            0,
            RigidTransform(),
            np.zeros(num_positions),
        )
        self._frames = self.DeclareAbstractState(Value(_Frames(none, none)))
        ticket = {self.abstract_state_ticket(self._frames)}
        self._image_out = self.DeclareAbstractOutputPort(
            f"{kind}_image",
            lambda: Value(self._image_type()),
            self._calc_image,
            prerequisites_of_calc=ticket,
        )
        self.DeclareVectorOutputPort(
            "time_stamp", 1, self._calc_time_stamp, prerequisites_of_calc=ticket
        )
        self.DeclareAbstractOutputPort(
            "X_WC",
            lambda: Value(RigidTransform()),
            self._calc_X_WC,
            prerequisites_of_calc=ticket,
        )
        self.DeclareVectorOutputPort(
            "position", num_positions, self._calc_position, prerequisites_of_calc=ticket
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset, self._capture)
        if latency > 0.0:
            self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset + latency, self._publish)

    def get_image_input_port(self) -> InputPort:
        """Returns the input port of the rendered image."""
        return self._image

    def prepare(self) -> None:
        """Computes the noise pattern common to all images ahead of the first."""
        channels = 4 if isinstance(self._noise, ColorNoise) else 1
        shape = (self.intrinsics.height, self.intrinsics.width, channels)
        pixels = np.zeros(shape, np.uint8 if channels == 4 else np.float32)
        self._degrade(pixels, RigidTransform(), number=0)

    def get_image_output_port(self) -> OutputPort:
        """Returns the output port of the captured image."""
        return self._image_out

    def last_frame(self, context: Context) -> Frame:
        """Returns the published frame in this context."""
        return self._get_frames(context).out

    def _get_frames(self, context: Context) -> _Frames:
        return context.get_abstract_state(int(self._frames)).get_value()

    def _capture(self, context: Context, state: State) -> EventStatus:
        if self._enabled.HasValue(context) and self._enabled.Eval(context)[0] <= 0:
            return EventStatus.DidNothing()
        frames = self._get_frames(context)
        last = frames.captured
        rendered = self._image.Eval(context)
        if not self._background:
            if rendered.size() == 0:
                return EventStatus.DidNothing()
            rendered = completed_image(rendered.data)
        X_WC = (
            RigidTransform(self._X_WC.Eval(context)) if self._X_WC.HasValue(context) else last.X_WC
        )
        frame = Frame(
            rendered.then(functools.partial(self._degrade, X_WC=X_WC, number=last.number)),
            context.get_time(),
            last.number + 1,
            X_WC,
            self._position.Eval(context) if self._position.HasValue(context) else last.position,
        )
        state.get_mutable_abstract_state(int(self._frames)).set_value(
            _Frames(frames.out if self._latency > 0.0 else frame, frame)
        )
        return EventStatus.Succeeded()

    def _degrade(self, pixels: Pixels, X_WC: RigidTransform, number: int) -> Pixels:
        """Degrades an image rendered from a pose; the frame's number seeds its noise."""
        image: Pixels
        if isinstance(self._noise, ColorNoise):
            image = apply_color_noise(
                pixels, self.intrinsics, self._noise, seed=self._seed, frame=number
            )
        else:
            depth = drop_dark_patches(
                pixels[..., 0], self.intrinsics, X_WC, self._noise, seed=self._seed
            )
            image = apply_depth_noise(
                depth, self.intrinsics, self._noise, seed=self._seed, frame=number
            )[..., None]
        image.setflags(write=False)
        return image

    def _publish(self, context: Context, state: State) -> EventStatus:
        frames = self._get_frames(context)
        if frames.out is frames.captured:
            return EventStatus.DidNothing()
        state.get_mutable_abstract_state(int(self._frames)).set_value(
            _Frames(frames.captured, frames.captured)
        )
        return EventStatus.Succeeded()

    def _calc_image(self, context: Context, output: Value) -> None:
        fill_image(output.get_mutable_value(), self.last_frame(context).image.pixels())

    def _calc_time_stamp(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self.last_frame(context).time)

    def _calc_X_WC(self, context: Context, output: Value) -> None:
        output.set_value(self.last_frame(context).X_WC)

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.last_frame(context).position)


def fill_image(image: Any, pixels: npt.NDArray[Any]) -> None:
    """Sets a Drake image's size and pixels (height, width, channels); both may be empty."""
    height, width = pixels.shape[:2]
    if (image.width(), image.height()) != (width, height):
        image.resize(width, height)
    if pixels.size:
        image.mutable_data[:] = pixels
