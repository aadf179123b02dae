"""The hand's next pose, in the form that Drake's differential inverse kinematics takes."""

from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BusValue, Context, InputPort, LeafSystem, OutputPort


class HandPoseBus(LeafSystem):
    """Puts the hand's position and orientation on a bus.

    .. pydrake_system::

        name: HandPoseBus
        input_ports:
        - position
        - orientation
        output_ports:
        - desired_cartesian_poses

    Inputs: `position` (3), m, and `orientation` (4), unit quaternion w, x, y, z, of the hand H in
    the torso frame T. Output: a BusValue with X_TH under `key`.
    """

    def __init__(self, key: str) -> None:
        super().__init__()
        self._key = key
        self.position_input: InputPort = self.DeclareVectorInputPort("position", 3)
        self.orientation_input: InputPort = self.DeclareVectorInputPort("orientation", 4)
        self.bus_output: OutputPort = self.DeclareAbstractOutputPort(
            "desired_cartesian_poses",
            lambda: Value(BusValue()),
            self._calc_bus,
            prerequisites_of_calc={
                self.position_input.ticket(),
                self.orientation_input.ticket(),
            },
        )

    def _calc_bus(self, context: Context, output: Value) -> None:
        quaternion = self.orientation_input.Eval(context)
        bus = BusValue()
        bus.Set(
            self._key,
            Value(RigidTransform(Quaternion(quaternion), self.position_input.Eval(context))),
        )
        output.set_value(bus)
