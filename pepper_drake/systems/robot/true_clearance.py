"""The true distance between Pepper and the obstacles, which no real robot knows."""

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

    Input: `query`, the scene graph's QueryObject. Output: `clearance` (1), m, negative in
    penetration, at most `max_distance`. State: the least distance at each `time_step`, and how
    many steps nothing can come near in: as long as everything is beyond `max_distance`, only every
    so many steps are looked at that nothing at `max_speed` could have touched meanwhile (2).

    Args:
        robot: Pepper's collision geometries.
        obstacles: The obstacles' collision geometries.
        max_distance: Distances beyond this are reported as this [m].
        max_speed: At which a link and an obstacle approach each other at most [m/s].
        time_step: s.
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
        self._most_per_step = max_speed * time_step
        self.query_input: InputPort = self.DeclareAbstractInputPort("query", Value(QueryObject()))
        self._free_steps = max(int(max_distance / (max_speed * time_step)) - 1, 0)
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
        # Few pairs are within what was nearest and what it can have come nearer.
        last = float(context.get_discrete_state(self._clearance).value()[0])
        nearest = self._nearest(query, max(last, 0.0) + self._most_per_step)
        if nearest is None:
            nearest = self._nearest(query, self._max_distance)
        distance = self._max_distance if nearest is None else nearest.distance
        discrete_state.set_value(self._clearance, [distance])
        discrete_state.set_value(self._remaining, [self._free_steps if nearest is None else 0])

    def closest_pair(self, query: QueryObject) -> tuple[float, str]:
        """The least distance, m, and the names of the two shapes as "link - obstacle"."""
        nearest = self._nearest(query, self._max_distance)
        if nearest is None:
            return self._max_distance, ""
        pair = (nearest.id_A, nearest.id_B)
        link, obstacle = pair if nearest.id_A in self._robot else reversed(pair)
        inspector: SceneGraphInspector = query.inspector()
        names = (_plain_name(inspector, geometry) for geometry in (link, obstacle))
        return nearest.distance, " - ".join(names)

    def _nearest(self, query: QueryObject, within: float) -> SignedDistancePair | None:
        """The nearest link and obstacle, if any are within a distance [m], or the largest."""
        pairs = query.ComputeSignedDistancePairwiseClosestPoints(min(within, self._max_distance))
        # Most distant pairs are never asked what they are, which takes longer than to sort them.
        for pair in sorted(pairs, key=operator.attrgetter("distance")):
            ids = (pair.id_A, pair.id_B)
            if not (self._robot.isdisjoint(ids) or self._obstacles.isdisjoint(ids)):
                return pair
        return None


def _plain_name(inspector: SceneGraphInspector, geometry: GeometryId) -> str:
    """The body's name, and which shape of it where the shape has a name of its own."""
    frame = inspector.GetFrameId(geometry)
    body, shape = (
        name.rpartition("::")[2] for name in (inspector.GetName(frame), inspector.GetName(geometry))
    )
    return body if shape in (body, SOLID) else f"{shape} of {body}"
