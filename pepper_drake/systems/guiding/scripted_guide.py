"""A scripted hand guide: a smooth trajectory through via poses."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.framework import Context
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.systems.framework import LeafSystem


class GuidePath:
    """A trajectory X_WG through via poses, at rest at both ends.

    Position and quaternion are cubic splines with continuous acceleration; the quaternion is
    normalised afterwards, which keeps the orientation smooth and the via poses exact.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[RigidTransform]) -> None:
        """Makes the trajectory.

        Args:
            times: N increasing times [s], N >= 3.
            poses: N poses X_WG.
        """
        quaternions = [X.rotation().ToQuaternion().wxyz() for X in poses]
        for k in range(1, len(quaternions)):
            if quaternions[k] @ quaternions[k - 1] < 0.0:
                quaternions[k] = -quaternions[k]
        rows = [np.r_[X.translation(), q] for X, q in zip(poses, quaternions, strict=True)]
        rest = np.zeros((7, 1))
        self._path = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
            list(times), [row.reshape(7, 1) for row in rows], rest, rest
        )
        self._rate = self._path.MakeDerivative()

    @property
    def end_time(self) -> float:
        """Time at which the guide comes to rest [s]."""
        return self._path.end_time()

    def pose(self, time: float) -> RigidTransform:
        """Returns X_WG; the guide is at rest before the start and after the end."""
        row = self._path.value(time).ravel()
        q = row[3:] / np.linalg.norm(row[3:])
        return RigidTransform(RotationMatrix(Quaternion(q)), row[:3])

    def velocity(self, time: float) -> SpatialVelocity:
        """Returns V_WG, the velocity of the guide's frame in the world [rad/s, m/s]."""
        if not self._path.start_time() < time < self._path.end_time():
            return SpatialVelocity.Zero()
        row, rate = self._path.value(time).ravel(), self._rate.value(time).ravel()
        norm = np.linalg.norm(row[3:])
        q = row[3:] / norm
        # The component of the rate along q only changes the norm, which normalising removes.
        q_rate = (rate[3:] - q * (q @ rate[3:])) / norm
        return SpatialVelocity(w=_angular_velocity(q, q_rate), v=rate[:3])


class ScriptedGuide(LeafSystem):
    """Plays a GuidePath.

    .. pydrake_system::

        name: ScriptedGuide
        output_ports:
        - guide_pose
        - guide_velocity

    `guide_pose` is X_WG (RigidTransform), `guide_velocity` V_WG (SpatialVelocity).

    Args:
        path: Pose over time.
    """

    def __init__(self, path: GuidePath) -> None:
        super().__init__()
        self._path = path
        now = {self.time_ticket()}
        self.guide_pose_output = self.DeclareAbstractOutputPort(
            "guide_pose", lambda: Value(RigidTransform()), self._calc_pose, now
        )
        self.guide_velocity_output = self.DeclareAbstractOutputPort(
            "guide_velocity", lambda: Value(SpatialVelocity()), self._calc_velocity, now
        )

    def _calc_pose(self, context: Context, output: Value) -> None:
        output.set_value(self._path.pose(context.get_time()))

    def _calc_velocity(self, context: Context, output: Value) -> None:
        output.set_value(self._path.velocity(context.get_time()))


def _angular_velocity(
    q: npt.NDArray[np.float64], q_rate: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Returns the angular velocity in the world of a unit quaternion (w, x, y, z) and its rate."""
    w, v = q[0], q[1:]
    w_rate, v_rate = q_rate[0], q_rate[1:]
    return 2.0 * (w * v_rate - w_rate * v - np.cross(v_rate, v))
