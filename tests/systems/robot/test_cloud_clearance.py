import numpy as np
import pytest
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import shared_control_model
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.systems.robot.cloud_clearance import CloudClearance

JOINTS = np.array([1.0, -0.4, 1.2, 0.9, 0.1])


@pytest.fixture(scope="module")
def kinematics():
    return arm_kinematics(shared_control_model(), "right")


def cloud_of(points):
    cloud = PointCloud(len(points))
    cloud.mutable_xyzs()[:] = np.asarray(points, dtype=float).reshape(-1, 3).T
    return cloud


def make_rig(kinematics, points, **options):
    system = CloudClearance(ExactDistance(shared_control_model(), kinematics), **options)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.cloud_input.FixValue(context, cloud_of(points))
    system.joint_position_input.FixValue(context, JOINTS)
    system.joint_velocity_input.FixValue(context, np.zeros(5))
    return system, simulator, context


def clearance(system, context):
    return system.GetOutputPort("clearance").Eval(context)[0]


def approach(system, context):
    return system.GetOutputPort("approach_clearance").Eval(context)[0]


@pytest.fixture(scope="module")
def brute_force(kinematics, true_clearance):
    """The spheres' clearance, or where it is below 3 cm that of the shapes, by Drake."""

    def clearance_at(joints, points):
        centers = kinematics.sphere_centers_at(joints[None])[0]
        gaps = np.linalg.norm(centers[:, None] - np.asarray(points), axis=-1)
        least = (gaps - kinematics.spheres.radii[:, None]).min()
        return least if least >= 0.03 else true_clearance("right", joints, points, cap=0.03)

    return clearance_at


def test_the_clearance_is_the_least_of_all_spheres_and_points(kinematics, brute_force):
    points = np.random.default_rng(1).uniform([0.2, -0.6, -0.3], [0.6, 0.1, 0.3], (40, 3))
    system, simulator, context = make_rig(kinematics, points)
    assert clearance(system, context) == np.inf, "nothing is known before the first tick"
    simulator.AdvanceTo(0.01)
    # Points come as 32-bit floats.
    assert clearance(system, context) == pytest.approx(brute_force(JOINTS, points), abs=1e-6)
    system.joint_position_input.FixValue(context, JOINTS + 0.2)
    simulator.AdvanceTo(0.06)
    assert clearance(system, context) == pytest.approx(brute_force(JOINTS + 0.2, points), abs=1e-6)


def test_a_new_cloud_takes_the_place_of_the_old(kinematics, brute_force):
    near = kinematics.sphere_centers_at(JOINTS[None])[0, 0]
    system, simulator, context = make_rig(kinematics, [near])
    simulator.AdvanceTo(0.01)
    assert clearance(system, context) == pytest.approx(brute_force(JOINTS, [near]), abs=1e-6)
    assert clearance(system, context) < -0.01
    system.cloud_input.FixValue(context, cloud_of([near + np.array([0, 0, 2.0])]))
    simulator.AdvanceTo(0.06)
    assert clearance(system, context) > 1.0


def test_where_the_arm_will_be_counts_as_much_as_where_it_is(kinematics, brute_force):
    points = [kinematics.sphere_centers_at(JOINTS[None] + 0.1)[0, -1] + np.array([0.1, 0, 0])]
    system, simulator, context = make_rig(kinematics, points, lookahead=0.2)
    for velocity in (np.full(5, 0.5), np.full(5, -0.5)):
        system.joint_velocity_input.FixValue(context, velocity)
        simulator.AdvanceTo(context.get_time() + 0.05)
        expected = min(
            brute_force(JOINTS, points),
            brute_force(JOINTS + 0.2 * velocity, points),
        )
        assert clearance(system, context) == pytest.approx(expected, abs=1e-6)


def test_an_arm_at_rest_has_nothing_to_watch(kinematics):
    near = kinematics.sphere_centers_at(JOINTS[None])[0, 0]
    system, simulator, context = make_rig(kinematics, [near])
    system.active_input.FixValue(context, [0.0])
    simulator.AdvanceTo(0.01)
    assert clearance(system, context) == np.inf
    system.active_input.FixValue(context, [1.0])
    simulator.AdvanceTo(0.06)
    assert clearance(system, context) < 0


def test_an_empty_cloud_is_infinitely_far(kinematics):
    system, simulator, context = make_rig(kinematics, np.zeros((0, 3)))
    simulator.AdvanceTo(0.1)
    assert clearance(system, context) == np.inf


def test_what_is_seen_reaches_down_when_asked_to(kinematics):
    centers = kinematics.sphere_centers_at(JOINTS[None])[0]
    lowest = centers[np.argmin(centers[:, 2])]
    point = [lowest + np.array([0, 0, 0.5])]  # Half a metre above the lowest part of the arm.
    seen = make_rig(kinematics, point)
    solid = make_rig(kinematics, point, extension=0.5)
    for _, simulator, _ in (seen, solid):
        simulator.AdvanceTo(0.01)
    assert clearance(solid[0], solid[2]) < 0 < clearance(seen[0], seen[2])


def test_nothing_is_fed_through(kinematics):
    assert not CloudClearance(
        ExactDistance(shared_control_model(), kinematics)
    ).HasAnyDirectFeedthrough()


def test_predicted_points_count_when_the_arm_is_about_to_go_there(kinematics):
    velocity = np.array([-0.6, 0.0, 0.0, 0.0, 0.0])
    hand, ahead = (
        kinematics.hand_pose(JOINTS + time * velocity).translation() for time in (0.0, 0.6)
    )
    points = [ahead + 0.05 * (ahead - hand) / np.linalg.norm(ahead - hand)]
    found = []
    for port, factor in (("cloud", 1), ("predicted_cloud", 1), ("predicted_cloud", -1)):
        system, simulator, context = make_rig(kinematics, [])
        system.GetInputPort(port).FixValue(context, cloud_of(points))
        system.joint_velocity_input.FixValue(context, factor * velocity)
        simulator.AdvanceTo(0.01)
        found.append(clearance(system, context))
    assert np.isfinite(found[0])
    assert found[1] == found[0]
    assert found[2] == np.inf
    system, simulator, context = make_rig(kinematics, [])
    system.predicted_cloud_input.FixValue(context, cloud_of([hand]))
    system.joint_velocity_input.FixValue(context, velocity)
    simulator.AdvanceTo(0.01)
    assert clearance(system, context) == np.inf


def test_only_the_arms_own_motion_approaches(kinematics, brute_force):
    """A point that is right at the hand: the arm may stand there, and go, but not go on."""
    velocity = np.array([-0.6, 0.0, 0.0, 0.0, 0.0])
    hand, ahead = (
        kinematics.hand_pose(JOINTS + time * velocity).translation() for time in (0.0, 0.3)
    )
    points = [ahead + 0.03 * (ahead - hand) / np.linalg.norm(ahead - hand)]
    system, simulator, context = make_rig(kinematics, points)
    assert approach(system, context) == np.inf, "nothing is known before the first tick"
    for factor, expected in (
        (0.0, np.inf),
        (0.01, np.inf),
        (-1.0, np.inf),
        (1.0, brute_force(JOINTS + 0.1 * velocity, points)),
    ):
        system.joint_velocity_input.FixValue(context, factor * velocity)
        simulator.AdvanceTo(context.get_time() + 0.05)
        assert np.isfinite(clearance(system, context))
        assert approach(system, context) == pytest.approx(expected, abs=1e-6)


def test_an_arm_that_all_but_stands_is_not_on_its_way_to_where_something_is_predicted(kinematics):
    velocity = np.array([-0.6, 0.0, 0.0, 0.0, 0.0])
    hand, ahead = (
        kinematics.hand_pose(JOINTS + time * velocity).translation() for time in (0.0, 0.6)
    )
    points = [ahead + 0.05 * (ahead - hand) / np.linalg.norm(ahead - hand)]
    for factor, counts in ((1.0, True), (0.01, False)):
        system, simulator, context = make_rig(kinematics, [])
        system.predicted_cloud_input.FixValue(context, cloud_of(points))
        system.joint_velocity_input.FixValue(context, factor * velocity)
        simulator.AdvanceTo(0.01)
        assert np.isfinite(clearance(system, context)) == counts
        assert approach(system, context) == clearance(system, context)
