"""Movements that improve themselves: searches over the parameters of a primitive.

primitive = MovementPrimitive.fit(demonstration)
parameters = all_weights(primitive)
task = make_task(primitive, goal=[0.3, -0.15, 0.1])
evaluate = FastRollouts(parameters, task, CostWeights(hand_to_goal=1.0))
problem = movement_problem(parameters, evaluate)
history = search(problem, make_optimizer("algorithm3", problem, seed=0), updates=7)
better = parameters.primitive_at(history.best()[0])
"""

from pepper_drake.optimization.averaging import RewardWeightedAveraging
from pepper_drake.optimization.cma_es import CmaEs
from pepper_drake.optimization.comparison import Comparison, compare_methods
from pepper_drake.optimization.cost import CostFunction, CostWeights, load_cost, parse_cost
from pepper_drake.optimization.cost_terms import TERMS, Task
from pepper_drake.optimization.fast_rollouts import FastRollouts
from pepper_drake.optimization.history import History
from pepper_drake.optimization.methods import METHODS, make_optimizer
from pepper_drake.optimization.movement_problem import make_task, movement_problem
from pepper_drake.optimization.optimizer import Optimizer
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.optimization.parallel import dask_cluster, evaluate_all, processes
from pepper_drake.optimization.parameters import (
    MovementParameters,
    all_weights,
    joint_bumps,
    smooth_bumps,
)
from pepper_drake.optimization.pi2_cma import Pi2Cma
from pepper_drake.optimization.problem import Problem
from pepper_drake.optimization.search import search

__all__ = [
    "METHODS",
    "TERMS",
    "CmaEs",
    "Comparison",
    "CostFunction",
    "CostWeights",
    "FastRollouts",
    "History",
    "MovementParameters",
    "Optimizer",
    "Outcome",
    "Pi2Cma",
    "Problem",
    "RewardWeightedAveraging",
    "Task",
    "all_weights",
    "compare_methods",
    "dask_cluster",
    "evaluate_all",
    "joint_bumps",
    "load_cost",
    "make_optimizer",
    "make_task",
    "movement_problem",
    "parse_cost",
    "processes",
    "search",
    "smooth_bumps",
]
