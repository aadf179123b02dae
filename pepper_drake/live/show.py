"""A live session on its page: what is pressed is done, what is done is shown."""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.live.drawing import LiveDrawing
from pepper_drake.live.page import LivePage
from pepper_drake.live.session import LiveSession, Mode

Vector = npt.NDArray[np.float64]

_HINT_PERIOD = 1.0
_LIMP = (Mode.GUIDED, Mode.RECORDED)


class LiveApp:
    """Puts a session, its page and its drawing together, frame by frame.

    Attributes:
        session: What happens.
        page: The controls.
    """

    def __init__(self, session: LiveSession, page: LivePage) -> None:
        """Shows a session.

        Args:
            session: What happens.
            page: On which page.
        """
        self.session, self.page = session, page
        self._drawing = LiveDrawing(page.meshcat, session.simulation.scene)
        self._mode: Mode | None = None
        self._hint, self._pace = "", session.simulation.pace

    def press(self, button: str) -> None:
        """Does what a button says."""
        session = self.session
        {
            "Record": session.record,
            "Stop": session.stop,
            "Learn": session.learn,
            "Reach": session.reach,
            "Save": session.save,
        }[button]()

    def move(self, name: str, offset: Vector) -> None:
        """Moves the goal object or an obstacle as its sliders do, to an offset (3,) in W [m].

        Raises:
            InputError: There is nothing of that name that can be moved.
        """
        self.session.simulation.set_offset(name, offset)
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
            session.simulation.set_offset(name, offset)
        limp = session.mode in _LIMP
        if limp:
            self._lead(entered=self._mode not in _LIMP)
        self._mode = session.mode
        session.advance()
        self._drawing.update(session)
        page.show_status(session.mode.value, session.status, self._describe_pace())

    def _lead(self, *, entered: bool) -> None:
        """Moves the guide as sliders or game pad say."""
        simulation, page = self.session.simulation, self.page
        velocity = page.pad_velocity()
        simulation.set_guide_velocity(velocity)
        if entered or np.any(velocity):
            X_TG = simulation.guide_pose()
            page.set_hand(X_TG)
            simulation.set_guide_target(X_TG)
        else:
            simulation.set_guide_target(page.hand())

    def _describe_pace(self) -> str:
        """Speed of the simulation in words, once a second."""
        before, pace = self._pace, self.session.simulation.pace
        wall = pace.wall_seconds - before.wall_seconds
        if wall > _HINT_PERIOD:
            frames = (pace.frames - before.frames) / wall
            rate = (pace.simulated_seconds - before.simulated_seconds) / wall
            self._hint, self._pace = f"{frames:.0f} frames/s, {rate:.2f} of real time", pace
        return self._hint
