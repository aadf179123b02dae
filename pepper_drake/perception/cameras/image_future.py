"""An image that is still being made: rendering goes on beside the simulation."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class ImageFuture:
    """Pixels that some thread is making, or has made. Never changed once made.

    Attributes:
        future: Gives the pixels (height, width, channels).
        executor: The single thread on which they are made, one image after the other.
    """

    future: "Future[Pixels]"
    executor: Executor

    def pixels(self) -> Pixels:
        """Waits for the pixels (height, width, channels)."""
        return self.future.result()

    def then(self, change: Callable[[Pixels], Pixels]) -> "ImageFuture":
        """Has the same thread make another image of this one, once it is there."""
        return ImageFuture(self.executor.submit(lambda: change(self.pixels())), self.executor)

    def __deepcopy__(self, memo: dict) -> "ImageFuture":
        """Returns itself: Drake copies values and state, and an image never changes."""
        return self


class _Immediately(Executor):
    """Does at once, on the calling thread, what it is asked for."""

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Runs the function and returns its result as a future that is done."""
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


IMMEDIATELY = _Immediately()
"""The executor that does at once, on the calling thread, what it is asked for."""


def completed_image(pixels: Pixels) -> ImageFuture:
    """Wraps pixels (height, width, channels) that are there already."""
    return ImageFuture(IMMEDIATELY.submit(lambda: pixels), IMMEDIATELY)


def empty_image() -> ImageFuture:
    """An image of no pixels (0, 0, 4)."""
    return completed_image(np.zeros((0, 0, 4), np.uint8))
