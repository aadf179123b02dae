"""Parameters of one arm's differential inverse kinematics, and its limits."""

import math
from dataclasses import dataclass

from pydrake.planning import JointLimits

from pepper_drake.models.control_model import CONTROL_PERIOD, ControlModel, arm_joints
from pepper_drake.models.pepper import coupled_limits, hand_frame


@dataclass
class DifferentialIkParams:
    """Weights and limits of the arm's inverse kinematics.

    Each tick solves, for the arm's five joint velocities v,

        min  position_weight |p-dot_d - J_p v|^2 + orientation_weight |w_d - J_w v|^2
             + |P (v - posture_gain (q_nominal - q))|^2

    Position comes first: an error of 1 cm/s weighs as much as one of
    0.01 sqrt(position_weight / orientation_weight) = 0.45 rad/s of direction. The posture term's
    unit weight is at once the damping near the singular poses: a direction in which the hand
    hardly moves, |J u| << position_weight^-1/2 = 0.007 m/rad, is left to the posture.
    """

    time_step: float = CONTROL_PERIOD
    """Period of the controller [s]."""
    position_weight: float = 2e4
    orientation_weight: float = 10.0
    posture_gain: float = 5.0
    """Pull to the nominal posture [1/s]."""
    tracking_rate: float = 40.0
    """Rate at which the hand's pose error is made up for, 1/s. The hand's velocity is fed forward
    besides, so that this costs no lag; much faster, the acceleration limits of the joint commands
    would turn the loop into an oscillator."""
    speed_fraction: float = 0.5
    """Share of the rated joint velocities that may be used."""
    limit_margin: float = 1e-3
    """Distance to a position limit at which motion towards it ends [rad]."""
    limit_influence: float = 0.1
    """Distance to a position limit from which on motion towards it is slowed [rad]."""
    linear_velocity_limit: float = 1.0
    """Per axis of the torso frame [m/s]."""
    angular_velocity_limit: float = 3.0
    """Per axis of the torso frame [rad/s]."""
    target_time_constant: float = 0.1
    """With which the command follows a joint target [s]."""
    catch_up_steps: int = 4
    """Control periods in which the command catches up with an arm that is led."""

    @property
    def tracking_gain(self) -> float:
        """Share of the hand's pose error that is made up for in one tick, below 1."""
        return -math.expm1(-self.tracking_rate * self.time_step)


def hand_key(arm: str) -> str:
    """The hand's scoped frame name, the key of its pose on the bus `desired_cartesian_poses`."""
    return f"pepper::{hand_frame(arm)}"


def arm_joint_limits(model: ControlModel, arm: str, params: DifferentialIkParams) -> JointLimits:
    """Limits of the plant's joints (18) that the arm's inverse kinematics keeps.

    The solver knows only constant limits: an elbow's roll gets those that every elbow yaw allows.
    The 11 degrees that some yaws would allow besides are at the folded end, where the hand is
    nearest to the shoulder.
    """
    rated = JointLimits(model.plant)
    lower, upper = rated.position_lower(), rated.position_upper()
    rows = model.position_indices(arm_joints(arm))
    for coupled in coupled_limits(arm_joints(arm)):
        lower[rows[coupled.follower]], upper[rows[coupled.follower]] = coupled.strictest
    return JointLimits(
        position_lower=lower,
        position_upper=upper,
        velocity_lower=params.speed_fraction * rated.velocity_lower(),
        velocity_upper=params.speed_fraction * rated.velocity_upper(),
        acceleration_lower=rated.acceleration_lower(),
        acceleration_upper=rated.acceleration_upper(),
    )
