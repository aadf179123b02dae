"""A trajectory that starts on a trigger."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, InputPort
from pydrake.trajectories import Trajectory

from pepper_drake.systems.framework import LeafSystem


class TriggeredTrajectory(LeafSystem):
    """Plays a trajectory from when its trigger is first set; until then it stays at the start.

    .. pydrake_system::

        name: TriggeredTrajectory
        input_ports:
        - trigger
        output_ports:
        - desired_state

    Input: `trigger` (1), 0 or 1. Output: `desired_state` (2 n), value and rate of the trajectory.
    State: the same, and the time of the trigger [s] (NaN before), at `time_step`.

    Args:
        path: A trajectory of n rows, from time 0.
        time_step: [s].
    """

    def __init__(self, path: Trajectory, *, time_step: float = 0.01) -> None:
        super().__init__()
        self._path, self._rate, self._time_step = path, path.MakeDerivative(), time_step
        start = path.value(path.start_time())[:, 0]
        self.trigger_input: InputPort = self.DeclareVectorInputPort("trigger", 1)
        self._desired = self.DeclareDiscreteState(np.concatenate((start, np.zeros(len(start)))))
        self._begin = self.DeclareDiscreteState([np.nan])
        self.DeclareStateOutputPort("desired_state", self._desired)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        time = context.get_time()
        begin = context.get_discrete_state(self._begin).value()[0]
        if np.isnan(begin):
            if self.trigger_input.Eval(context)[0] < 0.5:
                return
            begin = time
            discrete_state.set_value(self._begin, [begin])
        played = time + self._time_step - begin
        moving = self._path.start_time() <= played <= self._path.end_time()
        value = self._path.value(np.clip(played, self._path.start_time(), self._path.end_time()))
        rate = self._rate.value(played) if moving else np.zeros_like(value)
        discrete_state.set_value(self._desired, np.concatenate((value[:, 0], rate[:, 0])))
