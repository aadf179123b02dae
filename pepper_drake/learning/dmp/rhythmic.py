"""Periodic motions, such as waving and stirring: a primitive with a cyclic phase.

Ijspeert, Nakanishi, Hoffmann, Pastor, Schaal, "Dynamical Movement Primitives", Neural Computation
25 (2013), section 2.1.4, DOI 10.1162/NECO_a_00393:

    tau phi' = 1, tau z' = alpha_z (beta_z (g - y) - z) + f, tau y' = z, tau = period / (2 pi),
    f(phi) = r sum_i psi_i w_i / sum_i psi_i, psi_i = exp(h (cos(phi - c_i) - 1)).

The spring pulls the hand into a limit cycle around g from any state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import yaml
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar

from pepper_drake.errors import InputError
from pepper_drake.files import write_atomically
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.num_basis import check_num_basis
from pepper_drake.learning.dmp.primitive import Path3D
from pepper_drake.learning.dmp.rollout_arguments import check_seconds
from pepper_drake.learning.least_squares import ridge_solver
from pepper_drake.learning.phase import ALPHA_Z
from pepper_drake.learning.spring import NODES, acceleration, advance, make_step
from pepper_drake.short_repr import short_repr
from pepper_drake.yaml_files import read_yaml

Array = npt.NDArray[np.float64]

_FILE_LIMIT = 2**20

GRID = 512
"""Number of phases at which the response to a basis function is computed."""


@dataclass(frozen=True, eq=False)
class RhythmicPrimitive:
    """A periodic motion of the hand.

    Attributes:
        weights: w, shape (K, 3); the centres c_i are evenly spaced on the circle.
        concentration: h; the larger, the narrower a basis function.
        centre: g (3,) [m], around which the motion runs.
        period: Of the demonstration [s].
        alpha_z: Constant of the spring; its damper is critical.
        rotation_weights: (K, 3) of the orientation's forcing term; None if not demonstrated.
        rotation_centre: (4,) unit quaternion about which the hand's orientation oscillates.
    """

    weights: Array
    concentration: float
    centre: Array
    period: float
    alpha_z: float = ALPHA_Z
    rotation_weights: Array | None = None
    rotation_centre: Array | None = None

    __repr__ = short_repr

    def forcing(self, phases: npt.ArrayLike) -> Array:
        """Returns f (N, 3) at phases (N,) [rad], for an amplitude of one."""
        features = circular_features(phases, len(self.weights), self.concentration)
        return np.asarray(features @ self.weights)

    def limit_cycle(self, phases: npt.ArrayLike) -> tuple[Array, Array]:
        """Returns positions [m] and velocities [m/s] (N, 3) on the limit cycle at phases (N,)."""
        responses = steady_responses(phases, len(self.weights), self.concentration, self.alpha_z)
        tau = self.period / (2 * np.pi)
        return self.centre + responses[0] @ self.weights, responses[1] @ self.weights / tau

    def orientation(
        self, phases: npt.ArrayLike, amplitude: float = 1.0, period: float | None = None
    ) -> tuple[Array, Array] | None:
        """Returns the orientation on its limit cycle, None if not demonstrated.

        Its coordinates are those of the log map about `rotation_centre`: a second
        transformation system with the same phase (Ude et al. 2014, DOI
        10.1109/ICRA.2014.6907291).

        Args:
            phases: (N,) [rad].
            amplitude: Relative to the demonstration.
            period: [s]; the demonstration's if left out.

        Returns:
            Unit quaternions (N, 4) and angular velocities (N, 3) [rad/s] in the motion's frame.
        """
        if self.rotation_weights is None or self.rotation_centre is None:
            return None
        count = len(self.rotation_weights)
        responses = steady_responses(phases, count, self.concentration, self.alpha_z)
        turns = amplitude * (responses[0] @ self.rotation_weights)
        rates = amplitude * (responses[1] @ self.rotation_weights)
        rates = rates / (float(period or self.period) / (2 * np.pi))
        centre = np.broadcast_to(self.rotation_centre, (len(turns), 4))
        rotations = so3.make_continuous(so3.multiply(so3.exp_map(turns), centre))
        return rotations, so3.angular_velocity(turns, rates)

    def advance(
        self,
        state: Array,
        phase: float,
        time_step: float,
        *,
        period: float | None = None,
        amplitude: float = 1.0,
        centre: Array | None = None,
    ) -> tuple[Array, float]:
        """Returns state and phase one step later, exactly but for the quadrature of `spring`.

        Period, amplitude and centre may change between steps; position and velocity do not jump.

        Args:
            state: (2, 3) position [m] and velocity [m/s].
            phase: [rad].
            time_step: [s].
            period: [s]; the demonstration's if left out.
            amplitude: r, relative to the demonstration.
            centre: (3,) [m]; the demonstration's if left out.
        """
        tau = float(period or self.period) / (2 * np.pi)
        middle = self.centre if centre is None else centre
        inputs = amplitude * self.forcing(phase + time_step / tau * NODES) / tau**2
        goal = np.stack((middle, np.zeros(3)))
        moved = advance(state, goal, inputs, make_step(tau, time_step, self.alpha_z), time_step)
        return moved, phase + time_step / tau

    def rollout(
        self,
        duration: float,
        time_step: float = 0.01,
        *,
        start: npt.ArrayLike | None = None,
        start_velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
        start_phase: float = 0.0,
        period: float | None = None,
        amplitude: float = 1.0,
        centre: npt.ArrayLike | None = None,
    ) -> Path3D:
        """Performs the motion.

        Args:
            duration: [s].
            time_step: Between samples [s].
            start: (3,) initial position [m]; left out, position and velocity of the limit cycle.
            start_velocity: (3,) [m/s], used with `start`.
            start_phase: [rad].
            period: [s]; the demonstration's if left out.
            amplitude: Relative to the demonstration.
            centre: (3,) [m]; the demonstration's if left out.

        Returns:
            The path; `phases` grow by 2 pi each period, `taus` are the period.

        Raises:
            InputError: Duration, period or time step is not positive.
        """
        turn = float(self.period if period is None else period)
        check_seconds(duration=duration, time_step=time_step, period=turn)
        middle = self.centre if centre is None else np.array(centre, dtype=float)
        if start is None:
            shape = replace(self, weights=amplitude * self.weights, centre=middle, period=turn)
            position, velocity = (value[0] for value in shape.limit_cycle([start_phase]))
        else:
            position = np.array(start, dtype=float)
            velocity = np.array(start_velocity, dtype=float)
        num_steps = max(1, round(duration / time_step))
        states = np.empty((num_steps + 1, 2, 3))
        states[0, 0], states[0, 1] = position, velocity
        phases = np.empty(num_steps + 1)
        phases[0] = start_phase
        for k in range(num_steps):
            states[k + 1], phases[k + 1] = self.advance(
                states[k],
                float(phases[k]),
                time_step,
                period=turn,
                amplitude=amplitude,
                centre=middle,
            )
        tau = turn / (2 * np.pi)
        pull = amplitude * self.forcing(phases)
        goal = np.stack((middle, np.zeros(3)))
        turned = self.orientation(phases, amplitude, turn)
        return Path3D(
            np.asarray(time_step * np.arange(num_steps + 1.0), dtype=float),
            states[:, 0],
            states[:, 1],
            np.asarray(acceleration(states, goal, pull, tau, self.alpha_z)),
            phases,
            np.full(num_steps + 1, turn),
            rotations=None if turned is None else turned[0],
            angular_velocities=None if turned is None else turned[1],
        )

    def save(self, path: str | Path) -> None:
        """Writes the primitive as a readable YAML file, exact to the last bit."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        data = {
            name: np.asarray(value).tolist() for name, value in values.items() if value is not None
        }
        header = "# A rhythmic primitive of pepper_drake. Units: s, m, rad.\n"
        write_atomically(Path(path), header + yaml.safe_dump(data, sort_keys=False))

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Reads what `save` wrote.

        Raises:
            InputError: The file is not a rhythmic primitive.
        """
        data = read_yaml(Path(path), _FILE_LIMIT)
        try:
            primitive = cls(
                np.array(data["weights"], dtype=float).reshape(-1, 3),
                float(data["concentration"]),
                np.array(data["centre"], dtype=float).reshape(3),
                float(data["period"]),
                float(data["alpha_z"]),
                _optional(data, "rotation_weights", (-1, 3)),
                _optional(data, "rotation_centre", (4,)),
            )
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{path}: not a rhythmic primitive ({error!r})") from None
        limits = {"concentration": (0.0, 1e6), "period": (0.01, 600.0), "alpha_z": (0.1, 1e3)}
        for name, (lower, upper) in limits.items():
            if not lower <= getattr(primitive, name) <= upper:
                raise InputError(f"{path}: {name} must be {lower:g} to {upper:g}")
        size = len(primitive.weights)
        numbers = np.concatenate((primitive.weights.ravel(), primitive.centre))
        if not 1 <= size <= GRID or not np.all(np.abs(numbers) <= 1e6):
            raise InputError(f"{path}: weights must be 1 to {GRID} rows of three finite numbers")
        turned, middle = primitive.rotation_weights, primitive.rotation_centre
        if turned is None and middle is None:
            return primitive
        if turned is None or turned.shape != (size, 3) or not np.all(np.abs(turned) <= 1e6):
            raise InputError(f"{path}: rotation_weights must be {size} rows of finite numbers")
        if middle is None or not abs(np.linalg.norm(middle) - 1.0) <= 1e-3:
            raise InputError(f"{path}: rotation_centre must be a unit quaternion")
        return primitive


def _optional(data: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> Array | None:
    return None if name not in data else np.array(data[name], dtype=float).reshape(shape)


def circular_features(phases: npt.ArrayLike, num_basis: int, concentration: float) -> Array:
    """Returns psi_i / sum psi_i, shape (N, K), at phases (N,) [rad]."""
    centres = 2 * np.pi * np.arange(num_basis) / num_basis
    angles = np.asarray(phases, dtype=float)[:, None] - centres
    values = np.exp(concentration * (np.cos(angles) - 1))
    return np.asarray(values / values.sum(axis=1, keepdims=True))


def steady_responses(
    phases: npt.ArrayLike, num_basis: int, concentration: float, alpha_z: float
) -> Array:
    """Returns (2, N, K): the spring's steady-state response to each feature, for tau = 1.

    Position and its derivative by the phase at phases (N,). The spring's transfer function
    1 / ((j n)² + alpha_z j n + alpha_z² / 4) is applied to the features' Fourier series.
    """
    circle = 2 * np.pi * np.arange(GRID) / GRID
    series = np.fft.rfft(circular_features(circle, num_basis, concentration), axis=0)
    harmonic = 1j * np.arange(len(series))[:, None]
    answer = series / (harmonic**2 + alpha_z * harmonic + alpha_z**2 / 4)
    # Evaluated at the phases themselves: interpolation would lose the series' accuracy.
    size = np.where(np.arange(len(series)) % (GRID // 2) == 0, 1.0, 2.0)[:, None] / GRID
    waves = np.exp(np.multiply.outer(np.asarray(phases, dtype=float), harmonic[:, 0]))
    return np.stack(((waves @ (size * answer)).real, (waves @ (size * harmonic * answer)).real))


def fit_rhythmic(
    demonstration: Demonstration,
    *,
    period: float | None = None,
    num_basis: int = 25,
    alpha_z: float = ALPHA_Z,
) -> RhythmicPrimitive:
    """Learns a periodic motion by least squares on its positions.

    The limit cycle is linear in the weights; all samples are used, from all periods.

    Args:
        demonstration: At least one period of the motion; two or more to find the period.
        period: [s]; found by `find_period` if left out.
        num_basis: K, at least 3.
        alpha_z: Constant of the spring.

    Raises:
        InputError: Too few basis functions, or less than one period of motion.
    """
    check_num_basis(num_basis, least=3)
    turn = find_period(demonstration) if period is None else float(period)
    if not 0 < turn <= demonstration.duration * 1.02:
        raise InputError(
            f"period: {turn:g} s, but {demonstration.name} lasts {demonstration.duration:g} s; "
            "show at least one period"
        )
    phases = 2 * np.pi * (demonstration.times - demonstration.times[0]) / turn
    # psi is one half at the neighbouring centre.
    concentration = float(np.log(2) / (1 - np.cos(2 * np.pi / num_basis)))
    columns = steady_responses(phases, num_basis, concentration, alpha_z)[0]
    whole = phases <= 2 * np.pi * np.floor(phases[-1] / (2 * np.pi) + 1e-9)
    centre = demonstration.positions[whole].mean(axis=0)
    weights = ridge_solver(columns) @ (demonstration.positions - centre)
    turned, middle = None, None
    if demonstration.rotations is not None:
        middle = _mean_rotation(demonstration.rotations[whole])
        turns = so3.log_map(so3.multiply(demonstration.rotations, so3.conjugate(middle)))
        turned = ridge_solver(columns) @ turns
    return RhythmicPrimitive(weights, concentration, centre, turn, alpha_z, turned, middle)


def _mean_rotation(rotations: Array) -> Array:
    """Returns the mean (4,) of quaternions (N, 4) (Markley et al. 2007, DOI 10.2514/1.28949)."""
    _, vectors = np.linalg.eigh(rotations.T @ rotations)
    mean = vectors[:, -1]
    return np.asarray(mean if mean[0] >= 0.0 else -mean)


def find_period(demonstration: Demonstration) -> float:
    """Returns the period [s] of a motion of two periods or more.

    It is the first time shift T that maps the motion onto itself: a minimum of the mean of
    |y(t + T) - y(t)|², relative to the motion's variance.

    Raises:
        InputError: The motion does not repeat itself.
    """
    times = demonstration.times - demonstration.times[0]
    duration = demonstration.duration
    path = make_interp_spline(times, demonstration.positions)
    variance = float(np.sum(demonstration.positions.var(axis=0))) or 1.0

    def mismatch(shift: float) -> float:
        clock = np.linspace(0, duration - shift, 200)
        gap = path(clock + shift) - path(clock)
        return float(np.mean(np.sum(gap**2, axis=1))) / (2 * variance)

    step = duration / 400
    shifts = np.arange(1, 241) * step  # Up to 0.6 of the duration.
    values = np.array([mismatch(shift) for shift in shifts])
    dips = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:])) + 1
    deep = dips[values[dips] < 0.2 + values.min()]
    if len(deep) == 0 or values.min() > 0.5:
        raise InputError(
            f"{demonstration.name}: no period found in {duration:g} s; show two or more "
            "repetitions, or give the period"
        )
    around = shifts[deep[0]]
    best = minimize_scalar(mismatch, bounds=(around - step, around + step), method="bounded")
    return float(best.x)
