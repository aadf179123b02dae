"""A camera as the robot has it: its own rate, lens, noise, and a time stamp on every image."""

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
    LeafSystem,
    OutputPort,
    State,
)
from pydrake.systems.sensors import ImageDepth16U, ImageDepth32F, ImageRgba8U

from pepper_drake.errors import InputError
from pepper_drake.perception.camera import CameraIntrinsics
from pepper_drake.perception.noise import ColorNoise, DepthNoise, degrade_color, degrade_depth


@dataclass(frozen=True)
class Frame:
    """One captured image with all that was measured when it was taken. Never changed once made.

    Attributes:
        image: (height, width, channels); empty when none was taken yet.
        time: When it was taken, s; minus infinity when none was taken yet.
        number: How many images were taken before it.
        X_WC: The camera's measured pose.
        position: The robot's measured joint positions, (n,).
    """

    image: npt.NDArray[Any]
    time: float
    number: int
    X_WC: RigidTransform
    position: npt.NDArray[np.float64]

    def __deepcopy__(self, memo: dict) -> "Frame":
        """Returns itself: Drake copies the state at each event, and a frame never changes."""
        return self


class CameraModel(LeafSystem):
    """Captures rendered images at the camera's rate and spoils them as the real sensor does.

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

    `image` is an RgbdSensor's `color_image` (ImageRgba8U) or `depth_image_32f` (ImageDepth32F). It
    is evaluated at captures only, and not at all while `enabled` is zero, so that nothing is
    rendered that nobody looks at. `X_WC` (RigidTransform) and `position` (the robot's measured
    joints) are captured with the image and handed on beside it: who uses the image can tell where
    the camera was when it was taken. A camera whose `X_WC` is unconnected reports the identity.

    `color_image` is an ImageRgba8U, `depth_image` an ImageDepth16U in whole millimetres with 0
    where nothing came back. Before the first capture they are empty (0x0) and `time_stamp` is
    minus infinity. An empty image at the input counts as a dropped frame: the last one stays.

    State: the last frame (abstract). Event: one periodic unrestricted update.

    Args:
        intrinsics: The camera; its distortion is applied to colour images.
        kind: "color" or "depth".
        period: Time between images, s.
        offset: Time of the first image, s.
        noise: The sensor's noise; a ColorNoise or DepthNoise with its defaults when left out.
        seed: Seed of the noise; together with the frame's number it decides the noise.
        num_positions: Size of the input `position`.
    """

    def __init__(
        self,
        intrinsics: CameraIntrinsics,
        *,
        kind: str,
        period: float = 0.2,
        offset: float = 0.0,
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
        self.intrinsics = intrinsics
        self._noise = noise
        self._seed = seed
        is_color = isinstance(noise, ColorNoise)
        self._image_type = ImageRgba8U if is_color else ImageDepth16U

        self._image = self.DeclareAbstractInputPort(
            "image", Value(ImageRgba8U() if is_color else ImageDepth32F())
        )
        self._X_WC = self.DeclareAbstractInputPort("X_WC", Value(RigidTransform()))
        self._position = self.DeclareVectorInputPort("position", num_positions)
        self._enabled = self.DeclareVectorInputPort("enabled", 1)

        none = Frame(
            np.zeros((0, 0, 4 if is_color else 1), np.uint8 if is_color else np.uint16),
            -np.inf,
            0,
            RigidTransform(),
            np.zeros(num_positions),
        )
        self._frame = self.DeclareAbstractState(Value(none))
        ticket = {self.abstract_state_ticket(self._frame)}
        self._image_out = self.DeclareAbstractOutputPort(
            f"{kind}_image",
            lambda: Value(self._image_type()),
            self._calc_image,
            prerequisites_of_calc=ticket,
        )
        self._time_stamp_out = self.DeclareVectorOutputPort(
            "time_stamp", 1, self._calc_time_stamp, prerequisites_of_calc=ticket
        )
        self._X_WC_out = self.DeclareAbstractOutputPort(
            "X_WC",
            lambda: Value(RigidTransform()),
            self._calc_X_WC,
            prerequisites_of_calc=ticket,
        )
        self._position_out = self.DeclareVectorOutputPort(
            "position", num_positions, self._calc_position, prerequisites_of_calc=ticket
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset, self._capture)

    def get_image_input_port(self) -> InputPort:
        """The rendered image."""
        return self._image

    def get_image_output_port(self) -> OutputPort:
        """The captured image."""
        return self._image_out

    def last_frame(self, context: Context) -> Frame:
        """Returns the last frame captured in this context."""
        return context.get_abstract_state(int(self._frame)).get_value()

    def _capture(self, context: Context, state: State) -> EventStatus:
        if self._enabled.HasValue(context) and self._enabled.Eval(context)[0] <= 0:
            return EventStatus.DidNothing()
        last = self.last_frame(context)
        pixels: npt.NDArray[Any] = self._image.Eval(context).data
        if pixels.size == 0:
            return EventStatus.DidNothing()
        image: npt.NDArray[Any]
        if isinstance(self._noise, ColorNoise):
            image = degrade_color(
                pixels, self.intrinsics, self._noise, seed=self._seed, frame=last.number
            )
        else:
            image = degrade_depth(
                pixels[..., 0], self.intrinsics, self._noise, seed=self._seed, frame=last.number
            )[..., None]
        image.setflags(write=False)
        frame = Frame(
            image,
            context.get_time(),
            last.number + 1,
            RigidTransform(self._X_WC.Eval(context)) if self._X_WC.HasValue(context) else last.X_WC,
            self._position.Eval(context) if self._position.HasValue(context) else last.position,
        )
        state.get_mutable_abstract_state(int(self._frame)).set_value(frame)
        return EventStatus.Succeeded()

    def _calc_image(self, context: Context, output: Value) -> None:
        pixels = self.last_frame(context).image
        image = output.get_mutable_value()
        height, width = pixels.shape[:2]
        if (image.width(), image.height()) != (width, height):
            image.resize(width, height)
        if pixels.size:
            image.mutable_data[:] = pixels

    def _calc_time_stamp(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self.last_frame(context).time)

    def _calc_X_WC(self, context: Context, output: Value) -> None:
        output.set_value(self.last_frame(context).X_WC)

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.last_frame(context).position)
