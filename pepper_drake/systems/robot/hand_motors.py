"""The motors that open and close the hands, simulated outside the plant."""

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from pepper_drake.models.hands import CLOSED, HAND_SPEED, OPEN, RELAXED
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


def next_opening(opening: Vector, command: Vector, duration: float) -> Vector:
    """Returns the openings after a time, each moved towards its command at the motors' speed.

    Args:
        opening: Openings (2,) from 0, closed, to 1, open.
        command: Desired openings (2,); NaN leaves a hand unchanged.
        duration: The time [s].
    """
    wanted = np.clip(np.where(np.isnan(command), opening, command), CLOSED, OPEN)
    step = HAND_SPEED * duration
    return opening + np.clip(wanted - opening, -step, step)


class HandMotors(LeafSystem):
    """Moves both hands' openings towards their commands at the motors' speed.

    .. pydrake_system::

        name: HandMotors
        input_ports:
        - command (optional)
        output_ports:
        - opening

    Input: `command` (2), from 0, closed, to 1, open, in the order of `HANDS`; NaN, or no
    connection, leaves a hand unchanged. Output: `opening` (2). State: the openings (2), every
    `period`; half open at first.

    Args:
        period: Time between two steps [s].
    """

    def __init__(self, period: float) -> None:
        super().__init__()
        self._period = period
        self._command = self.DeclareVectorInputPort("command", len(HANDS))
        self._state = self.DeclareDiscreteState(np.full(len(HANDS), RELAXED))
        self.DeclareVectorOutputPort(
            "opening", len(HANDS), self._calc, prerequisites_of_calc={self.xd_ticket()}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value())

    def _update(self, context: Context, values: DiscreteValues) -> None:
        if self._command.HasValue(context):
            opening = context.get_discrete_state(self._state).value()
            opening = next_opening(opening, self._command.Eval(context), self._period)
            values.set_value(int(self._state), opening)
