"""Obstacle coupling as a system."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.perception import PointCloud

from pepper_drake.learning.dmp.obstacle_coupling import Coupling, CouplingOutput
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems.framework import LeafSystem, ValueProducer
from pepper_drake.systems.primitive.obstacle_field_cache import ObstacleFieldCache


class ObstacleCoupling(LeafSystem):
    """The coupling term of a cloud of obstacles.

    .. pydrake_system::

        name: ObstacleCoupling
        input_ports:
        - movement
        - cloud (optional)
        - predicted_cloud (optional)
        - position
        - velocity
        - nominal_acceleration
        - goal_position
        - tau
        output_ports:
        - coupling
        - slowdown
        - distance

    C_t of equation 2.6 and the phase stopping of `learning.Coupling`. No state. The search
    structure of the clouds is rebuilt only for a new cloud.

    Inputs: `movement`, abstract Movement: its coupling is applied, if it has one and runs; `cloud`
    and `predicted_cloud`, present obstacles and the predicted positions of moving ones, abstract
    PointCloud [m]; points that are not finite are ignored, an empty or missing cloud has no effect;
    `position` (3) [m], `velocity` (3) [m/s] and `nominal_acceleration` (3) [m/s²] of a
    `TransformationSystem`; `goal_position` (3) [m]; `tau` (1) [s]. All are in the frame of the
    motion, normally T.

    Outputs: `coupling` (3) [m]; `slowdown` (1) >= 0 for the `CanonicalSystem`; `distance` (1) [m]
    from the hand's centre to the nearest obstacle, infinite without obstacles and at rest.

    Examples:
        >>> from pepper_drake.learning import get_coupling
        >>> from pepper_drake.perception.mapping.cloud_points import make_cloud
        >>> system = ObstacleCoupling()
        >>> context = system.CreateDefaultContext()
        >>> movement = Movement(None, coupling=get_coupling("barrier"), id=1)
        >>> _ = system.movement_port.FixValue(context, Value[object](movement))
        >>> below = make_cloud(np.array([[0.0, 0.0, -0.06]]))
        >>> _ = system.cloud_port.FixValue(context, Value(below))
        >>> _ = system.position_port.FixValue(context, [0.0, 0.0, 0.0])
        >>> _ = system.velocity_port.FixValue(context, [0.1, 0.0, -0.2])
        >>> _ = system.nominal_acceleration_port.FixValue(context, [0.0, 0.0, -1.0])
        >>> _ = system.goal_position_port.FixValue(context, [0.3, 0.0, 0.0])
        >>> _ = system.tau_port.FixValue(context, [2.0])
        >>> print(f"{system.distance_port.Eval(context)[0]:.2f}")
        0.06
        >>> bool(system.coupling_port.Eval(context)[2] > 0.0)  # It pushes up.
        True
    """

    def __init__(self) -> None:
        super().__init__()
        self.movement_port = self.DeclareAbstractInputPort("movement", Value[object](None))
        self.cloud_port = self.DeclareAbstractInputPort("cloud", Value(PointCloud()))
        self.predicted_cloud_port = self.DeclareAbstractInputPort(
            "predicted_cloud", Value(PointCloud())
        )
        self.position_port = self.DeclareVectorInputPort("position", 3)
        self.velocity_port = self.DeclareVectorInputPort("velocity", 3)
        self.nominal_acceleration_port = self.DeclareVectorInputPort("nominal_acceleration", 3)
        self.goal_position_port = self.DeclareVectorInputPort("goal_position", 3)
        self.tau_port = self.DeclareVectorInputPort("tau", 1)

        self._field = ObstacleFieldCache(self, self.cloud_port, self.predicted_cloud_port)
        self._clearance = self.DeclareCacheEntry(
            "clearance at the goal",
            ValueProducer(allocate=lambda: Value({}), calc=self._calc_clearance),
            prerequisites_of_calc={
                self._field.entry.ticket(),
                self.goal_position_port.ticket(),
                self.movement_port.ticket(),
            },
        )
        self._push = self.DeclareCacheEntry(
            "push",
            ValueProducer(allocate=lambda: Value({}), calc=self._calc_push),
            prerequisites_of_calc={
                self._clearance.ticket(),
                *(
                    port.ticket()
                    for port in (
                        self.position_port,
                        self.velocity_port,
                        self.nominal_acceleration_port,
                        self.tau_port,
                    )
                ),
            },
        )
        cached = {self._push.ticket()}
        self.coupling_port = self.DeclareVectorOutputPort(
            "coupling",
            3,
            lambda context, out: out.SetFromVector(self._eval(context).coupling),
            prerequisites_of_calc=cached,
        )
        self.slowdown_port = self.DeclareVectorOutputPort(
            "slowdown",
            1,
            lambda context, out: out.SetFromVector([self._eval(context).slowdown]),
            prerequisites_of_calc=cached,
        )
        self.distance_port = self.DeclareVectorOutputPort(
            "distance",
            1,
            lambda context, out: out.SetFromVector([self._eval(context).distance]),
            prerequisites_of_calc=cached,
        )

    def _eval(self, context: Any) -> CouplingOutput:
        push: CouplingOutput = self._push.Eval(context)["push"]
        return push

    def _calc_clearance(self, context: Any, value: Any) -> None:
        law = self._law(context)
        if law is None:
            return
        goal, field = self.goal_position_port.Eval(context), self._field.eval(context)
        value.get_mutable_value()["clearance"] = law.clearance(field, goal)

    def _law(self, context: Any) -> Coupling | None:
        """Returns the coupling of the running movement, None at rest."""
        movement: Movement = self.movement_port.Eval(context)
        return movement.coupling if movement.runs else None

    def _calc_push(self, context: Any, value: Any) -> None:
        law = self._law(context)
        if law is None:
            value.get_mutable_value()["push"] = CouplingOutput(
                np.zeros(3), np.array(0.0), np.array(np.inf)
            )
            return
        value.get_mutable_value()["push"] = law.push(
            self._field.eval(context),
            np.array((self.position_port.Eval(context), self.velocity_port.Eval(context))),
            self.nominal_acceleration_port.Eval(context),
            self.goal_position_port.Eval(context),
            self._clearance.Eval(context)["clearance"],
            float(self.tau_port.Eval(context)[0]),
        )
