"""ALMotion's control of the base: velocities within limits of speed and acceleration, and moves."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pepper_drake.naoqi.constants import BASE_LIMITS, CYCLE
from pepper_drake.robot_server.robot.robot_port import RobotState

Pose = tuple[float, float, float]
"""x, y [m] and theta [rad]; for a velocity per second."""

_STILL: Pose = (0.0, 0.0, 0.0)

_PULL = 2.0
"""Gain on a move's position error [1/s]."""

_NEAR = (0.005, 0.01)
"""Distance and angle from its goal within which a move has arrived [m, rad]."""

_GIVES_UP = 2.0
"""Time after a move's nominal end at which it fails [s]."""


@dataclass(frozen=True)
class BaseSpeeds:
    """Limits of a move [m/s, rad/s, m/s^2, rad/s^2]."""

    speed: float
    turning: float
    acceleration: float
    turning_acceleration: float

    @classmethod
    def configured(cls, settings: Mapping[str, float]) -> "BaseSpeeds":
        """Returns NAOqi's limits, with settings clipped to its ranges."""

        def value(key: str) -> float:
            limit = BASE_LIMITS[key]
            return min(max(settings.get(key, limit.default), limit.lower), limit.upper)

        return cls(*map(value, ("MaxVelXY", "MaxVelTheta", "MaxAccXY", "MaxAccTheta")))


class BaseController:
    """Velocity control of the base.

    Attributes:
        velocity: Commanded vx, vy [m/s], wz [rad/s] in the base's frame.
        enabled: Whether the base may move: its wheels are stiff.
    """

    def __init__(self) -> None:
        self.velocity: Pose = _STILL
        self.enabled = False
        self._target: Pose = _STILL
        self._speeds = BaseSpeeds.configured({})

    def want(self, velocity: Pose, speeds: BaseSpeeds) -> None:
        """Sets the wanted velocity, which is reached as fast as the limits allow."""
        self._speeds = speeds
        vx, vy, wz = velocity
        length = math.hypot(vx, vy)
        scale = min(1.0, speeds.speed / length) if length else 1.0
        wz = min(max(wz, -speeds.turning), speeds.turning)
        self._target = (vx * scale, vy * scale, wz)

    def stop(self) -> None:
        """Sets the wanted velocity to zero."""
        self._target = _STILL

    @property
    def resting(self) -> bool:
        """Returns whether both commanded and wanted velocity are zero."""
        return self.velocity == _STILL == self._target

    def step(self) -> None:
        """Changes the velocity by at most one cycle's acceleration.

        The acceleration is relative to the floor: while the base turns, a constant velocity turns
        the other way in its frame.
        """
        wanted = self._target if self.enabled else _STILL
        vx, vy, wz = self.velocity
        c, s = math.cos(wz * CYCLE), math.sin(wz * CYCLE)
        vx, vy = c * vx + s * vy, -s * vx + c * vy
        dx, dy = wanted[0] - vx, wanted[1] - vy
        gap = math.hypot(dx, dy)
        reach = self._speeds.acceleration * CYCLE
        share = min(1.0, reach / gap) if gap else 1.0
        turn = self._speeds.turning_acceleration * CYCLE
        wz = wanted[2] if abs(wanted[2] - wz) <= turn else wz + math.copysign(turn, wanted[2] - wz)
        straight = wanted[:2] if share == 1.0 else (vx + share * dx, vy + share * dy)
        self.velocity = (*straight, wz)


class Odometry:
    """The base's pose in the world by wheel odometry.

    Attributes:
        pose: x, y [m], theta [rad].
    """

    def __init__(self, state: RobotState) -> None:
        self.pose: Pose = state.base_pose


class VelocityMove:
    """A move at a velocity until it is stopped; a task's motion."""

    def __init__(self, base: BaseController, velocity: Pose, speeds: BaseSpeeds) -> None:
        self._base = base
        self._velocity = velocity
        self._speeds = speeds

    def start(self) -> None:
        """Sets the wanted velocity."""
        self._base.want(self._velocity, self._speeds)

    def step(self) -> bool:
        """Ends if the wanted velocity is zero and the base is at rest."""
        return self._velocity == _STILL and self._base.resting

    def stop(self) -> None:
        """Brakes."""
        self._base.stop()


class PoseMove:
    """A move along straight lines through poses of the base; a task's motion.

    Translation and rotation of each leg have trapezoidal profiles of the same duration; odometry
    errors are corrected during the move.

    Attributes:
        goal: The last pose, in the world; known once the move has started.
        succeeded: Whether the goal was reached.
    """

    def __init__(
        self,
        base: BaseController,
        points: list[Pose],
        speeds: BaseSpeeds,
        odometry: Odometry,
        duration: float = 0.0,
    ) -> None:
        """Prepares a move.

        Args:
            base: Controller that gets the velocities.
            points: Poses to pass, relative to the base's initial pose [m, rad].
            speeds: Limits.
            odometry: Of the base.
            duration: Least duration of the move [s].
        """
        self._base = base
        self._points = points
        self._speeds = speeds
        self._odometry = odometry
        self._least = duration
        self._origin: Pose = _STILL
        self._stops: list[Pose] = []
        self._start: Pose = _STILL
        self._leg = -1
        self._time = 0.0
        self._duration = 0.0
        self.goal: Pose | None = None
        self.succeeded = False

    def start(self) -> None:
        """Computes the poses in the world."""
        self._origin = self._odometry.pose
        x, y, theta = self._origin
        c, s = math.cos(theta), math.sin(theta)
        self._stops = [
            (x + c * px - s * py, y + s * px + c * py, theta + p) for px, py, p in self._points
        ]
        self.goal = self._stops[-1]
        self._next_leg()

    def step(self) -> bool:
        """Sets the velocity of this cycle."""
        start, end = self._start, self._stops[self._leg]
        delta = tuple(b - a for a, b in zip(start, end, strict=True))
        distance, turn = math.hypot(*delta[:2]), abs(delta[2])
        share, _ = self._progress(self._time, distance, False)
        turned, _ = self._progress(self._time, turn, True)
        # The command is held over the next cycle: its speed is that of the cycle's middle.
        _, rate = self._progress(self._time + CYCLE / 2, distance, False)
        _, turning = self._progress(self._time + CYCLE / 2, turn, True)
        reference = (
            start[0] + share * delta[0],
            start[1] + share * delta[1],
            start[2] + turned * delta[2],
        )
        x, y, theta = self._odometry.pose
        error = (reference[0] - x, reference[1] - y, reference[2] - theta)
        over = self._time >= self._duration
        if over and math.hypot(*error[:2]) < _NEAR[0] and abs(error[2]) < _NEAR[1]:
            if self._leg + 1 < len(self._stops):
                self._next_leg()
                return False
            self.succeeded = True
            self._base.stop()
            return True
        if self._time > self._duration + _GIVES_UP or not self._base.enabled:
            self._base.stop()
            return True
        wx, wy = rate * delta[0] + _PULL * error[0], rate * delta[1] + _PULL * error[1]
        wz = turning * delta[2] + _PULL * error[2]
        middle = theta + wz * CYCLE / 2
        c, s = math.cos(middle), math.sin(middle)
        self._base.want((c * wx + s * wy, -s * wx + c * wy, wz), self._speeds)
        self._time += CYCLE
        return False

    def stop(self) -> None:
        """Brakes."""
        self._base.stop()

    def _next_leg(self) -> None:
        self._start = self._origin if self._leg < 0 else self._stops[self._leg]
        self._leg += 1
        end = self._stops[self._leg]
        distance = math.hypot(end[0] - self._start[0], end[1] - self._start[1])
        self._time = 0.0
        self._duration = max(
            trapezoid_duration(distance, self._speeds.speed, self._speeds.acceleration),
            trapezoid_duration(
                abs(end[2] - self._start[2]),
                self._speeds.turning,
                self._speeds.turning_acceleration,
            ),
            self._least / len(self._stops),
            CYCLE,
        )

    def _progress(self, time: float, distance: float, turning: bool) -> tuple[float, float]:
        """Returns the covered share of a distance and its rate at a time of this leg."""
        if distance < 1e-9:
            return 1.0, 0.0
        speed = self._speeds.turning if turning else self._speeds.speed
        gain = self._speeds.turning_acceleration if turning else self._speeds.acceleration
        own = trapezoid_duration(distance, speed, gain)
        scale = own / self._duration
        share, rate = trapezoid(min(time, self._duration) * scale, distance, speed, gain)
        return share / distance, rate * scale / distance


class FollowMove:
    """A move towards a pose that may change on the way; a task's motion."""

    def __init__(self, base: BaseController, speeds: BaseSpeeds, odometry: Odometry) -> None:
        """Prepares a move; `aim` says where to.

        Args:
            base: Controller that gets the velocities.
            speeds: Limits.
            odometry: Of the base.
        """
        self._base = base
        self._speeds = speeds
        self._odometry = odometry
        self._goal: Pose = odometry.pose
        self._near: Pose = _STILL
        self._left = 0.0

    def aim(self, goal: Pose, near: Pose, time: float) -> None:
        """Sets the pose.

        Args:
            goal: In the world.
            near: Distances along the goal's x and y and angle within which the move ends [m, rad].
            time: Time until the move ends unless it is aimed anew [s].
        """
        self._goal, self._near, self._left = goal, near, time

    @property
    def has_arrived(self) -> bool:
        """Returns whether the base is near the goal."""
        x, y, theta = self._odometry.pose
        c, s = math.cos(self._goal[2]), math.sin(self._goal[2])
        dx, dy = self._goal[0] - x, self._goal[1] - y
        turn = math.remainder(self._goal[2] - theta, 2 * math.pi)
        errors = (c * dx + s * dy, -s * dx + c * dy, turn)
        return all(abs(e) <= near for e, near in zip(errors, self._near, strict=True))

    def start(self) -> None:
        """Waits for the first cycle."""

    def step(self) -> bool:
        """Sets the velocity of this cycle, from which half the acceleration stops at the goal."""
        self._left -= CYCLE
        if self._left < 0 or self.has_arrived or not self._base.enabled:
            self._base.stop()
            return True
        x, y, theta = self._odometry.pose
        c, s = math.cos(theta), math.sin(theta)
        dx, dy = self._goal[0] - x, self._goal[1] - y
        distance = math.hypot(dx, dy)
        rate = math.sqrt(self._speeds.acceleration / distance) if distance else 0.0
        turn = math.remainder(self._goal[2] - theta, 2 * math.pi)
        turning = math.copysign(math.sqrt(self._speeds.turning_acceleration * abs(turn)), turn)
        velocity = (rate * (c * dx + s * dy), rate * (-s * dx + c * dy), turning)
        self._base.want(velocity, self._speeds)
        return False

    def stop(self) -> None:
        """Brakes."""
        self._base.stop()


def trapezoid_duration(distance: float, speed: float, acceleration: float) -> float:
    """Returns the duration of a rest-to-rest motion over a distance [s]."""
    if distance * acceleration < speed**2:
        return 2 * math.sqrt(distance / acceleration)
    return distance / speed + speed / acceleration


def trapezoid(
    time: float, distance: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """Returns covered distance and speed at a time of a rest-to-rest motion."""
    duration = trapezoid_duration(distance, speed, acceleration)
    peak = min(speed, math.sqrt(distance * acceleration))
    rise = peak / acceleration
    if time <= rise:
        return acceleration * time**2 / 2, acceleration * time
    if time >= duration - rise:
        left = duration - time
        return distance - acceleration * left**2 / 2, acceleration * left
    return peak * (time - rise / 2), peak
