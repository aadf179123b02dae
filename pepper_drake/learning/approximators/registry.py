"""The protocol that every forcing-term approximator follows, and the registry of them by name.

An approximator turns samples of the forcing term along one or several demonstrations into a
`ForcingModel`: the forcing term as a function of the phase. To add one, write a module that

1. defines a frozen dataclass following `ForcingModel`: callable on phases, plain data out
   (`to_data`) and in (`from_data`), both exact to the last bit;
2. defines `fit(data: ForcingData, num_basis: int, seed: int) -> ForcingModel`;
3. calls `register(Approximator("name", fit, Model.from_data))` at module level;

and import the module in `pepper_drake/learning/__init__.py`, which makes the name known to
`MovementPrimitive.fit(..., approximator="name")`, to the primitive files and to the apps.

The contract of a model `f`:

- `f(phases)` takes (N,) phases x in (0, 1] (1 at the start, falling) and gives (N, D): the forcing
  term *before* the formulation's scaling, *with* all gating. Past the motion's end it must vanish
  with the phase, like x³, or goals would be reached late or never; multiply by
  `fade_out(phases, alpha_x)` where the method does not ensure that itself.
- It is vectorised, changes nothing, and uses only arithmetic and numpy's `exp`, `log`, `sqrt` on
  the phases, so that arrays of `pydrake` AutoDiffXd pass through.
- `to_data` returns only dict, list, str, int, float, bool: what YAML can hold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.phase import fade_out as fade_out
from pepper_drake.registry import registered
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ForcingData:
    """Training data of an approximator: N samples of the forcing term in D dimensions.

    Several demonstrations are concatenated; `lengths` tells them apart. Coordinates are those of
    the formulation (its scaling taken out), so that demonstrations are comparable.

    Attributes:
        phases: (N,) phase of each sample, in (0, 1].
        times: (N,) time divided by the motion's duration, in [0, 1].
        targets: (N, D) the forcing term at the samples (equation 2.8 of the report).
        responses: (N, D) displacement that the forcing term must cause: position minus the unforced
            spring's trajectory from start to goal. In time divided by duration.
        scales: (N, D) size of the scaling that was taken out of `targets` and `responses`: a
            residual times its scale is one in metres (or radians). All one for most formulations.
        lengths: Samples of each demonstration; they add up to N.
        alpha_x: Decay rate of the phase: x = exp(-alpha_x time).
        alpha_z: Stiffness constant of the spring (its damper is critical).
    """

    phases: Array
    times: Array
    targets: Array
    responses: Array
    scales: Array
    lengths: tuple[int, ...]
    alpha_x: float
    alpha_z: float

    __repr__ = short_repr


@runtime_checkable
class ForcingModel(Protocol):
    """A learned forcing term; see the module's text for the contract."""

    @property
    def num_basis(self) -> int:
        """Number of basis functions, kernels or receptive fields."""
        ...

    @property
    def num_dimensions(self) -> int:
        """D, the number of coordinates."""
        ...

    def __call__(self, phases: npt.ArrayLike) -> Array:
        """Returns the forcing term (N, D) at phases (N,)."""
        ...

    def to_data(self) -> dict[str, Any]:
        """Returns the model as plain data; `from_data` gives it back bit for bit."""
        ...

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Self:
        """Makes the model from what `to_data` returned."""
        ...


@runtime_checkable
class LinearForcingModel(ForcingModel, Protocol):
    """A forcing term linear in its weights: f = features(x) @ weights.

    Rollouts of such models are one matrix product, and search methods work on their weights.
    """

    @property
    def weights(self) -> Array:
        """(K, D) weights."""
        ...

    def features(self, phases: npt.ArrayLike) -> Array:
        """Returns the (N, K) features, gating included, at phases (N,)."""
        ...

    def with_weights(self, weights: npt.ArrayLike) -> Self:
        """Returns the same model with other weights (K, D)."""
        ...


@dataclass(frozen=True)
class Approximator:
    """A method of learning a forcing term.

    Attributes:
        name: Selects it.
        fit: `fit(data, num_basis, seed)`; `seed` is for methods with random starts.
        load: Makes the model from plain data, as `from_data` does.
    """

    name: str
    fit: Callable[[ForcingData, int, int], ForcingModel]
    load: Callable[[Mapping[str, Any]], ForcingModel]


_registry: dict[str, Approximator] = {}


def register(approximator: Approximator) -> None:
    """Registers an approximator under its name."""
    _registry[approximator.name] = approximator


def approximator_names() -> tuple[str, ...]:
    """Returns the names of all approximators."""
    return tuple(_registry)


def get_approximator(name: str) -> Approximator:
    """Returns the approximator of that name.

    Raises:
        InputError: There is none; the message lists the known names.
    """
    return registered("approximator", name, _registry)
