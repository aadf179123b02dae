"""Files of a search."""

import json
import math
from pathlib import Path
from typing import Any

from pepper_drake.files import write_atomically
from pepper_drake.optimization.history import History
from pepper_drake.optimization.movement_rollouts import MovementRollouts
from pepper_drake.reporting.optimization_figures import draw_costs, draw_ways


def save_search(
    folder: Path, history: History, evaluate: MovementRollouts, *, seconds: float, converged: bool
) -> dict[str, float]:
    """Writes history.npz, primitive.yaml, report.json, cost.png and paths.png.

    Args:
        folder: Folder for the files.
        history: History of the search, with at least its start.
        evaluate: The search's cost function.
        seconds: Duration of the search.
        converged: Whether the search converged.

    Returns:
        Unweighted cost terms of the best movement, as far as measured.
    """
    task, before = evaluate.task, evaluate.parameters.primitive
    best, cost = history.best()
    history.save(folder / "history.npz")
    found = evaluate.primitive_at(best)
    found.save(folder / "primitive.yaml")
    measured = evaluate.measure(best)
    report: dict[str, Any] = {
        "settings": history.settings,
        "parameters": evaluate.parameters.size,
        "updates": history.updates,
        "rollouts": history.rollouts,
        "converged": converged,
        "costs": [_finite(cost) for cost in history.mean_costs],
        "best_cost": _finite(cost),
        "best_terms": measured,
        "seconds": seconds,
    }
    write_atomically(folder / "report.json", json.dumps(report, indent=2) + "\n")
    if history.updates:
        method = history.settings.get("method", "search")
        title = f"How far did the cost fall? {method} over {evaluate.parameters.size} parameters"
        figure = draw_costs(history.totals, history.mean_costs, title)
        figure.savefig(folder / "cost.png", dpi=110)
    points = None if task.obstacles is None else task.obstacles.points
    draw_ways(before, found, task.goal, points, task.clearance).savefig(
        folder / "paths.png", dpi=110
    )
    return measured


def _finite(cost: float) -> float | None:
    return cost if math.isfinite(cost) else None
