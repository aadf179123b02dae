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

    Position takes precedence: an error of 1 cm/s weighs as much as an orientation error of
    0.01 sqrt(position_weight / orientation_weight) = 0.45 rad/s. The posture term, of unit weight,
    is also the damping near singularities: a joint direction u in which the hand hardly moves,
    |J u| << position_weight^-1/2 = 0.007 m/rad, is left to the posture.
    """

    time_step: float = CONTROL_PERIOD
    """Period of the controller [s]."""
    position_weight: float = 2e4
    orientation_weight: float = 10.0
    posture_gain: float = 5.0
    """Gain towards the nominal posture [1/s]."""
    tracking_rate: float = 40.0
    """Rate at which the hand's pose error is corrected [1/s]. The hand's velocity is fed forward,
    so that this gain causes no lag; at a much larger one, the acceleration limits of the joint
    commands would make the loop oscillate."""
    speed_fraction: float = 0.5
    """Fraction of the rated joint velocities that may be used."""
    limit_margin: float = 1e-3
    """Distance to a position limit at which motion towards it ends [rad]."""
    limit_influence: float = 0.1
    """Distance to a position limit below which motion towards it is slowed down [rad]."""
    linear_velocity_limit: float = 1.0
    """Limit of the hand's velocity per axis of the torso frame [m/s]."""
    angular_velocity_limit: float = 3.0
    """Limit of the hand's angular velocity per axis of the torso frame [rad/s]."""
    target_time_constant: float = 0.1
    """Time constant with which the command follows a joint target [s]."""
    catch_up_steps: int = 4
    """Control periods in which the command catches up with an arm that is guided by hand."""

    @property
    def tracking_gain(self) -> float:
        """Fraction of the hand's pose error that is corrected in one tick, below 1."""
        return -math.expm1(-self.tracking_rate * self.time_step)


def hand_key(arm: str) -> str:
    """Returns the hand's scoped frame name, its key on the bus `desired_cartesian_poses`."""
    return f"pepper::{hand_frame(arm)}"


def arm_joint_limits(model: ControlModel, arm: str, params: DifferentialIkParams) -> JointLimits:
    """Returns the limits of the plant's joints (18) that the arm's inverse kinematics keeps.

    The solver supports only constant limits: an elbow roll gets those that hold for every elbow
    yaw. The 11 degrees lost at some yaws are at the folded end, where the hand is nearest to the
    shoulder.
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
