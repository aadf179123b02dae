"""Goal configurations with the hand at its goal, by Drake's inverse kinematics."""

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


def goal_postures(
    known: GroundTruthScene, base_pose: Array, rng: np.random.Generator, *, tries: int = 16
) -> list[Array]:
    """Postures (5,) [rad] in which nothing is hit, the ones with the hand turned best first.

    The hand's position is a constraint. Its direction is a cost in every other search, for five
    joints cannot take every pose; the rest look for what is nearest to where they start.

    Args:
        known: The scene.
        base_pose: (3,) x, y, yaw in W.
        rng: Draws the starts of the searches.
        tries: Number of starts.
    """
    found: list[tuple[float, Array]] = []
    for number in range(tries):
        guess = rng.uniform(known.lower, known.upper)
        posture = _solve(known, base_pose, guess, turned=number % 2 == 0)
        if posture is None or not known.free(posture, base_pose):
            continue
        if all(np.abs(posture - other).max() > 0.05 for _, other in found):
            X_WH = known.hand_poses(posture[None], base_pose)[0]
            found.append((_angle(X_WH, known.X_WG), posture))
    return [posture for _, posture in sorted(found, key=lambda pair: pair[0])]


def _solve(
    known: GroundTruthScene, base_pose: Array, guess: Array, *, turned: bool
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
    if turned:
        ik.AddOrientationCost(
            hand, RotationMatrix.Identity(), plant.world_frame(), goal.rotation(), 1.0
        )
    else:
        program.AddQuadraticErrorCost(np.eye(len(guess)), guess, q[known.arm_index])
    solver = SnoptSolver() if SnoptSolver().available() else IpoptSolver()
    result = solver.Solve(program, fixed)
    return result.GetSolution(q)[known.arm_index] if result.is_success() else None


def _angle(X_WA: RigidTransform, X_WB: RigidTransform) -> float:
    """The angle between two directions [rad]."""
    return float(X_WA.rotation().InvertAndCompose(X_WB.rotation()).ToAngleAxis().angle())
