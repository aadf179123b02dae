"""From a hand's path to joint commands that can be checked before the arm moves."""

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
