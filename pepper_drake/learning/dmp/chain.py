"""Movements in sequence: each begins with the position and velocity with which the last one ended.

A movement's own motion y_r comes from its primitive, between its start and its goal. The joins add
a smooth correction h, quintic polynomials of time near the ends that meet position, velocity and
acceleration exactly:

    y = y_r + h,    h(0) = 0, h'(0) = v_0 - y_r'(0), h(T) = g - y_r(T), h'(T) = v_T - y_r'(T),

which is the same transformation system with the forcing term h'' + alpha_z (h' + alpha_z / 4 h)
added in relative time. Away from the joins the motion is the primitive's. At a join without a stop
the hand passes the goal with v_T: in each coordinate the harmonic mean of both movements' mean
velocities if these have the same sign, otherwise zero (PCHIP's slopes), so that nothing overshoots.
Kober, Muelling, Kroemer, Lampert, Schoelkopf, Peters 2010 ("Movement templates for learning of
hitting and batting", DOI 10.1109/ROBOT.2010.5509672) use a moving target for a velocity at the
goal; the correction here leaves the rest of the motion unchanged. Saveriano, Franzel, Lee 2019
(DOI 10.1109/ICRA.2019.8793786) compare methods of joining.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.blending import (
    LEAST_ACCELERATION,
    blend_width,
    from_end,
    powers,
)
from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.learning.dmp.rollout_arguments import check_seconds, vector
from pepper_drake.short_repr import short_repr

_LONGEST = 1e4
"""Longest duration of a movement [s]."""

Array = npt.NDArray[np.float64]

BLEND = 0.8
"""Longest time at either end of a movement in which it is blended to the join's velocity [s]."""


@dataclass(frozen=True, eq=False)
class Step:
    """One movement of a sequence.

    Attributes:
        primitive: The movement; None waits in place for `duration`.
        goal: (3,) where it ends [m]; the demonstration's goal if left out.
        relative: Without a goal, the demonstration's displacement is applied from the start.
        duration: [s]; the demonstration's if left out.
        stop: Whether it ends at rest.
        goal_rotation: (4,) unit quaternion; the demonstration's last if left out.
        via: Points to pass: share of the duration, in (0, 1), and position (3,) [m].
    """

    primitive: MovementPrimitive | None
    goal: npt.ArrayLike | None = None
    relative: bool = False
    duration: float | None = None
    stop: bool = True
    goal_rotation: npt.ArrayLike | None = None
    via: tuple[tuple[float, npt.ArrayLike], ...] = ()

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Leg:
    """One planned movement: N samples, from its own time 0.

    Attributes:
        times: (N,) [s].
        positions: (N, 3) [m].
        velocities: (N, 3) [m/s].
        accelerations: (N, 3) [m/s²].
        rotations: (N, 4) unit quaternions, or None.
        step: What it performs.
    """

    __repr__ = short_repr

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    rotations: Array | None
    step: Step

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1])


@dataclass(frozen=True, eq=False)
class Chain:
    """A planned sequence.

    Attributes:
        legs: The movements.
        time_step: [s].
        blend: See `BLEND` [s].
    """

    legs: tuple[Leg, ...]
    time_step: float
    blend: float

    __repr__ = short_repr

    @property
    def joins(self) -> Array:
        """(L,) end times of the movements [s]."""
        return np.cumsum([leg.duration for leg in self.legs])

    @property
    def largest_jump(self) -> float:
        """Largest jump of the velocity at a join [m/s]."""
        pairs = zip(self.legs[:-1], self.legs[1:], strict=True)
        jumps = [np.linalg.norm(b.velocities[0] - a.velocities[-1]) for a, b in pairs]
        return float(max(jumps, default=0.0))

    def demonstration(self, name: str = "chain") -> Demonstration:
        """Returns the whole motion."""
        starts = np.concatenate(([0.0], self.joins[:-1]))
        parts = [slice(0, None) if k == 0 else slice(1, None) for k in range(len(self.legs))]
        pairs = list(zip(self.legs, parts, strict=True))

        def joined(values: list[Array]) -> Array:
            return np.concatenate(values)

        rotations = [leg.rotations for leg in self.legs]
        whole = [q[part] for q, part in zip(rotations, parts, strict=True) if q is not None]
        q = joined(whole) if len(whole) == len(self.legs) else None
        return Demonstration(
            joined(
                [start + leg.times[part] for start, (leg, part) in zip(starts, pairs, strict=True)]
            ),
            joined([leg.positions[part] for leg, part in pairs]),
            joined([leg.velocities[part] for leg, part in pairs]),
            joined([leg.accelerations[part] for leg, part in pairs]),
            rotations=None if q is None else so3.make_continuous(q),
            name=name,
            derivation="exact",
        )

    def replanned(self, time: float, leg: int, goal: npt.ArrayLike) -> Chain:
        """Returns the sequence with another goal of a movement, from a time on.

        The motion until then stays; position, velocity and acceleration do not jump. Legs after the
        moved goal are replanned from there.

        Args:
            time: Current time [s], since the sequence began.
            leg: Number of the movement whose goal moved, from 0; not over yet.
            goal: (3,) its new position [m].

        Raises:
            InputError: The movement is over, or does not exist.
        """
        if not 0 <= leg < len(self.legs):
            raise InputError(f"leg {leg}: there are {len(self.legs)} movements")
        ends = self.joins
        if not 0.0 <= time < ends[leg]:
            raise InputError(f"time {time:g} s: movement {leg + 1} ends at {ends[leg]:g} s")
        own = self.legs[leg]
        begun = time - (ends[leg] - own.duration)
        target = vector(goal, own.positions[-1], 3, "goal")
        legs = list(self.legs)
        moved = own.step if own.step.primitive is None else replace(own.step, goal=target)
        if begun <= 0.0 and own.step.primitive is not None:
            legs[leg] = _leg(
                moved,
                *self._begin(leg),
                own.velocities[-1],
                None if own.rotations is None else own.rotations[0],
                self.time_step,
                self.blend,
            )
        else:
            legs[leg] = _retargeted(own, max(begun, 0.0), target, moved, self.blend, self.time_step)
        return replace(self, legs=tuple(legs))._replanned_from(leg + 1)

    def _begin(self, leg: int) -> tuple[Array, Array, Array]:
        """Returns position, velocity and acceleration with which a leg begins."""
        own = self.legs[leg]
        return own.positions[0], own.velocities[0], own.accelerations[0]

    def _replanned_from(self, leg: int) -> Chain:
        """Returns the sequence with the legs from `leg` on replanned, one from another's end.

        The first one with a goal of its own is the last that changes.
        """
        legs = list(self.legs)
        for k in range(leg, len(legs)):
            before, own = legs[k - 1], legs[k]
            fixed = own.step.primitive is not None and not own.step.relative
            if _is_shifted(own, before):
                shift = before.positions[-1] - own.positions[0]
                legs[k] = replace(own, positions=own.positions + shift)
                continue
            legs[k] = _leg(
                replace(own.step, goal=own.positions[-1]) if fixed else own.step,
                before.positions[-1],
                before.velocities[-1],
                before.accelerations[-1],
                own.velocities[-1],
                None if before.rotations is None else before.rotations[-1],
                self.time_step,
                self.blend,
            )
            if fixed:
                break
        return replace(self, legs=tuple(legs))


def _is_shifted(own: Leg, before: Leg) -> bool:
    """Tells whether a leg, given the one before it, is the same motion from another start."""
    step = own.step
    follows = step.goal is None and (step.primitive is None or step.relative) and not step.via
    pairs = [
        (own.velocities[0], before.velocities[-1]),
        (own.accelerations[0], before.accelerations[-1]),
    ]
    if own.rotations is not None and before.rotations is not None:
        pairs.append((own.rotations[0], before.rotations[-1]))
    return follows and all(float(np.abs(a - b).max()) < 1e-9 for a, b in pairs)


def plan_chain(
    steps: Sequence[Step],
    *,
    start: npt.ArrayLike | None = None,
    start_velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    start_rotation: npt.ArrayLike | None = None,
    time_step: float = 0.01,
    blend: float = BLEND,
) -> Chain:
    """Plans a sequence of movements.

    Args:
        steps: The movements, in order.
        start: (3,) initial position of the hand [m]; the first demonstration's start if left out.
        start_velocity: (3,) [m/s].
        start_rotation: (4,) unit quaternion; the first demonstration's if left out.
        time_step: Between samples [s].
        blend: See `BLEND` [s].

    Raises:
        InputError: There is no movement, or a value is not finite or of the wrong shape.
    """
    if not steps:
        raise InputError("a sequence needs at least one movement")
    check_seconds(time_step=time_step, blend=blend)
    first = next((s.primitive for s in steps if s.primitive is not None), None)
    if first is None:
        raise InputError("a sequence of nothing but waiting: give it a movement")
    begin = vector(start, first.start, 3, "start")
    position, velocity = begin, vector(start_velocity, np.zeros(3), 3, "start_velocity")
    ends = _step_ends(steps, position)
    passing = _passing_velocities(steps, [position, *ends])
    acceleration = np.zeros(3)
    rotation = None
    if first.orientation is not None:
        rotation = vector(start_rotation, first.orientation.start, 4, "start_rotation")
        rotation = so3.normalize(rotation)
    legs: list[Leg] = []
    for step, passed in zip(steps, passing, strict=True):
        leg = _leg(step, position, velocity, acceleration, passed, rotation, time_step, blend)
        legs.append(leg)
        position, velocity = leg.positions[-1], leg.velocities[-1]
        acceleration = leg.accelerations[-1]
        rotation = None if leg.rotations is None else leg.rotations[-1]
    return Chain(tuple(legs), time_step, blend)


def _step_ends(steps: Sequence[Step], start: Array) -> list[Array]:
    """Returns where each step ends, (3,)."""
    places, here = [], start
    for number, step in enumerate(steps, start=1):
        here = _goal(step, here, number)
        places.append(here)
    return places


def _goal(step: Step, start: Array, number: int = 1) -> Array:
    if step.primitive is None:
        if step.duration is None or not step.duration > 0.0:
            raise InputError(f"movement {number}: say how long it waits, above 0 s")
        return start
    shown = step.primitive.goal
    if step.relative:
        shown = start + step.primitive.goal - step.primitive.start
    return vector(step.goal, shown, 3, f"goal of movement {number}")


def _duration(step: Step) -> float:
    tau = step.duration
    if tau is None:
        assert step.primitive is not None
        tau = step.primitive.duration
    if not (np.isfinite(tau) and 0.0 < tau < _LONGEST):
        raise InputError(f"duration: {tau} s; a movement lasts above 0 and below {_LONGEST:g} s")
    return float(tau)


def _passing_velocities(steps: Sequence[Step], places: list[Array]) -> list[Array]:
    """Returns the velocity (3,) with which each step ends."""
    means = [
        (b - a) / _duration(step) for step, a, b in zip(steps, places, places[1:], strict=False)
    ]
    passing = []
    for k, step in enumerate(steps):
        last = k + 1 == len(steps)
        waits = step.primitive is None or (not last and steps[k + 1].primitive is None)
        if step.stop or last or waits:
            passing.append(np.zeros(3))
            continue
        a, b = means[k], means[k + 1]
        same = a * b > 0.0
        total = np.where(same, a + b, 1.0)
        passing.append(np.where(same, 2.0 * a * b / total, 0.0))
    return passing


def _leg(
    step: Step,
    start: Array,
    start_velocity: Array,
    start_acceleration: Array,
    end_velocity: Array,
    start_rotation: Array | None,
    time_step: float,
    blend: float,
) -> Leg:
    tau = _duration(step)
    goal = _goal(step, start)
    # Samples divide the duration evenly, so that a leg ends on one.
    count = max(2, round(tau / time_step))
    times = np.linspace(0.0, tau, count + 1)
    rotations: Array | None = None
    rates: Array | None = None
    if step.primitive is None:
        p = np.tile(start, (count + 1, 1))
        v, a = np.zeros_like(p), np.zeros_like(p)
        if start_rotation is not None:
            rotations, rates = np.tile(start_rotation, (count + 1, 1)), np.zeros_like(p)
    else:
        path = step.primitive.rollout(
            tau / count,
            start=start,
            goal=goal,
            duration=tau,
            start_rotation=start_rotation if step.primitive.orientation is not None else None,
            goal_rotation=step.goal_rotation if step.primitive.orientation is not None else None,
        )
        p, v, a = (x[: count + 1] for x in (path.positions, path.velocities, path.accelerations))
        if path.rotations is not None and path.angular_velocities is not None:
            rotations = path.rotations[: count + 1]
            rates = path.angular_velocities[: count + 1]
    width = min(blend, 0.5 * tau)
    begin = np.stack((start - p[0], start_velocity - v[0], start_acceleration - a[0]))
    end = np.stack((goal - p[-1], end_velocity - v[-1], -a[-1]))
    most = max(float(np.sqrt(np.max(np.sum(a * a, axis=1)))), LEAST_ACCELERATION)
    first, last = (blend_width(wanted, tau, width, most) for wanted in (begin, end))
    ahead = from_end(times / first, begin * powers(first))
    back = from_end((tau - times) / last, end * powers(-last))
    p = p + ahead[0] + back[0]
    v = v + ahead[1] / first - back[1] / last
    a = a + ahead[2] / first**2 + back[2] / last**2
    if step.via:
        p, v, a = _through_via_points(step, times, p, v, a)
    if rotations is not None and rates is not None:
        rotations = _blended_rotations(step, rotations, rates, start_rotation, times, width)
    return Leg(times, p, v, a, rotations, step)


def _through_via_points(
    step: Step, times: Array, p: Array, v: Array, a: Array
) -> tuple[Array, Array, Array]:
    """Adds the quintic spline that passes the via points and vanishes at both ends."""
    tau = float(times[-1])
    shares = [float(share) for share, _ in step.via]
    if not all(0.0 < share < 1.0 for share in shares) or sorted(set(shares)) != shares:
        raise InputError("via points: give shares of the duration between 0 and 1, in order")
    points = [vector(point, np.zeros(3), 3, "via point") for _, point in step.via]
    at = np.array([share * tau for share in shares])
    own = np.column_stack([np.interp(at, times, column) for column in p.T])
    zero = np.zeros((1, 3))
    rest = [(1, np.zeros(3)), (2, np.zeros(3))]
    spline = make_interp_spline(
        np.concatenate(([0.0], at, [tau])),
        np.concatenate((zero, np.array(points) - own, zero)),
        k=5,
        bc_type=(rest, rest),  # type: ignore[arg-type]  # Pairs are right; the stubs are not.
    )
    return (
        p + spline(times),
        v + spline.derivative(1)(times),
        a + spline.derivative(2)(times),
    )


def _blended_rotations(
    step: Step,
    rotations: Array,
    rates: Array,
    start_rotation: Array | None,
    times: Array,
    width: float,
) -> Array:
    """Returns the orientations blended to rest at both ends, the given start and the goal."""
    tau = float(times[-1])
    begin = rotations[0] if start_rotation is None else start_rotation
    end = rotations[-1]
    if step.primitive is not None and step.primitive.orientation is not None:
        wanted = step.primitive.orientation.goal
        end = so3.normalize(vector(step.goal_rotation, wanted, 4, "goal_rotation"))
    first = so3.log_map(so3.multiply(begin, so3.conjugate(rotations[0])))
    last = so3.log_map(so3.multiply(end, so3.conjugate(rotations[-1])))
    zero = np.zeros(3)
    h = from_end(times / width, np.stack((first, -rates[0], zero)) * powers(width))[0]
    h = h + from_end((tau - times) / width, np.stack((last, -rates[-1], zero)) * powers(-width))[0]
    return so3.make_continuous(so3.multiply(so3.exp_map(h), rotations))


def _retargeted(
    own: Leg, begun: float, goal: Array, step: Step, blend: float, time_step: float
) -> Leg:
    """Returns a leg blended to another goal from a time on, by a quintic.

    With less than `blend` left, the leg takes that much longer.
    """
    times, tau = own.times, own.duration
    k = int(np.searchsorted(times, begun + 1e-9))
    k = min(k, len(times) - 1)
    left = tau - float(times[k])
    shift = goal - own.positions[-1]
    if left < blend:
        # From the current state to the new goal, in `blend` seconds.
        count = max(2, round(blend / time_step))
        u = np.linspace(0.0, 1.0, count + 1)
        state = np.stack((own.positions[k] - goal, own.velocities[k], own.accelerations[k]))
        last = np.stack((np.zeros(3), own.velocities[-1], np.zeros(3)))
        part = from_end(u, state * powers(blend))
        back = from_end(1.0 - u, last * powers(-blend))
        p = part[0] + back[0] + goal
        v = (part[1] - back[1]) / blend
        a = (part[2] + back[2]) / blend**2
        rest = slice(1, None)
        rotations = own.rotations
        if rotations is not None:
            after = rotations[np.minimum(k + np.arange(1, count + 1), len(times) - 1)]
            rotations = np.concatenate((rotations[: k + 1], after))
        return Leg(
            np.concatenate((times[: k + 1], times[k] + blend * u[rest])),
            np.concatenate((own.positions[: k + 1], p[rest])),
            np.concatenate((own.velocities[: k + 1], v[rest])),
            np.concatenate((own.accelerations[: k + 1], a[rest])),
            rotations,
            step,
        )
    u = np.clip((times - times[k]) / left, 0.0, 1.0)[:, None]
    bend = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    slope = 30.0 * u**2 * (1.0 - u) ** 2 / left
    curve = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / left**2
    return replace(
        own,
        positions=own.positions + bend * shift,
        velocities=own.velocities + slope * shift,
        accelerations=own.accelerations + curve * shift,
        step=step,
    )
