"""Two arms with one phase, whose relative pose is learned and held.

The motion is described in the cooperative task space (Chiacchio, Chiaverini, Siciliano, "Direct and
inverse kinematics for coordinated motion tasks of a two-manipulator system", 1996): the position of
the midpoint between the hands, the orientation of a frame A between them, and the left hand's pose
relative to the right one's, in A. Both are movement primitives with the same phase, so the relative
pose is as demonstrated for any goal.

Obstacles cause deviations d of the midpoint and e of the left hand relative to the right:

    d'' = -w² d - 2 w d' + (a_left + a_right) / 2,    e'' = -h² e - 2 h e' + a_left - a_right,

w = alpha_z / (2 tau), a the accelerations from obstacles. For one arm's transformation system the
second is the coupling term C_left = -C_right = -tau² / 2 ((h² - w²) e + 2 (h - w) e'), which holds
the relative position (Gams, Nemec, Ijspeert, Ude, "Coupling Movement Primitives", IEEE Transactions
on Robotics 30, 2014, use a learned force); in this form it is solved exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside, write_atomically
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.alignment import align
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.learning.dmp.primitive import DEFAULT_APPROXIMATOR, MovementPrimitive, Path3D
from pepper_drake.learning.dmp.rollout_arguments import coupling_and_field
from pepper_drake.learning.spring import NODES, advance, make_step
from pepper_drake.short_repr import short_repr
from pepper_drake.yaml_files import read_yaml

Array = npt.NDArray[np.float64]

_FILE_LIMIT = 2**16

SIDES = np.array([0.5, -0.5])[:, None]
"""Positions of left and right hand, in units of the vector from right to left."""

LONGEST = 10.0
"""A rollout that obstacles delay ends after this many durations."""


class HandPaths(NamedTuple):
    """A rollout of both hands, at the same times."""

    left: Path3D
    right: Path3D


@dataclass(frozen=True, eq=False)
class BimanualPrimitive:
    """A motion of both hands.

    Attributes:
        absolute: Of the midpoint between the hands, and of the frame A that turns with them.
        relative: Position of the left hand from the right in A, and orientation relative to the
            right hand.
        hold_rate: h [1/s], the stiffness of the relative position against disturbances.
    """

    absolute: MovementPrimitive
    relative: MovementPrimitive
    hold_rate: float = 60.0

    __repr__ = short_repr

    @classmethod
    def fit(
        cls,
        left: Demonstration,
        right: Demonstration,
        *,
        approximator: str = DEFAULT_APPROXIMATOR,
        num_basis: int | None = None,
        hold_rate: float = 60.0,
    ) -> Self:
        """Learns from a motion of both hands, recorded at the same time.

        Args:
            left: Of the left hand, in the same frame as `right`.
            right: Of the right hand.
            approximator: As in `MovementPrimitive.fit`.
            num_basis: As in `MovementPrimitive.fit`.
            hold_rate: See the class.

        Raises:
            InputError: The durations differ, or a number is out of range.
        """
        if abs(left.duration - right.duration) > 0.02 * left.duration:
            raise InputError(
                f"left lasts {left.duration:g} s and right {right.duration:g} s; "
                "record both hands at the same time"
            )
        if not hold_rate > 0:
            raise InputError(f"hold_rate: {hold_rate} is not positive")
        samples = max(len(left.times), len(right.times))
        absolute, relative = _to_pair(*align([left, right], num_samples=samples))
        return cls(
            MovementPrimitive.fit(absolute, approximator, num_basis, check=False),
            MovementPrimitive.fit(relative, approximator, num_basis, check=False),
            hold_rate,
        )

    def rollout(
        self,
        time_step: float = 0.01,
        *,
        goal: npt.ArrayLike | None = None,
        goal_rotation: npt.ArrayLike | None = None,
        start: npt.ArrayLike | None = None,
        duration: float | None = None,
        obstacles: npt.ArrayLike | PointCloudDistance | None = None,
        coupling: str | Coupling = "barrier",
        settle: float = 0.0,
    ) -> HandPaths:
        """Performs the motion.

        Args:
            time_step: Between samples [s].
            goal: (3,) of the midpoint between the hands [m]; as demonstrated if left out.
            goal_rotation: (4,) unit quaternion of A at the end; as demonstrated if left out.
            start: (3,) of the midpoint between the hands [m]; as demonstrated if left out.
            duration: tau [s]; as demonstrated if left out.
            obstacles: (P, 3) points [m], or a distance field of them.
            coupling: As in `MovementPrimitive.rollout`.
            settle: Time to continue after the motion's end, in tau.

        Returns:
            The paths of both hands. Near obstacles both slow down together.

        Raises:
            InputError: As in `MovementPrimitive.rollout`.
        """
        absolute = self.absolute.rollout(
            time_step, start, goal, duration, goal_rotation=goal_rotation, settle=settle
        )
        relative = self.relative.rollout(time_step, duration=duration, settle=settle)
        nominal = _to_hands(absolute, relative)
        chosen, field = coupling_and_field(coupling, obstacles)
        if chosen is None or field is None:
            return nominal
        return self._rollout_among(nominal, field, chosen, time_step)

    def save(self, folder: str | Path) -> None:
        """Writes `absolute.yaml`, `relative.yaml` and `pair.yaml` into a folder."""
        self.absolute.save(Path(folder) / "absolute.yaml")
        self.relative.save(Path(folder) / "relative.yaml")
        write_atomically(Path(folder) / "pair.yaml", f"hold_rate: {self.hold_rate!r}\n")

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """Reads what `save` wrote.

        Raises:
            InputError: A file is missing or broken.
        """
        path, absolute, relative = (
            path_inside(Path(folder), f"{name}.yaml") for name in ("pair", "absolute", "relative")
        )
        data = read_yaml(path, _FILE_LIMIT)
        hold_rate = data.get("hold_rate") if isinstance(data, dict) else None
        if isinstance(hold_rate, bool) or not isinstance(hold_rate, int | float):
            raise InputError(f"{path}: must hold `hold_rate: ` and a number")
        if not 0.1 <= hold_rate <= 1e4:
            raise InputError(f"{path}: hold_rate is {hold_rate:g}; it must be 0.1 to 10000")
        return cls(
            MovementPrimitive.load(absolute),
            MovementPrimitive.load(relative),
            float(hold_rate),
        )

    def _rollout_among(
        self, nominal: HandPaths, field: PointCloudDistance, coupling: Coupling, time_step: float
    ) -> HandPaths:
        """Integrates nominal motions among obstacles, with a common clock that these slow down."""
        times = nominal.left.times
        tau, end = float(nominal.left.taus[0]), float(times[-1])
        path = make_interp_spline(times, _both(nominal, "positions"), k=5, axis=1)
        rates, curvatures = path.derivative(1), path.derivative(2)
        goals = path(end)
        clearances = [coupling.clearance(field, goal) for goal in goals]
        w, h = self.absolute.translation.alpha_z / (2 * tau), self.hold_rate
        steps = [make_step(1.0, time_step, 2 * rate) for rate in (w, h)]
        deviations = np.zeros((2, 2, 3))  # Of the midpoint, and of left from right.
        rest = np.zeros((2, 3))
        clock, slowdown = 0.0, 0.0
        log = []
        for _ in range(int(LONGEST * len(times))):
            speed = 1 / (1 + slowdown)
            middle, apart = deviations
            states = np.stack((path(clock), rates(clock) * speed), axis=1)
            states = states + middle + SIDES[:, None] * apart
            pull = np.array([-w * w * middle[0] - 2 * w * middle[1], _spring(apart, h)])
            accelerations = curvatures(clock) * speed**2 + pull[0] + SIDES * pull[1]
            pushes = [
                coupling.push(field, state, before, goal, clearance, tau)
                for state, before, goal, clearance in zip(
                    states, accelerations, goals, clearances, strict=True
                )
            ]
            push = np.array([one.coupling for one in pushes]) / tau**2
            log.append((clock, states, accelerations + push, push, [p.distance for p in pushes]))
            if clock >= end * (1 - 1e-9):
                break
            slowdown = max(float(one.slowdown) for one in pushes)
            for part, drive, step in zip(
                deviations, (push.mean(axis=0), push[0] - push[1]), steps, strict=True
            ):
                held = np.tile(drive, (len(NODES), 1))
                part[:] = advance(part, rest, held, step, time_step)
            clock = min(end, clock + time_step / (1 + slowdown))
        return _logged(nominal, log, tau, time_step)


def _spring(deviation: Array, rate: float) -> Array:
    return -rate * rate * deviation[0] - 2 * rate * deviation[1]


def _both(paths: HandPaths, name: str) -> Array:
    """Returns an array of the left and the right hand, stacked in front."""
    return np.stack((getattr(paths.left, name), getattr(paths.right, name)))


def _to_pair(left: Demonstration, right: Demonstration) -> tuple[Demonstration, Demonstration]:
    """Returns the absolute and the relative motion of two motions at the same times."""
    gap = left.positions - right.positions
    if left.rotations is None or right.rotations is None:
        absolute = Demonstration(
            left.times,
            0.5 * (left.positions + right.positions),
            0.5 * (left.velocities + right.velocities),
            0.5 * (left.accelerations + right.accelerations),
            name="absolute",
        )
        relative = Demonstration(
            left.times,
            gap,
            left.velocities - right.velocities,
            left.accelerations - right.accelerations,
            name="relative",
        )
        return absolute, relative
    turn = so3.multiply(so3.conjugate(right.rotations), left.rotations)
    angle = so3.unwrapped_log(so3.make_continuous(turn))
    frame = so3.multiply(right.rotations, so3.exp_map(0.5 * angle))
    return (
        Demonstration.from_positions(
            left.times,
            0.5 * (left.positions + right.positions),
            0.5 * (left.velocities + right.velocities),
            0.5 * (left.accelerations + right.accelerations),
            rotations=frame,
            name="absolute",
        ),
        Demonstration.from_positions(
            left.times, _rotated(so3.conjugate(frame), gap), rotations=turn, name="relative"
        ),
    )


def _rotated(quaternions: Array, vectors: Array) -> Array:
    """Returns vectors (N, 3) rotated by unit quaternions (N, 4)."""
    pure = np.concatenate((np.zeros((len(vectors), 1)), vectors), axis=1)
    return so3.multiply(so3.multiply(quaternions, pure), so3.conjugate(quaternions))[:, 1:]


def _to_hands(absolute: Path3D, relative: Path3D) -> HandPaths:
    """Returns the paths of the hands: p = c +- R_A r / 2, R = R_A exp(+- phi / 2)."""
    times = absolute.times
    frame, turn = absolute.rotations, relative.rotations
    gap, gap_rate = relative.positions, relative.velocities
    spin = np.zeros_like(gap)
    if frame is not None and absolute.angular_velocities is not None:
        spin = absolute.angular_velocities
        gap = _rotated(frame, gap)
        gap_rate = _rotated(frame, gap_rate) + np.cross(spin, gap)
    hands = []
    for side in SIDES[:, 0]:
        velocities = absolute.velocities + side * gap_rate
        accelerations = absolute.accelerations + side * relative.accelerations
        rotations = angular = None
        if frame is not None and turn is not None and relative.angular_velocities is not None:
            accelerations = make_interp_spline(times, velocities, k=5).derivative(1)(times)
            angle = so3.unwrapped_log(so3.make_continuous(turn))
            angle_rate = so3.inverse_left_jacobian(angle) @ relative.angular_velocities[..., None]
            rotations = so3.multiply(frame, so3.exp_map(side * angle))
            own = (so3.left_jacobian(side * angle) @ (side * angle_rate))[..., 0]
            angular = spin + _rotated(frame, own)
        hands.append(
            Path3D(
                times,
                absolute.positions + side * gap,
                velocities,
                accelerations,
                absolute.phases,
                absolute.taus,
                rotations=rotations,
                angular_velocities=angular,
            )
        )
    return HandPaths(*hands)


def _logged(
    nominal: HandPaths,
    log: list[tuple[float, Array, Array, Array, list[Array]]],
    tau: float,
    time_step: float,
) -> HandPaths:
    """Returns the logged paths, with the nominal orientations at the logged clock."""
    clocks, states, accelerations, pushes, distances = (
        np.array(column) for column in zip(*log, strict=True)
    )
    times = np.asarray(time_step * np.arange(len(clocks)), dtype=float)
    speeds = np.gradient(clocks, time_step) if len(clocks) > 1 else np.ones(1)
    shown = nominal.left.times
    hands = []
    for hand, path in enumerate(nominal):
        rotations = angular = None
        if path.rotations is not None and path.angular_velocities is not None:
            rotations = so3.normalize(make_interp_spline(shown, path.rotations)(clocks))
            rates = make_interp_spline(shown, path.angular_velocities)(clocks)
            angular = rates * speeds[:, None]
        hands.append(
            Path3D(
                times,
                states[:, hand, 0],
                states[:, hand, 1],
                accelerations[:, hand],
                np.exp(np.interp(clocks, shown, np.log(path.phases))),
                np.full(len(clocks), tau),
                coupling=pushes[:, hand] * tau**2,
                distances=distances[:, hand],
                rotations=rotations,
                angular_velocities=angular,
            )
        )
    return HandPaths(*hands)
