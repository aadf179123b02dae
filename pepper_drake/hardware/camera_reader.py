"""A robot's camera, subscribed only while its images are wanted."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.transport import Transport
from pepper_drake.naoqi.clock import join_time
from pepper_drake.naoqi.constants import BOTTOM, DEPTH, DEPTH_MM, QVGA, RGB, TOP, VGA
from pepper_drake.naoqi.images import decode_reply, to_rgb

FORMATS: dict[int, tuple[int, int]] = {TOP: (VGA, RGB), BOTTOM: (VGA, RGB), DEPTH: (QVGA, DEPTH_MM)}
"""Requested resolution and colour space by camera."""
SIZES = {VGA: (480, 640), QVGA: (240, 320)}
FROZEN_SECONDS = 2.0
"""Time without a new time stamp after which a camera is frozen [s]: over WiFi two images per second
were observed."""
WARM_UP = 5.0
"""Timeout of the first image after a subscription [s]."""
_ANSWER_SECONDS = 3.0
_IDLE = 0.05

TakeImage = Callable[[int, float, npt.NDArray[Any]], Awaitable[bool]]


class CameraReader:
    """Reads one camera."""

    def __init__(
        self,
        transport: Transport,
        camera: int,
        name: str,
        rate: float,
        take: TakeImage,
        clock: LinkClock,
    ) -> None:
        """Subscribes to nothing yet.

        Args:
            transport: The robot.
            camera: NAOqi's id of the camera.
            name: Name for the subscription.
            rate: Images [1/s].
            take: Given camera, robot's time [s] and pixels, (height, width, 3) RGB or
                (height, width) of depths [mm]; returns whether it could use them.
            clock: Of the link.
        """
        self._transport, self._camera, self._rate = transport, camera, rate
        self._name = f"{name}_{camera}"
        self._take, self._clock, self._time = take, clock.now, clock
        self._handle = ""

    async def run(self, wanted: Callable[[], bool]) -> None:
        """Reads images while they are wanted, until cancelled.

        Raises:
            LinkFault: The camera is missing, frozen, or gives other images than requested.
        """
        stamp, changed = -np.inf, self._clock()
        try:
            while True:
                if not wanted():
                    await self._unsubscribe()
                    await self._time.pause(_IDLE)
                    continue
                begin = self._clock()
                if not self._handle:
                    await self._subscribe()
                    changed = self._clock() + WARM_UP
                reply = await self._reply()
                if reply is None:
                    if self._clock() > changed:
                        raise LinkFault("camera_missing", f"{self._title} has no image")
                    continue
                taken = join_time(reply[4], reply[5])
                if taken != stamp:
                    stamp, changed = taken, max(changed, self._clock())
                    await self._take(self._camera, taken, self._pixels(reply))
                elif self._clock() - changed > FROZEN_SECONDS:
                    raise LinkFault("camera_frozen", self._title)
                await self._time.pause(max(begin + 1 / self._rate - self._clock(), 0.0))
        finally:
            await self._unsubscribe()

    @property
    def _title(self) -> str:
        return f"camera {self._camera}"

    async def _subscribe(self) -> None:
        # A subscription left by an earlier run would count towards the robot's limit of six.
        await self._call("unsubscribeAllInstances", self._name)
        resolution, color_space = FORMATS[self._camera]
        rate = max(round(self._rate), 1)
        self._handle = await self._call(
            "subscribeCamera", self._name, self._camera, resolution, color_space, rate
        )
        if not self._handle:
            raise LinkFault("camera_missing", f"{self._title} cannot be subscribed to")

    async def _unsubscribe(self) -> None:
        handle, self._handle = self._handle, ""
        if handle and not self._transport.is_lost:
            with contextlib.suppress(LinkFault, TimeoutError):
                async with asyncio.timeout(1.0):
                    await self._call("unsubscribe", handle)

    async def _reply(self) -> Any:
        try:
            async with asyncio.timeout(_ANSWER_SECONDS / self._time.rate):
                reply = await self._call("getImageRemote", self._handle)
        except TimeoutError:
            raise LinkFault("camera_missing", f"{self._title} does not answer") from None
        return reply

    def _pixels(self, reply: Any) -> npt.NDArray[Any]:
        """Returns the decoded pixels, after a check of their size."""
        try:
            image = decode_reply(reply)
        except ValueError as error:
            raise LinkFault("camera_size", f"{self._title}: {error}") from None
        expected = SIZES[FORMATS[self._camera][0]]
        if image.pixels.shape[:2] != expected:
            height, width = image.pixels.shape[:2]
            raise LinkFault(
                "camera_size",
                f"{self._title} gives {width}x{height}, not {expected[1]}x{expected[0]}",
            )
        if self._camera == DEPTH:
            return image.pixels
        return to_rgb(image.pixels, image.color_space)

    async def _call(self, method: str, *arguments: Any) -> Any:
        return await self._transport.call("ALVideoDevice", method, *arguments)
