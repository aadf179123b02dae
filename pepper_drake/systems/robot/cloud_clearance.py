"""Clearance of the arm to the cloud."""

import numpy as np
from pydrake.common.value import Value
from pydrake.perception import PointCloud
from pydrake.systems.framework import Context, DiscreteValues, InputPort

from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.collision.own_approach import own_approach_clearance
from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.primitive.obstacle_field_cache import ObstacleFieldCache


class CloudClearance(LeafSystem):
    """Smallest distance between the arm, as spheres, and the cloud.

    .. pydrake_system::

        name: CloudClearance
        input_ports:
        - cloud
        - predicted_cloud (optional)
        - joint_position
        - joint_velocity
        - active (optional)
        output_ports:
        - clearance
        - approach_clearance
        - predicted_approach_clearance

    Inputs: `cloud` and `predicted_cloud`, PointClouds in the torso frame T; `joint_position` (5)
    and `joint_velocity` (5), the arm's [rad, rad/s]. Outputs: `clearance` (1) [m], the smallest of
    the distances to `cloud`, now and extrapolated by `lookahead` at this velocity, and of
    `predicted_approach_clearance`; `approach_clearance` (1) [m], the extrapolated distance to
    `cloud`, infinite unless the arm's own motion reduces it (`planning.collision.own_approach`);
    `predicted_approach_clearance` (1) [m], the same to `predicted_cloud`. All are infinite before
    the first tick, for an empty cloud, and while `active` (1) is 0: an arm at rest is not
    monitored. State: the three, every `time_step`.

    Predicted obstacles count only if the arm itself moves towards them: stopping an arm that is
    already inside one, or moves away, does not make it safer.

    Args:
        shapes: Shapes of the arm.
        extension: Downward extension of each point [m] (see `PointCloudDistance`); zero for none.
        lookahead: Time for which the arm's motion is extrapolated [s]: at least one period plus
            the arm's braking time.
        slowest_approach: Speed below which it is at rest [m/s]; see `own_approach_clearance`.
        time_step: [s].
    """

    def __init__(
        self,
        shapes: ExactDistance,
        *,
        extension: float = 0.0,
        lookahead: float = 0.1,
        slowest_approach: float = 0.01,
        time_step: float = 0.04,
    ) -> None:
        super().__init__()
        self._shapes, self._lookahead = shapes, lookahead
        self._slowest = slowest_approach
        self.cloud_input: InputPort = self.DeclareAbstractInputPort("cloud", Value(PointCloud()))
        self.predicted_cloud_input: InputPort = self.DeclareAbstractInputPort(
            "predicted_cloud", Value(PointCloud())
        )
        self.joint_position_input: InputPort = self.DeclareVectorInputPort("joint_position", 5)
        self.joint_velocity_input: InputPort = self.DeclareVectorInputPort("joint_velocity", 5)
        self.active_input: InputPort = self.DeclareVectorInputPort("active", 1)
        self._field = ObstacleFieldCache(self, self.cloud_input, extension=extension)
        self._predicted_field = ObstacleFieldCache(
            self, self.predicted_cloud_input, extension=extension
        )
        self._outputs = []
        for name in ("clearance", "approach_clearance", "predicted_approach_clearance"):
            self._outputs.append(self.DeclareDiscreteState([np.inf]))
            self.DeclareStateOutputPort(name, self._outputs[-1])
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        for state, value in zip(self._outputs, self._clearances(context), strict=True):
            discrete_state.set_value(state, [value])

    def _clearances(self, context: Context) -> tuple[float, float, float]:
        """Returns the values of the three outputs [m]."""
        if self.active_input.HasValue(context) and not self.active_input.Eval(context)[0]:
            return np.inf, np.inf, np.inf
        now = self.joint_position_input.Eval(context)
        later = now + self._lookahead * self.joint_velocity_input.Eval(context)
        postures = np.stack((now, later))
        seen, predicted = (
            self._shapes.distances(postures, field.eval(context)).tolist()
            for field in (self._field, self._predicted_field)
        )
        expected = np.inf
        if predicted[0] > 0.0:
            expected = own_approach_clearance(
                predicted[0], predicted[1], self._lookahead, self._slowest
            )
        approached = own_approach_clearance(seen[0], seen[1], self._lookahead, self._slowest)
        return min(*seen, expected), approached, expected
