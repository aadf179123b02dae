import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.pepper import posture_positions
from pepper_drake.systems.robot.body_watch import BodyWatch

JOINTS = [posture_positions("upright")[name] for name in BODY_JOINTS]


def watched(points, velocity=(0.0, 0.0, 0.0), pose=(0.0, 0.0, 0.0), active=0.0):
    """The clearance and whether the base has to stop."""
    watch = BodyWatch(shared_control_model(), "right")
    simulator = Simulator(watch)
    context = simulator.get_mutable_context()
    cloud = PointCloud(len(points))
    cloud.mutable_xyzs()[:] = np.array(points, dtype=np.float32).reshape(-1, 3).T
    watch.GetInputPort("cloud").FixValue(context, Value(cloud))
    for name, value in (
        ("joint_position", JOINTS),
        ("base_pose", pose),
        ("base_velocity_command", velocity),
        ("active", [active]),
    ):
        watch.GetInputPort(name).FixValue(context, value)
    simulator.AdvanceTo(0.01)
    return tuple(watch.GetOutputPort(name).Eval(context)[0] for name in ("clearance", "stop_base"))


BIN_WALL = [[0.32, y, 0.85] for y in np.linspace(-0.2, 0.2, 21)]
"""A wall 13 cm high at a table's edge, before the tablet."""


def test_nothing_seen_is_infinitely_far():
    assert watched([]) == (np.inf, 0.0)


def test_a_base_that_stands_has_nothing_to_stop_for():
    clearance, stop = watched(BIN_WALL)
    assert 0.1 < clearance < 0.25
    assert stop == 0.0


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        ([0.1, 0.0, 0.0], 0.0),
        ([0.35, 0.0, 0.0], 1.0),
        ([-0.35, 0.0, 0.0], 0.0),
        ([0.0, 0.3, 0.0], 0.0),
    ],
)
def test_the_base_stops_for_what_it_could_not_brake_before(velocity, expected):
    assert watched(BIN_WALL, velocity)[1] == expected


def test_a_turn_into_something_stops_too():
    # Before the left upper arm, which a turn to the right brings there.
    before_arm = [[0.09, 0.175, 0.87]]
    assert watched(before_arm, [0.0, 0.0, -1.0])[1] == 1.0
    assert watched(before_arm, [0.0, 0.0, 1.0])[1] == 0.0


def test_the_reaching_arm_belongs_to_the_body_only_while_it_rests():
    beside_hand = [[0.0, -0.32, 0.6]]
    assert watched(beside_hand)[0] < watched(beside_hand, active=1.0)[0]
