"""The true distance between Pepper and the obstacles, which a real robot cannot know."""

import operator
from collections.abc import Set

from pydrake.common.value import Value
from pydrake.geometry import GeometryId, QueryObject, SceneGraphInspector, SignedDistancePair
from pydrake.systems.framework import Context, DiscreteValues, InputPort

from pepper_drake.models.objects import SOLID
from pepper_drake.systems.framework import LeafSystem


class TrueClearance(LeafSystem):
    """Measures the signed distance between Pepper's links and the obstacles' true geometry.

    For reports only; nothing that drives the robot may be connected to it.

    .. pydrake_system::

        name: TrueClearance
        input_ports:
        - query
        output_ports:
        - clearance

    Input: `query`, the scene graph's QueryObject. Output: `clearance` (1) [m], negative in
    penetration, at most `max_distance`. State: the smallest distance, every `time_step`, and the
    number of steps that can be skipped (2): while everything is beyond `max_distance`, no contact
    at `max_speed` is possible in so many steps.

    Args:
        robot: Pepper's collision geometries.
        obstacles: The obstacles' collision geometries.
        max_distance: Distances beyond this are reported as this [m].
        max_speed: Largest speed at which a link and an obstacle approach each other [m/s].
        time_step: [s].
    """

    def __init__(
        self,
        *,
        robot: Set[GeometryId],
        obstacles: Set[GeometryId],
        max_distance: float = 0.1,
        max_speed: float = 1.5,
        time_step: float = 0.02,
    ) -> None:
        super().__init__()
        self._robot, self._obstacles = frozenset(robot), frozenset(obstacles)
        self._max_distance = max_distance
        self._max_approach = max_speed * time_step
        self.query_input: InputPort = self.DeclareAbstractInputPort("query", Value(QueryObject()))
        self._skipped_steps = max(int(max_distance / (max_speed * time_step)) - 1, 0)
        self._clearance = self.DeclareDiscreteState([max_distance])
        self._remaining = self.DeclareDiscreteState(1)
        self.DeclareStateOutputPort("clearance", self._clearance)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        remaining = context.get_discrete_state(self._remaining).value()[0]
        if remaining > 0:
            discrete_state.set_value(self._remaining, [remaining - 1])
            return
        query = self.query_input.Eval(context)
        # Only few pairs are within the last distance plus the largest approach in one step.
        last = float(context.get_discrete_state(self._clearance).value()[0])
        nearest = self._nearest(query, max(last, 0.0) + self._max_approach)
        if nearest is None:
            nearest = self._nearest(query, self._max_distance)
        distance = self._max_distance if nearest is None else nearest.distance
        discrete_state.set_value(self._clearance, [distance])
        discrete_state.set_value(self._remaining, [self._skipped_steps if nearest is None else 0])

    def closest_pair(self, query: QueryObject) -> tuple[float, str]:
        """Returns the smallest distance [m] and the two shapes' names as "link - obstacle"."""
        nearest = self._nearest(query, self._max_distance)
        if nearest is None:
            return self._max_distance, ""
        pair = (nearest.id_A, nearest.id_B)
        link, obstacle = pair if nearest.id_A in self._robot else reversed(pair)
        inspector: SceneGraphInspector = query.inspector()
        names = (_plain_name(inspector, geometry) for geometry in (link, obstacle))
        return nearest.distance, " - ".join(names)

    def _nearest(self, query: QueryObject, within: float) -> SignedDistancePair | None:
        """Returns the nearest link and obstacle within a distance [m], at most `max_distance`."""
        pairs = query.ComputeSignedDistancePairwiseClosestPoints(min(within, self._max_distance))
        # Sorting first is faster: most distant pairs then need no look-up of their bodies.
        for pair in sorted(pairs, key=operator.attrgetter("distance")):
            ids = (pair.id_A, pair.id_B)
            if not (self._robot.isdisjoint(ids) or self._obstacles.isdisjoint(ids)):
                return pair
        return None


def _plain_name(inspector: SceneGraphInspector, geometry: GeometryId) -> str:
    """Returns the body's name, with that of the shape if it has one of its own."""
    frame = inspector.GetFrameId(geometry)
    body, shape = (
        name.rpartition("::")[2] for name in (inspector.GetName(frame), inspector.GetName(geometry))
    )
    return body if shape in (body, SOLID) else f"{shape} of {body}"
