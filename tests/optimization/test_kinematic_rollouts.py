import pickle
from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.diagrams.factory import SHIPPED_DEMONSTRATION
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.pepper import elbow_roll_limits
from pepper_drake.optimization import (
    CostWeights,
    joint_bumps,
    make_optimizer,
    make_task,
    movement_problem,
    search,
    smooth_bumps,
)
from pepper_drake.optimization.kinematic_rollouts import (
    GRID_ERROR,
    KinematicRollouts,
    arm_and_limits,
    arm_shapes,
)
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.batch_ik import batch_inverse_kinematics


@pytest.fixture(scope="module")
def reach():
    return MovementPrimitive.fit(Demonstration.load(SHIPPED_DEMONSTRATION))


def table(edge=0.15, top=-0.08):
    """A table's top, through which the demonstration passes with the arm."""
    x, y = np.meshgrid(np.arange(edge, 0.6, 0.02), np.arange(-0.7, 0.3, 0.02))
    points = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, top)))
    return PointCloudDistance(points, extension=0.03)


def test_the_hand_follows_and_the_joints_keep_their_limits(reach):
    kinematics, limits = arm_and_limits("right")
    step = 0.04
    path = reach.rollout(time_step=step)
    way, nominal = path.positions, path.joints
    aside = np.multiply.outer(np.linspace(0, 1, len(way)), [0.0, 0.03, 0.02])
    ways = np.stack((way, way + aside, way * 3.0))
    joints = batch_inverse_kinematics(kinematics, limits, ways, np.stack([nominal] * 3), step)
    hands = kinematics.poses(joints.reshape(-1, 5)).hand_position.reshape(ways.shape)
    assert np.abs(hands[0] - ways[0]).max() < 0.001
    assert np.abs(hands[1] - ways[1]).max() < 0.003
    assert np.abs(hands[2] - ways[2]).max() > 0.1  # Out of reach.
    assert np.all((joints >= limits.position_lower) & (joints <= limits.position_upper))
    assert np.all(np.abs(np.diff(joints, axis=1)) <= limits.velocity * step * (1 + 1e-9))
    for q in joints.reshape(-1, 5):
        lower, upper = elbow_roll_limits(q[2], "right")
        assert lower - 1e-3 <= q[3] <= upper + 1e-3
    # Not only the hand: the spare joints stay where they were shown.
    assert np.abs(joints[0] - nominal).max() < 0.05


def test_many_ways_at_once_are_each_alone(reach):
    parameters = smooth_bumps(reach, 3, posture=True)
    evaluate = KinematicRollouts(
        parameters, make_task(reach, obstacles=table()), CostWeights(arm_to_obstacles=1.0)
    )
    x = 0.03 * np.random.default_rng(0).standard_normal((3, parameters.size))
    together = evaluate(x)
    alone = np.concatenate([evaluate(one[None]) for one in x])
    assert together == pytest.approx(alone, abs=1e-9)
    assert np.array_equal(pickle.loads(pickle.dumps(evaluate))(x), together)


@pytest.mark.parametrize("led_by", ["hand", "joints"])
def test_the_outcome_is_what_drake_says(reach, led_by):
    parameters = smooth_bumps(reach, 3, posture=True)
    field = table()
    evaluate = KinematicRollouts(
        parameters, make_task(reach, obstacles=field), CostWeights(deviation=1.0), led_by=led_by
    )
    x = 0.03 * np.random.default_rng(1).standard_normal((2, parameters.size))
    outcome = evaluate.outcome(x)
    kinematics = arm_kinematics(shared_control_model(), "right")
    for k in range(2):
        hands = [kinematics.hand_pose(q).translation() for q in outcome.joints[k]]
        assert np.abs(outcome.positions[k] - hands).max() < 1e-9
        # The grid is good to a few millimetres, and looks no farther than 8 cm.
        exact = kinematics.sphere_centers_at(outcome.joints[k])
        gaps = (field.distance(exact) - kinematics.spheres.radii).min(axis=1)
        near = gaps < 0.03
        assert near.any()
        # They are taken to be smaller, by what the grid is wrong.
        off = outcome.arm_distances[k][near] + GRID_ERROR - gaps[near]
        assert np.abs(off).max() < 0.012
        assert np.median(np.abs(off)) < 0.003


def test_joints_that_lead_are_those_of_the_posture(reach):
    parameters = joint_bumps(reach, 4)
    assert parameters.size == 25
    evaluate = KinematicRollouts(
        parameters, make_task(reach), CostWeights(joint_limits=1.0), led_by="joints"
    )
    still = evaluate.outcome(np.zeros((1, 25)))
    shown = reach.posture.at(still.times / reach.duration)
    assert still.joints[0] == pytest.approx(shown, abs=1e-9)
    x = np.zeros((5, 5))
    x[4, 0] = 0.1  # The last row is a ramp to another end, 2.5 rad for one metre.
    moved = evaluate.outcome(x.ravel()[None]).joints[0] - shown
    assert moved[-1] == pytest.approx([0.25, 0, 0, 0, 0], abs=1e-3)
    assert moved[0] == pytest.approx(np.zeros(5), abs=1e-3)
    assert joint_bumps(reach, 4, end_state=False).size == 20


def test_a_demonstration_through_the_table_becomes_a_movement_around_it(reach):
    parameters = joint_bumps(reach, 6, end_state=False)
    task = make_task(reach, obstacles=table(), clearance=0.02)
    cost = CostWeights(hand_to_goal=10.0, arm_to_obstacles=10.0, deviation=0.1)
    evaluate = KinematicRollouts(parameters, task, cost, led_by="joints")
    assert evaluate.measure(np.zeros(parameters.size))["arm_clearance"] < -0.02
    problem = movement_problem(parameters, evaluate)
    assert problem.exploration == 0.06
    optimizer = make_optimizer("cmaes", problem, samples=24, seed=1)
    history = search(problem, optimizer, 40, evaluate_means=False, target=0.02)
    best, cost = history.best()
    assert cost <= 0.02
    measured = evaluate.measure(best)
    assert measured["arm_clearance"] > 0.02
    found = evaluate.primitive_at(best)
    path = found.rollout()
    assert np.linalg.norm(path.positions[-1] - reach.goal) < 0.005
    # What was found is a primitive, joints and all: it goes where the arm went.
    assert arm_shapes("right").distances(path.joints, task.obstacles).min() > 0.02
    hands = arm_and_limits("right")[0].poses(path.joints).hand_position
    assert np.abs(hands - path.positions).max() < 0.003
    assert found.duration >= reach.duration


def test_movements_without_an_arm_are_refused(reach):
    parameters = smooth_bumps(reach, 2)
    task, cost = make_task(reach), CostWeights(hand_to_goal=1.0)
    bare = replace(parameters, primitive=replace(reach, posture=None))
    with pytest.raises(InputError, match="it has no joints of an arm"):
        KinematicRollouts(bare, task, cost)
    with pytest.raises(InputError, match="it has no joints; learn it from"):
        joint_bumps(replace(reach, posture=None), 2)
    wrong = replace(reach.posture, weights=reach.posture.weights + 0.1)
    elsewhere = replace(parameters, primitive=replace(reach, posture=wrong))
    with pytest.raises(InputError, match="mm from where its joints put the hand"):
        KinematicRollouts(elsewhere, task, cost)
    with pytest.raises(InputError, match="kernels: 0"):
        joint_bumps(reach, 0)
    with pytest.raises(InputError, match="arm_to_obstacles needs obstacles"):
        KinematicRollouts(parameters, task, CostWeights(arm_to_obstacles=1.0))(
            np.zeros((1, parameters.size))
        )
