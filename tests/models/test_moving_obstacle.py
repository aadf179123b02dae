import numpy as np
import pytest
from pydrake.geometry import Sphere

from pepper_drake.errors import InputError
from pepper_drake.models.motion import path_trajectory
from pepper_drake.models.random_scene import random_scene
from pepper_drake.models.scene import Obstacle, load_scene, save_scene
from pepper_drake.models.shapes import PlacedShape, distances

SEEDS = range(8)


@pytest.fixture(scope="module")
def scenes():
    return [random_scene(seed, moving=True) for seed in SEEDS]


def test_all_else_is_the_random_scene_of_the_seed(scenes):
    for seed, scene in zip(SEEDS, scenes, strict=True):
        still = random_scene(seed)
        assert scene.obstacles[:-1] == still.obstacles
        assert (scene.goal, scene.robot, scene.arm) == (still.goal, still.robot, still.arm)
        assert scene.obstacles[-1].path
        assert scene == random_scene(seed, moving=True)


def test_it_is_no_faster_than_it_says_and_moves_while_the_arm_does(scenes):
    fastest = []
    for scene in scenes:
        path = path_trajectory(scene.obstacles[-1].path)
        rate = path.MakeDerivative()
        times = np.linspace(path.start_time(), path.end_time(), 500)
        fastest.append(max(np.linalg.norm(rate.value(time)) for time in times))
        assert path.start_time() < 1.6
    assert max(fastest) <= 0.3 + 1e-3
    assert min(fastest) >= 0.1 - 1e-3


def hand_at_goal(scene):
    return PlacedShape("hand", Sphere(0.1), scene.goal.pose() @ scene.pre_grasp())


def test_it_runs_into_nothing_that_stands_still(scenes):
    for scene in scenes:
        mover = scene.obstacles[-1]
        _, poses = mover.poses_along(0.1)
        still = [solid for solid in scene.solids() if solid.name != mover.name]
        assert distances(mover.solid(), poses, still).min() > 0.0


def test_it_comes_near_the_hands_goal_and_leaves_it_to_the_hand(scenes):
    reaching_in = 0
    for scene in scenes:
        mover = scene.obstacles[-1]
        times, poses = mover.poses_along(0.1)
        gaps = distances(mover.solid(), poses, [hand_at_goal(scene)])[:, 0]
        assert gaps.min() < 0.45
        assert gaps[-1] >= 0.0
        inside = np.flatnonzero(gaps < 0.0)
        reaching_in += len(inside) > 0
        assert times[inside[0] if len(inside) else 0] < 2.0, "before any arm is there"
    assert 0 < reaching_in < len(scenes)


def test_it_stays_on_its_side_of_the_edge(scenes):
    for scene in scenes:
        mover = scene.obstacles[-1]
        top = scene.obstacles[0]
        _, poses = mover.poses_along(0.1)
        half = mover.size[1] / 2 if len(mover.size) > 1 else 0.0
        nearest = min((X @ [0.0, 0.0, s * half])[0] for X in poses for s in (-1, 1))
        assert nearest - mover.size[0] >= top.position[0] - top.size[0] / 2 - 1e-3


def wall(**changes):
    return Obstacle(
        name="wall",
        shape="capsule",
        size=[0.03, 0.2],
        position=[1.3, -0.12, 0.95],
        **changes,
    )


def test_a_path_through_the_goal_is_said_with_its_time():
    scene = load_scene("free")
    scene.obstacles.append(wall(path=[[1.0, 0, 0, 0], [3.0, -0.7, 0, 0]]))
    with pytest.raises(InputError, match=r'obstacles\[3\].path runs into "goal" at 1\.\d\d s'):
        scene.check()
    scene.obstacles[-1].path[1][3] = 0.6
    scene.check()


def test_a_capsule_is_an_obstacle_like_any_other(tmp_path):
    scene = load_scene("free")
    scene.obstacles.append(wall())
    save_scene(scene, tmp_path / "capsule.yaml")
    again = load_scene(tmp_path / "capsule.yaml")
    assert again.obstacles[-1] == scene.obstacles[-1]
    assert again.obstacles[-1].solid().length() == 0.2
    scene.obstacles[-1].size = [0.03]
    with pytest.raises(InputError, match="radius and length between its round ends"):
        scene.check()
