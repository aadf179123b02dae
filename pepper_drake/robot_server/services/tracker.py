"""ALTracker: looks and points at positions, and follows those in a program's events.

Nothing is recognised: a target that the robot would have to see itself stays lost.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.naoqi.constants import CHAINS, FRAME_ROBOT, FRAME_TORSO, FRAME_WORLD, JOINTS
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP
from pepper_drake.perception.gaze.head_aiming import aim_head, clamp_head
from pepper_drake.robot_server.robot.base_controller import BaseSpeeds, FollowMove, Pose
from pepper_drake.robot_server.robot.joint_controller import retarget
from pepper_drake.robot_server.robot.robot_model import clip_to_limits, kinematics
from pepper_drake.robot_server.robot.tasks import Task
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.memory import Memory
from pepper_drake.robot_server.services.motion import Motion
from pepper_drake.robot_server.services.motion_arguments import fraction, numbers, settings
from pepper_drake.robot_server.services.waiting import Module
from pepper_drake.robot_server.wire.service import Caller
from pepper_drake.robot_server.wire.signatures import with_caller

Vector = npt.NDArray[np.float64]

_ROUNDS = 6
"""Iterations until the hand is on the line to the position; each removes most of the error."""

_FOLLOWING = 0.5
"""Fraction of the largest speed at which a target is followed."""

_LEAST_TIME_OUT = 1.0
"""Shortest time without an event after which a target is lost [s]."""

_FARTHEST = 100.0
"""Distance above which the base does not go to its place beside a target [m]."""

_CAMERAS = {0: CAMERA_TOP, 1: CAMERA_TOP, 2: CAMERA_BOTTOM}
"""Camera that looks at a target, by the number of the eye in its event."""

_ORIGIN = (0.0, 0.0, 0.0)

_SHOULDER = {"LArm": "LShoulderPitch", "RArm": "RShoulderPitch"}


class Tracker(Module):
    """ALTracker."""

    def __init__(self, motion: Motion, memory: Memory, log: Callable[[str], None]) -> None:
        super().__init__("ALTracker")
        self._log = log
        self._motion = motion
        self._memory = memory
        self._active = ""
        self._has_logged = False
        self._p_WP: Vector | None = None
        self._last_seen = -math.inf
        self._is_new = False
        self._effector = "None"
        self._mode = "Head"
        self._timeout = 0
        self._range = 0.0
        self._search = False
        self._relative: list[float] = []
        self._move_config: Any = []
        self._caller: Caller | None = None
        self._move: tuple[Task, FollowMove] | None = None
        self._targets: dict[str, Any] = {}
        keep_settings(
            self,
            {
                "set_maximum_velocity": ("get_maximum_velocity", 0.35),
                "set_maximum_acceleration": ("get_maximum_acceleration", 0.3),
                "set_search_fraction_max_speed": ("get_search_fraction_max_speed", 0.2),
                "set_target_coordinates": ("get_target_coordinates", []),
            },
        )

    async def look_at(self, position: Any, *arguments: Any) -> None:
        """Turns the head so that the top camera looks at a position [m].

        Args:
            position: The position (3,) in a frame.
            arguments: The frame (0 torso, 1 world, 2 robot; left out: torso), fraction of the
                largest speed, and whether to use the whole body, which is ignored.
        """
        frame, share = (FRAME_TORSO, arguments[0]) if len(arguments) == 2 else arguments[:2]
        p_T = self._in_torso(numbers(position, 3, "the position"), frame)
        yaw, pitch = clamp_head(aim_head(CAMERA_TOP, p_T)).tolist()
        targets = {"HeadYaw": yaw, "HeadPitch": pitch}
        await self._motion.go_to(targets, fraction(share), "lookAt")

    async def point_at(self, effector: str, position: Any, *arguments: Any) -> None:
        """Points with an arm, straight from the shoulder, at a position [m].

        Args:
            effector: "LArm", "RArm" or "Arms": the nearer one.
            position: The position (3,) in a frame.
            arguments: The frame (left out: torso) and the fraction of the largest speed.
        """
        frame, share = (FRAME_TORSO, arguments[0]) if len(arguments) == 1 else arguments[:2]
        p_T = self._in_torso(numbers(position, 3, "the position"), frame)
        targets = _point(_arm(effector, p_T), p_T)
        await self._motion.go_to(targets, fraction(share), "pointAt")

    def get_robot_position(self) -> list[float]:
        """Returns the base's pose in the world: x, y [m], theta [rad]."""
        return self._motion.get_robot_position(True)

    def is_active(self) -> bool:
        """Returns whether a target is set, lost or not."""
        return bool(self._active)

    def is_new_target_detected(self) -> bool:
        """Returns whether the target was seen since its position was last requested."""
        return self._is_new

    def is_target_lost(self) -> bool:
        """Returns whether the target's position is older than the timeout."""
        return self._motion.state.time - self._last_seen > self._time_until_lost()

    def get_active_target(self) -> str:
        """Returns the target or event that is followed, or an empty string."""
        return self._active

    def get_supported_targets(self) -> list[str]:
        """Returns the targets that the robot can recognise: none."""
        return []

    def get_target_position(self, frame: int = FRAME_TORSO) -> list[float]:
        """Returns the target's position [m], or an empty list if unknown."""
        self._is_new = False
        if self._p_WP is None:
            return []
        X_FW = self._transform(frame) @ self._transform(FRAME_WORLD).inverse()
        return [float(value) for value in X_FW @ self._p_WP]

    def get_registered_targets(self) -> list[str]:
        """Returns the registered targets."""
        return sorted(self._targets)

    def register_target(self, target: str, parameters: Any) -> None:
        """Registers a target, which is never recognised."""
        self._targets[target] = parameters

    def unregister_target(self, target: str) -> None:
        """Unregisters a target, which is no longer followed."""
        self._targets.pop(target, None)
        if target == self._active:
            self._follow("")

    def unregister_targets(self, targets: list[str]) -> None:
        """Unregisters targets."""
        for target in targets:
            self.unregister_target(target)

    def unregister_all_targets(self) -> None:
        """Unregisters all targets, and stops following."""
        self._targets.clear()
        self._follow("")

    get_target_names = get_supported_targets
    get_managed_targets = get_registered_targets
    add_target = register_target
    remove_target = unregister_target
    remove_targets = unregister_targets
    remove_all_targets = unregister_all_targets

    def track(self, target: str) -> None:
        """Logs that a target is not tracked: it stays lost, as `isTargetLost` says."""
        if target not in self._targets:
            raise ValueError(f"target {target!r} was not registered")
        self._follow(target)
        self._log(f"ALTracker is to follow {target}; nothing is recognised, and it stays lost")

    @with_caller
    def track_event(self, caller: Caller, event: str) -> None:
        """Follows the positions in an event's values with the head and the effector.

        A value is [position in the world, time, number of the eye] or [position in the torso frame,
        position in the base frame, time, number of the eye]; each position begins with x, y, z [m].
        In the mode "Move" the base moves, too, where `setRelativePosition` says.
        """
        self._follow(event)
        self._caller = caller
        self._memory.listen(event, self._on_event)

    def stop_tracker(self) -> None:
        """Stops following, looking and pointing."""
        self._follow("")
        self._motion.tasks.kill_where(lambda task: task.name in ("lookAt", "pointAt"))

    def client_left(self, caller: Caller) -> None:
        """Ends the moves for a disconnected client; the head follows further."""
        if self._caller is not None and caller.client == self._caller.client:
            self._caller = None

    def set_effector(self, effector: str) -> None:
        """Sets the arm for tracking."""
        if effector not in ("None", "Arms", *_SHOULDER):
            raise ValueError(f"there is no effector {effector!r}")
        self._effector = effector

    def get_effector(self) -> str:
        """Returns the arm for tracking."""
        return self._effector

    def set_mode(self, mode: str) -> None:
        """Sets the mode of tracking."""
        if mode not in self.get_available_modes():
            raise ValueError(f"there is no mode {mode!r}")
        self._mode = mode

    def get_mode(self) -> str:
        """Returns the mode of tracking."""
        return self._mode

    def get_available_modes(self) -> list[str]:
        """Returns the modes of tracking."""
        return ["Head", "BodyRotation", "WholeBody", "Move", "Navigate"]

    def toggle_search(self, search: bool) -> None:
        """Sets whether a lost target is searched."""
        self._search = search

    def is_search_enabled(self) -> bool:
        """Returns whether a lost target is searched."""
        return self._search

    def set_time_out(self, milliseconds: int) -> None:
        """Sets the timeout of a target [ms]."""
        self._timeout = milliseconds

    def get_time_out(self) -> int:
        """Returns the timeout of a target [ms]."""
        return self._timeout

    def set_maximum_distance_detection(self, distance: float) -> None:
        """Sets the range of tracking [m]."""
        self._range = distance

    def get_maximum_distance_detection(self) -> float:
        """Returns the range of tracking [m]."""
        return self._range

    def initialize(self) -> None:
        """Unregisters all targets, stops following, and resets effector and mode."""
        self.unregister_all_targets()
        self._effector, self._mode = "None", "Head"

    def set_move_config(self, config: Any) -> None:
        """Sets the limits of the moves in the mode "Move", as `moveTo` takes them."""
        settings(config)
        self._move_config = config

    def get_move_config(self) -> Any:
        """Returns the limits of the moves in the mode "Move"."""
        return self._move_config

    def set_relative_position(self, position: Any) -> None:
        """Sets where the base stands in the mode "Move".

        The six numbers are x, y [m] and angle [rad] in a frame on the target whose x-axis points
        away from the base, and within how much of each the base does not move.
        """
        self._relative = numbers(position, 6, "the relative position") if position else []

    def get_relative_position(self) -> list[float]:
        """Returns where the base stands in the mode "Move"."""
        return self._relative

    def _follow(self, target: str) -> None:
        self._memory.stop_listening(self._on_event)
        if self._move is not None:
            self._motion.tasks.kill(self._move[0].id)
            self._move = None
        if target != self._active:
            self._active, self._p_WP, self._last_seen, self._is_new = target, None, -math.inf, False
            self._has_logged = False
            self._memory.raise_event("ALTracker/ActiveTargetChanged", target)

    def _on_event(self, value: Any) -> None:
        """Turns head and arms to the position in an event's value."""
        try:
            in_world = len(value[1]) == 2  # A time; otherwise a second position precedes it.
            frame = FRAME_WORLD if in_world else FRAME_TORSO
            p_T = self._in_torso(numbers(value[0][:3], 3, "the position"), frame)
            camera = _CAMERAS.get(value[2 if in_world else 3])
        except (ValueError, TypeError, IndexError, KeyError):
            if not self._has_logged:
                self._log(
                    f"ALTracker finds no position in the value of {self._active}: {value!r:.80}"
                )
                self._has_logged = True
            return
        self._p_WP = self._transform(FRAME_WORLD) @ p_T
        self._last_seen, self._is_new = self._motion.state.time, True
        if self._mode == "Move" and self._relative and self._caller is not None:
            self._approach(self._p_WP, self._caller)
        targets: dict[str, float] = {}
        if camera is not None:
            yaw, pitch = clamp_head(aim_head(camera, p_T)).tolist()
            targets |= {"HeadYaw": yaw, "HeadPitch": pitch}
        if self._effector != "None":
            targets |= _point(_arm(self._effector, p_T), p_T)
        retarget(self._motion.joints, self._motion.tasks, targets, _FOLLOWING)

    def _approach(self, p_WP: Vector, caller: Caller) -> None:
        """Aims the base at its place beside a position in the world."""
        x, y, _ = self._motion.odometry.pose
        along, across, turn, *near = self._relative
        bearing = math.atan2(p_WP[1] - y, p_WP[0] - x)
        c, s = math.cos(bearing), math.sin(bearing)
        goal = (p_WP[0] + c * along - s * across, p_WP[1] + s * along + c * across, bearing + turn)
        if not math.hypot(goal[0] - x, goal[1] - y) < _FARTHEST:
            return
        if self._move is None or self._move[0].ended:
            speeds = BaseSpeeds.configured(settings(self._move_config))
            move = FollowMove(self._motion.base, speeds, self._motion.odometry)
            self._aim(move, goal, near)
            if not move.has_arrived:
                self._move = self._motion.start_move(move, "trackEvent", caller), move
        else:
            self._aim(self._move[1], goal, near)

    def _aim(self, move: FollowMove, goal: Pose, near: list[float]) -> None:
        move.aim(goal, (near[0], near[1], near[2]), self._time_until_lost())

    def _time_until_lost(self) -> float:
        return max(self._timeout / 1e3, _LEAST_TIME_OUT)

    def _in_torso(self, position: list[float], frame: int) -> Vector:
        return self._transform(frame).inverse() @ np.array(position)

    def _transform(self, frame: int) -> RigidTransform:
        """Returns the pose of the torso in a frame."""
        if frame not in (FRAME_TORSO, FRAME_WORLD, FRAME_ROBOT):
            raise ValueError(f"frame is {frame}; it must be 0 (torso), 1 (world) or 2 (robot)")
        state = self._motion.state
        return kinematics().transform("Torso", frame, state.positions, state.base_pose)


def _arm(effector: str, p_T: Vector) -> str:
    """Returns the arm that points at a place."""
    if effector == "Arms":
        effector = "LArm" if p_T[1] > 0 else "RArm"
    if effector not in _SHOULDER:
        raise ValueError(f"there is no effector {effector!r}; it must be LArm, RArm or Arms")
    return effector


def _point(arm: str, p_T: Vector) -> dict[str, float]:
    """Returns the angles of the arm stretched towards a position [rad], within limits."""
    place = np.zeros(len(JOINTS))
    names = CHAINS[arm][:5]
    pitch, roll = (JOINTS.index(name) for name in names[:2])
    p_TS = kinematics().transform(_SHOULDER[arm], FRAME_TORSO, place, _ORIGIN).translation()
    wanted = _pitch_and_roll(p_T - p_TS)
    for _ in range(_ROUNDS):
        X_TH = kinematics().transform(arm, FRAME_TORSO, clip_to_limits(place), _ORIGIN)
        pointed = _pitch_and_roll(X_TH.translation() - p_TS)
        place[pitch] += math.remainder(wanted[0] - pointed[0], 2 * math.pi)
        place[roll] += wanted[1] - pointed[1]
        place = clip_to_limits(place)
    return {name: float(place[JOINTS.index(name)]) for name in names}


def _pitch_and_roll(direction: Vector) -> tuple[float, float]:
    """Returns a direction's angles below the horizontal and to the left [rad]."""
    x, y, z = direction
    return math.atan2(-z, x), math.atan2(y, math.hypot(x, z))
