from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.planning import RobotCollisionType

from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.goal_search import goal_postures
from pepper_drake.benchmarking.known_scene import GroundTruthScene
from pepper_drake.benchmarking.methods import get_method
from pepper_drake.benchmarking.pink_barriers import barrier_motion, pinocchio_models
from pepper_drake.benchmarking.planned_reach import (
    PlannedReach,
    optimized_motions,
    roboplan_motions,
    rrt_motions,
)
from pepper_drake.benchmarking.roboplan_rrt import roboplan_scene
from pepper_drake.benchmarking.timed_path import timed_path
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.scene import Obstacle, load_scene, save_scene
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams


@pytest.fixture(scope="module")
def free():
    return GroundTruthScene(load_scene("free"))


@pytest.fixture(scope="module")
def place(free):
    return next(free.candidate_base_poses())


def test_at_rest_the_robot_touches_nothing_where_it_may_stand(free, place):
    assert free.free(free.start, place)
    clearance, _ = free.clearance(free.start[None], place)
    assert clearance > 0.02


def test_a_place_inside_the_stand_is_none(free, place):
    goal = free.scene.goal.position
    clearance, pair = free.clearance(free.start[None], np.array([*goal[:2], 0.0]))
    assert clearance < 0.0
    assert pair == "base of Tibia - pole"


def test_an_elbow_beyond_its_coupled_limit_is_not_free(free, place):
    joints = free.start.copy()
    joints[3] = free.lower[3] - 0.1
    assert not free.free(joints, place)


def test_goal_postures_put_the_hand_at_the_goal_and_touch_nothing(free, place):
    postures = goal_postures(free, place, np.random.default_rng(0))
    assert postures
    for posture, X_WH in zip(postures, free.hand_poses(np.array(postures), place), strict=True):
        error = np.linalg.norm(X_WH.translation() - free.X_WG.translation())
        assert error < 0.001
        assert free.clearance(posture[None], place)[0] > 0.0
        assert free.is_at_goal(posture, place)


def test_a_hand_that_is_at_its_goal_but_turned_away_has_not_reached(free, place):
    task = free.scene.goal.pre_grasp
    postures = np.array(goal_postures(free, place, np.random.default_rng(0)))
    turned = [
        task.axis_error(X_WH.rotation().inverse() @ free.X_WG.rotation())
        for X_WH in free.hand_poses(postures, place)
    ]
    tolerance = max(turned) - 0.01
    assert min(turned) < tolerance < task.tolerance
    goal = replace(free.scene.goal, pre_grasp=replace(task, tolerance=tolerance))
    strict = GroundTruthScene(replace(free.scene, goal=goal))
    worst, best = postures[np.argmax(turned)], postures[np.argmin(turned)]
    assert strict.is_at_goal(best, place)
    assert not strict.is_at_goal(worst, place)
    for posture in goal_postures(strict, place, np.random.default_rng(0)):
        assert strict.is_at_goal(posture, place)

    found = [
        PlannedReach(lambda *_, end=end: iter([np.array([free.start, end])]))._search_from(
            strict, place, 0.0, 0
        )
        for end in (best, worst)
    ]
    assert found[0] is not None
    assert found[1] is None


BASE = np.array([-0.3, 0.0, 0.0])


@pytest.fixture(scope="module")
def crossing():
    """A wall that begins to move at 1 s, and at 2 s stands where the robot stands."""
    scene = load_scene("free")
    scene.obstacles.append(
        Obstacle(
            name="wall",
            shape="box",
            size=[0.02, 0.3, 0.3],
            position=[-0.3, 1.0, 1.0],
            path=[[1.0, 0.0, 0.0, 0.0], [2.0, 0.0, -1.0, 0.0]],
        )
    )
    return GroundTruthScene(scene)


def test_clearance_knows_where_an_obstacle_is_when(crossing):
    path = np.repeat(crossing.start[None], 201, axis=0)
    assert crossing.quiet_after == 2.0
    assert crossing.clearance(path[:101], BASE)[0] == pytest.approx(0.1)
    clearance, pair = crossing.clearance(path, BASE)
    assert clearance < 0.0
    assert "wall" in pair


def test_a_timed_path_keeps_the_limits_and_rests_at_both_ends():
    corners = np.array(
        [[1.5, -0.2, 1.2, 0.5, 0.0], [1.0, -0.5, 1.0, 0.9, 0.3], [0.3, -0.3, 0, 1, 0]]
    )
    motion = timed_path("right", corners)
    limits = shared_control_model().command_limits(
        arm_joints("right"), speed_fraction=DifferentialIkParams().speed_fraction
    )
    speed = np.diff(motion, axis=0) / 0.01
    np.testing.assert_allclose(motion[[0, -1]], corners[[0, -1]], atol=1e-9)
    assert np.all(np.abs(speed[:-1]) <= 1.01 * limits.velocity)
    assert np.all(np.abs(np.diff(speed[:-1], axis=0)) / 0.01 <= 1.1 * limits.acceleration)
    # As fast as they allow: some joint is at a limit nearly all the time.
    share = np.abs(np.diff(speed[:-1], axis=0)) / 0.01 / limits.acceleration
    assert (
        np.mean(
            np.maximum(share.max(axis=1), (np.abs(speed[1:-1]) / limits.velocity).max(axis=1)) > 0.8
        )
        > 0.8
    )


def check_reached(result):
    assert result.outcome == "reached"
    assert result.clearance > 0.0
    assert result.position_error < 0.01
    assert 0.0 < result.first_motion_seconds <= result.planning_seconds
    assert 0.3 < result.path_length < 1.5
    assert 0.3 < result.duration < 5.0
    assert result.jerk > 0.0


@pytest.fixture(scope="module")
def optimized(tmp_path_factory):
    """A reach by trajectory optimisation: its folder, its result, and the motion found last."""
    found, folder = [], tmp_path_factory.mktemp("optimized")

    def kept_motions(known, base_pose, seed):
        for motion in optimized_motions(known, base_pose, seed):
            found.append(motion)
            yield motion

    return folder, PlannedReach(kept_motions).replay(Case(0, "free"), folder), found[-1]


def test_trajectory_optimisation_reaches_a_free_goal(optimized):
    folder, result, _ = optimized
    check_reached(result)
    assert "meshcat" in (folder / "recording.html").read_text().lower()


def test_rrt_connect_reaches_a_free_goal():
    pytest.importorskip("ompl", reason="OMPL is in the bench extra")
    check_reached(PlannedReach(rrt_motions)(Case(0, "free")))


@pytest.fixture(scope="module")
def table():
    return GroundTruthScene(load_scene("table"))


def roboplan_sees_as_drake(known, base_pose, count=150):
    """Share of random postures of which RoboPlan's model says the same as Drake's checker."""
    scene = roboplan_scene(known, base_pose)
    rng = np.random.default_rng(0)
    names = scene.getJointGroupInfo(f"{known.scene.arm}_arm").joint_names
    places = scene.getJointPositionIndices(names)
    said = []
    for joints in rng.uniform(known.lower, known.upper, (count, 5)):
        q = scene.getCurrentJointPositions()
        q[places] = joints
        free = known.arm_checker.CheckConfigCollisionFree(known.positions(joints, base_pose))
        said.append((not scene.hasCollisions(q), free))
    return np.array(said)


def test_roboplan_plans_in_the_same_scene(table):
    pytest.importorskip("roboplan", reason="RoboPlan is in the bench extra")
    base_pose = next(table.candidate_base_poses())
    said = roboplan_sees_as_drake(table, base_pose)
    assert 0.1 < said[:, 1].mean() < 0.9
    # Its capsules and meshes are the boxes and cylinders around them: it may refuse more.
    assert np.mean(said[:, 0] & ~said[:, 1]) < 0.01
    assert np.mean(said[:, 0] == said[:, 1]) > 0.95


def test_roboplan_reaches_a_free_goal():
    pytest.importorskip("roboplan", reason="RoboPlan is in the bench extra")
    check_reached(PlannedReach(roboplan_motions)(Case(0, "free")))


def test_pinks_barriers_keep_the_padding_where_there_is_a_way(free, place):
    pytest.importorskip("pink", reason="Pink is in the bench extra")
    motion = barrier_motion(free, place)
    error = free.hand_poses(motion[-1:], place)[0].translation() - free.X_WG.translation()
    assert np.linalg.norm(error) < 0.01
    assert free.clearance(motion, place)[0] > free.padding - 0.002
    limits = shared_control_model().command_limits(
        arm_joints("right"), speed_fraction=DifferentialIkParams().speed_fraction
    )
    assert np.all(np.abs(np.diff(motion, axis=0)) / 0.01 <= 1.001 * limits.velocity)


def test_pink_measures_distances_as_drake_does(table):
    pytest.importorskip("pink", reason="Pink is in the bench extra")
    import pinocchio as pin

    base_pose = next(table.candidate_base_poses())
    model, geometry = pinocchio_models(table, base_pose)
    solids = {name for name, _, _ in table.solids()}
    rng, own, drakes = np.random.default_rng(0), [], []
    for joints in rng.uniform(table.lower, table.upper, (20, 5)):
        data, geometry_data = model.createData(), pin.GeometryData(geometry)
        pin.computeDistances(model, data, geometry, geometry_data, joints)
        pairs = zip(geometry.collisionPairs, geometry_data.distanceResults, strict=True)
        own.append(
            min(
                result.min_distance
                for pair, result in pairs
                if geometry.geometryObjects[pair.second].name in solids
            )
        )
        clearance = table.arm_checker.CalcRobotClearance(table.positions(joints, base_pose), 0.3)
        kinds = np.array(clearance.collision_types())
        outside = kinds == RobotCollisionType.kEnvironmentCollision
        drakes.append(clearance.distances()[outside].min() + table.padding)
    apart = np.array(drakes) > 0.002
    assert apart.sum() >= 10
    np.testing.assert_allclose(np.array(own)[apart], np.array(drakes)[apart], atol=1e-3)


def test_what_cannot_be_reached_is_refused(tmp_path):
    scene = load_scene("free")
    goal = scene.goal.position
    # A box around the hand's goal, open to nobody.
    scene.obstacles = [
        Obstacle(
            name="case",
            shape="box",
            size=[0.3, 0.3, 0.3],
            position=[goal[0], goal[1] - 0.19, goal[2] + 0.1],
        )
    ]
    save_scene(scene, tmp_path / "closed.yaml")

    def none(known, base_pose, seed):
        return iter(goal_postures(known, base_pose, np.random.default_rng(seed), tries=2))

    result = PlannedReach(none)(Case(0, str(tmp_path / "closed.yaml")))
    assert (result.outcome, result.reason) == ("refused", "no_clear_path")
    assert result.first_motion_seconds is None


def test_who_knows_that_something_moves_waits_until_it_has_passed(
    free, place, optimized, monkeypatch
):
    _, _, motion = optimized
    assert free.clearance(motion, place)[0] > 0.0
    scene = load_scene("free")
    p_WG = free.X_WG.translation()
    scene.obstacles.append(
        Obstacle(
            name="ball",
            shape="sphere",
            size=[0.03],
            position=list(p_WG + [0.0, 0.0, 0.05]),
            path=[[1.5, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.8]],
        )
    )
    monkeypatch.setattr(Case, "build", lambda case: scene)
    reach = PlannedReach(lambda known, base_pose, seed: iter([motion]))
    result = reach(Case(0))
    assert result.outcome == "reached"
    assert result.first_motion_seconds > 1.0
    assert result.duration == pytest.approx(
        result.first_motion_seconds + len(motion) / 100, abs=0.1
    )


def test_the_planner_in_the_docs_reaches_a_free_goal(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "arena.md").read_text()
    (tmp_path / "own.py").write_text(page.partition("```python\n")[2].partition("```")[0])
    method = get_method(f"{tmp_path}/own.py:by_chance")
    check_reached(method.run(Case(0, "free")))
