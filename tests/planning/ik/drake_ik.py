"""Drake's own inverse kinematics of one arm, the witness of the compiled one."""

import numpy as np
from pydrake.multibody.inverse_kinematics import DifferentialInverseKinematicsSystem
from pydrake.multibody.math import SpatialVelocity
from pydrake.planning import DofMask, JointLimits

from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.planning.ik.differential_ik import (
    DifferentialIkParams,
    arm_joint_limits,
    hand_key,
)


def make_differential_ik(
    model: ControlModel, arm: str, params: DifferentialIkParams
) -> DifferentialInverseKinematicsSystem:
    """Makes the system that turns the hand's next pose in the torso frame into joint velocities.

    Ports (Drake's): `position` and `nominal_posture` are plant positions (18,),
    `desired_cartesian_poses` a bus with X_TH under `hand_key(arm)`; `commanded_velocity` has the
    arm's five joints, shoulder to wrist.

    Position is weighed over direction by two least-squares costs. Two joint-centering costs,
    each blind to one rotation axis only, together pull every joint to the nominal posture with
    unit weight, which damps the singular poses (see `DifferentialIkParams`).
    """
    dik = DifferentialInverseKinematicsSystem
    key = hand_key(arm)
    translation = {key: np.array([0.0, 0, 0, 1, 1, 1])}
    rotation = {key: np.array([1.0, 1, 1, 0, 0, 0])}

    indices = model.position_indices(arm_joints(arm))
    mask = DofMask([k in indices for k in range(model.plant.num_positions())])
    limits = arm_joint_limits(model, arm, params)

    recipe = dik.Recipe()
    recipe.AddIngredient(
        dik.LeastSquaresCost(
            dik.LeastSquaresCost.Config(
                cartesian_qp_weight=params.position_weight, cartesian_axis_masks=translation
            )
        )
    )
    recipe.AddIngredient(
        dik.LeastSquaresCost(
            dik.LeastSquaresCost.Config(
                cartesian_qp_weight=params.orientation_weight, cartesian_axis_masks=rotation
            )
        )
    )
    for axis in range(2):
        blind = np.zeros(6)
        blind[axis] = 1
        recipe.AddIngredient(
            dik.JointCenteringCost(
                dik.JointCenteringCost.Config(
                    posture_gain=params.posture_gain, cartesian_axis_masks={key: blind}
                )
            )
        )
    recipe.AddIngredient(
        dik.JointVelocityLimitConstraint(
            dik.JointVelocityLimitConstraint.Config(
                min_margin=params.limit_margin, influence_margin=params.limit_influence
            ),
            JointLimits(limits, mask),
        )
    )
    return dik(
        recipe=recipe,
        task_frame="pepper::torso",
        collision_checker=model.make_collision_checker(),
        active_dof=mask,
        time_step=params.time_step,
        K_VX=params.tracking_gain,
        Vd_TG_limit=SpatialVelocity(
            w=[params.angular_velocity_limit] * 3, v=[params.linear_velocity_limit] * 3
        ),
    )
