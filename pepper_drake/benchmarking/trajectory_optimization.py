"""Drake's KinematicTrajectoryOptimization: one smooth motion from the arm's start to a posture."""

import numpy as np
import numpy.typing as npt
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.planning import KinematicTrajectoryOptimization
from pydrake.solvers import SnoptSolver, SolverOptions
from pydrake.trajectories import BsplineTrajectory

from pepper_drake.benchmarking.known_scene import GroundTruthScene
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams

Array = npt.NDArray[np.float64]

_CONTROL_POINTS = 10
_NUM_CHECKS = 25
"""Number of collision checks along the path."""
_DURATIONS = (0.5, 6.0)
_BEYOND_PADDING = 0.001
_INFLUENCE = 0.03
"""Distance [m] beyond the padding within which obstacles influence the solver."""
_MAJOR_ITERATIONS = 100
_SECONDS = 5.0
"""Time limit of one solution; usually the solver takes less than a second."""


def optimized_motion(
    known: GroundTruthScene, base_pose: Array, goal: Array, *, time_step: float = 0.01
) -> Array:
    """Returns joints (N, 5) at each time step from the arm's start to a posture, at rest [rad].

    As in Drake's own examples, the problem is solved without obstacles first, then with them from
    that solution. The cost is duration and path length; the limits are those of our own planner.

    Args:
        known: The scene.
        base_pose: (3,) x, y, yaw in W.
        goal: Posture (5,) [rad].
        time_step: Time step [s].

    Returns:
        Samples of the solver's final iterate; the caller must check it for collisions.
    """
    start, end = known.positions(known.start, base_pose), known.positions(goal, base_pose)
    problem = KinematicTrajectoryOptimization(len(start), _CONTROL_POINTS, 4, 2.0)
    lower, upper = known.positions(known.lower, base_pose), known.positions(known.upper, base_pose)
    limits = shared_control_model().command_limits(
        arm_joints(known.scene.arm),
        speed_fraction=DifferentialIkParams().speed_fraction,
    )
    speed, acceleration = np.ones((2, len(start)))  # Any limit for resting joints.
    speed[known.arm_index], acceleration[known.arm_index] = limits.velocity, limits.acceleration
    problem.AddPositionBounds(lower, upper)
    problem.AddVelocityBounds(-speed, speed)
    problem.AddAccelerationBounds(-acceleration, acceleration)
    problem.AddPathPositionConstraint(start, start, 0.0)
    problem.AddPathPositionConstraint(end, end, 1.0)
    for place in (0.0, 1.0):
        problem.AddPathVelocityConstraint(np.zeros(len(start)), np.zeros(len(start)), place)
    problem.AddDurationConstraint(*_DURATIONS)
    problem.AddDurationCost(1.0)
    problem.AddPathLengthCost(1.0)
    points = start[:, None] + np.linspace(0.0, 1.0, _CONTROL_POINTS) * (end - start)[:, None]
    problem.SetInitialGuess(BsplineTrajectory(problem.basis(), list(points.T[:, :, None])))
    problem.SetInitialGuess(_solved(problem))
    clear = MinimumDistanceLowerBoundConstraint(
        collision_checker=known.arm_checker,
        bound=_BEYOND_PADDING,
        collision_checker_context=known.arm_checker.MakeStandaloneModelContext(),
        penalty_function=None,
        influence_distance_offset=_INFLUENCE,
    )
    for place in np.linspace(0.0, 1.0, _NUM_CHECKS):
        problem.AddPathPositionConstraint(clear, place)
    motion = _solved(problem)
    times = np.append(np.arange(0.0, motion.end_time(), time_step), motion.end_time())
    return np.array([motion.value(time)[known.arm_index, 0] for time in times])


def _solved(problem: KinematicTrajectoryOptimization) -> BsplineTrajectory:
    """Returns the solver's final iterate, optimal or not: the caller checks the motion."""
    options = SolverOptions()
    options.SetOption(SnoptSolver.id(), "Major iterations limit", _MAJOR_ITERATIONS)
    options.SetOption(SnoptSolver.id(), "Time limit", _SECONDS)
    result = SnoptSolver().Solve(problem.prog(), None, options)
    return problem.ReconstructTrajectory(result)
