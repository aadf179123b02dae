"""An image that may still be rendering in the background."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class ImageFuture:
    """Pixels computed on a background thread; immutable.

    Attributes:
        future: Future of the pixels (height, width, channels).
        executor: The single thread that computes them, one image after the other.
    """

    future: "Future[Pixels]"
    executor: Executor

    def pixels(self) -> Pixels:
        """Waits for the pixels and returns them (height, width, channels)."""
        return self.future.result()

    def then(self, change: Callable[[Pixels], Pixels]) -> "ImageFuture":
        """Has the same thread transform this image once it is ready."""
        return ImageFuture(self.executor.submit(lambda: change(self.pixels())), self.executor)

    def __deepcopy__(self, memo: dict) -> "ImageFuture":
        """Returns itself: Drake copies values and state, and an image never changes."""
        return self


class _ImmediateExecutor(Executor):
    """Runs functions immediately on the calling thread."""

    def __repr__(self) -> str:
        """Short, as signatures have it as a default."""
        return "IMMEDIATE"

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Runs the function and returns its result as a completed future."""
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


IMMEDIATE = _ImmediateExecutor()
"""An executor that runs its work at once, on the calling thread."""


def completed_image(pixels: Pixels) -> ImageFuture:
    """Wraps existing pixels (height, width, channels)."""
    return ImageFuture(IMMEDIATE.submit(lambda: pixels), IMMEDIATE)


def empty_image() -> ImageFuture:
    """Returns an image without pixels (0, 0, 4)."""
    return completed_image(np.zeros((0, 0, 4), np.uint8))
