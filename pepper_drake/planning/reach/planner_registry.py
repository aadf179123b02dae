"""Registry of planners by name: the default one and the user's own."""

from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.registry import registered

DEFAULT_PLANNER = "ReachPlanner"
_planners: dict[str, type[ReachPlanner]] = {DEFAULT_PLANNER: ReachPlanner}


def register_planner(name: str, planner: type[ReachPlanner]) -> None:
    """Registers a planner.

    Args:
        name: The name that selects it.
        planner: A class with the constructor arguments of `ReachPlanner`.
    """
    _planners[name] = planner


def get_planner(name: str) -> type[ReachPlanner]:
    """Returns the planner class of that name.

    Raises:
        InputError: There is none; the message lists the known ones.
    """
    return registered("planner_class", name, _planners)
