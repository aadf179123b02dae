"""Differential inverse kinematics of one arm as a system."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, BusValue, Context, InputPort

from pepper_drake.models.control_model import ControlModel
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.compiled_ik import CompiledIk
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams, hand_key
from pepper_drake.systems.framework import LeafSystem


class ArmDifferentialIk(LeafSystem):
    """Computes joint velocities from the hand's next pose in the torso frame (see `CompiledIk`).

    .. pydrake_system::

        name: ArmDifferentialIk
        input_ports:
        - position
        - nominal_posture
        - desired_cartesian_poses
        output_ports:
        - commanded_velocity

    The ports are those of Drake's DifferentialInverseKinematicsSystem for the arm's joints alone:
    `position` and `nominal_posture` (5), rad, `desired_cartesian_poses` a bus with X_TH under
    `hand_key(arm)`, `commanded_velocity` (5), rad/s.

    Args:
        model: Pepper.
        arm: "left" or "right".
        params: Weights and limits.
    """

    def __init__(self, model: ControlModel, arm: str, params: DifferentialIkParams) -> None:
        super().__init__()
        self._key = hand_key(arm)
        self._ik = CompiledIk(model, arm_kinematics(model, arm).chain, arm, params)
        self._position: InputPort = self.DeclareVectorInputPort("position", 5)
        self._nominal: InputPort = self.DeclareVectorInputPort("nominal_posture", 5)
        self._poses: InputPort = self.DeclareAbstractInputPort(
            "desired_cartesian_poses", Value(BusValue())
        )
        ports = (self._position, self._nominal, self._poses)
        self.DeclareVectorOutputPort(
            "commanded_velocity",
            5,
            self._calc_velocity,
            prerequisites_of_calc={port.ticket() for port in ports},
        )

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        X_TH = self._poses.Eval(context).Find(self._key)
        output.SetFromVector(
            self._ik.velocity(
                np.asarray(self._position.Eval(context)),
                np.asarray(self._nominal.Eval(context)),
                X_TH.translation(),
                X_TH.rotation().ToQuaternion().wxyz(),
            )
        )
