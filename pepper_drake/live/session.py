"""One live session: what Pepper does next when a person presses a button."""

import contextlib
import time
from enum import StrEnum
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.diagrams.live_teaching import PUBLISH_PERIOD
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.recording import (
    RecordingWriter,
    recorded_demonstration,
    without_rest,
)
from pepper_drake.live.simulation import LiveSimulation
from pepper_drake.live.way_back import WayBack
from pepper_drake.planning.ik.command_check import STOP_SENTENCES, StopReason
from pepper_drake.systems.robot.arm_command import ArmMode

Vector = npt.NDArray[np.float64]

_SHORTEST_WAY = 0.03
"""A recording in which the hand goes less far is no movement [m]."""
_ARRIVED = 0.006
"""The hand is at its goal within this [m]."""
_LONGEST = 2.5
"""After so many durations of the movement it is over, wherever the hand is."""
_AT_START = 0.015
"""The arm is back at the start within this [rad]."""
_PATIENCE = 3.0
"""How long the arm, back at the start, waits for what it takes to reach [s]."""
_NOTICE = 4.0
"""How long it is told what came of a button [s]."""


class Mode(StrEnum):
    """What Pepper is doing."""

    GUIDED = "guided"
    RECORDED = "recorded"
    RETURNING = "returning"
    REACHING = "reaching"
    HOLDING = "holding"
    STOPPED = "stopped"


_ARM_MODES = {
    Mode.GUIDED: ArmMode.LIMP,
    Mode.RECORDED: ArmMode.LIMP,
    Mode.RETURNING: ArmMode.JOINTS,
    Mode.REACHING: ArmMode.HAND,
    Mode.HOLDING: ArmMode.HAND,
    Mode.STOPPED: ArmMode.HELD,
}


class LiveSession:
    """What Pepper is taught and does, frame by frame.

    The buttons of the page are its methods `record`, `stop`, `learn`, `reach` and `save`; what
    comes of them is in `mode` and `status`. Where a button makes no sense, `status` says why, and
    nothing else happens. `advance` goes on to the next frame.

    Attributes:
        simulation: The robot.
        mode: What Pepper is doing.
        demonstration: What was recorded last, if anything.
        primitive: What was learned last, if anything.
    """

    def __init__(self, simulation: LiveSimulation, folder: Path | None = None) -> None:
        """Makes a session in which nothing has been taught.

        Args:
            simulation: The robot.
            folder: Where Save puts what was taught. A recording is kept there in `recording/` as it
                is made, and survives whatever ends the session. Left out, nothing is written.
        """
        self.simulation, self._folder = simulation, folder
        self.mode = Mode.GUIDED
        self.demonstration: Demonstration | None = None
        self.primitive: MovementPrimitive | None = None
        self._learned: Demonstration | None = None
        self._writer: RecordingWriter | None = None
        self._way_back: WayBack | None = None
        self._since = self._settled = self._notice_until = 0.0
        self._notice = self._stopped_because = ""

    @property
    def status(self) -> str:
        """What Pepper is doing in words, or for some seconds what came of a button."""
        told = self.simulation.time < self._notice_until
        return self._notice if told else self._describe()

    def record(self) -> None:
        """Takes the arm limp, if it is not, and records from now on."""
        if self.mode == Mode.RECORDED:
            self._notify("It is recorded already; Stop ends it")
            return
        if self._folder is not None:
            names = self.simulation.diagram.recorder.joint_names
            try:
                self._writer = RecordingWriter(self._folder / "recording", names)
            except InputError as error:
                self._notify(str(error))
                return
        self._enter(Mode.RECORDED)

    def stop(self) -> None:
        """Ends what is going on; the arm is limp then, and the guide holds the hand."""
        if self.mode == Mode.RECORDED:
            self._end_recording()
        elif self.mode == Mode.GUIDED:
            self._notify("Nothing is going on; Record keeps what you show")
        else:
            self._enter(Mode.GUIDED)
            self._notify("The arm is limp again; lead the hand with sliders or keys")

    def learn(self) -> None:
        """Learns the movement that was recorded last."""
        if self.mode != Mode.GUIDED:
            self._notify(f"Pepper is {self.mode}; Stop comes before Learn")
        elif self.demonstration is None:
            self._notify("There is nothing to learn yet; Record a movement first")
        else:
            started = time.perf_counter()
            primitive = MovementPrimitive.fit(self.demonstration)
            spent = 1000 * (time.perf_counter() - started)
            self.primitive, self._learned = primitive, self.demonstration
            self.simulation.set_primitive(primitive)
            self._notify(
                f"Learned a movement of {primitive.duration:.1f} s and "
                f"{primitive.path_length:.2f} m in {spent:.0f} ms; Reach performs it"
            )

    def reach(self) -> None:
        """Takes the arm back to where the movement starts, and performs it."""
        if self.mode == Mode.RECORDED:
            self._notify("The arm is being led; Stop comes before Reach")
        elif self.primitive is None or self._learned is None:
            self._notify("There is nothing to perform yet; Record a movement, then Learn it")
        else:
            assert self._learned.joints is not None
            self._way_back = WayBack(self.simulation.joints(), self._learned.joints)
            self._enter(Mode.RETURNING)

    def save(self) -> None:
        """Writes the demonstration's files and `primitive.yaml`, as far as there are any."""
        if self._folder is None:
            self._notify("There is no folder to save in")
        elif self.demonstration is None:
            self._notify("There is nothing to save yet; Record a movement first")
        else:
            kept = "the demonstration"
            try:
                self.demonstration.save(self._folder / "demonstration")
                if self.primitive is not None:
                    self.primitive.save(self._folder / "primitive.yaml")
                    kept += " and the primitive"
            except InputError as error:
                self._notify(str(error))
                return
            self._notify(f"Saved {kept} in {self._folder}")

    def advance(self) -> None:
        """Simulates up to the next frame, and lets one thing follow from the other.

        Raises:
            PepperDrakeError: The simulation cannot go on.
            InputError: What is recorded cannot be written.
        """
        self.simulation.advance()
        if self._writer is not None:
            self._writer.write(*self.simulation.samples(self._since))
        if _ARM_MODES[self.mode] in (ArmMode.JOINTS, ArmMode.HAND):
            reason = self.simulation.stop_reason()
            if reason != StopReason.NONE:
                self._halt(STOP_SENTENCES[reason])
        if self.mode == Mode.RETURNING:
            self._return()
        elif self.mode == Mode.REACHING:
            self._reach()

    @property
    def _elapsed(self) -> float:
        return self.simulation.time - self._since

    def _enter(self, mode: Mode) -> None:
        self.simulation.set_arm_mode(_ARM_MODES[mode])
        self.mode, self._since, self._settled = mode, self.simulation.time, 0.0
        self._notice_until = 0.0

    def _halt(self, reason: str) -> None:
        self._enter(Mode.STOPPED)
        self._stopped_because = reason

    def _end_recording(self) -> None:
        times, samples = self.simulation.samples(self._since)
        names = self.simulation.diagram.recorder.joint_names
        self._enter(Mode.GUIDED)
        recorded: Demonstration | None = None
        with contextlib.suppress(InputError):  # There are hardly any samples.
            recorded = recorded_demonstration(times, samples, names)
        if recorded is None or recorded.path_length < _SHORTEST_WAY:
            self._end_writing(None)
            self._notify("The hand hardly moved; Record again")
            return
        motion = self.demonstration = without_rest(recorded)
        self._end_writing(motion)
        self._notify(
            f"Recorded {motion.duration:.1f} s and {motion.path_length:.2f} m; "
            "Learn makes a movement of it"
        )

    def _end_writing(self, demonstration: Demonstration | None) -> None:
        """Ends the file that is written while it is recorded; None leaves nothing of it."""
        if self._writer is None:
            return
        with self._writer:
            if demonstration is None:
                self._writer.discard()
            else:
                self._writer.finish(demonstration)
        self._writer = None

    def _return(self) -> None:
        """Takes the arm a bit further on its way back, and starts the movement at its end."""
        way, elapsed = self._way_back, self._elapsed
        assert way is not None
        self.simulation.set_joint_target(way.at(elapsed))
        if elapsed < way.duration:
            return
        behind = float(np.abs(self.simulation.joints() - way.at(elapsed)).max())
        if behind < _AT_START and self.simulation.goal_is_seen():
            self._enter(Mode.REACHING)
        elif elapsed > way.duration + _PATIENCE:
            held = behind >= _AT_START
            self._halt("something holds the arm" if held else "the goal's marker is not seen")

    def _reach(self) -> None:
        """Finds out whether the hand is there, or will not be."""
        simulation, elapsed, tau = self.simulation, self._elapsed, self.simulation.tau()
        is_there = elapsed >= tau and simulation.goal_distance() < _ARRIVED
        self._settled = self._settled + PUBLISH_PERIOD if is_there else 0.0
        if self._settled > 0.2 or elapsed > _LONGEST * tau:
            self.mode, self._since = Mode.HOLDING, simulation.time

    def _notify(self, words: str) -> None:
        self._notice, self._notice_until = words, self.simulation.time + _NOTICE

    def _describe(self) -> str:
        """Says what is going on, and what one can do next."""
        if self.mode == Mode.GUIDED:
            return self._describe_next()
        if self.mode == Mode.RECORDED:
            return f"Recording, {self._elapsed:.1f} s: lead the hand; Stop ends it"
        if self.mode == Mode.RETURNING:
            return "The arm goes back to where the movement starts"
        if self.mode == Mode.STOPPED:
            return f"Stopped: {self._stopped_because}; Reach again, or Stop to lead the hand"
        left = 1000 * self.simulation.goal_distance()
        if self.mode == Mode.REACHING:
            return f"Reaching, {left:.0f} mm to go; move the goal or what is in the way"
        if not self.simulation.goal_is_seen():
            return f"{left:.0f} mm from the goal, whose marker is hidden; Reach again, or Stop"
        if left < 1000 * _ARRIVED:
            return "At the goal; move it and the hand follows; Reach again, or Stop"
        return f"{left:.0f} mm from the goal; the hand follows"

    def _describe_next(self) -> str:
        if self.demonstration is None:
            return "Lead the hand with sliders or keys; Record keeps what you show"
        if self._learned is not self.demonstration:
            return "Learn makes a movement of what you showed; Record shows another"
        return "Reach performs what was learned; Record shows another movement"
