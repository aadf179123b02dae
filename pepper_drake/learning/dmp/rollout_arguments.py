"""Arguments of rollouts, checked and in one form."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.dmp.obstacle_coupling import Coupling, get_coupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance

Array = npt.NDArray[np.float64]
GoalMotion = Callable[[float], npt.ArrayLike]


def vector(
    value: npt.ArrayLike | GoalMotion | None, default: Array, size: int, label: str
) -> Array:
    """Returns finite numbers (size,), or the default for None.

    Raises:
        InputError: The value is anything else.
    """
    if value is None:
        return default
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (size,) or not np.isfinite(numbers).all():
        raise InputError(f"{label}: {value!r} must be {size} finite numbers")
    return numbers


def quaternion(value: npt.ArrayLike | None, default: Array, label: str) -> Array:
    """Returns a unit quaternion (4,), or the default for None.

    Raises:
        InputError: The value is anything else.
    """
    q = vector(value, default, 4, label)
    if abs(float(np.linalg.norm(q)) - 1.0) > 1e-3:
        raise InputError(f"{label}: {value!r} must be a unit quaternion w, x, y, z")
    return so3.normalize(q)


def goal_function(
    goal: npt.ArrayLike | GoalMotion | None,
    velocity: npt.ArrayLike | GoalMotion | None,
    first: Array,
) -> Callable[[float], tuple[Array, Array]] | Array:
    """Returns the goal (3,), or a function of the time [s]: the goal's position and velocity.

    Raises:
        InputError: The velocity is a function, but the goal is not.
    """
    if not callable(goal):
        if velocity is None:
            return first
        if callable(velocity):
            raise InputError("goal_velocity: a function of the time needs a goal that is one too")
        speed = vector(velocity, first, 3, "goal_velocity")
        return lambda time: (first + speed * time, speed)

    def goal_at(time: float) -> tuple[Array, Array]:
        known = velocity(time) if callable(velocity) else velocity
        return (
            vector(goal(time), first, 3, "goal"),
            vector(known, np.zeros(3), 3, "goal_velocity"),
        )

    return goal_at


def check_seconds(**values: float) -> None:
    """Checks times by their names.

    Raises:
        InputError: One is not a positive number [s].
    """
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value} is not a positive number of seconds")


def field_of(obstacles: npt.ArrayLike | PointCloudDistance) -> PointCloudDistance:
    """Returns the obstacles' distance field, made from points (P, 3) [m] if need be."""
    return obstacles if isinstance(obstacles, PointCloudDistance) else PointCloudDistance(obstacles)


def coupling_and_field(
    coupling: str | Coupling, obstacles: npt.ArrayLike | PointCloudDistance | None
) -> tuple[Coupling | None, PointCloudDistance | None]:
    """Returns the coupling and the obstacles' distance field, both None without obstacles."""
    if obstacles is None:
        return None, None
    chosen = get_coupling(coupling) if isinstance(coupling, str) else coupling
    return chosen, field_of(obstacles)
