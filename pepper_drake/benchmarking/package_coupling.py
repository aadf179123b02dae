"""The obstacle coupling of the package movement_primitives, for our primitives.

Its DMP and ours have the same equation: tau² y'' = alpha (beta (g - y) - tau y') + f + C_t, where
C_t is the output of its `obstacle_avoidance_acceleration_3d`. So its own function, with its own
constants, can drive our primitive. It takes one obstacle point: here the point of the cloud nearest
to the hand. The package is in the `bench` extra.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.learning.dmp.obstacle_coupling import CouplingOutput, Field, ReportCoupling

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PackageCoupling(ReportCoupling):
    """The package's coupling: the report's equation for one point; see the module.

    Attributes:
        gamma: Strength, the package's default.
        beta: Decay of the coupling with the angle, the package's default [1/rad].
    """

    gamma: float = 1000.0
    beta: float = 20.0 / np.pi

    def push(
        self,
        field: Field,
        state: Array,
        acceleration: Array,
        goal: Array,
        goal_clearance: float,
        tau: float,
    ) -> CouplingOutput:
        """Returns the package's coupling term; see `learning.Coupling`."""
        from movement_primitives.dmp import obstacle_avoidance_acceleration_3d

        hands = state.reshape(-1, 2, 3)
        coupling = np.zeros((len(hands), 3))
        if len(field.points):
            for k, (position, velocity) in enumerate(hands):
                nearest = np.argmin(np.sum((field.points - position) ** 2, axis=1))
                with np.errstate(invalid="ignore"):  # The hand heads exactly for the point.
                    push = obstacle_avoidance_acceleration_3d(
                        position, velocity, field.points[nearest], self.gamma, self.beta
                    )
                coupling[k] = np.nan_to_num(push)
        shape = state.shape[:-2]
        return CouplingOutput(
            coupling.reshape(*shape, 3), np.zeros(shape), field.distance(state[..., 0, :])
        )
