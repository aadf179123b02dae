import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.optimization import (
    TERMS,
    CostFunction,
    CostWeights,
    FastRollouts,
    Outcome,
    Task,
    all_weights,
    load_cost,
    make_task,
    parse_cost,
)
from pepper_drake.optimization.cost import terms_of
from pepper_drake.optimization.cost_terms import violation
from pepper_drake.optimization.movement_problem import load_movement, load_points

TIMES = 0.1 * np.arange(5)


def straight(offset=0.0, **more):
    """Two hands that move along x by 0.1 m in each step, the second one higher by `offset`."""
    way = np.zeros((2, 5, 3))
    way[:, :, 0] = 0.1 * np.arange(5)
    way[1, :, 2] = offset
    return Outcome(TIMES, way, **more)


def task(**more):
    shown = np.zeros((9, 3))
    shown[:, 0] = np.linspace(0.0, 0.4, 9)
    return Task(np.array([0.4, 0.0, 0.3]), shown, 2.0, **more)


def test_hand_to_goal_is_charged_at_the_end():
    costs = TERMS["hand_to_goal"](straight(offset=0.3), task())
    assert costs[:, :-1].tolist() == [[0.0] * 4] * 2
    assert costs[:, -1] == pytest.approx([0.3, 0.0])


def test_deviation_is_the_mean_distance_at_the_same_time():
    costs = TERMS["deviation"](straight(offset=0.2), task())
    assert costs.sum(axis=1) == pytest.approx([0.0, 0.2])
    assert costs[1] == pytest.approx([0.04] * 5)


def test_a_shortage_counts_on_average_and_at_its_worst():
    costs = violation(np.array([[0.05, 0.015, 0.0, -0.01]]), 0.02)
    assert costs[0] == pytest.approx([0.0, 0.00125, 0.005, 0.0075 + 0.03])
    assert violation(np.full((1, 3), 0.02), 0.02).sum() == 0.0


def test_the_hand_is_a_sphere_among_obstacles():
    field = PointCloudDistance([[0.2, 0.0, 0.0]], extension=0.0)
    costs = TERMS["hand_to_obstacles"](
        straight(offset=0.06), task(obstacles=field, hand_radius=0.05)
    )
    # Within 0 and 0.06 m: 0.07 and 0.01 m are lacking, each once more on average.
    assert costs.sum(axis=1) == pytest.approx([0.07 + 0.07 / 5, 0.01 + 0.01 / 5])
    assert costs.argmax(axis=1).tolist() == [2, 2]


def test_the_arm_among_obstacles_and_joints_near_their_limits():
    gaps, joints = np.full((2, 5), 0.03), np.zeros((2, 5, 2))
    gaps[1, 3], joints[0, :, 0], joints[1, :, 1] = 0.0, 0.95, -1.0
    outcome = straight(
        arm_distances=lambda: gaps, joints=joints, joint_limits=np.array([[-1.0] * 2, [1.0] * 2])
    )
    costs = TERMS["arm_to_obstacles"](
        outcome, task(obstacles=PointCloudDistance([[9.0, 9.0, 9.0]]))
    )
    assert costs.sum(axis=1) == pytest.approx([0.0, 0.02 + 0.004])
    assert TERMS["joint_limits"](outcome, task()).sum(axis=1) == pytest.approx([0.5, 1.0])


def test_jerk_is_a_multiple_of_what_it_was(primitive):
    parameters = all_weights(primitive)
    evaluate = FastRollouts(parameters, make_task(primitive), CostWeights(jerk=3.0))
    assert evaluate(np.zeros((1, parameters.size))).sum() == pytest.approx(3.0)
    # x = t³ has a jerk of 6; squared, over the 2 that it was.
    cubic = np.zeros((1, 5, 3))
    outcome = Outcome(TIMES, cubic, accelerations=lambda: cubic + (6 * TIMES)[:, None] * [1, 0, 0])
    assert TERMS["jerk"](outcome, task()).sum() == pytest.approx(18.0)
    moved = Outcome(TIMES, cubic + (TIMES**2)[:, None])
    assert moved.accelerations[0, 2] == pytest.approx([2.0] * 3)


def test_terms_add_up_with_their_weights():
    cost = CostWeights(hand_to_goal=2.0, deviation=10.0)
    outcome = straight(offset=0.2)
    assert cost(outcome, task()).sum(axis=1) == pytest.approx([0.6, 0.2 + 2.0])
    assert terms_of(cost, outcome, task()) == pytest.approx({"hand_to_goal": 0.3, "deviation": 0.0})


@pytest.mark.parametrize(
    ("term", "words"),
    [
        ("hand_to_obstacles", "hand_to_obstacles needs obstacles"),
        ("arm_to_obstacles", "arm_to_obstacles needs the arm; use kinematics"),
        ("joint_limits", "needs the arm; use kinematics"),
    ],
)
def test_a_term_without_what_it_needs(term, words):
    with pytest.raises(InputError, match=words):
        TERMS[term](straight(), task())


def test_an_error_that_was_measured_goes_before_the_tasks_goal():
    outcome = straight(end_errors=np.array([0.01, 0.02]))
    assert TERMS["hand_to_goal"](outcome, task()).sum(axis=1).tolist() == [0.01, 0.02]


def test_a_cost_from_the_command_line():
    cost = parse_cost("hand_to_goal, jerk=0.01,deviation = 2")
    assert cost == CostWeights(hand_to_goal=1.0, jerk=0.01, deviation=2.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hand_to_gaol", "--cost: 'hand_to_gaol' is not a term; use some of hand_to_goal"),
        ("jerk=much", "--cost: jerk=much is not a number"),
        ("jerk=-1", "--cost: jerk: -1.0 is negative"),
        ("jerk=0", "--cost: every term has weight 0"),
        ("none.py:cost", "no such file"),
        ("none.yaml", "none.yaml: no such file"),
    ],
)
def test_a_bad_cost_from_the_command_line(text, words):
    with pytest.raises(InputError, match=words):
        parse_cost(text)


def test_a_cost_file(tmp_path):
    path = tmp_path / "cost.yaml"
    path.write_text("hand_to_goal: 1\njerk: 1e-3\n")
    assert parse_cost(str(path)) == CostWeights(hand_to_goal=1.0, jerk=1e-3)
    path.write_text("hand_to_goal: 1\njerk: -2\n")
    with pytest.raises(InputError, match=r"cost.yaml line 2: jerk: -2.0 is negative"):
        load_cost(path)
    path.write_text("hand_to_goal: 1\njrek: 2\n")
    with pytest.raises(InputError, match='line 2: the file has no field "jrek"'):
        load_cost(path)


def test_a_cost_of_ones_own(tmp_path, primitive):
    path = tmp_path / "mine.py"
    path.write_text(
        "def highest(outcome, task):\n    return outcome.positions[:, :, 2].max(axis=1)\n"
        "def wrong(outcome, task):\n    return 1.0\nvalue = 3\n"
    )
    cost = parse_cost(f"{path}:highest")
    assert isinstance(cost, CostFunction)
    parameters = all_weights(primitive)
    evaluate = FastRollouts(parameters, make_task(primitive), cost)
    costs = evaluate(np.zeros((2, parameters.size)))
    assert costs == pytest.approx([primitive.rollout().positions[:, 2].max()] * 2)
    with pytest.raises(InputError, match=r"wrong gave costs of shape \(\); it must give \(2,\)"):
        CostFunction(path, "wrong")(straight(), task())
    with pytest.raises(InputError, match="defines no function value"):
        parse_cost(f"{path}:value")
    path = tmp_path / "broken.py"
    path.write_text("1 / 0\n")
    with pytest.raises(InputError, match=r"broken\.py, line 1: ZeroDivisionError"):
        parse_cost(f"{path}:any")


def test_points_and_movements_from_files(tmp_path, primitive):
    path = tmp_path / "cloud.txt"
    path.write_text("# x y z\n0.1 0.2 0.3\n\n0.4 0.5 0.6 # a corner\n")
    assert load_points(path).tolist() == [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]
    np.savez(tmp_path / "log.npz", cloud_torso_m=np.ones((4, 3)))
    assert load_points(tmp_path / "log.npz").shape == (4, 3)
    np.savez(tmp_path / "other.npz", cloud=np.ones((4, 3)))
    with pytest.raises(InputError, match="holds no cloud_torso_m"):
        load_points(tmp_path / "other.npz")
    path.write_text("0.1 0.2 0.3\n0.1 0.2\n")
    with pytest.raises(InputError, match=r"line 2: '0.1 0.2' is not x y z"):
        load_points(path)
    path.write_text("# nothing\n")
    with pytest.raises(InputError, match="holds no points"):
        load_points(path)
    primitive.save(tmp_path / "primitive.yaml")
    assert np.array_equal(load_movement(tmp_path / "primitive.yaml").goal, primitive.goal)
    with pytest.raises(InputError, match="must be 3 finite numbers"):
        make_task(primitive, goal=[0.0, np.nan, 0.0])
