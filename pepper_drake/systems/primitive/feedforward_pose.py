"""The hand's desired pose with feed-forward, for Drake's differential inverse kinematics."""

from pydrake.common.value import Value
from pydrake.systems.framework import BusValue, Context, InputPort, OutputPort

from pepper_drake.planning.ik.feedforward import feedforward_pose
from pepper_drake.systems.framework import LeafSystem


class FeedforwardPose(LeafSystem):
    """Puts the hand's desired pose on a bus (see `feedforward_pose`).

    .. pydrake_system::

        name: FeedforwardPose
        input_ports:
        - position
        - next_position
        - orientation
        - next_orientation
        output_ports:
        - desired_cartesian_poses

    Inputs: `position` and `next_position` (3), m, `orientation` and `next_orientation` (4), unit
    quaternions w, x, y, z: of the hand H in the torso frame T, now and one tick later.
    Output: a BusValue with the pose under `key`.

    Args:
        key: The hand's scoped frame name.
        gain: Fraction of the hand's error that is corrected in one tick.
    """

    def __init__(self, key: str, gain: float) -> None:
        super().__init__()
        self._key, self._gain = key, gain
        self._inputs: list[InputPort] = [
            self.DeclareVectorInputPort(name, size)
            for name, size in (
                ("position", 3),
                ("next_position", 3),
                ("orientation", 4),
                ("next_orientation", 4),
            )
        ]
        self.bus_output: OutputPort = self.DeclareAbstractOutputPort(
            "desired_cartesian_poses",
            lambda: Value(BusValue()),
            self._calc_bus,
            prerequisites_of_calc={port.ticket() for port in self._inputs},
        )

    def _calc_bus(self, context: Context, output: Value) -> None:
        now, following, rotation, next_rotation = (port.Eval(context) for port in self._inputs)
        pose = feedforward_pose(now, following, rotation, next_rotation, self._gain)
        output.get_mutable_value().Set(self._key, Value(pose))
