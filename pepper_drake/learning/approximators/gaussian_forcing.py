"""A forcing term of Gaussian basis functions, the model of all approximators but GMR and LWPR.

f(x) = sum_i psi_i(x) (w_i + w'_i (x - c_i) / sigma_i) / sum_i psi_i(x) * x,
psi_i = exp(-(x - c_i)² / (2 sigma_i²)) (equation 2.5 of the report; w' only with slopes; without
the division for a radial basis function network, B.2).

Centres are evenly spaced in time. Each width is the overlap times the local distance between
centres, sigma_i = overlap alpha_x ds c_i, so that all basis functions have the same shape in time.
Past the end of the motion the basis functions are held and the gate x becomes x³, which falls
faster than the spring settles.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled
from pepper_drake.files import LARGEST_NUMBER
from pepper_drake.learning.phase import Array, hold
from pepper_drake.short_repr import short_repr

FARTHEST_CENTRE = 100.0
"""Largest distance of a basis function's centre from phase 0; the phase falls from 1 to 0."""

_FEW = 16
"""Up to this many phases are evaluated in a scalar loop: a step needs four at most."""


@compiled
def _combine_few(
    phases: Array,
    slope: Array,
    shift: Array,
    end: float,
    weights: Array,
    normalized: bool,
    slopes: bool,
    added: Array,
) -> Array:
    """Evaluates `GaussianBasis.combine` in a scalar loop."""
    count = len(slope)
    total = np.zeros((len(phases), weights.shape[1]))
    for n in range(len(phases)):
        held, size = max(phases[n], end), 0.0
        for b in range(count):
            offset = held * slope[b] - shift[b]
            value = math.exp(-0.5 * offset * offset)
            size += value
            for d in range(weights.shape[1]):
                weight = weights[b, d]
                if slopes:
                    weight += offset * weights[count + b, d]
                total[n, d] += value * weight
        late = phases[n] / held
        gate = phases[n] * late * late
        for d in range(weights.shape[1]):
            total[n, d] = (total[n, d] / size if normalized else total[n, d]) + added[d]
            total[n, d] *= gate
    return total


@dataclass(frozen=True, eq=False)
class GaussianBasis:
    """Basis functions of the phase.

    Attributes:
        centres: (B,) c in the phase.
        widths: (B,) sigma in the phase.
        normalized: Whether the functions are divided by their sum.
        slopes: Whether each has a slope beside its constant: twice as many features.
        alpha_x: Decay rate of the phase.
    """

    __repr__ = short_repr

    centres: Array
    widths: Array
    normalized: bool
    slopes: bool
    alpha_x: float

    @property
    def num_features(self) -> int:
        """B, or 2 B with slopes."""
        return len(self.centres) * (2 if self.slopes else 1)

    def activations(self, phases: npt.ArrayLike) -> Array:
        """Returns the basis functions (N, B) at phases (N,), normalised if `normalized`."""
        values = self._raw(np.asarray(phases))[0]
        return values / values.sum(axis=1)[:, None] if self.normalized else values

    def features(self, phases: npt.ArrayLike) -> Array:
        """Returns (N, num_features): basis functions times x, then those times (x - c) / sigma."""
        x = np.asarray(phases)
        values, offsets, gate = self._raw(x)
        if self.normalized:
            gate = gate / values.sum(axis=1)
        values = values * gate[:, None]
        return np.concatenate((values, values * offsets), axis=1) if self.slopes else values

    def combine(self, phases: Array, weights: Array, offset: Array | None = None) -> Array:
        """Returns features(phases) @ weights, (N, D), without building the features.

        Args:
            phases: (N,).
            weights: (K, D).
            offset: (D,) added to the basis functions' sum, before the gate.
        """
        offset = np.zeros(weights.shape[1]) if offset is None else offset
        if len(phases) <= _FEW and phases.dtype == weights.dtype == offset.dtype == np.float64:
            # Copies: read-only or strided arrays would trigger another compilation.
            few: Array = _combine_few(
                np.array(phases),
                *self._affine,
                np.array(weights),
                self.normalized,
                self.slopes,
                np.array(offset),
            )
            return few
        values, offsets, gate = self._raw(phases)
        size = len(self.centres)
        total = values @ weights[:size]
        if self.slopes:
            total = total + (values * offsets) @ weights[size:]
        if self.normalized:
            total = total / (values @ self._ones)[:, None]
        return (total + offset) * gate[:, None]

    def _raw(self, phases: Array) -> tuple[Array, Array, Array]:
        """Returns the functions (N, B), not normalised, (x - c) / sigma (N, B), the gate (N,)."""
        slope, shift, end = self._affine
        held = hold(phases, end)
        offsets = held[:, None] * slope - shift
        late = phases / held
        return np.exp(offsets * offsets * -0.5), offsets, phases * late * late

    @cached_property
    def _ones(self) -> Array:
        return np.ones(len(self.centres))

    @cached_property
    def _affine(self) -> tuple[Array, Array, float]:
        """1 / sigma, c / sigma, and the phase at the motion's end."""
        return 1.0 / self.widths, self.centres / self.widths, float(np.exp(-self.alpha_x))


@lru_cache(maxsize=64)
def even_basis(
    num_basis: int, overlap: float, alpha_x: float, normalized: bool = True, slopes: bool = False
) -> GaussianBasis:
    """Returns basis functions with centres evenly in time from the start to the end.

    The same arguments give the same object, so that cached responses are shared by all motions.
    """
    times = np.linspace(0.0, 1.0, num_basis) if num_basis > 1 else np.array([0.5])
    spacing = 1.0 / max(1, num_basis - 1)
    centres = np.exp(-alpha_x * times)
    return GaussianBasis(
        centres, overlap * alpha_x * spacing * centres, normalized, slopes, alpha_x
    )


@dataclass(frozen=True, eq=False)
class GaussianForcing:
    """A forcing term linear in its weights (K, D): f = basis.features(x) @ weights."""

    __repr__ = short_repr

    basis: GaussianBasis
    weights: Array

    @property
    def num_basis(self) -> int:
        """Number of basis functions."""
        return len(self.basis.centres)

    @property
    def num_dimensions(self) -> int:
        """D, the number of coordinates."""
        return self.weights.shape[1]

    def features(self, phases: npt.ArrayLike) -> Array:
        """Returns the (N, K) features, gating included, at phases (N,)."""
        return self.basis.features(phases)

    def __call__(self, phases: npt.ArrayLike) -> Array:
        """Returns the forcing term (N, D) at phases (N,)."""
        return self.basis.combine(np.asarray(phases), self.weights)

    def with_weights(self, weights: npt.ArrayLike) -> Self:
        """Returns the same model with other weights (K, D)."""
        return replace(self, weights=np.asarray(weights))

    def to_data(self) -> dict[str, Any]:
        """Returns the model as plain data."""
        return {
            "normalized": self.basis.normalized,
            "slopes": self.basis.slopes,
            "alpha_x": self.basis.alpha_x,
            "centres": self.basis.centres.tolist(),
            "widths": self.basis.widths.tolist(),
            "weights": self.weights.tolist(),
        }

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Self:
        """Makes the model from what `to_data` returned.

        Raises:
            ValueError: Numbers are missing or not finite.
        """
        basis = GaussianBasis(
            np.array(data["centres"], dtype=float),
            np.array(data["widths"], dtype=float),
            bool(data["normalized"]),
            bool(data["slopes"]),
            float(data["alpha_x"]),
        )
        weights = np.array(data["weights"], dtype=float)
        if basis.centres.ndim != 1 or basis.widths.shape != basis.centres.shape:
            raise ValueError("centres and widths must be two lists of the same length")
        if weights.ndim != 2 or len(weights) != basis.num_features:
            raise ValueError(f"weights must have {basis.num_features} rows of the same length")
        if not np.isfinite(weights).all():
            raise ValueError("weights must be finite")
        if not np.all(np.abs(basis.centres) <= FARTHEST_CENTRE):
            raise ValueError(f"centres must be within {FARTHEST_CENTRE:g} of the phase's 0")
        if not np.all((basis.widths >= 1.0 / LARGEST_NUMBER) & (basis.widths <= LARGEST_NUMBER)):
            raise ValueError("widths must be positive, and neither tiny nor huge")
        check_phase_rate(basis.alpha_x)
        return cls(basis, weights)


def check_phase_rate(alpha_x: float) -> None:
    """Raises ValueError unless `alpha_x` is positive and finite."""
    if not 0.0 < alpha_x <= LARGEST_NUMBER:
        raise ValueError(f"alpha_x is {alpha_x:g}; it must be positive and finite")
