"""Optimisation: a hand that should end 7 cm farther finds out how, without being told a goal."""

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.optimization.cost import CostWeights
from pepper_drake.optimization.methods import make_optimizer
from pepper_drake.optimization.movement_problem import make_task, movement_problem
from pepper_drake.optimization.movement_rollouts import make_parameters, make_rollouts
from pepper_drake.optimization.search import search


def draw() -> Figure:
    """Draws the best cost over the rollouts, for two methods."""
    (shown,) = example_demonstrations(1)
    primitive = MovementPrimitive.fit(shown)
    task = make_task(primitive, goal=primitive.goal + [0.04, 0.04, 0.04])
    parameters = make_parameters(primitive, "hand", 8, end_state=True)
    rollouts = make_rollouts("fast", parameters, task, CostWeights(hand_to_goal=1.0))
    problem = movement_problem(rollouts.parameters, rollouts)

    figure = Figure(figsize=(7, 3.5), layout="constrained")
    axes = figure.add_subplot()
    for name, title in (("algorithm3", "the report's algorithm 3"), ("cmaes", "CMA-ES")):
        optimizer = make_optimizer(name, problem, samples=10, seed=0)
        history = search(problem, optimizer, 20)
        costs = np.minimum.accumulate(np.concatenate(history.costs).reshape(200, -1).sum(axis=1))
        axes.semilogy(np.arange(1, 201), costs, label=title)
    axes.set(xlabel="rollouts", ylabel="least cost so far [m]", title="How soon is the goal found?")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


if __name__ == "__main__":
    draw().savefig("optimisation.png", dpi=90)
