from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.models import random_scene
from pepper_drake.models.shapes import overlaps

seeds = st.integers(0, 2**31 - 1)


@given(seeds)
@settings(max_examples=30)
def test_a_seed_gives_one_scene_without_overlaps(seed):
    scene = random_scene(seed)
    assert scene == random_scene(seed)
    assert not overlaps(scene.solids())
    assert 2 <= len(scene.obstacles) - 5 <= 6  # a table top and four legs
    assert 0.66 <= scene.goal.position[2] <= 0.80


def test_seeds_differ_and_draw_both_arms():
    scenes = [random_scene(seed) for seed in range(10)]
    assert {scene.arm for scene in scenes} == {"left", "right"}
    assert len({scene.goal.position[2] for scene in scenes}) == 10
