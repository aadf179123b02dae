"""The input of planning and supervision at one moment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.pepper import BODY_JOINTS, JOINT_GROUPS
from pepper_drake.perception.mapping.depth_validity import FAULT_SENTENCES, DepthFault
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.safety.command_check import StopReason
from pepper_drake.short_repr import short_repr, short_signature

Vector = npt.NDArray[np.float64]

HIP_PITCH = BODY_JOINTS.index("HipPitch")
"""Index of the hip's joint that leans the torso forward."""
_HEAD = [BODY_JOINTS.index(name) for name in JOINT_GROUPS["head"]]
_FUTURE = -0.1
"""An image of a lower age was stamped by a wrong clock [s]."""


def _no_points() -> Vector:
    return np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class Observation:
    """Measurements, obstacle cloud and commands at one moment; immutable.

    All but the first five have defaults, which mean "no problem".

    Attributes:
        time: [s].
        base_pose: (3,) x, y, yaw of the base in W [m, rad].
        joint_position: (15,) measured, in the order of `BODY_JOINTS` [rad].
        arm: Command of the reaching arm's joints, from which a movement starts [rad, rad/s].
        X_WO: Pose of the goal object.
        cloud: (P, 3) obstacles in W [m].
        predicted_cloud: (Q, 3) predicted positions of moving obstacles near the goal, in W [m].
        cloud_time: Capture time of the last depth image in the cloud [s]; not finite before it.
        cloud_fault: Why the last depth image was not used.
        space: Free, occupied and unknown space; None without cameras: all space is known.
        goal_valid: Whether there is an estimate of the goal object's pose.
        goal_age: Time since the goal object's marker was last seen [s].
        image_ages: (2,) age of the newest usable image of the top and the bottom camera [s]; while
            the goal is seen, only one of them takes images.
        search_delay: Time for which the search for the goal has waited for images [s].
        goal_position: (3,) the hand's goal in T [m].
        hand_position: (3,) measured, in T [m].
        measured_arm: (5,) measured joints of the arm [rad]; None to skip their comparison.
        head_command: (2,) commanded HeadYaw and HeadPitch [rad]; None to skip their comparison.
        desired_position: (3,) of the hand, from the primitive, in T [m]; None if unknown.
        base_arrived: Whether the base has arrived at its goal.
        tau: Duration of the present movement [s].
        stop_reason: Why the safety monitor stopped the robot.
        stop_joint: Name of the joint that caused the stop, "" for none.
        base_blocked: Whether the base waits for an obstacle on its path.
        predicted_clearance: Clearance to the predicted positions of moving obstacles that the arm's
            own motion leads to [m].
    """

    __repr__ = short_repr
    __signature__ = short_signature

    time: float
    base_pose: Vector
    joint_position: Vector
    arm: ArmState
    X_WO: RigidTransform
    cloud: Vector = field(default_factory=_no_points)
    predicted_cloud: Vector = field(default_factory=_no_points)
    cloud_time: float = -np.inf
    cloud_fault: DepthFault = DepthFault.NONE
    space: SeenSpace | None = None
    goal_valid: bool = True
    goal_age: float = 0.0
    image_ages: Vector = field(default_factory=lambda: np.zeros(2))
    search_delay: float = 0.0
    goal_position: Vector = field(default_factory=lambda: np.zeros(3))
    hand_position: Vector = field(default_factory=lambda: np.zeros(3))
    measured_arm: Vector | None = None
    head_command: Vector | None = None
    desired_position: Vector | None = None
    base_arrived: bool = True
    tau: float = 1.0
    stop_reason: StopReason = StopReason.NONE
    stop_joint: str = ""
    base_blocked: bool = False
    predicted_clearance: float = np.inf

    @property
    def p_WO(self) -> Vector:
        """(3,) position of the goal object in W [m]."""
        position: Vector = self.X_WO.translation()
        return position

    @property
    def cloud_age(self) -> float:
        """Time since the last depth image [s]; infinite if there is none, or one of the future."""
        age = self.time - self.cloud_time
        return age if np.isfinite(age) and age > _FUTURE else np.inf

    @property
    def cloud_message(self) -> str:
        """Sentence that says why there is no cloud."""
        if self.cloud_fault != DepthFault.NONE:
            return FAULT_SENTENCES[self.cloud_fault]
        if np.isinf(self.cloud_age):
            return "the depth camera gave no image of the scene"
        return f"no depth image got into the cloud of obstacles for {self.cloud_age:.1f} s"

    @property
    def cloud_is_of_map(self) -> bool:
        """False if the cloud differs from the map's at the same image: stuck, or corrupted."""
        space = self.space
        if space is None or not space.views or space.views[-1].time != self.cloud_time:
            return True
        return np.array_equal(self.cloud.astype(np.float32), space.voxels.positions)

    @property
    def image_message(self) -> str:
        """Sentence that names the colour camera without a usable image."""
        age, camera = float(self.image_ages.max()), int(np.argmax(self.image_ages))
        words = f"the {('top', 'bottom')[camera]} camera gave no usable image"
        return words if np.isinf(age) else f"{words} for {age:.1f} s"

    @property
    def goal_distance(self) -> float:
        """Distance of the hand to its goal [m]."""
        return float(np.linalg.norm(self.goal_position - self.hand_position))

    @property
    def following_error(self) -> float:
        """Distance of the hand to its desired position [m]; 0 if that is unknown."""
        if self.desired_position is None:
            return 0.0
        return float(np.linalg.norm(self.desired_position - self.hand_position))

    @property
    def joint_error(self) -> Vector:
        """(5,) measured minus commanded joints of the arm [rad]; 0 if they are not compared."""
        if self.measured_arm is None:
            return np.zeros(5)
        return self.measured_arm - self.arm.position

    @property
    def head_error(self) -> Vector:
        """(2,) measured minus commanded joints of the head [rad]; 0 if they are not compared."""
        if self.head_command is None:
            return np.zeros(2)
        return self.joint_position[_HEAD] - self.head_command

    @cached_property
    def obstacles(self) -> Vector:
        """(P + Q, 3) the cloud and the predicted positions of moving obstacles, in W [m]."""
        return np.concatenate((self.cloud, self.predicted_cloud))

    @cached_property
    def known(self) -> PointCloudDistance:
        """Distances to the points of the cloud, to find new points in a later one."""
        return PointCloudDistance(self.cloud, extension=0.0)

    def with_cloud(self, cloud: Vector) -> Observation:
        """Returns the observation with a cloud (P, 3) [m] in place of all obstacles."""
        return replace(self, cloud=cloud, predicted_cloud=np.zeros((0, 3)))

    def with_arm(self, arm: ArmState) -> Observation:
        """Returns the observation with another arm command."""
        return replace(self, arm=arm)

    @property
    def hip_pitch(self) -> float:
        """Angle of the hip [rad]: negative when the torso leans forward."""
        return float(self.joint_position[HIP_PITCH])

    def with_hip_pitch(self, hip_pitch: float) -> Observation:
        """Returns the observation with the hip at another angle [rad]."""
        joints = self.joint_position.copy()
        joints[HIP_PITCH] = hip_pitch
        return replace(self, joint_position=joints)

    def leaning_to(self, hip_pitch: float | None) -> list[Observation]:
        """Returns the observation at five hip angles from now to another [rad]; none for None."""
        if hip_pitch is None:
            return []
        return [self.with_hip_pitch(a) for a in np.linspace(self.hip_pitch, hip_pitch, 5)]

    def from_base_pose(self, base_pose: Vector) -> Observation:
        """Returns the observation with the base at another pose (3,) [m, rad]."""
        return replace(self, base_pose=base_pose)
