import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics, arm_kinematics
from pepper_drake.planning.ik.batch_ik import damped_least_squares
from pepper_drake.planning.ik.goal_configurations import (
    GoalConfigurations,
    axis_error,
    orientation_error,
)

MODEL = shared_control_model()
LIMITS = MODEL.command_limits(arm_joints("right"))
LOWER, UPPER = LIMITS.position_lower, LIMITS.position_upper
GOAL = np.array([0.25, -0.22, 0.0])
EYE, AXIS = np.eye(3), (0, 0, -1)


@pytest.fixture(scope="module")
def postures():
    return GoalConfigurations(ArmKinematics(MODEL, "right"), LOWER, UPPER)


def near(postures, count, point=GOAL, R_TG=EYE, tolerance=np.pi):
    """The nearest postures, however they are turned unless a tolerance is given."""
    return postures.near(point, count, R_TG, AXIS, tolerance, among=1000)


def test_postures_turned_well_are_found_where_few_are(postures):
    # Where an arm once waited in vain: all of its detours ended with the hand turned away.
    goal = np.array([0.232, -0.238, 0.076])
    R_TG = Rotation.from_euler("xyz", (1.5877, -0.2832, -0.533)).as_matrix()
    kinematics, tolerance = arm_kinematics(MODEL, "right"), 0.45

    def turned(starts):
        q, there = postures.solve(goal, starts)
        R_TH = kinematics.poses(q[there]).hand_rotation
        return axis_error(R_TH, R_TG, AXIS) <= tolerance

    starts = near(postures, 150, goal, R_TG, tolerance)
    assert len(starts) == 150
    assert turned(starts).sum() > 5 * turned(near(postures, 150, goal)).sum()


def test_most_postures_nearby_are_brought_to_the_goal(postures):
    q, there = postures.solve(GOAL, near(postures, 200))
    assert there.mean() > 0.7
    kinematics = arm_kinematics(MODEL, "right")
    for joints in q[there]:
        np.testing.assert_allclose(kinematics.hand_pose(joints).translation(), GOAL, atol=3e-4)
    assert np.all((q >= LOWER) & (q <= UPPER))


def test_compiled_steps_are_those_of_damped_least_squares(postures):
    kinematics = arm_kinematics(MODEL, "right")
    starts = near(postures, 40)
    q = np.clip(starts, LOWER, UPPER)
    for _ in range(8):
        poses = kinematics.poses(q)
        J = poses.hand_jacobian()[:, 3:]
        step = damped_least_squares(J, GOAL - poses.hand_position, 0.01)
        step /= np.maximum(np.abs(step).max(axis=1, keepdims=True) / 0.3, 1.0)
        q = np.clip(q + step, LOWER, UPPER)
    np.testing.assert_allclose(postures.solve(GOAL, starts)[0], q, atol=1e-9)


def test_they_spread_over_the_two_spare_degrees_of_freedom(postures):
    q, there = postures.solve(GOAL, near(postures, 200))
    sizes = np.linalg.svd(q[there] - q[there].mean(axis=0), compute_uv=False)
    assert sizes[1] > 0.3 * sizes[0], "they lie on a surface, not on a line"
    assert np.ptp(q[there], axis=0).max() > 1.0


def test_what_is_there_already_stays(postures):
    start = np.array([0.8, -0.5, 1.1, 1.0, 0.5])
    target = arm_kinematics(MODEL, "right").hand_pose(start).translation()
    q, there = postures.solve(target, start[None])
    assert there[0]
    np.testing.assert_allclose(q[0], start, atol=1e-9)


def test_out_of_reach_no_posture_is_there(postures):
    far = np.array([0.9, -0.2, 0.0])
    assert not postures.solve(far, near(postures, 50, far))[1].any()


def test_the_library_is_the_same_each_time(postures):
    again = GoalConfigurations(ArmKinematics(MODEL, "right"), LOWER, UPPER)
    np.testing.assert_array_equal(near(postures, 5), near(again, 5))


def test_angles_of_an_axis_are_those_between_the_turned_axes():
    hands, goal = Rotation.random(20, random_state=0), Rotation.random(random_state=1)
    axis = np.array([0.3, -0.4, 1.2])
    one, other = hands.apply(axis), goal.apply(axis)
    expected = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), one @ other)
    np.testing.assert_allclose(axis_error(hands.as_matrix(), goal.as_matrix(), axis), expected)
    whole = orientation_error(hands.as_matrix(), goal.as_matrix())
    assert np.all(expected <= whole + 1e-9)


def test_postures_turned_well_are_kept_and_all_if_there_are_none(postures):
    q = near(postures, 50)
    R_TG = arm_kinematics(MODEL, "right").poses(q[:1]).hand_rotation[0]
    kept = postures.well_turned(q, R_TG, (0, 0, -1), 0.3)
    assert 1 <= len(kept) < len(q)
    away = R_TG @ Rotation.from_euler("x", np.pi).as_matrix()
    assert len(postures.well_turned(q[:1], away, (0, 0, -1), 0.3)) == 1
