"""OMPL's RRT-Connect with path smoothing, over Drake's collision checker.

OMPL is in the `bench` extra and imported only where needed.
"""

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.benchmarking.known_scene import GroundTruthScene

Array = npt.NDArray[np.float64]

_RESOLUTION = 0.01
"""Distance between checks along a motion, as a fraction of the joint space's extent."""


@lru_cache(maxsize=1)
def seed_ompl(seed: int) -> None:
    """Seeds OMPL's random numbers, once, since OMPL has one seed per process."""
    from ompl import util

    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(seed + 1)  # 0 means no seed.


def rrt_connect(
    known: GroundTruthScene, base_pose: Array, goals: list[Array], *, seconds: float = 5.0
) -> Array | None:
    """Plans from the arm's start to one of several postures.

    Args:
        known: The scene.
        base_pose: (3,) x, y, yaw in W.
        goals: Postures (5,) [rad].
        seconds: Time limit of the search.

    Returns:
        Waypoints (K, 5) of the path after OMPL's simplification and smoothing [rad]; None if no
        path was found.
    """
    from ompl import base, geometric

    space = base.RealVectorStateSpace(len(known.lower))
    bounds = base.RealVectorBounds(len(known.lower))
    for k, (low, high) in enumerate(zip(known.lower, known.upper, strict=True)):
        bounds.setLow(k, float(low))
        bounds.setHigh(k, float(high))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)

    def vector(state: Any) -> Array:
        return np.array([state[k] for k in range(len(known.lower))])

    setup.setStateValidityChecker(lambda state: known.free(vector(state), base_pose))
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(_RESOLUTION)
    setup.setStartState(_state(space, known.start))
    targets = base.GoalStates(information)
    for goal in goals:
        targets.addState(_state(space, goal))
    setup.setGoal(targets)
    setup.setPlanner(geometric.RRTConnect(information))
    if not setup.solve(seconds) or not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    simplifier.simplifyMax(path)
    simplifier.smoothBSpline(path)
    return np.array([vector(state) for state in path.getStates()])


def _state(space: Any, joints: Array) -> Any:
    state = space.allocState()
    for k, angle in enumerate(joints):
        state[k] = float(angle)
    return state
