"""Time-optimal parameterization of a joint path."""

import numpy as np
import numpy.typing as npt
from pydrake.multibody.optimization import Toppra
from pydrake.trajectories import PathParameterizedTrajectory, PiecewisePolynomial

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams

Array = npt.NDArray[np.float64]

_GRID = 200
"""Number of points of the path at which TOPP-RA keeps the limits."""


def timed_path(arm: str, corners: Array, *, time_step: float = 0.01) -> Array | None:
    """Returns joints (N, 5) at each time step along a path, from rest to rest [rad].

    The path is a curve without overshoot through the waypoints, timed by Drake's TOPP-RA (Pham and
    Pham 2018) with the limits of our own planner: half the rated speed, and its acceleration.

    Args:
        arm: "left" or "right".
        corners: (K, 5) waypoints [rad].
        time_step: Time step [s].

    Returns:
        The samples, the last one at rest; None if no timing keeps the limits.
    """
    model = shared_control_model()
    index = model.position_indices(arm_joints(arm))
    own = model.command_limits(
        arm_joints(arm), speed_fraction=DifferentialIkParams().speed_fraction
    )
    # TOPP-RA needs limits for all joints of a plant; resting joints keep any.
    speed, acceleration = np.ones((2, model.plant.num_positions()))
    speed[index], acceleration[index] = own.velocity, own.acceleration
    path = _curve(corners, index, model.plant.num_positions())
    toppra = Toppra(path, model.plant, np.linspace(path.start_time(), path.end_time(), _GRID))
    toppra.AddJointVelocityLimit(-speed, speed)
    toppra.AddJointAccelerationLimit(-acceleration, acceleration)
    timing = toppra.SolvePathParameterization()
    if timing is None:
        return None
    motion = PathParameterizedTrajectory(path, timing)
    times = np.append(np.arange(0.0, motion.end_time(), time_step), motion.end_time())
    return np.array([motion.value(time)[index, 0] for time in times])


def _curve(corners: Array, index: list[int], num_positions: int) -> PiecewisePolynomial:
    """Returns all joints as a function of the chord length between waypoints."""
    chords = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    kept = np.concatenate(([True], chords > 1e-9))
    positions = np.zeros((num_positions, int(kept.sum())))
    positions[index] = corners[kept].T
    breaks = np.concatenate(([0.0], np.cumsum(chords[kept[1:]])))
    return PiecewisePolynomial.CubicShapePreserving(
        breaks, positions, zero_end_point_derivatives=False
    )
