"""One live session: what Pepper does next when a person presses a button."""

import time
from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, System

from pepper_drake.diagrams.live_teaching import PUBLISH_PERIOD, LiveTeaching, with_movables
from pepper_drake.diagrams.reach_setup import make_coupling, make_primitive
from pepper_drake.diagrams.station import StationConfig
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.recording import recorded_demonstration, without_rest
from pepper_drake.live.way_back import WayBack
from pepper_drake.models.pepper import arm_group
from pepper_drake.models.scene import Scene
from pepper_drake.perception.cloud_points import cloud_points
from pepper_drake.planning.command_check import STOP_SENTENCES, StopReason
from pepper_drake.systems.arm_mode import ArmMode

Vector = npt.NDArray[np.float64]

_SHORTEST_WAY = 0.03
"""A recording in which the hand goes less far is no movement, m."""
_ARRIVED = 0.006
"""The hand is at its goal within this, m."""
_LONGEST = 2.5
"""After so many durations of the movement it is over, wherever the hand is."""
_CAUGHT_UP = 0.015
"""The limp arm may be stiffened when its command is as near to it, rad."""


_NOTICE = 4.0
"""How long it is told what came of a button, s."""
_PATIENCE = 3.0
"""How long the arm, back at the start, waits for what it takes to reach, s."""


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


@dataclass(frozen=True)
class Pace:
    """How fast a session ran: over what time, s, and how many frames it showed."""

    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    frames: int = 0

    @property
    def realtime_rate(self) -> float:
        """Simulated seconds by second."""
        return self.simulated_seconds / max(self.wall_seconds, 1e-9)

    @property
    def frames_per_second(self) -> float:
        """Frames by second of wall time."""
        return self.frames / max(self.wall_seconds, 1e-9)


class LiveSession:
    """A simulation of Pepper that is taught and reaches, frame by frame.

    The buttons of the page are its methods `record`, `stop`, `learn`, `reach` and `save`; what
    comes of them is in `mode` and `status`. Where a button makes no sense, `status` says why, and
    nothing else happens. `advance` simulates up to the next frame.

    Attributes:
        mode: What Pepper is doing.
        demonstration: What was recorded last, if anything.
        primitive: What was learned last, if anything.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        station: StationConfig | None = None,
        movables: Collection[str] = (),
        coupling: str | None = None,
        meshcat: Meshcat | None = None,
        realtime: bool = False,
    ) -> None:
        """Makes a session; Pepper stands where the scene has it, its arm limp.

        Args:
            scene: With the goal within reach.
            station: How the robot is simulated.
            movables: Obstacles that can be moved, besides those that have a path in the scene.
            coupling: The obstacle coupling's name; the scene's if left out.
            meshcat: Where the robot is shown, if anywhere.
            realtime: Whether it runs no faster than real time.
        """
        self.scene = with_movables(scene, movables)
        self.mode = Mode.GUIDED
        self.demonstration: Demonstration | None = None
        self.primitive: MovementPrimitive | None = None
        self._learned: Demonstration | None = None
        self._stopped_because = ""
        self._notice, self._notice_until = "", 0.0
        self._since = 0.0
        self._settled = 0.0
        self._way_back: WayBack | None = None
        self._targets: dict[str, Vector] = {}
        self._guide_target = RigidTransform()
        self._guide_velocity = np.zeros(6)
        self._frames = 0
        self._wall = 0.0
        self.diagram = LiveTeaching(
            self.scene,
            make_primitive(None, scene.arm),
            make_coupling(coupling or scene.coupling),
            station=station,
            meshcat=meshcat,
        )
        self.simulator = Simulator(self.diagram)
        self._fix_inputs()
        self.simulator.set_target_realtime_rate(1.0 if realtime else 0.0)
        self.simulator.Initialize()
        self.release_guide()

    def _fix_inputs(self) -> None:
        """Gives all inputs of the diagram the values that they have in the session."""
        self._fix("arm_mode", [float(_ARM_MODES[self.mode])])
        self._fix("guide_target", self._guide_target)
        self._fix("guide_velocity", self._guide_velocity)
        self._fix("joint_target", np.zeros(5))
        for name in self.diagram.movables:
            self._fix(f"{name}.target", self._targets.setdefault(name, np.zeros(3)))

    def _fix(self, port: str, value: object) -> None:
        self.diagram.GetInputPort(port).FixValue(self.simulator.get_mutable_context(), value)

    def _eval(self, system: System, port: str) -> Any:
        context = system.GetMyContextFromRoot(self.simulator.get_context())
        return system.GetOutputPort(port).Eval(context)

    # What the page and the drawing want to know.

    @property
    def status(self) -> str:
        """What Pepper is doing in words, or for some seconds what came of a button."""
        return self._notice if self.time < self._notice_until else self._describe()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.simulator.get_context().get_time())

    @property
    def arm(self) -> str:
        """The arm that is taught, "left" or "right"."""
        return self.scene.arm

    @property
    def pace(self) -> Pace:
        """How fast the session has run so far."""
        return Pace(self.time, self._wall, self._frames)

    def torso_pose(self) -> RigidTransform:
        """Returns X_WT."""
        return RigidTransform(self._eval(self.diagram.station, "torso_pose"))

    def hand_pose(self) -> RigidTransform:
        """Returns X_TH."""
        return RigidTransform(self._eval(self.diagram.station, f"{self.arm}_hand_pose"))

    def guide_pose(self) -> RigidTransform:
        """Returns X_TG of the guide."""
        X_WG = self._eval(self.diagram.guide, "guide_pose")
        return self.torso_pose().InvertAndCompose(RigidTransform(X_WG))

    def goal_position(self) -> Vector:
        """Returns where the hand's goal is (3,) in T [m]."""
        return np.array(self._eval(self.diagram.hand_goal, "goal_position"))

    def goal_is_seen(self) -> bool:
        """Tells whether Pepper knows where the goal is."""
        estimator = self.diagram.perception.goal_estimator
        return estimator is None or bool(self._eval(estimator, "valid")[0])

    def cloud(self) -> Vector:
        """Returns the obstacles that Pepper sees or remembers (P, 3) in W [m]."""
        source = self.diagram.perception.cloud_source
        if source is None:
            return np.zeros((0, 3))
        return cloud_points(self._eval(source, "cloud"))

    def coupling(self) -> Vector:
        """Returns what the obstacles do to the hand (3,) in T [m/s²]: C_t / tau²."""
        if self.mode not in (Mode.REACHING, Mode.HOLDING) or self.diagram.coupling is None:
            return np.zeros(3)
        tau = float(self._eval(self.diagram.canonical, "tau")[0])
        return np.array(self._eval(self.diagram.coupling, "coupling")) / tau**2

    def goal_distance(self) -> float:
        """Returns how far the hand is from its goal [m]."""
        return float(np.linalg.norm(self.goal_position() - self.hand_pose().translation()))

    def joints(self) -> Vector:
        """Returns the taught arm's joints (5,) [rad]."""
        port = self.diagram.arm_position
        return np.array(port.Eval(port.get_system().GetMyContextFromRoot(self._root())))

    # What a person does.

    def set_guide_target(self, X_TG: RigidTransform) -> None:
        """Puts the guide's target to a pose in T; the guide follows smoothly."""
        self._guide_target = RigidTransform(X_TG)
        self._fix("guide_target", self._guide_target)

    def set_guide_velocity(self, velocity: Vector) -> None:
        """Moves the guide with a velocity (6,), angular and linear in T, instead of to a target."""
        if np.any(velocity) or np.any(self._guide_velocity):
            self._guide_velocity = np.array(velocity, dtype=float)
            self._fix("guide_velocity", self._guide_velocity)

    def set_offset(self, name: str, offset: Vector) -> None:
        """Moves the goal object or an obstacle to an offset (3,) [m] from its place in the scene.

        Raises:
            InputError: There is nothing of that name that can be moved.
        """
        if name not in self._targets:
            raise InputError(f'"{name}" cannot be moved; {", ".join(self._targets)} can')
        if not np.array_equal(self._targets[name], offset):
            self._targets[name] = np.array(offset, dtype=float)
            self._fix(f"{name}.target", self._targets[name])

    def record(self) -> None:
        """Takes the arm limp, if it is not, and records from now on."""
        if self.mode == Mode.RECORDED:
            self._notify("It is recorded already; Stop ends it")
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
            self._notify("The arm is limp again; lead the hand with the sliders")

    def learn(self) -> None:
        """Learns the movement that was recorded last."""
        if self.mode != Mode.GUIDED:
            self._notify(f"Pepper is {self.mode}; Stop comes before Learn")
        elif self.demonstration is None:
            self._notify("There is nothing to learn yet; Record a movement first")
        else:
            started = time.perf_counter()
            primitive = MovementPrimitive.fit(self.demonstration)
            self.primitive, self._learned = primitive, self.demonstration
            self._fix("primitive", primitive)
            spent = 1000 * (time.perf_counter() - started)
            self._notify(
                f"Learned a movement of {primitive.duration:.1f} s and "
                f"{primitive.path_length:.2f} m in {spent:.0f} ms; Reach performs it"
            )

    def reach(self) -> None:
        """Takes the arm back to where the movement starts, and performs it."""
        if self.primitive is None or self.demonstration is None:
            self._notify("There is nothing to perform yet; Record a movement, then Learn it")
        elif self.mode == Mode.RECORDED:
            self._notify("The arm is being led; Stop comes before Reach")
        else:
            assert self.demonstration.joints is not None
            self._way_back = WayBack(self.joints(), self.demonstration.joints)
            self._enter(Mode.RETURNING)

    def save(self, folder: Path) -> None:
        """Writes the demonstration's files and `primitive.yaml`, as far as there are any."""
        if self.demonstration is None:
            self._notify("There is nothing to save yet; Record a movement first")
            return
        self.demonstration.save(folder / "demonstration")
        kept = "the demonstration"
        if self.primitive is not None:
            self.primitive.save(folder / "primitive.yaml")
            kept += " and the primitive"
        self._notify(f"Saved {kept} in {folder}")

    def release_guide(self) -> None:
        """Lets the guide take the hand anew, where the hand is now."""
        guide = self.diagram.guide
        guide.SetDefaultContext(guide.GetMyMutableContextFromRoot(self._root()))
        self.set_guide_target(self.hand_pose())
        self.set_guide_velocity(np.zeros(6))

    # What goes on by itself.

    def advance(self) -> None:
        """Simulates up to the next frame, and lets one thing follow from the other."""
        started = time.perf_counter()
        self._frames += 1
        self.simulator.AdvanceTo(self._frames * PUBLISH_PERIOD)
        self._wall += time.perf_counter() - started
        elapsed = self.time - self._since
        if self.mode == Mode.RETURNING:
            self._return(elapsed)
        elif self.mode == Mode.REACHING:
            self._reach(elapsed)
        elif self.mode == Mode.HOLDING:
            self._is_stopped()

    def _root(self) -> Context:
        return self.simulator.get_mutable_context()

    def _enter(self, mode: Mode) -> None:
        """Changes what the arm does; it stays where it is."""
        was_limp = _ARM_MODES[self.mode] == ArmMode.LIMP
        limp = _ARM_MODES[mode] == ArmMode.LIMP
        if limp and not was_limp:
            self.release_guide()
        if limp != was_limp:
            self.diagram.station.set_stiffness(arm_group(self.arm), 0.0 if limp else 1.0)
        # A stop of the safety monitor is over when a person has decided what comes next.
        safety = self.diagram.safety
        safety.SetDefaultContext(safety.GetMyMutableContextFromRoot(self._root()))
        self.mode, self._since, self._settled = mode, self.time, 0.0
        self._notice_until = 0.0
        self._fix("arm_mode", [float(_ARM_MODES[mode])])

    def _end_recording(self) -> None:
        times, samples = self.diagram.recorder.samples(self.simulator.get_context())
        mine = times >= self._since - 1e-9
        self._enter(Mode.GUIDED)
        try:
            recorded = recorded_demonstration(
                times[mine] - self._since, samples[mine], self.diagram.recorder.joint_names
            )
        except InputError:
            self._notify("That was too short to be a movement; Record again")
            return
        if recorded.path_length < _SHORTEST_WAY:
            self._notify("The hand hardly moved; Record again")
            return
        self.demonstration = without_rest(recorded)
        self._notify(
            f"Recorded {self.demonstration.duration:.1f} s and "
            f"{self.demonstration.path_length:.2f} m; Learn makes a movement of it"
        )

    def _return(self, elapsed: float) -> None:
        way = self._way_back
        assert way is not None
        self._fix("joint_target", way.at(elapsed))
        if self._is_stopped() or elapsed < way.duration:
            return
        behind = float(np.abs(self.joints() - way.at(elapsed)).max())
        if behind < _CAUGHT_UP and self.goal_is_seen():
            self._enter(Mode.REACHING)
        elif elapsed > way.duration + _PATIENCE:
            self._halt(
                "something holds the arm"
                if behind >= _CAUGHT_UP
                else "Pepper does not see the goal's marker"
            )

    def _reach(self, elapsed: float) -> None:
        if self._is_stopped():
            return
        tau = float(self._eval(self.diagram.canonical, "tau")[0])
        is_there = elapsed >= tau and self.goal_distance() < _ARRIVED
        self._settled = self._settled + PUBLISH_PERIOD if is_there else 0.0
        if self._settled > 0.2 or elapsed > _LONGEST * tau:
            self.mode, self._since = Mode.HOLDING, self.time

    def _is_stopped(self) -> bool:
        """Tells whether the safety monitor has stopped the arm, and halts the session, too."""
        reason = StopReason(int(self._eval(self.diagram.safety, "stop_reason")[0]))
        if reason == StopReason.NONE:
            return False
        self._halt(STOP_SENTENCES[reason])
        return True

    def _halt(self, reason: str) -> None:
        self._enter(Mode.STOPPED)
        self._stopped_because = reason

    def _notify(self, words: str) -> None:
        self._notice, self._notice_until = words, self.time + _NOTICE

    def _describe(self) -> str:
        """Says what is going on, and what one can do next."""
        if self.mode == Mode.GUIDED:
            return self._describe_next()
        if self.mode == Mode.RECORDED:
            elapsed = self.time - self._since
            return f"Recording, {elapsed:.1f} s: lead the hand; Stop ends it"
        if self.mode == Mode.RETURNING:
            return "The arm goes back to where the movement starts"
        if self.mode == Mode.STOPPED:
            return f"Stopped: {self._stopped_because}; Reach again, or Stop to lead the hand"
        left = 1000 * self.goal_distance()
        if self.mode == Mode.REACHING:
            return f"Reaching, {left:.0f} mm to go; move the goal or what is in the way"
        if not self.goal_is_seen():
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
