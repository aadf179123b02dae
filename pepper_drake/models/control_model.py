"""Pepper's model for its controllers: kinematics without a scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import (
    CollisionCheckerParams,
    RobotDiagram,
    RobotDiagramBuilder,
    SceneGraphCollisionChecker,
)
from pydrake.systems.framework import Context

from pepper_drake.models.pepper import (
    BODY_JOINTS,
    JOINT_GROUPS,
    CoupledLimit,
    add_pepper,
    coupled_limits,
)

CONTROL_PERIOD = 0.02
"""Period of joint commands [s]: that of NAOqi's ALMotion."""

Vector = npt.NDArray[np.float64]


def arm_joints(arm: str) -> tuple[str, ...]:
    """Returns the five joint names of `arm` ("left" or "right"), shoulder to wrist."""
    return JOINT_GROUPS[f"{arm}_arm"]


def body_indices(names: Sequence[str]) -> list[int]:
    """Returns the indices of joints in a vector over `BODY_JOINTS`."""
    return [BODY_JOINTS.index(name) for name in names]


class LimitArrays(NamedTuple):
    """`CommandLimits` of n joints with C coupled limits, for compiled code.

    Attributes:
        lower: (n,) position limits [rad].
        upper: (n,) position limits [rad].
        velocity: (n,) [rad/s].
        acceleration: (n,) [rad/s^2].
        pairs: (C, 2) indices of leader and follower.
        strictest: (C, 2) limits of the follower that are valid for any leader position [rad].
        tables: (C, 3, K) positions of the leader, and the follower's limits there [rad].
    """

    lower: Vector
    upper: Vector
    velocity: Vector
    acceleration: Vector
    pairs: npt.NDArray[np.int64]
    strictest: Vector
    tables: Vector


@dataclass(frozen=True)
class CommandLimits:
    """Limits of some joints, each an array of shape (n,), in rad, rad/s and rad/s^2."""

    position_lower: Vector
    position_upper: Vector
    velocity: Vector
    acceleration: Vector
    coupled: tuple[CoupledLimit, ...] = ()
    """Limits of a joint that depend on another's position, by their indices among these joints."""

    @cached_property
    def arrays(self) -> LimitArrays:
        """Returns the limits for compiled code."""
        coupled = self.coupled
        longest = max((len(one.positions) for one in coupled), default=1)
        tables = np.empty((len(coupled), 3, longest))
        for table, one in zip(tables, coupled, strict=True):
            # Beyond the last node the limits are constant, so it can be repeated as padding.
            for row, values in zip(table, (one.positions, one.lower, one.upper), strict=True):
                row[:] = np.pad(values, (0, longest - len(values)), mode="edge")
        return LimitArrays(
            self.position_lower,
            self.position_upper,
            self.velocity,
            self.acceleration,
            np.array([(one.leader, one.follower) for one in coupled], int).reshape(-1, 2),
            np.array([one.strictest for one in coupled]).reshape(-1, 2),
            tables,
        )


class ControlModel:
    """Pepper alone, with its base at the pose given by the positions.

    The model is immutable after construction; all state is in contexts made by `create_context`,
    so that one model serves many systems and threads.

    Attributes:
        plant: The finalized plant, 18 positions with v = q-dot.
        diagram: The plant with its scene graph.
    """

    def __init__(self) -> None:
        builder = RobotDiagramBuilder(time_step=0.0)
        self.plant: MultibodyPlant = builder.plant()
        self.model_instance = add_pepper(self.plant)
        self.plant.Finalize()
        self.diagram: RobotDiagram = builder.Build()
        self._joint_index = {
            self.plant.get_joint(index).name(): self.plant.get_joint(index).position_start()
            for index in self.plant.GetJointIndices(self.model_instance)
            if self.plant.get_joint(index).num_positions() == 1
        }
        self._body_index = self.position_indices(BODY_JOINTS)
        self._base_index = self.position_indices(JOINT_GROUPS["base"])
        self._num_positions: int = self.plant.num_positions()
        self._frame = cache(self.plant.GetFrameByName)
        self._context: Context = self.plant.CreateDefaultContext()

    def create_context(self) -> Context:
        """Returns a new context of the plant."""
        return self._context.Clone()

    def make_collision_checker(self) -> SceneGraphCollisionChecker:
        """Returns a checker for self-collisions; each owns a new model."""
        builder = RobotDiagramBuilder(time_step=0.0)
        model_instance = add_pepper(builder.plant())
        builder.plant().Finalize()
        return SceneGraphCollisionChecker(
            CollisionCheckerParams(
                model=builder.Build(),
                robot_model_instances=[model_instance],
                edge_step_size=0.1,
                implicit_context_parallelism=False,
            )
        )

    def position_indices(self, names: Sequence[str]) -> list[int]:
        """Returns the indices of joints in the plant's position vector."""
        return [self._joint_index[name] for name in names]

    def positions(self, joint_position: Vector, base_pose: Vector) -> Vector:
        """Returns plant positions (18,) from `BODY_JOINTS` angles (15,) and base x, y, yaw."""
        q = np.empty(self._num_positions)
        q[self._body_index] = joint_position
        q[self._base_index] = base_pose
        return q

    def pose(
        self, context: Context, frame_name: str, relative_to: str | None = None
    ) -> RigidTransform:
        """Returns the pose X_RF of a frame in another (the world if omitted)."""
        frame = self._frame(frame_name)
        if relative_to is None:
            return frame.CalcPoseInWorld(context)
        return frame.CalcPose(context, self._frame(relative_to))

    def command_limits(
        self, names: Sequence[str], *, speed_fraction: float = 1.0, acceleration: float = 10.0
    ) -> CommandLimits:
        """Returns the limits of the named joints, with scaled velocities.

        Args:
            names: Joint names.
            speed_fraction: Fraction of the rated velocity that may be used.
            acceleration: Limit for every joint [rad/s^2]. There is no source for Pepper; the
                default is half of what the shoulder's rated effort achieves with a stretched arm.
        """
        joints = [self.plant.GetJointByName(name) for name in names]
        return CommandLimits(
            position_lower=np.array([joint.position_lower_limit() for joint in joints]),
            position_upper=np.array([joint.position_upper_limit() for joint in joints]),
            velocity=speed_fraction * np.array([joint.velocity_upper_limit() for joint in joints]),
            acceleration=np.full(len(names), acceleration),
            coupled=coupled_limits(names),
        )


@lru_cache(maxsize=1)
def shared_control_model() -> ControlModel:
    """Returns the immutable model shared by all systems of a process."""
    return ControlModel()
