"""Arm configurations with the hand at its goal, by Drake's inverse kinematics."""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.solvers import IpoptSolver, SnoptSolver

from pepper_drake.benchmarking.known_scene import GroundTruthScene
from pepper_drake.models.pepper import hand_frame

Array = npt.NDArray[np.float64]

_TOLERANCE = 0.0005
"""Tolerance [m] of the hand's position along each axis."""
_AXIS_MARGIN = 0.01
"""Margin to the scene's tolerance of the task axis [rad]."""


def goal_postures(
    known: GroundTruthScene, base_pose: Array, rng: np.random.Generator, *, tries: int = 16
) -> list[Array]:
    """Returns collision-free postures (5,) [rad], sorted by the hand's orientation error.

    The hand's position and the direction of its task axis are constraints. Its orientation is a
    cost in every other search, since five joints cannot reach every pose; the rest minimise the
    distance to their initial guess.

    Args:
        known: The scene.
        base_pose: (3,) x, y, yaw in W.
        rng: Draws the initial guesses.
        tries: Number of initial guesses.
    """
    found: list[tuple[float, Array]] = []
    for number in range(tries):
        guess = rng.uniform(known.lower, known.upper)
        posture = _solve(known, base_pose, guess, oriented=number % 2 == 0)
        if posture is None or not known.free(posture, base_pose):
            continue
        if all(np.abs(posture - other).max() > 0.05 for _, other in found):
            X_WH = known.hand_poses(posture[None], base_pose)[0]
            found.append((_angle(X_WH, known.X_WG), posture))
    return [posture for _, posture in sorted(found, key=lambda pair: pair[0])]


def _solve(
    known: GroundTruthScene, base_pose: Array, guess: Array, *, oriented: bool
) -> Array | None:
    plant, hand = known.plant, known.plant.GetFrameByName(hand_frame(known.scene.arm))
    ik = InverseKinematics(plant)
    q, program = ik.q(), ik.get_mutable_prog()
    fixed = known.positions(guess, base_pose)
    others = np.setdiff1d(np.arange(len(fixed)), known.arm_index)
    program.AddBoundingBoxConstraint(fixed[others], fixed[others], q[others])
    goal = known.X_WG
    ik.AddPositionConstraint(
        hand,
        np.zeros(3),
        plant.world_frame(),
        goal.translation() - _TOLERANCE,
        goal.translation() + _TOLERANCE,
    )
    task = known.scene.goal.pre_grasp
    ik.AddAngleBetweenVectorsConstraint(
        hand,
        np.asarray(task.axis),
        plant.world_frame(),
        goal.rotation() @ np.asarray(task.axis),
        0.0,
        task.tolerance - _AXIS_MARGIN,
    )
    if oriented:
        ik.AddOrientationCost(
            hand, RotationMatrix.Identity(), plant.world_frame(), goal.rotation(), 1.0
        )
    else:
        program.AddQuadraticErrorCost(np.eye(len(guess)), guess, q[known.arm_index])
    solver = SnoptSolver() if SnoptSolver().available() else IpoptSolver()
    result = solver.Solve(program, fixed)
    return result.GetSolution(q)[known.arm_index] if result.is_success() else None


def _angle(X_WA: RigidTransform, X_WB: RigidTransform) -> float:
    """Returns the angle between two orientations [rad]."""
    return float(X_WA.rotation().InvertAndCompose(X_WB.rotation()).ToAngleAxis().angle())
