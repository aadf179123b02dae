"""A forcing term of local lines, the model of `gmr` and `lwpr`."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.approximators.gaussian_forcing import check_phase_rate
from pepper_drake.learning.approximators.registry import Array, fade_out


@dataclass(frozen=True, eq=False)
class LineBasis:
    """Weights of the local lines: h_k(s), proportional to exp(gain_k - (s - c_k)^2 / (2 v_k)).

    The h_k add up to one, and s = -log(x) / alpha_x is the time divided by the duration. The input
    is s rather than the phase x, in which the second half of a motion is squeezed into the last
    hundredth of the axis.

    Attributes:
        alpha_x: Decay rate of the phase.
        log_gains: Shape (K,).
        centres: c, shape (K,), in [0, 1].
        variances: v, shape (K,).
    """

    alpha_x: float
    log_gains: Array
    centres: Array
    variances: Array

    def activations(self, phases: npt.ArrayLike) -> tuple[Array, Array]:
        """Returns h (N, K) and s - c (N, K); past the motion's end s stays 1."""
        times = np.minimum(1.0, -np.log(np.asarray(phases)) / self.alpha_x)
        offsets = times[:, None] - self.centres
        logs = self.log_gains - offsets**2 / (2 * self.variances)
        values = np.exp(logs - logs.max(axis=1)[:, None])
        return values / values.sum(axis=1)[:, None], offsets

    def features(self, phases: npt.ArrayLike) -> Array:
        """Returns the (N, 2 K) features at phases (N,): those of the heights, then the slopes."""
        activations, offsets = self.activations(phases)
        gated = activations * fade_out(phases, self.alpha_x)[:, None]
        return np.concatenate((gated, gated * offsets), axis=1)


@dataclass(frozen=True, eq=False)
class LocalLines:
    """f(s) = sum_k h_k(s) (height_k + slope_k (s - c_k)).

    Attributes:
        basis: The h_k and c_k.
        weights: K heights, then K slopes, shape (2 K, D).
    """

    basis: LineBasis
    weights: Array

    @property
    def num_basis(self) -> int:
        """K."""
        return len(self.basis.centres)

    @property
    def num_dimensions(self) -> int:
        """D."""
        return self.weights.shape[1]

    def features(self, phases: npt.ArrayLike) -> Array:
        """Returns the (N, 2 K) features, gating included, at phases (N,)."""
        return self.basis.features(phases)

    def __call__(self, phases: npt.ArrayLike) -> Array:
        """Returns the forcing term (N, D) at phases (N,)."""
        return np.asarray(self.features(phases) @ self.weights)

    def with_weights(self, weights: npt.ArrayLike) -> Self:
        """Returns the same model with other weights (2 K, D)."""
        return replace(self, weights=np.asarray(weights))

    def to_data(self) -> dict[str, Any]:
        """Returns the model as plain data."""
        return {
            "alpha_x": self.basis.alpha_x,
            "log_gains": self.basis.log_gains.tolist(),
            "centres": self.basis.centres.tolist(),
            "variances": self.basis.variances.tolist(),
            "weights": self.weights.tolist(),
        }

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Self:
        """Makes the model from what `to_data` returned."""
        return cls(read_basis(data), np.array(data["weights"], dtype=float))


def read_basis(data: Mapping[str, Any]) -> LineBasis:
    """Makes the basis from what `LocalLines.to_data` returned.

    Raises:
        ValueError: `alpha_x` is not positive and finite.
    """
    arrays = (np.array(data[key], dtype=float) for key in ("log_gains", "centres", "variances"))
    alpha_x = float(data["alpha_x"])
    check_phase_rate(alpha_x)
    return LineBasis(alpha_x, *arrays)
