"""Shared memory of the station's process and the link's: states, commands and images.

Times are the machine's monotonic clock [s], which is the same in all its processes.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.robot_server.robot.shared_state import SharedRecord

CAMERA_NAMES = ("camera_top", "camera_bottom", "camera_depth")
"""Cameras in the order of NAOqi's ids."""

IDLE, STREAM, HOLD, HAND_OVER, END = range(5)
"""Modes that the station commands: nothing, follow commands, hold, lower the arm, end."""

LARGEST_IMAGE = 640 * 480 * 3

STATE = np.dtype(
    [
        ("time", "f8"),
        ("positions", "f8", len(BODY_JOINTS)),
        ("base_pose", "f8", 3),
        ("hands", "f8", len(HANDS)),
        ("round_trip", "f8"),
        ("clock_bound", "f8"),
        ("states", "i8"),
        ("late", "i8"),
        ("phase", "U16"),
        ("slowed", "?"),
        ("held", "?"),
        ("fault", "U24"),
        ("detail", "U240"),
    ]
)
"""Newest state of robot and link; `time` is that of the measurement, `hands` are openings."""

COMMAND = np.dtype(
    [
        ("time", "f8"),
        ("mode", "i4"),
        ("positions", "f8", len(BODY_JOINTS)),
        ("velocities", "f8", len(BODY_JOINTS)),
        ("base_velocity", "f8", 3),
        ("hands", "f8", len(HANDS)),
        ("enabled", "?", len(CAMERA_NAMES)),
    ]
)
"""Newest command, of time `time`. A hand with NaN is not moved."""

IMAGE = np.dtype(
    [
        ("time", "f8"),
        ("width", "i4"),
        ("height", "i4"),
        ("positions", "f8", len(BODY_JOINTS)),
        ("base_pose", "f8", 3),
        ("pixels", "u1", LARGEST_IMAGE),
    ]
)
"""Newest image of a camera, with the joints at its capture."""


@dataclass(frozen=True)
class MailboxNames:
    """Names under which another process opens a mailbox."""

    state: str
    command: str
    images: tuple[str, ...]


class Mailbox:
    """The shared records. The link writes state and images, the station the command.

    Attributes:
        state: Of dtype `STATE`.
        command: Of dtype `COMMAND`.
        images: Of dtype `IMAGE`, one for each of `CAMERA_NAMES`.
    """

    def __init__(self, names: MailboxNames | None = None) -> None:
        """Creates the memory, or opens that of another process.

        Args:
            names: Of the mailbox to open; None to create one.
        """
        self.state = SharedRecord(STATE, names.state if names else None)
        self.command = SharedRecord(COMMAND, names.command if names else None)
        if names is None:
            self.command.write(hands=np.full(len(HANDS), np.nan))
        self.images = tuple(
            SharedRecord(IMAGE, names.images[k] if names else None)
            for k in range(len(CAMERA_NAMES))
        )

    @property
    def names(self) -> MailboxNames:
        """Names for another process."""
        return MailboxNames(
            self.state.name, self.command.name, tuple(image.name for image in self.images)
        )

    def write_image(
        self,
        camera: int,
        time: float,
        pixels: npt.NDArray[Any],
        positions: npt.NDArray[np.float64],
        base_pose: npt.NDArray[np.float64],
    ) -> None:
        """Writes an image: (height, width, 3) of uint8, or (height, width) of uint16."""
        content = np.zeros(LARGEST_IMAGE, np.uint8)
        content[: pixels.nbytes] = np.ascontiguousarray(pixels).view(np.uint8).ravel()
        self.images[camera].write(
            time=time,
            width=pixels.shape[1],
            height=pixels.shape[0],
            positions=positions,
            base_pose=base_pose,
            pixels=content,
        )

    def close(self) -> None:
        """Releases the memory; its creator removes it."""
        for record in (self.state, self.command, *self.images):
            record.close()
