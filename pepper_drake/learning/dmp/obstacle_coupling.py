"""Coupling terms: what pushes the hand around obstacles.

Both modes give C_t of equation 2.6 (tau z' = ... + f + C_t) and how much the phase is slowed down.

`ReportCoupling` is the report's equation 2.7, exactly: the sum over all points o of the cloud of
gamma R y' theta exp(-beta theta), theta the angle between y' and o - y, R the rotation by 90
degrees about (o - y) x y'. It leaves two cases undefined. Heading straight at (or away from) a
point, and at rest, the push is zero here: at rest and dead ahead that is its limit.

`BarrierCoupling` is the default. With d, n the distance and unit normal of the obstacles at y, a0
the acceleration without coupling and v = y':

    rho = rho0 + (rho_g - rho0) exp(-|y - g|² / 2 fade²),
    a_n = clip(-n·a0 - k1 n·v - k0 (k1² / 4) (d - rho), 0, a_max), zero for d > rho + reach,
    w = v - (n·v) n + eta (up - (n·up) n), t = w / max(|w|, 0.05),
    lambda = 1 - exp(-|y - g|² / 2 goal_fade²),
    C_t = tau² sat(a_n n + k_t lambda a_n t), tau x' = -alpha_x x / (1 + k_s |C_t| / tau²),

rho0 = hand radius + margin, rho_g = min(rho0, d(g) - 4 mm). A second-order control barrier with
sliding and phase stopping: it cancels only the excess of inward acceleration, acts at rest and dead
ahead, does not depend on how dense the cloud is, and is silent otherwise.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.arithmetic import arithmetic
from pepper_drake.registry import registered
from pepper_drake.short_repr import short_repr, short_signature

Array = npt.NDArray[np.float64]

_UP = np.array([0.0, 0.0, 1.0])


class CouplingOutput(NamedTuple):
    """Effect of obstacles on the hand, for any leading shape (...).

    Attributes:
        coupling: (..., 3) C_t [m].
        slowdown: (...) s >= 0 in tau x' = -alpha_x x / (1 + s).
        distance: (...) from the hand's centre to the nearest obstacle [m].
    """

    coupling: Array
    slowdown: Any
    distance: Any


class Field(Protocol):
    """Obstacles, such as a `PointCloudDistance`."""

    def distance(self, positions: npt.ArrayLike, within: float = np.inf) -> Array:
        """Returns distances (...) [m] at positions (..., 3), infinite from `within` [m] on."""
        ...

    def distance_and_normal(self, position: Array, /) -> tuple[Any, Array]:
        """Returns distances (...) [m] and unit normals (..., 3) at positions (..., 3)."""
        ...

    @property
    def points(self) -> Array:
        """(P, 3) the cloud [m]."""
        ...


class Coupling(Protocol):
    """A coupling term."""

    def clearance(self, field: Field, goal: Array) -> float:
        """Returns the distance [m] that is kept at the goal (3,)."""
        ...

    def push(
        self,
        field: Field,
        state: Array,
        acceleration: Array,
        goal: Array,
        goal_clearance: float,
        tau: float,
    ) -> CouplingOutput:
        """Returns what obstacles do.

        Args:
            field: The obstacles.
            state: (..., 2, 3) position [m] and velocity [m/s] of the hand.
            acceleration: (..., 3) what it would be without coupling [m/s²].
            goal: (3,) [m].
            goal_clearance: Of `clearance`, for this field and goal.
            tau: [s].
        """
        ...

    def zero_beyond(self, state: Array, acceleration: Array) -> Any:
        """Returns the distance (...) [m] beyond which `push` is surely zero."""
        ...


@dataclass(frozen=True)
class ReportCoupling:
    """Equation 2.7; the cloud is taken as it is, point by point.

    Attributes:
        gamma: Strength of the push of each point; it adds up over the cloud.
        beta: How fast the push fades with the angle [1/rad].
    """

    gamma: float = 20.0
    beta: float = 20.0 / np.pi

    def clearance(self, field: Field, goal: Array) -> float:
        """Returns 0: the report keeps no distance."""
        return 0.0

    def push(
        self,
        field: Field,
        state: Array,
        acceleration: Array,
        goal: Array,
        goal_clearance: float,
        tau: float,
    ) -> CouplingOutput:
        """Returns the sum of equation 2.7 over all points; see `Coupling`."""
        position, velocity = state[..., 0, :], state[..., 1, :]
        speed = np.sqrt((velocity * velocity).sum(axis=-1))
        heading = velocity / np.maximum(speed, 1e-12)[..., None]
        towards = field.points - position[..., None, :]
        along = (towards @ heading[..., None])[..., 0]
        across = towards - along[..., None] * heading[..., None, :]
        sideways = np.sqrt((across * across).sum(axis=-1))
        theta = np.arctan2(sideways, along)
        # R y' points away from the point, at right angles to y': -|y'| across / |across|.
        strength = self.gamma * speed[..., None] * theta * np.exp(-self.beta * theta)
        strength = np.where(sideways > 1e-9, strength / np.maximum(sideways, 1e-12), 0.0)
        coupling = -(strength[..., None, :] @ across)[..., 0, :]
        return CouplingOutput(coupling, np.zeros(speed.shape), field.distance(position))

    def zero_beyond(self, state: Array, acceleration: Array) -> Any:
        """Returns infinity: the report's push has no end."""
        return np.full(state.shape[:-2], np.inf)


@dataclass(frozen=True)
class BarrierCoupling:
    """Barrier, sliding and phase stopping. The z axis of the motion's frame points up.

    Attributes:
        hand_radius: Of the sphere that stands for the hand [m].
        margin: Distance between that sphere and obstacles [m].
        goal_margin: How much nearer than the goal obstacles may be, near the goal [m].
        goal_distance: Over which the kept distance changes to that at the goal [m].
        sliding_distance: Over which sliding fades towards the goal [m].
        damping: k1 [1/s].
        stiffness: k0, relative to k1² / 4.
        sliding: k_t.
        up_bias: eta: sliding prefers to go up.
        slowdown: k_s [s²/m].
        largest_normal: Limit of a_n [m/s²].
        largest_acceleration: Limit of C_t / tau² [m/s²].
        reach: Beyond rho by more than this nothing happens [m].
    """

    hand_radius: float = 0.05
    margin: float = 0.010
    goal_margin: float = 0.004
    goal_distance: float = 0.055
    sliding_distance: float = 0.04
    damping: float = 30.0
    stiffness: float = 0.8
    sliding: float = 1.0
    up_bias: float = 0.5
    slowdown: float = 0.05
    largest_normal: float = 12.0
    largest_acceleration: float = 15.0
    reach: float = 0.3

    __repr__ = short_repr
    __signature__ = short_signature

    def check(self) -> None:
        """Raises InputError for a number by which the law divides and which is not positive."""
        for name in ("goal_distance", "sliding_distance", "damping", "stiffness"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"barrier.{name} is {getattr(self, name):g}; it must be positive")

    def clearance(self, field: Field, goal: Array) -> float:
        """Returns rho_g = min(rho0, d(g) - goal_margin) [m]."""
        enough = self._rho0 + self.goal_margin
        return min(enough, float(field.distance(goal, within=enough))) - self.goal_margin

    def push(
        self,
        field: Field,
        state: Array,
        acceleration: Array,
        goal: Array,
        goal_clearance: float,
        tau: float,
    ) -> CouplingOutput:
        """Returns the barrier's push; see `Coupling`."""
        xp, vector, array, dot, plus, times, anything = arithmetic(state)
        position, velocity = vector(state[..., 0, :]), vector(state[..., 1, :])
        distance, direction = field.distance_and_normal(state[..., 0, :])
        normal = vector(direction)
        offset = plus(position, vector(goal), -1.0)
        to_goal = dot(offset, offset)
        near_goal = xp.exp(-0.5 / self.goal_distance**2 * to_goal)
        rho = self._rho0 + (goal_clearance - self._rho0) * near_goal
        approach = dot(normal, velocity)
        inward = -dot(normal, vector(acceleration))
        pressed = inward - self.damping * approach - self._stiffness * (distance - rho)
        strength = xp.minimum(xp.maximum(pressed, 0.0), self.largest_normal)
        strength = strength * (distance <= rho + self.reach)
        if not anything(strength):
            return CouplingOutput(np.zeros(direction.shape), np.zeros(state.shape[:-2]), distance)
        slide = plus(velocity, vector(_UP), self.up_bias)
        slide = plus(slide, normal, -dot(normal, slide))
        length = xp.maximum(xp.sqrt(dot(slide, slide)), 0.05)
        fade = self.sliding * (1.0 - xp.exp(-0.5 / self.sliding_distance**2 * to_goal))
        total = times(plus(normal, slide, fade / length), strength)
        size = xp.sqrt(dot(total, total))
        limited = xp.minimum(size, self.largest_acceleration)
        total = times(total, tau * tau * limited / xp.maximum(size, 1e-12))
        return CouplingOutput(array(total), self.slowdown * limited, distance)

    def zero_beyond(self, state: Array, acceleration: Array) -> Any:
        """Returns a distance beyond which a_n is zero whatever the normal's direction."""
        xp, vector, _, dot, *_ = arithmetic(state)
        velocity, nominal = vector(state[..., 1, :]), vector(acceleration)
        most = xp.sqrt(dot(nominal, nominal)) + self.damping * xp.sqrt(dot(velocity, velocity))
        return self._rho0 + xp.minimum(self.reach, most / self._stiffness)

    @property
    def _rho0(self) -> float:
        return self.hand_radius + self.margin

    @property
    def _stiffness(self) -> float:
        return self.stiffness * self.damping**2 / 4.0


_couplings: dict[str, Callable[[], Coupling]] = {
    "barrier": BarrierCoupling,
    "report": ReportCoupling,
}


def register_coupling(name: str, make: Callable[[], Coupling]) -> None:
    """Makes a coupling known by its name.

    Args:
        name: The word that chooses it.
        make: Makes one with its default constants, such as its class.
    """
    _couplings[name] = make


def get_coupling(name: str) -> Coupling:
    """Returns the coupling of that name with its default constants.

    Raises:
        InputError: There is none; the message lists those that there are.
    """
    return registered("coupling", name, _couplings)()
