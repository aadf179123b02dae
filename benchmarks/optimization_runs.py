"""Quality and duration of searches: the report's run, and the whole arm around tables.

  optimization_runs.py               20 seeds of each
  optimization_runs.py --seeds 3     a quick look

The report's run: end state and all weights are free, the hand ends 10 cm off its goal, 7 updates of
10 samples; the cost is the final distance from hand to goal. Around tables: the shipped
demonstration moves the arm through a table's edge; a search with the arm's kinematics stops at the
first movement that keeps the clearance, and the robot's inverse kinematics performs it. Times are
processor time on one core, without that of other programs.
"""

import json
import time
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.diagrams.factory import SHIPPED_DEMONSTRATION
from pepper_drake.learning import Demonstration, MovementPrimitive, PointCloudDistance
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.optimization import (
    METHODS,
    CostWeights,
    FastRollouts,
    all_weights,
    joint_bumps,
    make_optimizer,
    make_task,
    movement_problem,
    search,
)
from pepper_drake.optimization.averaging import decay_over
from pepper_drake.optimization.kinematic_rollouts import KinematicRollouts, arm_shapes
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.kinematic_simulation import ArmState, KinematicSimulator
from pepper_drake.planning.reach.movement import Movement

UPDATES, SAMPLES = 7, 10
TABLES = [(edge, top) for edge in (0.10, 0.13, 0.16) for top in (-0.12, -0.10, -0.08)]
"""Edges (x) and tops (z) of tables in the torso frame [m]."""


def reports_run(primitive: MovementPrimitive, method: str, seed: int) -> tuple[float, float]:
    """Returns the final cost [m] of the mean, and the search's processor time [s]."""
    direction = np.random.default_rng(seed).standard_normal(3)
    goal = primitive.goal + 0.1 * direction / np.linalg.norm(direction)
    begin = time.process_time()
    parameters = all_weights(primitive)
    evaluate = FastRollouts(
        parameters, make_task(primitive, goal=goal), CostWeights(hand_to_goal=1.0)
    )
    problem = movement_problem(parameters, evaluate)
    settings = {"decay": decay_over(UPDATES)} if method in ("algorithm3", "enac") else {}
    optimizer = make_optimizer(method, problem, samples=SAMPLES, seed=seed, **settings)
    history = search(problem, optimizer, UPDATES)
    return history.mean_costs[-1], time.process_time() - begin


def around_table(
    primitive: MovementPrimitive,
    table: tuple[float, float],
    seed: int,
    simulator: KinematicSimulator,
) -> dict[str, Any]:
    """Optimizes a movement of the whole arm around a table, and performs it."""
    edge, top = table
    x, y = np.meshgrid(np.arange(edge, 0.6, 0.015), np.arange(-0.7, 0.3, 0.015))
    points = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, top)))
    shapes, kinematics = arm_shapes("right"), arm_kinematics(shared_control_model(), "right")
    begin = time.process_time()
    task = make_task(
        primitive, obstacles=PointCloudDistance(points, extension=0.03), clearance=0.021
    )
    parameters = joint_bumps(primitive, 6, end_state=False)
    cost = CostWeights(hand_to_goal=10.0, arm_to_obstacles=10.0, deviation=0.1)
    evaluate = KinematicRollouts(parameters, task, cost, led_by="joints")
    problem = movement_problem(parameters, evaluate)
    optimizer = make_optimizer("cmaes", problem, samples=24, seed=seed)
    history = search(problem, optimizer, 60, evaluate_means=False, target=0.02)
    found = evaluate.primitive_at(history.best()[0])
    seconds = time.process_time() - begin
    assert found.posture is not None
    assert found.orientation is not None
    start = ArmState(found.posture.at([0.0])[0], np.zeros(5))
    goal = RigidTransform(Quaternion(found.orientation.goal), found.goal)
    assert task.obstacles is not None
    movement = Movement(found, None, RigidTransform())
    path = simulator.roll_out(movement, start, goal, task.obstacles)
    joints = simulator.track(start, path, 0.002)
    end = kinematics.hand_pose(joints[-1]).translation()
    before = primitive.rollout().joints
    return {
        "edge": edge,
        "top": top,
        "seed": seed,
        "rollouts": history.rollouts,
        "seconds": seconds,
        "clearance_before": float(shapes.distances(before, task.obstacles).min()),
        "clearance": float(shapes.distances(joints, task.obstacles).min()),
        "goal_error": float(np.linalg.norm(end - primitive.goal)),
    }


def main() -> int:
    """Runs the benchmark."""
    parser = cli.make_parser("optimization_runs", __doc__)
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="of each method")
    parser.add_argument("--table-seeds", type=int, default=3, metavar="N", help="of each table")
    options = parser.parse_args()
    cli.quiet_libraries()
    options.output.mkdir(parents=True, exist_ok=True)
    primitive = MovementPrimitive.fit(Demonstration.load(SHIPPED_DEMONSTRATION))
    runs = {
        method: np.array(
            [
                reports_run(primitive, method, seed)
                for seed in tqdm(range(options.seeds), desc=method, disable=options.quiet)
            ]
        )
        for method in METHODS
    }
    print(f"The report's run, {options.seeds} seeds: hand to goal after 70 rollouts [mm], seconds")
    for method, rows in runs.items():
        lower, middle, upper = 1000 * np.quantile(rows[:, 0], (0.25, 0.5, 0.75))
        print(
            f"  {method:11} {middle:7.2f}  (quartiles {lower:.2f}, {upper:.2f})"
            f"  {np.median(rows[:, 1]):.3f} s, at most {rows[:, 1].max():.3f} s"
        )
    model = shared_control_model()
    simulator = KinematicSimulator(
        model, arm_kinematics(model, "right"), DifferentialIkParams(), 0.4, 0.02
    )
    cases = [(table, seed) for table in TABLES for seed in range(options.table_seeds)]
    rows = [
        around_table(primitive, table, seed, simulator)
        for table, seed in tqdm(cases, desc="tables", disable=options.quiet)
    ]
    print(
        "Around tables: edge, top [m]; clearance before, after [mm]; error [mm]; rollouts; seconds"
    )
    for row in rows:
        print(
            f"  {row['edge']:.2f} {row['top']:6.2f}  {1000 * row['clearance_before']:7.1f}"
            f" {1000 * row['clearance']:6.1f} {1000 * row['goal_error']:6.2f}"
            f" {row['rollouts']:6d} {row['seconds']:6.2f}"
        )
    kept = sum(row["clearance"] >= 0.02 and row["goal_error"] <= 0.005 for row in rows)
    within = sum(row["seconds"] <= 1.0 for row in rows)
    print(f"  {kept} of {len(rows)} with 20 mm and 5 mm, {within} within 1 s")
    result = {
        "report": {method: rows_.tolist() for method, rows_ in runs.items()},
        "tables": rows,
    }
    (options.output / "optimization.json").write_text(json.dumps(result, indent=2) + "\n")
    return cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
