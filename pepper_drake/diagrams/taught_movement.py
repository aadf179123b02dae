"""The taught movement, compared with the performed one: its path, and obstacles on it."""

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import Context

from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.learning import MovementPrimitive
from pepper_drake.models.control_model import arm_joints
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import last_attempt
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.results.movement_report import ADAPTED, MovementReport

Vector = npt.NDArray[np.float64]

_STRIDE = 5
"""Number of path samples between true-clearance queries."""


def taught_path(
    primitive: MovementPrimitive,
    times: Vector,
    mode: npt.NDArray[np.int64],
    origin: npt.NDArray[np.int64],
    hand: Vector,
    goal: Vector,
) -> Vector:
    """Returns the taught primitive's path (K, 3) to the moving goal, neither coupled nor adapted.

    Args:
        primitive: The taught primitive.
        times: Times of the rows (N,) [s].
        mode: The supervisor's `ReachMode` (N,).
        origin: The `Origin` of the movement (N,): a retreat has another goal.
        hand: Measured hand position in T (N, 3) [m].
        goal: Estimated goal of the hand in T (N, 3) [m].
    """
    moving = np.flatnonzero(
        last_attempt(mode) & ~np.isin(origin, (Origin.NONE, Origin.RETREAT, Origin.RETURN))
    )
    if not len(moving) or not np.isfinite(goal[moving]).all():
        return np.zeros((0, 3))
    since, seen = times[moving] - times[moving[0]], goal[moving]
    still = np.ptp(seen, axis=0).max() < 0.003

    def at(time: float) -> Vector:
        return np.array([np.interp(time, since, column) for column in seen.T])

    path = primitive.rollout(
        time_step=primitive.duration / 400,
        start=hand[moving[0]],
        goal=seen[-1] if still else at,
        start_velocity=np.zeros(3),
    )
    return path.positions


def simulate_taught(planner: ReachPlanner, observation: Observation) -> tuple[ReachPlan, str]:
    """Returns the movement as taught, simulated, and why it was adapted, as a sentence.

    Args:
        planner: That adapted it.
        observation: What was known when the movement was planned.
    """
    plan, want = planner.simulate_taught(observation), planner.params.clearance.want
    if plan.status != PlanStatus.CLEAR:
        return plan, plan.message
    if plan.clearance < want:
        return plan, (
            f"the arm would come within {1000 * plan.clearance:.1f} mm of what was seen, nearer "
            f"than the {1000 * want:.1f} mm that it keeps where it can"
        )
    return plan, (
        "it was not clear, seen from where the robot stood before (from here it would be: "
        f"{1000 * plan.clearance:.0f} mm)"
    )


def explain_adaptation(
    report: MovementReport,
    reaching: Reaching,
    observation: Observation | None,
    root: Context,
    state: Vector,
) -> None:
    """Fills in why a movement was not performed as taught.

    Args:
        report: Report of the same reach.
        reaching: The diagram.
        observation: The observation with which the movement was planned.
        root: A context of the root diagram that may be changed.
        state: State of the plant when the arm started.
    """
    if report.kind != ADAPTED or observation is None:
        return
    plan, report.taught_message = simulate_taught(reaching.planner, observation)
    report.taught_clearance = plan.clearance
    if plan.joint_path is None:
        return
    plant = reaching.station.plant
    context = plant.GetMyMutableContextFromRoot(root)
    columns = [plant.GetJointByName(n).position_start() for n in arm_joints(reaching.scene.arm)]
    nearest = (np.inf, "")
    for joints in plan.joint_path[::_STRIDE]:
        at = state.copy()
        at[columns] = joints
        plant.SetPositionsAndVelocities(context, at)
        query = reaching.GetOutputPort("ground_truth.query").Eval(
            reaching.GetMyContextFromRoot(root)
        )
        nearest = min(nearest, reaching.clearance.closest_pair(query))
    report.taught_closest_pair = f"{nearest[1]}, {1000 * nearest[0]:.0f} mm" if nearest[1] else ""
