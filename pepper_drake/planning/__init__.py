"""Planning: from a hand path to joint commands that are checked before the arm moves."""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pepper_drake.planning.reach.movement import Movement
    from pepper_drake.planning.reach.observation import Observation
    from pepper_drake.planning.reach.planner_registry import get_planner, register_planner
    from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
    from pepper_drake.planning.reach.reach_plan import (
        Planner,
        PlanStatus,
        ReachPlan,
        RemainingClearance,
    )
    from pepper_drake.planning.reach.reach_planner import ReachPlanner

__all__ = [
    "Movement",
    "Observation",
    "PlanStatus",
    "Planner",
    "ReachPlan",
    "ReachPlanner",
    "ReachPlannerParams",
    "RemainingClearance",
    "get_planner",
    "register_planner",
]

_MODULES = {
    "movement": ("Movement",),
    "observation": ("Observation",),
    "planner_registry": ("get_planner", "register_planner"),
    "reach_parameters": ("ReachPlannerParams",),
    "reach_plan": ("PlanStatus", "Planner", "ReachPlan", "RemainingClearance"),
    "reach_planner": ("ReachPlanner",),
}
"""Modules of `planning.reach` and the names they export."""


def __getattr__(name: str) -> object:
    """Imports a name on first use: playback needs the reach modes, but no planner."""
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.reach.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
