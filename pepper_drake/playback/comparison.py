"""Comparison of motions by figures."""

from collections.abc import Sequence

import numpy as np

from pepper_drake.playback.bodies import Frames
from pepper_drake.playback.motion import Vector

FARTHEST = "from the first, max [mm]"
"""The figure that compares two hand paths: the largest distance from the first motion's path."""

_DECIMALS = {"mm": 1, "deg": 1}


def compare(runs: Sequence[Frames]) -> dict[str, list[str]]:
    """Compares motions by their figures.

    Returns:
        A text for each motion, by the figure's name; empty if the motion lacks that figure. Names
        are in the order of their first occurrence.
    """
    figures = [dict(run.motion.figures) for run in runs]
    for run, own in zip(runs[1:], figures[1:], strict=True):
        own[FARTHEST] = 1000.0 * farthest(run.hand_W, runs[0].hand_W)
    names = dict.fromkeys(name for own in figures for name in own)
    rows = {name: [_text(name, own.get(name, "")) for own in figures] for name in names}
    return {name: texts for name, texts in rows.items() if any(texts)}


def farthest(path: Vector, reference: Vector) -> float:
    """Returns the largest distance of a path's points (K, 3) from a reference path (L, 3) [m]."""
    pairwise = np.linalg.norm(path[:, None, :] - reference[None, :, :], axis=2)
    return float(pairwise.min(axis=1).max())


def _text(name: str, value: str | float) -> str:
    if isinstance(value, str):
        return value
    unit = name.partition("[")[2].rstrip("]")
    return f"{value:.{_DECIMALS.get(unit, 2)}f}"


def table(runs: Sequence[Frames]) -> str:
    """Returns the comparison as lines for a terminal, with one column per motion."""
    rows = {"": [run.motion.name for run in runs], **compare(runs)}
    first = max(len(name) for name in rows)
    widths = [max(len(texts[k]) for texts in rows.values()) for k in range(len(runs))]
    return "\n".join(
        "  ".join(
            (
                f"  {name:{first}}",
                *(f"{text:>{width}}" for text, width in zip(texts, widths, strict=True)),
            )
        ).rstrip()
        for name, texts in rows.items()
    )
