"""A person's hand that guides a hand of the served robot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant

from pepper_drake.models.pepper import ARMS, hand_frame
from pepper_drake.systems.guiding.external_force import force_at
from pepper_drake.systems.guiding.guide_target import velocity_to
from pepper_drake.systems.guiding.hand_guide import HandGuideParams, guide_force
from pepper_drake.systems.guiding.velocity_guide import GuideLimits, step_guide

_FOLLOWING = {"time_constant": 0.15, "max_speed": 0.35, "max_turn_rate": 1.5}
"""Motion of the person's hand to its target [s, m/s, rad/s]."""


class LedHand:
    """A person's hold on a hand: a spring-damper from a guide that follows a target.

    The guide's pose is the only state; it starts at the hand's pose.
    """

    def __init__(self, plant: MultibodyPlant, time_step: float) -> None:
        """Finds the hands.

        Args:
            plant: Of the robot, finalized.
            time_step: Time between two steps [s].
        """
        self._time_step, self._params = time_step, HandGuideParams()
        self._turning_freely = replace(
            self._params, rotational_stiffness=0.0, rotational_damping=0.0
        )
        self._frames = {arm: plant.GetFrameByName(hand_frame(arm)) for arm in ARMS}
        self._arm, self._guide = "", RigidTransform()

    def let_go(self) -> None:
        """Releases the hand; the next hold starts at the hand's pose at that time."""
        self._arm = ""

    def step(
        self,
        arm: str,
        target: npt.NDArray[np.float64],
        X_WT: RigidTransform,
        body_poses: Sequence[RigidTransform],
        body_velocities: Sequence[SpatialVelocity],
    ) -> ExternallyAppliedSpatialForce:
        """Moves the guide by one step and returns its force on the hand.

        Args:
            arm: "left" or "right".
            target: (6,) Pose of the hand in T: x, y, z [m], roll, pitch, yaw [rad]; NaN angles
                leave the orientation free.
            X_WT: Pose of the torso.
            body_poses: X_WB of the plant's bodies.
            body_velocities: V_WB of the plant's bodies.
        """
        frame = self._frames[arm]
        body, X_BH = frame.body().index(), frame.GetFixedPoseInBodyFrame()
        X_WH = body_poses[body] @ X_BH
        X_TH = X_WT.InvertAndCompose(X_WH)
        if arm != self._arm:
            self._arm, self._guide = arm, X_TH
        turns_freely = bool(np.isnan(target[3:]).any())
        R_TG = X_TH.rotation() if turns_freely else RollPitchYaw(target[3:]).ToRotationMatrix()
        velocity = velocity_to(self._guide, RigidTransform(R_TG, target[:3]), **_FOLLOWING)
        self._guide = step_guide(self._guide, velocity, X_TH, self._time_step, GuideLimits())
        R_WT = X_WT.rotation()
        force = guide_force(
            X_WH,
            body_velocities[body].Shift(body_poses[body].rotation() @ X_BH.translation()),
            X_WT @ self._guide,
            SpatialVelocity(w=R_WT @ velocity[:3], v=R_WT @ velocity[3:]),
            self._turning_freely if turns_freely else self._params,
        )
        return force_at(frame, force.get_coeffs())
