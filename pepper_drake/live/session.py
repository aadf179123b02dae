"""A live session: Pepper's response to the buttons."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.recording import (
    RecordingWriter,
    recorded_demonstration,
    without_rest,
)
from pepper_drake.live.session_file import SessionFolder, SessionRecord, Taught
from pepper_drake.live.simulation import LiveSimulation
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.trajectories.joint_trajectories import Retrace
from pepper_drake.systems.robot.arm_command import ArmMode

Vector = npt.NDArray[np.float64]

_SHORTEST_WAY = 0.03
"""Least path length of the hand in a recording [m]."""
_AT_START = 0.015
"""Joint error below which the arm has returned to the start [rad]."""
_FEWEST = 10
"""Least number of samples of a trimmed demonstration."""
_PATIENCE = 3.0
"""Longest settling time of the arm at the start [s]."""
_NOTICE = 4.0
"""Time for which the result of a button is shown [s]."""


class Mode(StrEnum):
    """Modes of the session."""

    GUIDED = "guided"
    RECORDED = "recorded"
    RETURNING = "returning"
    LOOKING = "looking"
    PLANNING = "planning"
    REACHING = "reaching"
    WAITING = "waiting"
    HOLDING = "holding"
    STOPPED = "stopped"


_OF_REACH = {
    ReachMode.IDLE: Mode.LOOKING,
    ReachMode.LOOKING: Mode.LOOKING,
    ReachMode.SETTLING: Mode.PLANNING,
    ReachMode.REACHING: Mode.REACHING,
    ReachMode.HOLDING: Mode.HOLDING,
    ReachMode.FAILED: Mode.STOPPED,
}


class LiveSession:
    """Session of teaching and reaching, advanced frame by frame.

    The buttons of the page call the methods `record`, `stop`, `learn`, `reach` and `save`, whose
    results are in `mode` and `status`. A button that does not apply only sets `status` to the
    reason. `advance` proceeds to the next frame.

    Attributes:
        simulation: The robot.
        taught: The taught movement, apart from the objects' places, which the simulation holds.
        resumed: What the session resumed with, in words; empty for a new session.
    """

    def __init__(
        self,
        simulation: LiveSimulation,
        folder: SessionFolder | Path | None = None,
        lesson: SessionFolder | None = None,
    ) -> None:
        """Resumes the folder's session, or begins with the lesson, or with nothing taught.

        Args:
            simulation: The robot.
            folder: Folder to which every change is written at once, a recording to `recording/`
                while it is made, so that nothing is lost if the session ends. None writes nothing.
            lesson: The initial state of the session, to which `start_over` returns.

        Raises:
            InputError: A file of the session or the lesson is missing or broken.
        """
        self.simulation, self._lesson = simulation, lesson
        self._folder = SessionFolder(folder) if isinstance(folder, Path) else folder
        self._doing: Mode | None = Mode.GUIDED
        self.taught = Taught()
        self._before: list[Taught] = []
        self._writer: RecordingWriter | None = None
        self._retrace: Retrace | None = None
        self._since = self._notice_until = 0.0
        self._notice = self._why_adapted = ""
        self._explained_movement: Movement | None = None
        self.resumed = ""
        if self._folder is not None and self._folder.exists():
            self._restore(self._folder.taught(simulation.arm), at_once=True)
            number = len(self.shown)
            self.resumed = f"{number} demonstration{'' if number == 1 else 's'}"
            if self.primitive is not None:
                self.resumed += " and a learned movement"
        elif lesson is not None:
            self._restore(self._of_lesson(lesson), at_once=True)
            self._keep()

    @property
    def demonstration(self) -> Demonstration | None:
        """The last demonstration, if any."""
        return self.taught.demonstration

    @property
    def shown(self) -> tuple[Demonstration, ...]:
        """All demonstrations, from which Learn learns together."""
        return self.taught.shown

    @property
    def primitive(self) -> MovementPrimitive | None:
        """The primitive learned last, if any."""
        return self.taught.primitive

    @property
    def lesson(self) -> SessionRecord | None:
        """Title and tasks of the lesson, if any."""
        return self._lesson.record if self._lesson is not None else None

    @property
    def mode(self) -> Mode:
        """Present mode: the user's, or else the reach's."""
        if self._doing is not None:
            return self._doing
        state = self.simulation.reach_state()
        if state.suspended_plan is not None and state.mode == ReachMode.REACHING:
            return Mode.WAITING
        return _OF_REACH[state.mode]

    @property
    def status(self) -> str:
        """Status in words, or for some seconds the result of a button."""
        has_notice = self.simulation.time < self._notice_until
        return self._notice if has_notice else self._describe()

    @property
    def next_button(self) -> str:
        """The button of the next step."""
        if self.mode in (Mode.HOLDING, Mode.STOPPED):
            return "Reach"
        if self.mode != Mode.GUIDED:
            return "Stop"
        if self.demonstration is None:
            return "Record"
        return "Reach" if self.taught.learned is self.demonstration else "Learn"

    def record(self) -> None:
        """Makes the arm limp, if it is not, and starts to record."""
        if self.mode == Mode.RECORDED:
            self._notify("Already recording; Stop ends it")
            return
        if self._folder is not None:
            names = self.simulation.diagram.recorder.joint_names
            try:
                self._writer = RecordingWriter(self._folder.path / "recording", names)
            except InputError as error:
                self._notify(str(error))
                return
        self._enter(Mode.RECORDED)

    def stop(self) -> None:
        """Ends the present activity; then the arm is limp, and the guide holds the hand."""
        if self.mode == Mode.RECORDED:
            self._end_recording()
        elif self.mode == Mode.GUIDED:
            self._notify("Nothing is running; Record keeps what you show")
        else:
            self._enter(Mode.GUIDED)
            self._notify("The arm is limp again; lead the hand with mouse or keys")

    def learn(self) -> None:
        """Learns one movement from all demonstrations."""
        if not self.check_limp("Learn"):
            return
        if self.demonstration is None:
            self._notify("There is nothing to learn yet; Record a movement first")
        else:
            started = time.perf_counter()
            try:
                primitive = MovementPrimitive.fit(self.shown)
            except InputError as error:
                self._notify(f"{error}; Discard one of them, or Undo")
                return
            spent = 1000 * (time.perf_counter() - started)
            self._change(primitive=primitive, learned=self.demonstration)
            self.simulation.set_primitive(primitive)
            number = len(self.shown)
            source = f" from {number} demonstrations" if number > 1 else ""
            self._notify(
                f"Learned a movement of {primitive.duration:.1f} s and "
                f"{primitive.path_length:.2f} m{source} in {spent:.0f} ms; Reach performs it"
            )
            self._keep()

    def reach(self) -> None:
        """Returns the arm to the start of the movement, and performs it."""
        if self.mode == Mode.RECORDED:
            self.check_limp("Reach")
        elif self.taught.learned is None:
            first = "Record a movement, then Learn it" if not self.shown else "press Learn"
            self._notify(f"There is nothing to perform yet; {first}")
        else:
            assert self.taught.learned.joints is not None
            self._retrace = Retrace(self.simulation.joints(), self.taught.learned.joints)
            self._enter(Mode.RETURNING)

    def trim(self, start: float, end: float) -> None:
        """Keeps the part of the last demonstration between two times [s]."""
        motion = self.demonstration
        if not self.check_limp("Trim"):
            return
        if motion is None:
            self._notify("There is nothing to trim yet; Record a movement first")
            return
        part = np.flatnonzero((motion.times >= start) & (motion.times <= end))
        if len(part) == len(motion.times):
            self._notify("That keeps all of it; move the ends of Keep, then Trim")
            return
        trimmed = motion.selected(part)
        if len(part) < _FEWEST or trimmed.path_length < _SHORTEST_WAY:
            self._notify("That would leave no movement; keep more of it")
            return
        trimmed = self._numbered(replace(trimmed, times=trimmed.times - trimmed.times[0]))
        self._change(shown=(*self.shown[:-1], trimmed))
        self._notify(
            f"Kept {trimmed.duration:.1f} s of {motion.duration:.1f} s; Undo brings it back"
        )
        self._keep()

    def discard(self) -> None:
        """Discards the last demonstration."""
        if not self.check_limp("Discard"):
            return
        if not self.shown:
            self._notify("There is nothing to discard yet; Record a movement first")
            return
        self._change(shown=self.shown[:-1])
        self._notify("Discarded the last demonstration; Undo brings it back")
        self._keep()

    def move(self, name: str, offset: Vector) -> None:
        """Moves the goal object or an obstacle to an offset (3,) in W [m] from its place.

        Raises:
            InputError: There is no movable object of that name.
        """
        self.simulation.set_offset(name, offset)

    def begin_move(self) -> None:
        """Stores the objects' places for Undo before one of them is moved."""
        self._change()

    def end_move(self, words: str = "") -> None:
        """Saves the objects' places, and shows a result in words."""
        if words:
            self._notify(words)
        self._keep()

    def undo(self) -> None:
        """Undoes the last recording, trimming, discarding, learning, moving or adding."""
        if not self._before:
            self._notify("There is nothing to undo")
            return
        before = self._before[-1]
        objects_only = before.taught_the_same(self.taught)
        if not objects_only and not self.check_limp("Undo"):
            return
        self._before.pop()
        self._restore(before)
        what = "objects stand as before" if objects_only else self._describe_next()
        self._notify(f"Undone: {what}")
        self._keep()

    def start_over(self) -> None:
        """Goes back to what the lesson began with; Undo brings the rest back."""
        if self.check_limp("Start over") and self._lesson is not None:
            try:
                start = self._of_lesson(self._lesson)
            except InputError as error:
                self._notify(str(error))
                return
            self._change()
            self._restore(start)
            self._notify("The lesson starts over; Undo brings back what was there")
            self._keep()

    def predicted(self) -> Vector:
        """Returns the primitive's path of the hand (N, 3) in T to the present goal [m].

        It ignores obstacles; empty before a primitive was learned.
        """
        if self.primitive is None:
            return np.zeros((0, 3))
        goal = self.simulation.goal_position()
        return self.primitive.rollout(time_step=0.05, goal=goal).positions

    def _change(self, **taught: Any) -> None:
        """Changes the taught state, and stores the previous one for Undo."""
        now = replace(self.taught, offsets=self.simulation.offsets())
        self._before.append(now)
        self.taught = replace(now, **taught)

    def _restore(self, taught: Taught, *, at_once: bool = False) -> None:
        """Restores a taught state."""
        self.taught = taught
        if taught.primitive is not None:
            self.simulation.set_primitive(taught.primitive)
        self.simulation.restore_offsets(taught.offsets, at_once=at_once)

    def _of_lesson(self, lesson: SessionFolder) -> Taught:
        """Reads a lesson; its demonstrations become this session's."""
        taught = lesson.taught(self.simulation.arm)
        stored = {motion.name: self._numbered(motion) for motion in taught.shown}
        learned = taught.learned
        if learned is not None:
            learned = stored.get(learned.name) or self._numbered(learned)
        return replace(taught, shown=tuple(stored.values()), learned=learned)

    def _numbered(self, motion: Demonstration) -> Demonstration:
        """Names a demonstration by a new number in this session's folder."""
        return motion if self._folder is None else self._folder.named(motion)

    def _keep(self) -> None:
        """Writes all changes, so that nothing is lost if the session ends."""
        if self._folder is None:
            return
        try:
            self._folder.write(replace(self.taught, offsets=self.simulation.offsets()))
        except InputError as error:
            self._notify(str(error))

    def save(self) -> None:
        """Writes the demonstration's files and `primitive.yaml`, if they exist."""
        if self._folder is None:
            self._notify("There is no folder to save in")
        elif self.demonstration is None and self.mode == Mode.RECORDED:
            self.check_limp("Save")
        elif self.demonstration is None:
            self._notify("There is nothing to save yet; Record a movement first")
        else:
            kept = "the demonstration"
            try:
                self.demonstration.save(self._folder.path / "demonstration")
                self._keep()
                if self.primitive is not None:
                    kept += " and the primitive"
            except InputError as error:
                self._notify(str(error))
                return
            self._notify(f"Saved {kept} in {self._folder.path}")

    def advance(self, attend: Callable[[], None] = lambda: None) -> None:
        """Simulates up to the next frame, and advances recording and return.

        Args:
            attend: Called at the start and several times in between, to process user input.

        Raises:
            PepperDrakeError: The simulation cannot continue.
            InputError: The recording cannot be written.
        """
        self.simulation.advance(attend)
        if self._writer is not None:
            self._writer.write(*self.simulation.samples(self._since))
        if self._doing == Mode.RETURNING:
            self._return()

    @property
    def _elapsed(self) -> float:
        return self.simulation.time - self._since

    def _enter(self, doing: Mode) -> None:
        """Begins a user's activity, or the return to the movement's start."""
        returns = doing == Mode.RETURNING
        self.simulation.set_arm_mode(ArmMode.JOINTS if returns else ArmMode.LIMP)
        self._doing, self._since, self._notice_until = doing, self.simulation.time, 0.0

    def _end_recording(self) -> None:
        times, samples = self.simulation.samples(self._since)
        names = self.simulation.diagram.recorder.joint_names
        self._enter(Mode.GUIDED)
        recorded: Demonstration | None = None
        with contextlib.suppress(InputError):  # Too few samples.
            recorded = recorded_demonstration(times, samples, names)
        if recorded is None or recorded.path_length < _SHORTEST_WAY:
            self._end_writing(None)
            self._notify("The hand hardly moved; Record again")
            return
        motion = without_rest(recorded)
        self._end_writing(motion)
        motion = self._numbered(motion)
        self._change(shown=(*self.shown, motion))
        self._notify(
            f"Recorded {motion.duration:.1f} s and {motion.path_length:.2f} m; "
            "Learn makes a movement from it"
        )
        self._keep()

    def _end_writing(self, demonstration: Demonstration | None) -> None:
        """Finishes the file of the running recording, or deletes it for None."""
        if self._writer is None:
            return
        with self._writer:
            if demonstration is None:
                self._writer.discard()
            else:
                self._writer.finish(demonstration)
        self._writer = None

    def _return(self) -> None:
        """Continues the return of the arm, and starts the reach once it is at the start.

        If the arm was stopped or does not settle, the reach starts, too, and reports the reason.
        """
        path, elapsed = self._retrace, self._elapsed
        assert path is not None
        self.simulation.set_joint_target(path.at(elapsed))
        error = float(np.abs(self.simulation.joints() - path.at(elapsed)).max())
        has_returned = elapsed >= path.duration and error < _AT_START
        if has_returned or self.simulation.is_stopped() or elapsed > path.duration + _PATIENCE:
            self.simulation.reach()
            self._doing, self._since = None, self.simulation.time

    def check_limp(self, button: str) -> bool:
        """Tells whether a button for the limp arm may act; if not, the status says why."""
        if self.mode != Mode.GUIDED:
            doing = "recording" if self.mode == Mode.RECORDED else self.mode
            self._notify(f"Pepper is {doing}; press Stop before {button}")
        return self.mode == Mode.GUIDED

    def tell(self, words: str) -> None:
        """Shows the result of an action on the page for some seconds."""
        self._notify(words)

    def _notify(self, words: str) -> None:
        self._notice, self._notice_until = words, self.simulation.time + _NOTICE

    def _describe(self) -> str:
        """Returns a sentence about the present activity and the next step."""
        if self.mode == Mode.GUIDED:
            return self._describe_next()
        if self.mode == Mode.RECORDED:
            return f"Recording, {self._elapsed:.1f} s: lead the hand; Stop ends it"
        if self.mode == Mode.RETURNING:
            return "The arm goes back to where the movement starts"
        return self._describe_reach()

    def _describe_reach(self) -> str:
        mode, state = self.mode, self.simulation.reach_state()
        left = 1000 * self.simulation.goal_distance()
        if mode == Mode.STOPPED:
            hint = "Move the goal or what is in the way, then Reach; or Stop, and Record again"
            return f"Stopped: {state.message}. {hint}"
        if mode == Mode.LOOKING:
            seen = self.simulation.goal_is_seen()
            return "Pepper looks at the scene" if seen else "Pepper looks for the goal's marker"
        if mode == Mode.PLANNING:
            return "Pepper plans its movement around what it sees"
        if mode == Mode.WAITING:
            unseen = f": {state.message}" if state.message else ""
            return f"Something is in the way; the arm has withdrawn and waits for it to go{unseen}"
        if mode == Mode.REACHING:
            if state.movement is not self._explained_movement:
                self._explained_movement, self._why_adapted = (
                    state.movement,
                    self.simulation.why_adapted(),
                )
            if self._why_adapted:
                return f"{left:.0f} mm to go. Adapted: {self._why_adapted}"
            return f"{left:.0f} mm to go; move the goal or what is in the way"
        if not self.simulation.goal_is_seen():
            return f"{left:.0f} mm from the goal, whose marker is hidden; Reach again, or Stop"
        if self.simulation.has_arrived():
            return "At the goal; move it and the hand follows; Reach again, or Stop"
        return f"{left:.0f} mm from the goal; the hand follows"

    def _describe_next(self) -> str:
        if self.demonstration is None:
            return "Lead the hand with mouse or keys; Record keeps what you show"
        if self.taught.learned is not self.demonstration:
            return "Learn makes a movement from what you showed; Record adds another demonstration"
        return "Reach performs what was learned; Record adds another demonstration"
