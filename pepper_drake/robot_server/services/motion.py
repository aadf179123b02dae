"""ALMotion: joints, stiffness, tasks, poses of frames; with `BaseMoves` and `MotionSettings`."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from pepper_drake.naoqi.clock import MeasurementHistory, join_time
from pepper_drake.naoqi.constants import (
    BODY,
    CHAINS,
    CYCLE,
    GROUPS,
    HANDS,
    JOINTS,
    STIFFNESS_CHAINS,
    WHEELS,
)
from pepper_drake.robot_server.robot.joint_controller import (
    INDEX,
    STIFFNESS,
    JointController,
    PathMotion,
    Sampler,
    StiffnessMotion,
    retarget,
)
from pepper_drake.robot_server.robot.robot_model import (
    JOINT_LIMITS,
    SENSOR_NAMES,
    UnknownFrameError,
    as_position6,
    as_transform16,
    clip_to_limits,
    kinematics,
)
from pepper_drake.robot_server.robot.robot_port import RobotCommand, RobotPort
from pepper_drake.robot_server.robot.time_laws import (
    duration_with_speed,
    sample_bezier,
    sample_keys,
    sample_ramp,
)
from pepper_drake.robot_server.services.motion_arguments import (
    bezier_keys,
    fraction,
    joint_names,
    lists_each,
    one_each,
    one_for_each_chain,
)
from pepper_drake.robot_server.services.motion_base import BaseMoves
from pepper_drake.robot_server.services.motion_settings import MotionSettings
from pepper_drake.robot_server.services.movers import Movers
from pepper_drake.robot_server.services.postures import NAOQI_POSTURES
from pepper_drake.robot_server.services.waiting import Module, until_ended
from pepper_drake.robot_server.wire.service import Caller
from pepper_drake.robot_server.wire.signatures import with_caller

_T = TypeVar("_T")

_WAKE_SPEED = 0.3
"""Fraction of the largest speed at which the robot wakes up and goes to rest."""

_HAND_SPEED = 0.5

_NOT_ON_PEPPER = "Cartesian control is not available on Pepper"


class Motion(BaseMoves, MotionSettings, Module):
    """ALMotion.

    `step` is its cycle: it reads the robot's state, computes the next command from tasks and
    targets, and sends it.

    Attributes:
        joints: The joints' commands and stiffnesses.
    """

    def __init__(
        self,
        port: RobotPort,
        raise_event: Callable[[str, Any], None],
        *,
        log: Callable[[str], None] = lambda _: None,
        awake: bool = False,
    ) -> None:
        """Makes ALMotion for a robot at rest.

        Args:
            port: The robot.
            raise_event: Stores a value in ALMemory and notifies its subscribers.
            log: Takes a line when a client moves what another one was moving.
            awake: Whether its joints are stiff from the start.
        """
        state = port.state()
        Module.__init__(self, "ALMotion")
        BaseMoves.__init__(self, state, Movers(log, lambda: self.state.time))
        MotionSettings.__init__(self)
        self.joints = JointController(state)
        self._port = port
        self._raise_event = raise_event
        self._history = MeasurementHistory()
        self._awake = awake
        if awake:
            self.joints.stiffness[:] = 1.0

    def step(self) -> None:
        """Runs one cycle of 20 ms."""
        self.state = self._port.state()
        self.odometry.pose = self.state.base_pose
        self._history.add(self.state.time, [*self.state.positions, *self.state.base_pose])
        self.base.enabled = self._awake
        self.tasks.step()
        self.joints.step(self.state)
        self.base.step()
        self._port.command(
            RobotCommand(
                self.joints.command.copy(), self.joints.stiffness.copy(), self.base.velocity
            )
        )

    def client_left(self, caller: Caller) -> None:
        """Ends the tasks of a client that is gone; its base move brakes."""
        self.tasks.kill_where(lambda task: task.client == caller.client)

    # Stiffness.

    async def wake_up(self) -> None:
        """Makes all joints stiff and stands up; if awake, does nothing."""
        if self._awake:
            return
        self._awake = True
        self._raise_event("ALMotion/Stiffness/wakeUpStarted", True)
        self.tasks.kill_where(lambda task: True)
        for name in JOINTS:
            self.joints.set_stiffness(name, 1.0)
        await self.go_to(NAOQI_POSTURES["StandInit"], _WAKE_SPEED, "wakeUp")
        self._raise_event("robotIsWakeUp", True)
        self._raise_event("ALMotion/Stiffness/wakeUpFinished", True)

    async def rest(self, chain: str = "") -> None:
        """Crouches and makes all joints limp; with a chain, makes only that limp."""
        if chain:
            self.set_stiffnesses(chain, 0.0)
            return
        self._raise_event("ALMotion/Stiffness/restStarted", True)
        self.tasks.kill_where(lambda task: True)
        self.stop_move()
        if self._awake:
            await self.go_to(NAOQI_POSTURES["Crouch"], _WAKE_SPEED, "rest")
        self._awake = False
        for name in JOINTS:
            self.joints.set_stiffness(name, 0.0)
        self._raise_event("robotIsWakeUp", False)
        self._raise_event("ALMotion/Stiffness/restFinished", True)

    def robot_is_wake_up(self) -> bool:
        """Returns whether the robot is awake: its leg is stiff."""
        return self._awake

    def set_stiffnesses(self, names: Any, stiffnesses: Any) -> None:
        """Sets stiffnesses from 0 to 1; those of the lower body stay."""
        stiffnesses = one_for_each_chain(names, stiffnesses)
        for name, value in one_each(names, stiffnesses, "stiffnesses").items():
            if name in STIFFNESS_CHAINS:
                self.joints.set_stiffness(name, value)

    def get_stiffnesses(self, names: Any) -> list[float]:
        """Returns stiffnesses."""
        return [
            float(self._awake) if name in WHEELS else float(self.joints.stiffness[INDEX[name]])
            for name in joint_names(names)
        ]

    async def stiffness_interpolation(self, names: Any, stiffnesses: Any, times: Any) -> None:
        """Changes stiffnesses along straight lines through timed keys [s]."""
        keys = lists_each(names, stiffnesses, times, "stiffnesses")
        samplers = {
            name: _ramp(ts, xs) for name, (ts, xs) in keys.items() if name in STIFFNESS_CHAINS
        }
        if not samplers:
            return
        resources = [name + STIFFNESS for name in samplers]
        task = self.tasks.add(
            "stiffnessInterpolation", resources, StiffnessMotion(self.joints, samplers)
        )
        await until_ended(self.tasks, task)

    # Joints.

    async def angle_interpolation(
        self, names: Any, angles: Any, times: Any, is_absolute: bool
    ) -> None:
        """Moves joints along smooth paths through timed keys [rad, s]."""
        samplers = {
            name: _keys(name, ts, xs, bool(is_absolute))
            for name, (ts, xs) in lists_each(names, angles, times, "angles").items()
        }
        await self._follow("angleInterpolation", samplers)

    async def angle_interpolation_with_speed(
        self, names: Any, angles: Any, max_speed_fraction: float
    ) -> None:
        """Moves joints to targets [rad], the slowest at a fraction of its largest speed."""
        await self.go_to(
            one_each(names, angles, "angles"),
            fraction(max_speed_fraction),
            "angleInterpolationWithSpeed",
        )

    async def angle_interpolation_bezier(self, names: Any, times: Any, controls: Any) -> None:
        """Moves joints along Bezier curves between timed keys [rad, s]."""
        samplers = {
            name: _bezier(ts, keys)
            for name, (ts, keys) in bezier_keys(names, times, controls).items()
        }
        await self._follow("angleInterpolationBezier", samplers)

    @with_caller
    def set_angles(self, caller: Caller, names: Any, angles: Any, fraction_max_speed: Any) -> None:
        """Sets targets of joints [rad]; returns at once."""
        targets = one_each(names, angles, "angles")
        self._movers.claim(caller, targets)
        if isinstance(fraction_max_speed, list | tuple):
            shares = one_each(names, fraction_max_speed, "fractions")
            for name, target in targets.items():
                retarget(self.joints, self.tasks, {name: target}, fraction(shares[name]))
            return
        retarget(self.joints, self.tasks, targets, fraction(fraction_max_speed))

    @with_caller
    def change_angles(
        self, caller: Caller, names: Any, changes: Any, fraction_max_speed: float
    ) -> None:
        """Sets targets of joints by differences [rad] from their commands."""
        targets = {
            name: change + float(self.joints.command[INDEX[name]])
            for name, change in one_each(names, changes, "changes").items()
        }
        self._movers.claim(caller, targets)
        retarget(self.joints, self.tasks, targets, fraction(fraction_max_speed))

    def get_angles(self, names: Any, use_sensors: bool) -> list[float]:
        """Returns measured or commanded angles [rad], 0 for wheels."""
        source = self.state.positions if use_sensors else self.joints.command
        return [
            0.0 if name in WHEELS else float(source[INDEX[name]]) for name in joint_names(names)
        ]

    async def open_hand(self, hand: str) -> None:
        """Opens a hand."""
        await self._move_hand(hand, 1.0, "openHand")

    async def close_hand(self, hand: str) -> None:
        """Closes a hand."""
        await self._move_hand(hand, 0.0, "closeHand")

    # Frames.

    def get_position(self, name: str, frame: int, use_sensors: bool) -> list[float]:
        """Returns a frame's pose as x, y, z, wx, wy, wz [m, rad]."""
        return as_position6(self._pose(name, frame, use_sensors))

    def get_transform(self, name: str, frame: int, use_sensors: bool) -> list[float]:
        """Returns a frame's pose as 16 numbers, row by row."""
        return as_transform16(self._pose(name, frame, use_sensors))

    def get_sensor_transform_at_time(self, name: str, time: Any) -> list[float]:
        """Returns a frame's pose in the world at a time of the last two seconds.

        The time is (s, us), or an integer of nanoseconds.
        """
        when = join_time(*time) if isinstance(time, list | tuple) else time * 1e-9
        measured = self._history.at(when)
        if measured is None:
            raise ValueError(f"nothing is known of the time {when:.3f} s")
        x, y, theta = measured[len(JOINTS) :].tolist()
        q = measured[: len(JOINTS)]
        X = _named(name, lambda: kinematics().transform(name, 1, q, (x, y, theta)))
        return as_transform16(X)

    def get_mass(self, name: str) -> float:
        """Returns the mass of "Body", of a chain, or of the link that a joint moves [kg]."""
        return _named(name, lambda: kinematics().mass(name))

    def get_com(self, name: str, frame: int, use_sensors: bool) -> list[float]:
        """Returns the centre of mass of `getMass`'s mass in a frame: x, y, z [m]."""
        q = self.state.positions if use_sensors else self.joints.command
        base = self.state.base_pose
        return _named(name, lambda: kinematics().center_of_mass(name, frame, q, base).tolist())

    def get_sensor_names(self) -> list[str]:
        """Returns the sensors with a known pose."""
        return list(SENSOR_NAMES)

    def get_body_names(self, name: str) -> list[str]:
        """Returns the joints of "Body", "Joints", "Actuators", a chain; or "Chains" themselves."""
        return list(CHAINS) if name == "Chains" else joint_names(name)

    def get_joint_names(self, name: str) -> list[str]:
        """As `getBodyNames`, its former name."""
        return self.get_body_names(name)

    def get_limits(self, name: str) -> list[list[float]]:
        """Returns [min, max, max speed, max torque] of joints [rad, rad/s, N m]."""
        limits = (JOINT_LIMITS[joint] for joint in joint_names(name))
        return [[limit.lower, limit.upper, limit.velocity, limit.effort] for limit in limits]

    def get_motion_cycle_time(self) -> int:
        """Returns the cycle [ms]."""
        return round(CYCLE * 1000)

    def get_robot_config(self) -> list[list[Any]]:
        """Returns names and values of the robot's configuration."""
        config: dict[str, Any] = {
            "Model Type": "juliette",
            "Head Version": "VERSION_16",
            "Body Version": "VERSION_16",
            "Arm Version": "VERSION_16",
            "Laser": True,
            "Extended Arms": False,
            "Number of Legs": 1,
            "Number of Arms": 2,
            "Number of Hands": 2,
        }
        return [list(config), list(config.values())]

    def get_summary(self) -> str:
        """Returns a table of the joints and the tasks."""
        lines = [f"{'JointName':>20}{'Stiffness':>12}{'Command':>12}{'Sensor':>12}"]
        for name, *values in zip(
            BODY,
            self.get_stiffnesses("Body"),
            self.get_angles("Body", False),
            self.get_angles("Body", True),
            strict=True,
        ):
            lines.append(f"{name:>20}" + "".join(f"{value:12.6f}" for value in values))
        lines += ["", f"{'Task':>20}{'ID':>12}"]
        lines += [f"{task.name:>20}{task.id:12d}" for task in self.tasks.tasks()]
        return "\n".join(lines) + f"\n\nMotion cycle time: {self.get_motion_cycle_time()} ms\n"

    # Tasks.

    def get_task_list(self) -> list[list[Any]]:
        """Returns [name, number] of each task, running or postponed."""
        return [[task.name, task.id] for task in self.tasks.tasks()]

    def are_resources_available(self, resources: list[str]) -> bool:
        """Returns whether no running task books one of these joints or chains."""
        return not self.tasks.booked() & _resources(resources)

    def kill_task(self, task_id: int) -> bool:
        """Ends a task smoothly; returns whether there was one of that number."""
        return self.tasks.kill(task_id)

    def kill_tasks_using_resources(self, resources: list[str]) -> None:
        """Ends the tasks that book one of these joints or chains."""
        names = _resources(resources)
        self.tasks.kill_where(lambda task: bool(task.resources & names))

    def kill_all(self) -> None:
        """Ends all tasks; joints moving to a target brake, too."""
        self.tasks.kill_where(lambda task: True)
        self.stop_move()
        self.joints.halt(JOINTS)

    # For the other services.

    async def go_to(self, targets: Mapping[str, float], share: float, name: str) -> bool:
        """Moves joints to targets [rad] as one task; returns False if it was killed.

        The joint with the longest motion moves at most at `share` of its largest speed; all arrive
        together.
        """
        if share <= 0.0:
            raise ValueError("the fraction of the largest speed is 0; nothing would move")
        place = self.joints.command.copy()
        for joint, value in targets.items():
            place[INDEX[joint]] = value
        place = clip_to_limits(place)
        goals = {joint: float(place[INDEX[joint]]) for joint in targets}

        def duration() -> float:
            return max(
                duration_with_speed(
                    goal - self.joints.command[INDEX[joint]],
                    share * JOINT_LIMITS[joint].velocity,
                )
                for joint, goal in goals.items()
            )

        return await self._follow(
            name, {joint: _timed(goal, duration) for joint, goal in goals.items()}
        )

    async def _follow(self, name: str, samplers: dict[str, Sampler]) -> bool:
        if not samplers:
            return True
        motion = PathMotion(self.joints, samplers)
        task = self.tasks.add(name, samplers, motion)
        await until_ended(self.tasks, task)
        return task.state.value == "done"

    async def _move_hand(self, hand: str, value: float, name: str) -> None:
        if hand not in HANDS:
            raise ValueError(f"there is no hand {hand!r}; it must be LHand or RHand")
        was_limp = self.joints.stiffness[INDEX[hand]] == 0.0
        if was_limp:
            self.joints.set_stiffness(hand, 1.0)
        try:
            await self.go_to({hand: value}, _HAND_SPEED, name)
        finally:
            if was_limp:
                self.joints.set_stiffness(hand, 0.0)

    def _pose(self, name: str, frame: int, use_sensors: bool) -> Any:
        q = self.state.positions if use_sensors else self.joints.command
        base = self.state.base_pose
        return _named(name, lambda: kinematics().transform(name, frame, q, base))

    def _refuse_cartesian(self, *_: Any) -> None:
        raise ValueError(_NOT_ON_PEPPER)

    position_interpolation = _refuse_cartesian
    position_interpolations = _refuse_cartesian
    set_position = _refuse_cartesian
    set_positions = _refuse_cartesian
    change_position = _refuse_cartesian
    transform_interpolation = _refuse_cartesian
    transform_interpolations = _refuse_cartesian
    set_transform = _refuse_cartesian
    set_transforms = _refuse_cartesian
    change_transform = _refuse_cartesian

    def _refuse_whole_body(self, *_: Any) -> None:
        raise ValueError("whole-body control is not available on Pepper")

    wb_enable = _refuse_whole_body
    wb_enable_balance_constraint = _refuse_whole_body
    wb_enable_effector_control = _refuse_whole_body
    wb_enable_effector_optimization = _refuse_whole_body
    wb_foot_state = _refuse_whole_body
    wb_go_to_balance = _refuse_whole_body
    wb_go_to_balance_with_speed = _refuse_whole_body
    wb_set_effector_control = _refuse_whole_body

    def _refuse_steps(self, *_: Any) -> None:
        raise ValueError("Pepper rolls on wheels and takes no steps")

    set_foot_steps = _refuse_steps
    set_foot_steps_with_speed = _refuse_steps
    get_foot_steps = _refuse_steps
    get_foot_gait_config = _refuse_steps


def _named(name: str, compute: Callable[[], _T]) -> _T:
    """Computes a property of a frame; raises ValueError if there is no frame of that name."""
    try:
        return compute()
    except UnknownFrameError:
        raise ValueError(f"there is no joint, effector or sensor {name!r}") from None


def _resources(names: list[str]) -> frozenset[str]:
    """Returns joints, wheels and stiffnesses for names of joints, chains and resources."""
    found: set[str] = set()
    for name in names:
        base, slash, _ = name.partition("/")
        suffix = STIFFNESS if slash else ""
        found |= {joint + suffix for joint in (GROUPS.get(base) or joint_names(base))}
    return frozenset(found)


def _ramp(times: list[float], values: list[float]) -> Sampler:
    return lambda start, _: sample_ramp(start, times, [min(max(v, 0.0), 1.0) for v in values])


def _keys(name: str, times: list[float], values: list[float], absolute: bool) -> Sampler:
    limits = JOINT_LIMITS[name]

    def sample(start: float, velocity: float) -> Any:
        keys = np.array(values) + (0.0 if absolute else start)
        keys = np.clip(keys, limits.lower, limits.upper)
        return sample_keys(start, velocity, times, keys.tolist())

    return sample


def _bezier(times: list[float], keys: list[Any]) -> Sampler:
    return lambda start, _: sample_bezier(start, times, keys)


def _timed(goal: float, duration: Callable[[], float]) -> Sampler:
    return lambda start, velocity: sample_keys(start, velocity, [duration()], [goal])
