import numpy as np
import pytest

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.diagrams.taught_movement import taught_path
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_mode import ReachMode

PRIMITIVE = make_primitive(None, "right")
TIMES = 0.01 * np.arange(500)
GOAL = PRIMITIVE.goal + [0.02, 0.01, -0.01]


def path(mode=ReachMode.REACHING, origin=Origin.TAUGHT, goal=GOAL):
    modes, origins = np.full(500, int(mode)), np.broadcast_to(np.int64(origin), 500)
    hand = np.tile(PRIMITIVE.start, (500, 1))
    return taught_path(
        PRIMITIVE, TIMES, modes, origins, hand, np.broadcast_to(goal, (500, 3)).copy()
    )


def test_it_is_the_undisturbed_motion_from_the_hand_to_the_goal():
    taught = path()
    np.testing.assert_allclose(taught[0], PRIMITIVE.start, atol=1e-9)
    np.testing.assert_allclose(taught[-1], GOAL, atol=2e-3)
    own = PRIMITIVE.rollout(goal=GOAL, start_velocity=np.zeros(3)).positions
    nearest = np.linalg.norm(own[:, None] - taught, axis=2).min(axis=1)
    assert nearest.max() < 2e-3


def test_it_goes_to_where_the_goal_went():
    moved = GOAL + np.clip(TIMES, 0.0, 1.0)[:, None] * [0.0, 0.0, 0.08]
    np.testing.assert_allclose(path(goal=moved)[-1], moved[-1], atol=3e-3)


def test_the_goal_of_a_retreat_is_left_out():
    origin = np.where(TIMES < 4.0, Origin.RETREAT, Origin.DETOUR)
    goal = np.where((TIMES < 4.0)[:, None], PRIMITIVE.start, GOAL)
    np.testing.assert_allclose(path(origin=origin, goal=goal)[-1], GOAL, atol=2e-3)


@pytest.mark.parametrize("how", [{"mode": ReachMode.LOOKING}, {"goal": np.full(3, np.nan)}])
def test_there_is_none_of_an_arm_that_did_not_start(how):
    assert path(**how).shape == (0, 3)
