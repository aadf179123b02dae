"""Nominal joint positions along a motion, as a function of relative time."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.approximators.gaussian_forcing import GaussianBasis, even_basis
from pepper_drake.learning.cached_times import MOST_CACHED, TimesKey
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.least_squares import ridge_solver
from pepper_drake.learning.phase import PHASE_RATIO, phase_at
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

_OVERLAP = 0.7
_LAST_PHASE = math.exp(-PHASE_RATIO)


@dataclass(frozen=True, eq=False)
class PostureProfile:
    """Joints as local lines, weighted by basis functions evenly spaced in time.

    Attributes:
        names: J joint names.
        weights: (2 B, J): B constants, then B slopes.
    """

    __repr__ = short_repr

    names: tuple[str, ...]
    weights: Array

    def at(self, relative_times: npt.ArrayLike) -> Array:
        """Returns joints (N, J) [rad] at relative times (N,); after 1 they are held."""
        basis, phases = _basis(np.asarray(relative_times), len(self.weights) // 2)
        return basis.combine(phases, self.weights) / phases[:, None]

    def basis(self, relative_times: npt.ArrayLike) -> Array:
        """Returns the features (N, 2 B) of the weights at relative times (N,)."""
        return _features(np.asarray(relative_times), len(self.weights) // 2)

    def to_data(self) -> dict[str, Any]:
        """Returns the profile as plain data."""
        return {"names": list(self.names), "weights": self.weights.tolist()}

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Self:
        """Makes the profile from what `to_data` returned."""
        return cls(tuple(data["names"]), np.array(data["weights"], dtype=float))


def learn_posture(
    demonstrations: list[Demonstration], times: list[Array], num_basis: int
) -> PostureProfile | None:
    """Learns the joints of demonstrations at relative times; None if a demonstration has none.

    Raises:
        InputError: Demonstrations have different joints.
    """
    joints = [demo.joints for demo in demonstrations if demo.joints is not None]
    if len(joints) < len(demonstrations):
        return None
    names = demonstrations[0].joint_names
    for demo in demonstrations:
        if demo.joint_names != names:
            raise InputError(
                f"{demo.name}: its joints differ from those of {demonstrations[0].name}"
            )
    key = TimesKey(np.concatenate(times))
    solver = (_cached_solver if len(key.times) <= MOST_CACHED else _solver)(key, num_basis)
    return PostureProfile(names, solver @ np.concatenate(joints))


def _solver(times: TimesKey, num_basis: int) -> Array:
    """Returns the matrix from joints at relative times to weights."""
    solver = ridge_solver(_features(times.times, num_basis))
    solver.setflags(write=False)
    return solver


_cached_solver = lru_cache(maxsize=16)(_solver)
"""The same; most paths have even times, and so the same matrix."""


def _features(relative_times: Array, num_basis: int) -> Array:
    basis, phases = _basis(relative_times, num_basis)
    return basis.features(phases) / phases[:, None]


def _basis(relative_times: Array, num_basis: int) -> tuple[GaussianBasis, Array]:
    """The basis, evenly spaced in time for any alpha_x, and the phases (N,), its gates."""
    basis = even_basis(num_basis, _OVERLAP, PHASE_RATIO, slopes=True)
    return basis, np.maximum(phase_at(relative_times, PHASE_RATIO), _LAST_PHASE)
