import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.pepper import posture_positions
from pepper_drake.planning.collision.body_clearance import BodyClearance, body_links
from pepper_drake.systems.robot.body_watch import BodyWatch

JOINTS = [posture_positions("upright")[name] for name in BODY_JOINTS]


def cloud_of(points):
    cloud = PointCloud(len(points))
    cloud.mutable_xyzs()[:] = np.array(points, dtype=np.float32).reshape(-1, 3).T
    return Value(cloud)


class Rig:
    """A watch by itself."""

    def __init__(self, points, velocity=(0.0, 0.0, 0.0), pose=(0.0, 0.0, 0.0), active=0.0):
        self.watch = BodyWatch(shared_control_model(), "right")
        self.simulator = Simulator(self.watch)
        self.context = self.simulator.get_mutable_context()
        self.set("cloud", cloud_of(points))
        self.set("joint_position", JOINTS)
        self.set("base_pose", pose)
        self.set("base_velocity_command", velocity)
        self.set("active", [active])

    def set(self, name, value):
        self.watch.GetInputPort(name).FixValue(self.context, value)

    def tick(self):
        self.simulator.AdvanceTo(self.context.get_time() + 0.05)
        return self

    def output(self, name):
        return self.watch.GetOutputPort(name).Eval(self.context)[0]


def watched(points, velocity=(0.0, 0.0, 0.0), pose=(0.0, 0.0, 0.0), active=0.0):
    """The clearance and whether the base has to stop."""
    rig = Rig(points, velocity, pose, active).tick()
    return rig.output("clearance"), rig.output("stop_base")


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


@pytest.fixture(scope="module")
def near_wall():
    """Distance of the base towards the wall at which the body is 5 mm from it [m]."""
    model = shared_control_model()
    poses = np.column_stack((np.arange(0.0, 0.25, 1e-4), np.zeros((2500, 2))))
    field = PointCloudDistance(np.array(BIN_WALL), extension=0.0)
    clearances = BodyClearance(model, body_links(model))(poses, np.array(JOINTS), field)
    return poses[np.argmax(clearances < 0.005), 0]


def test_what_comes_to_a_body_that_stands_is_seen_and_is_no_approach_of_its_own(near_wall):
    rig = Rig([], pose=(near_wall, 0.0, 0.0)).tick()
    rig.set("cloud", cloud_of(BIN_WALL))
    rig.tick()
    assert rig.output("clearance") == pytest.approx(0.005, abs=1e-3)
    assert rig.output("approach_clearance") == np.inf
    assert rig.output("stop_base") == 0.0


@pytest.mark.parametrize(("step", "approaches"), [(0.003, True), (-0.003, False)])
def test_a_base_that_moves_approaches_and_one_that_leaves_does_not(step, approaches, near_wall):
    rig = Rig(BIN_WALL, pose=(near_wall - step, 0.0, 0.0)).tick()
    rig.set("base_pose", (near_wall, 0.0, 0.0))
    rig.tick()
    expected = rig.output("clearance") if approaches else np.inf
    assert rig.output("approach_clearance") == expected
    assert rig.output("clearance") == pytest.approx(0.005, abs=1e-3)


def test_an_arm_at_rest_that_moves_approaches_too():
    model = shared_control_model()
    lowered = np.array(JOINTS)
    lowered[BODY_JOINTS.index("LShoulderPitch")] += 0.1
    hand = BodyClearance(model, ["l_wrist"]).centers(lowered)
    below = [hand[np.argmin(hand[:, 2])] - [0.0, 0.0, 0.035]]
    found = []
    for first, second in ((JOINTS, lowered), (lowered, JOINTS)):
        rig = Rig(below)
        rig.set("joint_position", first)
        rig.tick().set("joint_position", second)
        rig.tick()
        found.append((rig.output("clearance"), rig.output("approach_clearance")))
    (near, approached), (away, left) = found
    assert near == approached < away
    assert left == np.inf


def test_what_is_predicted_stops_a_drive_and_not_a_body_that_stands():
    for velocity, stops in (((0.0, 0.0, 0.0), 0.0), ((0.35, 0.0, 0.0), 1.0)):
        rig = Rig([], velocity=velocity)
        rig.set("predicted_cloud", cloud_of(BIN_WALL))
        rig.tick()
        assert rig.output("clearance") == rig.output("approach_clearance") == np.inf
        assert rig.output("stop_base") == stops


def head_joints(hip_pitch):
    leant = np.array(JOINTS)
    leant[BODY_JOINTS.index("HipPitch")] = hip_pitch
    return leant


@pytest.mark.parametrize(("velocity", "expected"), [(-0.25, 1.0), (0.25, 0.0), (0.0, 0.0)])
@pytest.mark.parametrize("port", ["cloud", "predicted_cloud"])
def test_the_torso_stops_before_it_leans_into_something(velocity, expected, port):
    body = BodyClearance(shared_control_model(), body_links(shared_control_model()))
    # A board that the torso, leaning forward at 0.25 rad/s, would touch before it has braked.
    path = 0.25 * (0.1 + 0.5 * 0.25 / 0.5)
    centers = body.centers(head_joints(-path))
    foremost = int(np.argmax(centers[:, 0] + centers[:, 2]))
    x, _, z = centers[foremost] + [body.radii[foremost], 0.0, 0.0]
    board = [[x, y, z] for y in np.linspace(-0.1, 0.1, 11)]
    rig = Rig(board if port == "cloud" else [])
    rig.set("predicted_cloud", cloud_of(board if port == "predicted_cloud" else []))
    rig.set("hip_velocity", [velocity])
    assert rig.tick().output("stop_base") == expected
    assert rig.output("clearance") > 0.0
