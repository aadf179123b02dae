"""Connects a live session with its page: user input and drawing."""

from collections import deque
from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from pepper_drake.live.controls import (
    clamped_offset,
    clamped_place,
    plain_name,
    stepped,
    within_reach,
)
from pepper_drake.live.drawing import LiveDrawing
from pepper_drake.live.page import CLEARANCE_SHOWN, Action, LivePage
from pepper_drake.live.robot_drawing import RobotDrawing
from pepper_drake.live.session import LiveSession, Mode
from pepper_drake.live.simulation import CHECKS
from pepper_drake.models.movable_objects import SPARES
from pepper_drake.perception.goal.marker import detect_markers
from pepper_drake.systems.guiding.gamepad_velocity import (
    GamepadParams,
    GamepadState,
    gamepad_velocity,
)

Vector = npt.NDArray[np.float64]

_HINT_PERIOD = 1.0
_SLOW = 0.8
"""Fraction of real time below which the page reports a slow computer."""
_WORDS = {Mode.GUIDED: "ready", Mode.RECORDED: "recording"}
"""Names on the page of modes that are named differently in scripts."""
_LIMP = (Mode.GUIDED, Mode.RECORDED)
_SIGNAL_PERIOD, _PLOT_PERIOD, _PICTURE_PERIOD = 4, 16, 32
"""Numbers of frames between samples, updates of the plots, and camera pictures."""
_HISTORY = 160
"""Number of samples in the plots: 20 s of autonomous motion."""
_TOWARDS, _ASIDE, _UP = 0.08, 0.22, 0.12
"""Place of an added obstacle relative to the goal: towards Pepper, aside, up [m]."""


class LiveApp:
    """Runs a session with its page and its drawing, frame by frame.

    Attributes:
        session: The session.
        page: The controls; None for a session without a page.
        target: X_TG, the pose to which the hand is guided.
    """

    def __init__(self, session: LiveSession, page: LivePage | None) -> None:
        """Shows a session.

        Args:
            session: The session.
            page: The page, if any.
        """
        self.session, self.page = session, page
        self.target = session.simulation.guide_pose()
        self._pad_velocity = np.zeros(6)
        self._grabbed: dict[str, Vector] = {}
        self._mode: Mode | None = None
        self._hint, self._pace = "", session.simulation.pace
        self._frame = self._checks = 0
        self._samples: deque[Vector] = deque(maxlen=_HISTORY)
        self._listed: tuple[object, ...] = ()
        self._play_from: float | None = None
        self._ghost_share: float | None = None
        if page is not None:
            self._draw_all(page)

    def _draw_all(self, page: LivePage) -> None:
        simulation = self.session.simulation
        marker = simulation.scene.goal.marker
        server = page.server
        server.scene.set_up_direction("+z")
        server.scene.world_axes.visible = False
        server.scene.configure_environment_map(hdri=None)
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.add_light_hemisphere("/lights/sky", intensity=2.0)
        self._robot = RobotDrawing(
            server,
            simulation.query().inspector(),
            marker=(marker.id, marker.size),
            draggable={name: partial(page.dragged, name) for name in simulation.diagram.movables},
            labels={n: plain_name(n) for n in simulation.diagram.movables if n not in SPARES},
        )
        self._drawing = LiveDrawing(server, self.session)
        position, target, up = self.view("Front")
        server.initial_camera.position = tuple(position)
        server.initial_camera.look_at = tuple(target)
        server.initial_camera.up = tuple(up)

    def press(self, button: str) -> None:
        """Performs the action of a button."""
        session = self.session
        {
            "Record": session.record,
            "Stop": session.stop,
            "Learn": session.learn,
            "Reach": session.reach,
            "Undo": session.undo,
            "Save": session.save,
        }[button]()

    def move(self, name: str, offset: Vector) -> None:
        """Moves the goal object or an obstacle to an offset (3,) in W [m].

        Raises:
            InputError: There is no movable object of that name.
        """
        self.session.move(name, offset)

    def lead(self, X_TG: RigidTransform) -> None:
        """Guides the hand to a pose in T."""
        self.target = RigidTransform(X_TG)

    def step(self) -> None:
        """Processes user input, simulates one frame, and shows it."""
        self.session.advance(self._attend)
        if self.page is not None:
            self._show(self.page)
            self.page.server.flush()  # Viser would wait for half a frame.
        self._frame += 1

    def _attend(self) -> None:
        """Processes the page's actions since the last call."""
        for action in self.page.actions() if self.page is not None else ():
            self._do(action)
        mode = self.session.mode
        if mode in _LIMP:
            self._lead(entered=self._mode not in _LIMP)
            if self.page is not None and self._checks % CHECKS == CHECKS // 2:
                # In the middle of the frame, to shorten the delay of guiding.
                with self.page.server.atomic():
                    self._robot.update(self.session.simulation.query())
                self.page.server.flush()
        self._mode, self._checks = mode, self._checks + 1

    def _lead(self, *, entered: bool) -> None:
        """Moves the guide by mouse, keys or gamepad."""
        simulation, velocity = self.session.simulation, self._pad_velocity
        simulation.set_guide_velocity(velocity)
        if entered or np.any(velocity):
            self.target = simulation.guide_pose()
        simulation.set_guide_target(self.target)

    def _do(self, action: Action) -> None:
        """Processes one action."""
        session, kind = self.session, action.kind
        handlers: dict[str, Callable[[Action], None]] = {
            "press": lambda a: self.press(a.name),
            "hand": self._take_hand,
            "key": self._step_hand,
            "pad": self._take_pad,
            "drag": self._drag,
            "add": lambda a: self.add(a.name),
            "remove": lambda a: self.remove_added(),
            "trim": lambda a: self._trim(*a.values),
            "discard": lambda a: session.discard(),
            "play": lambda a: self._play(),
            "scrub": lambda a: self._scrub(a.values[0]),
            "view": self._turn,
            "over": lambda a: session.start_over(),
        }
        handlers[kind](action)

    def _take_hand(self, action: Action) -> None:
        position, wxyz = action.values
        R = RotationMatrix(Quaternion(wxyz / np.linalg.norm(wxyz)))
        X_WT = self.session.simulation.torso_pose()
        self.target = within_reach(X_WT.InvertAndCompose(RigidTransform(R, position)))

    def _step_hand(self, action: Action) -> None:
        if self.page is not None and self.session.mode in _LIMP:
            right, ahead = self.page.sight()
            R_TW = self.session.simulation.torso_pose().rotation().inverse()
            self.target = stepped(self.target, action.name, R_TW @ right, R_TW @ ahead)

    def _take_pad(self, action: Action) -> None:
        self._pad_velocity = gamepad_velocity(GamepadState.of(*action.values), GamepadParams())

    def _drag(self, action: Action) -> None:
        """Moves an object by the point at which it was grabbed."""
        simulation, name = self.session.simulation, action.name
        phase, start, end = action.values
        if phase == "start":
            self.session.begin_move()
            self._grabbed[name] = start - simulation.position(name)
        if name not in self._grabbed:
            return
        place = end - self._grabbed[name]
        offset = place - (simulation.position(name) - simulation.offset(name))
        if name in SPARES:
            offset += clamped_place(place) - place
        else:
            offset = clamped_offset(offset)
        simulation.set_offset(name, offset)
        if phase == "end":
            del self._grabbed[name]
            self.session.end_move()

    def add(self, name: str) -> None:
        """Adds one of `SPARES` beside the goal, on the taught arm's side."""
        simulation = self.session.simulation
        side = 1.0 if simulation.arm == "left" else -1.0
        place = simulation.position("goal_object") + [-_TOWARDS, side * _ASIDE, _UP]
        self.session.begin_move()
        home = simulation.position(name) - simulation.offset(name)
        simulation.place(name, clamped_place(place) - home)
        words = f"Added a {plain_name(name)} beside the goal; drag it with the mouse"
        self.session.end_move(words)

    def remove_added(self) -> None:
        """Removes all of `SPARES` from the scene."""
        simulation = self.session.simulation
        added = [name for name in SPARES if simulation.offset(name).any()]
        if not added:
            self.session.tell("Nothing was added")
            return
        self.session.begin_move()
        for name in added:
            simulation.place(name, np.zeros(3))
        self.session.end_move("Removed what was added; Undo brings it back")

    def _trim(self, start: float, end: float) -> None:
        motion = self.session.demonstration
        duration = motion.duration if motion is not None else 0.0
        self.session.trim(start * duration, end * duration)

    def _play(self) -> None:
        if not self.session.check_limp("Play"):
            return
        if self.session.demonstration is None:
            self.session.tell("There is nothing to play yet; Record a movement first")
        else:
            self._play_from = self.session.simulation.time

    def _scrub(self, share: float) -> None:
        if self.session.check_limp("Playback"):
            self._play_from, self._ghost_share = None, share

    def _turn(self, action: Action) -> None:
        if action.client is not None and self.page is not None:
            self.page.look(action.client, *self.view(action.name))

    def view(self, name: str) -> tuple[Vector, Vector, Vector]:
        """Returns camera position, target and up direction of a view, (3,) in W."""
        simulation = self.session.simulation
        robot = simulation.scene.robot
        X_WR = RigidTransform(RollPitchYaw(0.0, 0.0, robot.yaw), [robot.x, robot.y, 0.0])
        side = 1.0 if simulation.arm == "left" else -1.0
        up = np.array([0.0, 0.0, 1.0])
        if name == "Camera":
            X_WC = simulation.camera_pose()
            return X_WC.translation(), X_WC @ np.array([0.0, 0.0, 0.6]), up
        position, target = {
            "Front": ([1.05, 0.62 * side, 1.2], [0.12, 0.02 * side, 0.8]),
            "Shoulder": ([-0.55, 0.45 * side, 1.45], [0.4, 0.1 * side, 0.85]),
            "Top": ([0.25, 0.15 * side, 2.3], [0.26, 0.15 * side, 0.8]),
        }[name]
        if name == "Top":
            up = X_WR.rotation() @ np.array([1.0, 0.0, 0.0])
        return X_WR @ np.array(position), X_WR @ np.array(target), up

    def _show(self, page: LivePage) -> None:
        session, simulation = self.session, self.session.simulation
        with page.server.atomic():
            self._robot.update(simulation.query())
            self._drawing.update(session, self.target, predicts=page.shows_prediction)
            limp = session.mode in _LIMP
            if limp:
                page.show_hand(simulation.torso_pose() @ self.target, visible=True)
            else:
                X_WH = simulation.torso_pose() @ simulation.hand_pose()
                page.show_hand(X_WH, visible=False)
            self._show_ghost(page)
        page.show_status(
            _WORDS.get(session.mode, session.mode.value), session.status, self._describe_pace()
        )
        page.show_next(session.next_button)
        self._show_signals(page)
        if session.shown != self._listed:
            self._listed = session.shown
            page.show_demonstrations(self._describe_demonstrations())
        if page.shows_camera and self._frame % _PICTURE_PERIOD == 0:
            self._show_picture(page)

    def _show_ghost(self, page: LivePage) -> None:
        """Shows the hand of the demonstration during playback."""
        motion, now = self.session.demonstration, self.session.simulation.time
        if motion is None or self.session.mode != Mode.GUIDED:
            self._play_from = self._ghost_share = None
        elif self._play_from is not None:
            self._ghost_share = (now - self._play_from) / max(motion.duration, 1e-9)
            if self._ghost_share >= 1.0:
                self._play_from, self._ghost_share = None, None
            elif self._frame % _SIGNAL_PERIOD == 0:
                page.show_progress(self._ghost_share)
        if self._ghost_share is None or motion is None or motion.rotations is None:
            self._drawing.show_ghost(None)
            return
        index = round(self._ghost_share * (len(motion.times) - 1))
        R = RotationMatrix(Quaternion(motion.rotations[index]))
        X_TH = RigidTransform(R, motion.positions[index])
        self._drawing.show_ghost(self.session.simulation.torso_pose() @ X_TH)

    def _show_signals(self, page: LivePage) -> None:
        simulation = self.session.simulation
        performs = self.session.mode not in _LIMP
        if performs and self._frame % _SIGNAL_PERIOD == 0:
            clearance = 100 * min(simulation.clearance(), CLEARANCE_SHOWN)
            coupling = float(np.linalg.norm(simulation.coupling()))
            sample = [simulation.time, simulation.phase(), clearance, coupling]
            self._samples.append(np.array(sample))
        if self._frame % _PLOT_PERIOD == 0 and len(self._samples) > 1:
            times, phase, clearance_cm, coupling_size = np.array(self._samples).T
            signals = {"phase": phase, "clearance": clearance_cm, "coupling": coupling_size}
            page.show_signals(times, signals)

    def _show_picture(self, page: LivePage) -> None:
        taken = self.session.simulation.camera_picture()
        if taken is None:
            return
        camera, picture = taken
        found = detect_markers(picture, wanted=self.session.simulation.scene.goal.marker.id)
        corners = [np.round(one.corners).astype(np.int32) for one in found]
        cv2.polylines(picture, corners, True, (255, 60, 30), 3)
        name = camera.removeprefix("camera_").capitalize()
        words = f"{name} camera: the goal's marker is {'found' if found else 'not seen'}"
        page.show_picture(cv2.resize(picture, (320, 240), interpolation=cv2.INTER_AREA), words)

    def _describe_demonstrations(self) -> str:
        rows = [
            f"| {number} | {motion.duration:.1f} | {motion.path_length:.2f} |"
            for number, motion in enumerate(self.session.shown, 1)
        ]
        if not rows:
            return "None yet: Record keeps what you show."
        head = ["| number | duration [s] | path length [m] |", "| :-: | :-: | :-: |"]
        together = "Learn makes one movement from all of them." if len(rows) > 1 else ""
        return "\n".join([*head, *rows, "", together])

    def _describe_pace(self) -> str:
        """Returns the speed of the simulation in words, updated once a second."""
        before, pace = self._pace, self.session.simulation.pace
        wall = pace.wall_seconds - before.wall_seconds
        if wall > _HINT_PERIOD:
            frames = (pace.frames - before.frames) / wall
            rate = (pace.simulated_seconds - before.simulated_seconds) / wall
            unit = "frame" if round(frames) == 1 else "frames"
            self._hint = f"{frames:.0f} {unit} per second, {rate:.2f} times real time"
            if rate < _SLOW:
                self._hint += ": too slow"
                if self.session.simulation.diagram.station.config.cameras:
                    self._hint += "; --no-cameras is faster"
            self._pace = pace
        return self._hint
