"""A live session on its page: what is pressed is done, what is done is shown."""

import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.live.drawing import LiveDrawing
from pepper_drake.live.page import LivePage
from pepper_drake.live.session import LiveSession, Mode

Vector = npt.NDArray[np.float64]

_HINT_PERIOD = 1.0
_LIMP = (Mode.GUIDED, Mode.RECORDED)


class LiveShow:
    """Puts a session, its page and its drawing together, frame by frame.

    Attributes:
        session: What happens.
        page: The controls.
    """

    def __init__(self, session: LiveSession, page: LivePage, folder: Path) -> None:
        """Shows a session.

        Args:
            session: What happens.
            page: On which page.
            folder: Where Save puts what was taught.
        """
        self.session, self.page, self._folder = session, page, folder
        self._drawing = LiveDrawing(page.meshcat, session.scene)
        self._mode: Mode | None = None
        self._hint, self._hint_pace, self._hint_time = "", session.pace, time.perf_counter()

    def press(self, button: str) -> None:
        """Does what a button says."""
        session = self.session
        if button == "Save":
            session.save(self._folder)
        else:
            {
                "Record": session.record,
                "Stop": session.stop,
                "Learn": session.learn,
                "Reach": session.reach,
            }[button]()

    def move(self, name: str, offset: Vector) -> None:
        """Moves the goal object or an obstacle as its sliders do, to an offset (3,) in W [m].

        Raises:
            InputError: There is nothing of that name that can be moved.
        """
        self.session.set_offset(name, offset)
        self.page.set_offset(name, offset)

    def lead(self, X_TG: RigidTransform) -> None:
        """Leads the hand to a pose in T as the hand's sliders do."""
        self.page.set_hand(X_TG)

    def step(self) -> None:
        """Reads the page, simulates one frame, and shows it."""
        session, page = self.session, self.page
        for button in page.pressed():
            self.press(button)
        for name, offset in page.offsets().items():
            session.set_offset(name, offset)
        limp = session.mode in _LIMP
        if limp:
            self._lead(entered=self._mode not in _LIMP)
        self._mode = session.mode
        session.advance()
        self._drawing.update(session)
        page.show_status(session.mode.value, session.status, self._pace())

    def _lead(self, *, entered: bool) -> None:
        """Moves the guide as sliders or game pad say."""
        session, page = self.session, self.page
        velocity = page.pad_velocity()
        session.set_guide_velocity(velocity)
        if entered or np.any(velocity):
            X_TG = session.guide_pose()
            page.set_hand(X_TG)
            session.set_guide_target(X_TG)
        else:
            session.set_guide_target(page.hand())

    def _pace(self) -> str:
        """How fast it goes, in words, once a second."""
        now, pace = time.perf_counter(), self.session.pace
        if now - self._hint_time > _HINT_PERIOD:
            before = self._hint_pace
            wall = now - self._hint_time
            frames = (pace.frames - before.frames) / wall
            rate = (pace.simulated_seconds - before.simulated_seconds) / wall
            self._hint = f"{frames:.0f} frames/s, {rate:.2f} of real time"
            self._hint_pace, self._hint_time = pace, now
        return self._hint
