"""A recorded motion of the hand, and its preparation for learning."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_smoothing_spline

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.conditioning import (
    careful,
    evenly_chosen,
    fill_times,
    hermite,
    interpolant,
    strays,
)
from pepper_drake.short_repr import figure_view, short_repr, short_signature

Array = npt.NDArray[np.float64]

TORSO_HEIGHT = 0.82
"""Height [m] of Pepper's torso frame over its floor frame (`base_footprint`) when it stands."""

RECORDED = "as recorded"

LARGEST = 1e12
"""Larger numbers are no motion; squares up to this do not overflow."""


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A motion of the hand: N samples, positions in one frame (normally T, the torso).

    Make one with `load` or `from_positions`; the constructor checks nothing.

    Attributes:
        times: (N,) [s], increasing, not necessarily uniform.
        positions: (N, 3) [m].
        velocities: (N, 3) [m/s].
        accelerations: (N, 3) [m/s²].
        rotations: (N, 4) unit quaternions w, x, y, z of the hand, neighbours on the same half
            sphere; None where the orientation was not recorded.
        angles: (N, 9) the report's three angles (roll, pitch, yaw, without jumps), their rates
            and their accelerations [rad, s], where the orientation was recorded that way.
        joints: (N, J) joint positions [rad], or None.
        joint_names: J names.
        name: Its origin, for messages and figures.
        derivation: How velocities and accelerations were obtained.
        notes: How the file was interpreted and what was changed, for messages.
    """

    __repr__ = short_repr
    __signature__ = short_signature
    _repr_html_ = figure_view

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    rotations: Array | None = None
    angles: Array | None = None
    joints: Array | None = None
    joint_names: tuple[str, ...] = ()
    name: str = "demonstration"
    derivation: str = RECORDED
    notes: tuple[str, ...] = ()

    @classmethod
    def load(cls, path: str | Path, **said: Any) -> Demonstration:
        """Reads a demonstration, or another tool's recording; see `demonstration_files`.

        Args:
            path: A folder or a file.
            said: What the file does not say, as in `importers.ImportOptions`: unit="mm",
                angle="deg", time="ms", quaternion="xyzw", frame="base_footprint", arm="left".

        Raises:
            InputError: It is wrong or cannot be read; with file, line and what to do.
        """
        from pepper_drake.learning.demonstrations.demonstration_files import read_demonstration
        from pepper_drake.learning.demonstrations.importers.options import ImportOptions

        return read_demonstration(Path(path), ImportOptions.of(**said))

    def save(self, path: str | Path) -> None:
        """Writes a folder, or a text file when `path` ends in .txt; see `demonstration_files`.

        Raises:
            InputError: The path cannot be written to, or the format cannot hold the demonstration.
        """
        from pepper_drake.learning.demonstrations.demonstration_files import write_demonstration

        write_demonstration(self, Path(path))

    @classmethod
    def from_positions(
        cls,
        times: npt.ArrayLike,
        positions: npt.ArrayLike,
        velocities: npt.ArrayLike | None = None,
        accelerations: npt.ArrayLike | None = None,
        rotations: npt.ArrayLike | None = None,
        joints: npt.ArrayLike | None = None,
        joint_names: tuple[str, ...] = (),
        name: str = "demonstration",
    ) -> Self:
        """Makes a demonstration from arrays and derives missing velocities and accelerations.

        Missing velocities and accelerations are the derivatives of the quintic spline through the
        positions, or of the piecewise cubic where samples are so few that the spline strays (see
        `conditioning.interpolant`); missing accelerations alone are derived from the velocities
        likewise.

        Raises:
            InputError: Shapes disagree, times do not increase, a value is not finite, or a
                quaternion has not norm 1.
        """
        t = _numbers(times, (None,), name, "times")
        if len(t) < 4:
            raise InputError(f"{name}: times {t.shape} must be (N,), N >= 4")
        p = _numbers(positions, (len(t), 3), name, "positions")
        if np.any(np.diff(t) <= 0.0):
            raise InputError(f"{name}: times must increase from sample to sample")
        derivation = RECORDED
        if velocities is None and accelerations is not None:
            raise InputError(f"{name}: accelerations without velocities; give both, or none")
        if velocities is None:
            v, a, curve = interpolant(t, p)
            derivation = f"derivatives of the {curve} through the positions"
        else:
            v = _numbers(velocities, p.shape, name, "velocities")
            if accelerations is None:
                a, _, curve = interpolant(t, v)
                derivation = f"accelerations: derivative of the {curve} through the velocities"
            else:
                a = _numbers(accelerations, p.shape, name, "accelerations")
        q = None
        if rotations is not None:
            q = _numbers(rotations, (len(t), 4), name, "rotations")
            norms = np.linalg.norm(q, axis=1)
            k = int(np.argmax(np.abs(norms - 1.0)))
            if abs(norms[k] - 1.0) > 1e-2:
                raise InputError(
                    f"{name}: rotations: sample {k + 1} has norm {norms[k]:.4g}; give unit"
                    " quaternions w, x, y, z"
                )
            # Unit quaternions, up to rounding, stay unchanged.
            q = so3.make_continuous(q if abs(norms[k] - 1.0) < 1e-6 else so3.normalize(q))
        j = None
        joint_names = tuple(joint_names)
        named = all(isinstance(joint, str) for joint in joint_names)
        if not named or len(set(joint_names)) < len(joint_names):
            raise InputError(f"{name}: joint_names {joint_names!r} must be different words")
        if joints is not None:
            j = _numbers(joints, (len(t), len(joint_names)), name, "joints")
        return cls(
            times=t,
            positions=p,
            velocities=v,
            accelerations=a,
            rotations=q,
            joints=j,
            joint_names=joint_names,
            name=name,
            derivation=derivation,
        )

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def path_length(self) -> float:
        """Length of the hand's path [m]."""
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())

    def translated(self, offset: npt.ArrayLike) -> Self:
        """Returns the motion with all positions shifted by `offset` (3,) [m].

        A motion recorded in the floor frame becomes one in the torso frame with
        `demo.translated((0, 0, -TORSO_HEIGHT))` when Pepper stands upright.
        """
        return replace(self, positions=self.positions + np.asarray(offset, dtype=float))

    def mirrored(self) -> Self:
        """Returns the motion for the other arm, mirrored at the robot's x-z plane (y to -y).

        Joints whose axis is not the pitch axis change sign, and left and right change names.
        """
        flip = np.array([1.0, -1.0, 1.0])
        joints = self.joints
        if joints is not None:
            signs = [-1.0 if "Roll" in name or "Yaw" in name else 1.0 for name in self.joint_names]
            joints = joints * np.array(signs)
        return replace(
            self,
            positions=self.positions * flip,
            velocities=self.velocities * flip,
            accelerations=self.accelerations * flip,
            rotations=None
            if self.rotations is None
            else self.rotations * np.array([1.0, -1.0, 1.0, -1.0]),
            angles=None if self.angles is None else self.angles * np.tile([-1.0, 1.0, -1.0], 3),
            joints=joints,
            joint_names=tuple(_other_side(name) for name in self.joint_names),
        )

    def trimmed(self, speed: float = 0.01, turn_rate: float = 0.05) -> Self:
        """Returns the motion without the rest at both ends.

        The hand rests where it is slower than `speed` [m/s] and, if its orientation is known,
        turns slower than `turn_rate` [rad/s]. One sample of rest is kept at each end. Times keep
        their origin.
        """
        moving = np.linalg.norm(self.velocities, axis=1) > speed
        if self.rotations is not None:
            turns = so3.log_map(
                so3.multiply(self.rotations[1:], so3.conjugate(self.rotations[:-1]))
            )
            rates = np.linalg.norm(turns, axis=1) / np.diff(self.times)
            moving[1:] |= rates > turn_rate
            moving[:-1] |= rates > turn_rate
        samples = np.flatnonzero(moving)
        if len(samples) == 0:
            raise InputError(f"{self.name}: the hand never moves faster than {speed} m/s")
        first = max(0, samples[0] - 1)
        last = min(len(self.times), samples[-1] + 2)
        if last - first < 4:
            raise InputError(f"{self.name}: only {last - first} samples of motion remain; need 4")
        return self.selected(slice(first, last))

    def smoothed(self, cutoff: float = 6.0) -> Self:
        """Returns the motion through a cubic smoothing spline, a zero-phase low-pass filter.

        Velocities and accelerations become the spline's derivatives. Works on any time stamps and
        has no transients at the ends (Reinsch 1967; its frequency response is
        1 / (1 + (f / cutoff)⁴)).

        Args:
            cutoff: Frequency [Hz] of half the amplitude.
        """
        if len(self.times) < 5:
            raise InputError(f"{self.name}: smoothing needs at least 5 samples")
        step = self.duration / (len(self.times) - 1)
        weight = 1.0 / (step * (2.0 * np.pi * cutoff) ** 4)

        def smooth(values: Array) -> tuple[Array, Array, Array]:
            splines = [make_smoothing_spline(self.times, y, lam=weight) for y in values.T]
            return (
                np.column_stack([s(self.times) for s in splines]),
                np.column_stack([s.derivative(1)(self.times) for s in splines]),
                np.column_stack([s.derivative(2)(self.times) for s in splines]),
            )

        positions, velocities, accelerations = smooth(self.positions)
        rotations, angles = self.rotations, None
        if self.angles is not None:
            angles = np.hstack(smooth(self.angles[:, :3]))
            rotations = so3.make_continuous(so3.from_angles(angles[:, :3]))
        elif rotations is not None:
            rotations = so3.normalize(smooth(rotations)[0])
        return replace(
            self,
            positions=positions,
            velocities=velocities,
            accelerations=accelerations,
            rotations=rotations,
            angles=angles,
            joints=None if self.joints is None else smooth(self.joints)[0],
            derivation=f"derivatives of the cubic smoothing spline, cut-off {cutoff:g} Hz",
        )

    def filled(self, longest: float) -> Self:
        """Returns the motion with samples inserted between those further apart than `longest` [s].

        They lie on the cubic Hermite spline through positions and velocities, or, where that
        strays, on the piecewise cubic without overshoot, with which orientations and joints are
        always interpolated.
        """
        times = fill_times(self.times, longest)
        if len(times) == len(self.times):
            return self
        curve = hermite(self.times, self.positions, self.velocities)
        if strays(self.times, self.positions, curve):
            curve = careful(self.times, self.positions)

        def between(values: Array | None) -> Array | None:
            return None if values is None else careful(self.times, values)(times)

        rotations, angles = between(self.rotations), between(self.angles)
        if rotations is not None:
            rotations = so3.normalize(rotations)
        return replace(
            self,
            times=times,
            positions=curve(times),
            velocities=curve.derivative(1)(times),
            accelerations=curve.derivative(2)(times),
            rotations=rotations,
            angles=angles,
            joints=between(self.joints),
        )

    def thinned(self, most: int) -> Self:
        """Returns the motion with at most `most` samples, evenly spaced, ends included."""
        if len(self.times) <= most:
            return self
        return self.selected(evenly_chosen(len(self.times), most))

    def selected(self, samples: slice | npt.NDArray[np.int64]) -> Self:
        """Returns some of the samples."""

        def part(values: Array | None) -> Array | None:
            return None if values is None else values[samples]

        return replace(
            self,
            times=self.times[samples],
            positions=self.positions[samples],
            velocities=self.velocities[samples],
            accelerations=self.accelerations[samples],
            rotations=part(self.rotations),
            angles=part(self.angles),
            joints=part(self.joints),
        )


def _numbers(values: npt.ArrayLike, shape: tuple[int | None, ...], name: str, label: str) -> Array:
    """Returns an array of finite numbers of a shape; None in it is any size."""
    try:
        given = np.asanyarray(values)
        real = not np.ma.is_masked(given) and not np.iscomplexobj(given)
        array = np.array(values, dtype=float) if real else np.empty(0)
    except (TypeError, ValueError):
        raise InputError(f"{name}: {label} are not an array of numbers") from None
    if not real:
        raise InputError(f"{name}: {label} hold masked or complex values; give numbers alone")
    fits = len(array.shape) == len(shape) and all(
        size in (None, own) for own, size in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join(["N", *map(str, shape[1:])]) + ("," if len(shape) == 1 else "")
        count = "" if shape[0] is None else f", N = {shape[0]}"
        raise InputError(f"{name}: {label} have shape {array.shape}; give ({wanted}){count}")
    if not np.isfinite(array).all():
        k = int(np.argwhere(~np.isfinite(array))[0][0])
        raise InputError(
            f"{name}: {label} hold a value that is not finite, in sample {k + 1}; remove it"
        )
    if np.abs(array).max(initial=0.0) > LARGEST:
        raise InputError(f"{name}: {label} hold a value above {LARGEST:g}; correct it")
    return array


def _other_side(name: str) -> str:
    if name.startswith(("L", "R")) and name[1:2].isupper():
        return ("R" if name[0] == "L" else "L") + name[1:]
    return name
