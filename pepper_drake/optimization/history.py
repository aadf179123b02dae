"""History of a search, its complete state, in one file."""

from __future__ import annotations

import io
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from pepper_drake.array_files import read_npz
from pepper_drake.errors import InputError
from pepper_drake.files import parse_json, write_atomically
from pepper_drake.optimization.problem import total_costs
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

_MOST_UPDATES = 100_000

_KEEP_PERIOD = 0.8
"""Wall time between writes of a history [s]."""


@dataclass
class History:
    """All samples and costs of a search, update by update.

    Attributes:
        settings: Of the search; plain data.
        samples: (S, n) of each update.
        costs: (S,) or (S, T) of each update.
        means: (n,) before the first update and after each.
        mean_costs: The costs of the means; NaN where they were not evaluated.
            pending: Costs of an interrupted update, by the number of updates before it and the
                first sample of their chunk.

        It is consistent at any time: an update counts once its costs are there.
    """

    settings: dict[str, Any] = field(default_factory=dict)
    samples: list[Array] = field(default_factory=list)
    costs: list[Array] = field(default_factory=list)
    means: list[Array] = field(default_factory=list)
    mean_costs: list[float] = field(default_factory=list)
    pending: dict[int, dict[int, Array]] = field(default_factory=dict)

    __repr__ = short_repr

    @property
    def updates(self) -> int:
        """Number of updates."""
        return len(self.costs)

    @property
    def totals(self) -> list[Array]:
        """(S,) total costs of each update's samples."""
        return [total_costs(costs) for costs in self.costs]

    @property
    def rollouts(self) -> int:
        """Number of samples evaluated in whole updates, without the means."""
        return sum(len(costs) for costs in self.costs)

    def best(self) -> tuple[Array, float]:
        """Returns the cheapest parameters (n,) evaluated so far, and their cost.

        If nothing was evaluated: the last mean and NaN.
        """
        found = list(zip(self.means, self.mean_costs, strict=False))
        for samples, totals in zip(self.samples, self.totals, strict=False):
            least = int(np.argmin(totals))
            found.append((samples[least], float(totals[least])))
        known = [(parameters, cost) for parameters, cost in found if np.isfinite(cost)]
        if not known:
            return self.means[-1], float("nan")
        return min(known, key=lambda pair: pair[1])

    def check_settings(self, settings: dict[str, Any]) -> None:
        """Raises InputError if the search was started with other settings."""
        for name, now in settings.items():
            before = self.settings.get(name)
            if before != now:
                raise InputError(
                    f"--resume: {name.replace('_', '-')} was {before} and is {now} now;"
                    " give the same options, or start anew without --resume"
                )

    def save(self, path: Path, *, compress: bool = True) -> None:
        """Writes the history as numpy's npz; a crash leaves the old file intact.

        Args:
            path: The file.
            compress: Whether a small file is preferred to fast writing.

        Raises:
            InputError: The path cannot be written to.
        """
        arrays: dict[str, Any] = {
            "settings": json.dumps(self.settings),
            "means": np.array(self.means[: len(self.mean_costs)]),
            "mean_costs": np.array(self.mean_costs),
        }
        for name, rows in (("samples", self.samples), ("costs", self.costs)):
            arrays |= {f"{name}_{k}": row for k, row in enumerate(rows[: self.updates])}
        pending = self.pending.get(self.updates, {})
        arrays |= {f"pending_{k}": costs for k, costs in pending.items()}
        content = io.BytesIO()
        (np.savez_compressed if compress else np.savez)(content, **arrays)
        write_atomically(path, content.getvalue())

    @classmethod
    def load(cls, path: Path) -> Self:
        """Reads a history.

        Raises:
            InputError: The file is missing or is no history.
        """
        if not path.exists():
            raise InputError(f"{path}: no such file; there is nothing to resume")
        try:
            return cls._of(read_npz(path, kinds="fiubU"), str(path))
        except (InputError, ValueError, KeyError, TypeError, IndexError):
            raise InputError(f"{path}: not a history of a search; start anew") from None

    @classmethod
    def _of(cls, data: dict[str, Array], name: str) -> Self:
        """Makes a history from what `save` wrote, or raises ValueError, KeyError or TypeError."""
        if data["means"].ndim and len(data["means"]) > _MOST_UPDATES:
            raise ValueError("more updates than any search makes")
        if data["mean_costs"].shape != data["means"].shape[:1]:
            raise ValueError("not one cost for each mean")
        updates = sum(key.startswith("costs_") for key in data)
        history = cls(
            settings=parse_json(str(data["settings"]), name),
            samples=[data[f"samples_{k}"] for k in range(updates)],
            costs=[data[f"costs_{k}"] for k in range(updates)],
            means=list(data["means"]),
            mean_costs=data["mean_costs"].tolist(),
            pending={
                updates: {
                    int(key.removeprefix("pending_")): costs
                    for key, costs in data.items()
                    if key.startswith("pending_")
                }
            },
        )
        if not history._is_complete():
            raise ValueError("shapes that belong to no search")
        return history

    def _is_complete(self) -> bool:
        """Tells whether shapes and numbers are consistent."""
        pending = self.pending[self.updates].items()
        tables = [*self.samples, *self.means]
        sizes = {table.shape[-1] for table in tables if table.ndim}
        return (
            isinstance(self.settings, dict)
            and self.updates <= len(self.means) <= self.updates + 1
            and len(sizes) <= 1
            and all(mean.ndim == 1 for mean in self.means)
            and all(samples.ndim == 2 and len(samples) for samples in self.samples)
            and all(costs.ndim in (1, 2) and costs.size for costs in self.costs)
            and all(len(s) == len(c) for s, c in zip(self.samples, self.costs, strict=True))
            and all(start >= 0 and costs.ndim in (1, 2) for start, costs in pending)
            and all(
                table.dtype.kind in "fiub" and bool(np.all(np.isfinite(table)))
                for table in (*tables, *self.costs, *(costs for _, costs in pending))
            )
            and all(isinstance(cost, float) for cost in self.mean_costs)
        )


@dataclass
class HistoryKeeper:
    """Writes the history to a file about once a second during the search.

    Attributes:
        path: The file; its folder is created on the first write.
        history: Of the search.
    """

    path: Path
    history: History
    _kept: float = field(default_factory=time.monotonic, repr=False)

    def keep(self, *, now: bool = False) -> None:
        """Writes the file if due, or with `now` at once.

        Raises:
            InputError: The path cannot be written to.
        """
        if self.history.means and (now or time.monotonic() - self._kept > _KEEP_PERIOD):
            self.history.save(self.path, compress=False)
            self._kept = time.monotonic()
