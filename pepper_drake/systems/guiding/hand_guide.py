"""A virtual guide that holds the robot's hand by a spring and a damper."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.guiding.external_force import force_at


@dataclass(frozen=True)
class HandGuideParams:
    """Stiffness and damping of the guide's grip; about those of a person.

    A distance of 5 cm pulls with 30 N, an angle of 60 degrees with 3 N m. The limits keep a distant
    guide from jerking the arm.
    """

    stiffness: float = 600.0  # [N/m]
    damping: float = 20.0  # [N s/m]
    rotational_stiffness: float = 3.0  # [N m/rad]
    rotational_damping: float = 0.05  # [N m s/rad]
    max_force: float = 30.0  # [N]
    max_torque: float = 3.0  # [N m]


def guide_force(
    X_WH: RigidTransform,
    V_WH: SpatialVelocity,
    X_WG: RigidTransform,
    V_WG: SpatialVelocity,
    params: HandGuideParams,
) -> SpatialForce:
    """Returns the spring and damper force of a guide pose G on the hand frame H, at Ho, in W.

    f = k (p_WG - p_WH) + d (v_WG - v_WH), tau = k_r theta a + d_r (w_WG - w_WH), where theta a is
    the rotation vector from H to G; both are limited in magnitude.
    """
    force = params.stiffness * (X_WG.translation() - X_WH.translation())
    force += params.damping * (V_WG.translational() - V_WH.translational())
    turn = (X_WG.rotation() @ X_WH.rotation().inverse()).ToAngleAxis()
    torque = params.rotational_stiffness * turn.angle() * turn.axis()
    torque += params.rotational_damping * (V_WG.rotational() - V_WH.rotational())
    return SpatialForce(
        tau=_limited(torque, params.max_torque), f=_limited(force, params.max_force)
    )


class HandGuide(LeafSystem):
    """Pulls a hand towards a guide pose through the plant's applied spatial forces.

    .. pydrake_system::

        name: HandGuide
        input_ports:
        - body_poses
        - body_spatial_velocities
        - guide_pose
        - guide_velocity (optional)
        - holding (optional)
        output_ports:
        - spatial_forces
        - force

    The first two inputs are the plant's ports of these names. `guide_pose` is X_WG
    (RigidTransform), `guide_velocity` V_WG (SpatialVelocity; zero if unconnected). While `holding`
    (1; optional) is 0 the guide has released the hand.
    `spatial_forces` goes to the plant's applied_spatial_force port; `force` (6) is the same as
    torque [N m] and force [N] on H in W. The force is sampled every `time_step` and held, so that
    Python does not run at the plant's rate. Before the first sample it is zero.
    """

    def __init__(
        self, frame: Frame, params: HandGuideParams | None = None, time_step: float = 0.005
    ) -> None:
        """Makes the guide.

        Args:
            frame: The frame H on the robot, of a finalized plant.
            params: Spring and damper.
            time_step: Period of the held force [s].
        """
        super().__init__()
        self._params = params or HandGuideParams()
        self._frame, self._body_index = frame, frame.body().index()
        self._X_BH = frame.GetFixedPoseInBodyFrame()
        self.body_poses_input = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self.body_spatial_velocities_input = self.DeclareAbstractInputPort(
            "body_spatial_velocities", Value([SpatialVelocity()])
        )
        self.guide_pose_input = self.DeclareAbstractInputPort("guide_pose", Value(RigidTransform()))
        self.guide_velocity_input = self.DeclareAbstractInputPort(
            "guide_velocity", Value(SpatialVelocity())
        )
        self.holding_input = self.DeclareVectorInputPort("holding", 1)
        self._force = self.DeclareDiscreteState(6)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
        held = {self.discrete_state_ticket(self._force)}
        self.spatial_forces_output = self.DeclareAbstractOutputPort(
            "spatial_forces",
            lambda: Value([ExternallyAppliedSpatialForce()]),
            self._calc_spatial_forces,
            held,
        )
        self.force_output = self.DeclareVectorOutputPort("force", 6, self._calc_force, held)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        if self.holding_input.HasValue(context) and not self.holding_input.Eval(context)[0]:
            state.set_value(self._force, np.zeros(6))
            return
        X_WB = self.body_poses_input.Eval(context)[self._body_index]
        V_WB = self.body_spatial_velocities_input.Eval(context)[self._body_index]
        V_WG = SpatialVelocity.Zero()
        if self.guide_velocity_input.HasValue(context):
            V_WG = self.guide_velocity_input.Eval(context)
        p_BoHo_W = X_WB.rotation() @ self._X_BH.translation()
        force = guide_force(
            X_WB @ self._X_BH,
            V_WB.Shift(p_BoHo_W),
            self.guide_pose_input.Eval(context),
            V_WG,
            self._params,
        )
        state.set_value(self._force, force.get_coeffs())

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._force).value())

    def _calc_spatial_forces(self, context: Context, output: Value) -> None:
        force = context.get_discrete_state(self._force).value()
        output.set_value([force_at(self._frame, force)])


def _limited(vector: npt.NDArray[np.float64], limit: float) -> npt.NDArray[np.float64]:
    return vector * min(1.0, limit / max(float(np.linalg.norm(vector)), 1e-12))
