"""Rollouts with the whole arm, without dynamics: hundreds per second."""

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.learning.dmp.rollout import number_of_steps
from pepper_drake.models.control_model import CommandLimits, arm_joints, shared_control_model
from pepper_drake.optimization.cost import Cost, terms_of
from pepper_drake.optimization.cost_terms import Task
from pepper_drake.optimization.fast_rollouts import roll_out
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.optimization.parameters import MovementParameters
from pepper_drake.planning.collision.arm_collision_checker import GRID_CAP, arm_region
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics, arm_kinematics
from pepper_drake.planning.collision.distance_grid import DistanceGrid
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.ik.batch_ik import batch_inverse_kinematics
from pepper_drake.planning.reach.movement_from_path import fit_primitive_to_joint_path
from pepper_drake.planning.trajectories.joint_trajectories import minimum_duration

Array = npt.NDArray[np.float64]

SPEED_FRACTION = 0.5
"""Usable share of the joints' rated speed."""

GRID_ERROR = 0.005
"""Margin [m] by which the grid may overestimate distances."""


class KinematicRollouts:
    """Costs of parameters, by rollouts with an arm that tracks exactly.

    The arm's collision spheres are evaluated in a grid of distances to the obstacles; the grid's
    largest error is subtracted, so that a required clearance is kept.

    Args:
        parameters: Meaning of the numbers.
        task: Of the movement.
        cost: Of an outcome.
        time_step: Between samples [s].
        led_by: "hand": the hand follows the primitive, the redundant joints its posture
            (`batch_inverse_kinematics`). "joints": the arm follows the posture.

    Raises:
        InputError: The primitive has no joints, or its start contradicts their forward kinematics.
    """

    def __init__(
        self,
        parameters: MovementParameters,
        task: Task,
        cost: Cost,
        time_step: float = 0.04,
        led_by: str = "hand",
    ) -> None:
        self.parameters, self.task, self.cost = parameters, task, cost
        self.time_step, self.led_by = time_step, led_by
        self.arm = arm_of(parameters.primitive)
        self._grid: DistanceGrid | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leaves out the grid, which another process computes for itself."""
        return self.__dict__ | {"_grid": None}

    @property
    def at_once(self) -> int:
        """Suitable number of samples for one call."""
        return 8

    def __call__(self, samples: Array) -> Array:
        """Returns the costs (S,) or (S, N) of parameters (S, n)."""
        return self.cost(self.outcome(samples), self.task)

    def outcome(self, samples: Array) -> Outcome:
        """Returns the outcome of parameters (S, n)."""
        kinematics, limits = arm_and_limits(self.arm)
        times, joints = self.joints(samples)
        flat = joints.reshape(-1, joints.shape[2])
        poses = kinematics.poses(flat)
        shape = joints.shape[:2]

        def gaps() -> Array:
            centers = kinematics.sphere_centers(poses)
            radii = kinematics.spheres.radii
            distances = self._distances().distance(centers, np.zeros(len(radii), np.intp))
            least = (distances - radii).min(axis=1)
            return least.reshape(shape) - GRID_ERROR

        return Outcome(
            times,
            poses.hand_position.reshape(*shape, 3),
            joints=joints,
            joint_limits=np.stack((limits.position_lower, limits.position_upper)),
            arm_distances=gaps,
        )

    def joints(self, samples: Array) -> tuple[Array, Array]:
        """Returns times (N,) [s] and the arm's joints (S, N, 5) [rad]."""
        kinematics, limits = arm_and_limits(self.arm)
        parameters, duration = self.parameters, self.parameters.primitive.duration
        times = self.time_step * np.arange(number_of_steps(duration, self.time_step) + 1.0)
        profile = parameters.primitive.posture
        assert profile is not None
        nominal = profile.basis(times / duration) @ parameters.posture_weights(samples)
        if self.led_by == "joints":
            return times, np.clip(nominal, limits.position_lower, limits.position_upper)
        paths = roll_out(parameters, samples, self.time_step).positions
        return times, batch_inverse_kinematics(kinematics, limits, paths, nominal, self.time_step)

    def primitive_at(self, parameters: Array) -> MovementPrimitive:
        """Returns a primitive of the whole arm's motion with parameters (n,).

        Its orientation and posture are the arm's; its duration is extended where joints would be
        too fast.
        """
        times, joints = self.joints(parameters[None])
        kinematics, limits = arm_and_limits(self.arm)
        needed = float(minimum_duration(joints[0], limits.velocity, limits.acceleration))
        name = self.parameters.primitive.name
        return fit_primitive_to_joint_path(kinematics, joints[0], max(times[-1], needed), name)

    def measure(self, parameters: Array) -> dict[str, float]:
        """Returns the terms of the cost of parameters (n,), before the weights.

        With obstacles they include `arm_clearance`: the least distance of the arm's own shapes to
        them [m], exact below 3 cm.
        """
        measured = terms_of(self.cost, self.outcome(parameters[None]), self.task)
        if self.task.obstacles is not None:
            joints = self.joints(parameters[None])[1][0]
            gaps = arm_shapes(self.arm).distances(joints, self.task.obstacles)
            measured["arm_clearance"] = float(gaps.min())
        return measured

    def _distances(self) -> DistanceGrid:
        if self._grid is None:
            field = self.task.obstacles
            if field is None:
                raise InputError("cost: arm_to_obstacles needs obstacles")
            self._grid = distance_grid(self.arm, field)
        return self._grid


def distance_grid(arm: str, field: PointCloudDistance) -> DistanceGrid:
    """Returns the grid of distances to obstacles in an arm's workspace, in T."""
    region = arm_region(arm)
    far = np.full((1, np.prod(region.counts)), GRID_CAP)
    return DistanceGrid(region, far, [(field, RigidTransform())], GRID_CAP)


def arm_of(primitive: MovementPrimitive) -> str:
    """Returns "left" or "right": the arm whose joints a primitive has.

    Raises:
        InputError: It has none, others, or its start contradicts their forward kinematics.
    """
    names = primitive.posture.names if primitive.posture is not None else ()
    for arm in ("left", "right"):
        if names == arm_joints(arm):
            assert primitive.posture is not None
            kinematics, _ = arm_and_limits(arm)
            hand = kinematics.poses(primitive.posture.at([0.0])).hand_position[0]
            off = float(np.linalg.norm(hand - primitive.start))
            if off > 0.02:
                raise InputError(
                    f"{primitive.name}: it starts {1000 * off:.0f} mm from where its joints put the"
                    " hand; positions must be in the torso frame"
                )
            return arm
    raise InputError(
        f"{primitive.name}: it has no joints of an arm; learn it from a demonstration with a"
        " joints.csv"
    )


@lru_cache(maxsize=2)
def arm_and_limits(arm: str) -> tuple[ArmKinematics, CommandLimits]:
    """Returns an arm's kinematics, and the limits of its joints; computed once per process."""
    model = shared_control_model()
    limits = model.command_limits(arm_joints(arm), speed_fraction=SPEED_FRACTION)
    return arm_kinematics(model, arm), limits


@lru_cache(maxsize=2)
def arm_shapes(arm: str) -> ExactDistance:
    """Returns an arm's shapes; computed once per process."""
    return ExactDistance(shared_control_model(), arm_and_limits(arm)[0])
