import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.models.scene import load_scene, save_scene
from pepper_drake.models.scene_families import FAMILIES, MOVING_FAMILIES, family_scene

seeds = st.integers(0, 2**31 - 1)


@pytest.mark.parametrize("family", FAMILIES)
@given(seed=seeds)
@settings(max_examples=10)
def test_a_seed_gives_one_scene_that_makes_sense(family, seed):
    scene = family_scene(family, seed)
    scene.check()
    assert scene == family_scene(family, seed)
    assert scene.name == f"{family}_{seed}"
    assert len({obstacle.name for obstacle in scene.obstacles}) == len(scene.obstacles)


@pytest.mark.parametrize("family", FAMILIES)
def test_scenes_are_files_that_the_reader_takes(family, tmp_path):
    scene = family_scene(family, 3)
    save_scene(scene, tmp_path / "scene.yaml")
    assert load_scene(tmp_path / "scene.yaml") == scene


@pytest.mark.parametrize("family", FAMILIES)
def test_seeds_differ_and_draw_both_arms(family):
    scenes = [family_scene(family, seed) for seed in range(10)]
    assert {scene.arm for scene in scenes} == {"left", "right"}
    assert len({tuple(scene.goal.position) for scene in scenes}) == 10


def named(scene, part):
    return [obstacle for obstacle in scene.obstacles if part in obstacle.name]


@pytest.mark.parametrize("seed", range(5))
def test_each_family_is_what_it_is_called(seed):
    bin_scene = family_scene("bin", seed)
    goal, walls = bin_scene.goal.position, named(bin_scene, "bin_")
    xs, ys = (np.array([wall.position[k] for wall in walls]) for k in (0, 1))
    assert xs.min() < goal[0] < xs.max()
    assert ys.min() < goal[1] < ys.max()
    top = walls[0].position[2] + walls[0].size[2] / 2
    assert 0.05 < top - goal[2] < 0.14

    shelf = family_scene("compartment", seed)
    above = named(shelf, "upper_board")[0]
    assert above.position[2] > shelf.goal.position[2] + shelf.goal.height

    assert 3 <= len(named(family_scene("pickets", seed), "picket")) <= 7
    assert len(named(family_scene("side_panels", seed), "panel")) == 2

    beside = family_scene("cupboard", seed)
    side = 1.0 if beside.arm == "left" else -1.0
    cupboard = named(beside, "cupboard")[0]
    assert side * (cupboard.position[1] - beside.goal.position[1]) > 0.3
    assert cupboard.size[2] > 0.8

    assert family_scene("low_table", seed).goal.position[2] < 0.63
    assert family_scene("high_table", seed).goal.position[2] > 0.81


def test_an_unknown_family_is_refused():
    with pytest.raises(InputError, match='family is "cave"; it must be one of bin, compartment'):
        family_scene("cave", 0)


@pytest.mark.parametrize("family", MOVING_FAMILIES)
def test_something_may_move_in_a_family_and_all_else_stays(family):
    still, moving = family_scene(family, 4), family_scene(family, 4, moving=True)
    assert moving.name == f"moving_{family}_4"
    assert moving.obstacles[:-1] == still.obstacles
    assert moving.obstacles[-1].path
    assert (moving.goal, moving.arm, moving.robot) == (still.goal, still.arm, still.robot)


def test_a_family_without_room_for_what_moves_says_so():
    with pytest.raises(InputError, match=r"compartment has no room .*bin, pickets"):
        family_scene("compartment", 4, moving=True)
