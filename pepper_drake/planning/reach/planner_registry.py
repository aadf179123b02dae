"""Planners by name: the default one, and those of one's own."""

from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.registry import registered

DEFAULT_PLANNER = "ReachPlanner"
_planners: dict[str, type[ReachPlanner]] = {DEFAULT_PLANNER: ReachPlanner}


def register_planner(name: str, planner: type[ReachPlanner]) -> None:
    """Makes a planner known by its name.

    Args:
        name: The word that chooses it.
        planner: A class with the constructor arguments of `ReachPlanner`.
    """
    _planners[name] = planner


def get_planner(name: str) -> type[ReachPlanner]:
    """Returns the planner class of that name.

    Raises:
        InputError: There is none; the message lists those that there are.
    """
    return registered("planner_class", name, _planners)
