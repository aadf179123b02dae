"""Makes the problem of a movement for the search methods."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.array_files import read_npz
from pepper_drake.errors import InputError
from pepper_drake.files import read_text
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.learning.dmp.rollout_arguments import field_of
from pepper_drake.optimization.cost_terms import HAND_RADIUS, Task
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.optimization.parameters import MovementParameters
from pepper_drake.optimization.problem import Evaluate, Problem

Array = npt.NDArray[np.float64]

_FARTHEST = 1e3
"""Largest coordinate of an obstacle point [m]."""

EXPLORATION = 0.02
"""Default standard deviation of each parameter [m]: r = 4e-4 m² in equation 3.2."""

JOINT_EXPLORATION = 0.06
"""The same in a search over joints: 0.15 rad."""

CLEARANCE = 0.02
"""Default distance to keep from obstacles [m]."""


def make_task(
    primitive: MovementPrimitive,
    *,
    goal: npt.ArrayLike | None = None,
    obstacles: npt.ArrayLike | PointCloudDistance | None = None,
    clearance: float = CLEARANCE,
    hand_radius: float = HAND_RADIUS,
) -> Task:
    """Makes the task of a primitive's movement.

    Args:
        primitive: Before the search: reference of the deviation and the jerk.
        goal: (3,) of the hand, in T [m]; the primitive's own if left out.
        obstacles: (P, 3) points in T [m], or a distance field of them.
        clearance: Distance to keep from them [m].
        hand_radius: Of the sphere that represents the hand in fast rollouts [m].

    Raises:
        InputError: The goal is not three finite numbers.
    """
    path = primitive.rollout()
    target = primitive.goal if goal is None else np.array(goal, dtype=float)
    if target.shape != (3,) or not np.isfinite(target).all():
        raise InputError(f"goal: {goal!r} must be 3 finite numbers")
    shown = Outcome(
        path.times, path.positions[None], accelerations=lambda: path.accelerations[None]
    )
    jerk = float(np.mean(np.sum(shown.jerks**2, axis=2)))
    field = None if obstacles is None else field_of(obstacles)
    return Task(target, path.positions, max(jerk, 1e-12), field, clearance, hand_radius)


def movement_problem(
    parameters: MovementParameters,
    evaluate: Evaluate,
    *,
    exploration: float | None = None,
    chunk: int | None = None,
) -> Problem:
    """Makes the problem of optimising the parameters of a movement.

    Args:
        parameters: The searched parameters.
        evaluate: Their cost.
        exploration: Initial standard deviation of the search [m]; a suitable one if left out.
        chunk: Number of samples per call; the evaluator's if left out.
    """
    if chunk is None:
        chunk = int(getattr(evaluate, "at_once", 1))
    if exploration is None:
        exploration = EXPLORATION if parameters.posture is None else JOINT_EXPLORATION
    # The nominal joints act through the inverse kinematics: not a linear policy.
    features = parameters.features if parameters.posture is None else None
    return Problem(np.zeros(parameters.size), exploration, evaluate, chunk, features)


def load_movement(path: Path) -> MovementPrimitive:
    """Loads a primitive, or learns one from a demonstration.

    Args:
        path: A primitive's YAML file, or a demonstration.

    Raises:
        InputError: It is neither.
    """
    if path.suffix in (".yaml", ".yml"):
        return MovementPrimitive.load(path)
    return MovementPrimitive.fit(Demonstration.load(path))


def load_points(path: Path) -> Array:
    """Loads obstacle points (P, 3) [m]: rows of x y z, or the cloud in a reach's log.npz.

    Raises:
        InputError: With file and line.
    """
    if path.suffix == ".npz":
        points = read_npz(path, ("cloud_torso_m",)).get("cloud_torso_m", np.zeros(0))
        if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.abs(points) < _FARTHEST):
            raise InputError(f"{path}: holds no cloud_torso_m; give a reach's log.npz")
        return np.asarray(points, dtype=float)
    rows = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 3 or not np.all(np.abs(row) < _FARTHEST):
            raise InputError(f"{path}, line {number}: '{line.strip()}' is not x y z, in metres")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: holds no points; write rows of x y z, in metres")
    return np.array(rows)
