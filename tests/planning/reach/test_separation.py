"""The speed before space that was not seen lately: what stops in time, what may touch."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.separation import (
    SeparationParams,
    StaleSpace,
    changed_speed,
    separated_speed,
    speed_fraction,
)
from tests.planning.reach.scripted_planner import CLOUD, NO_DETOUR, STALE, THING, on_its_way

PARAMS = SeparationParams()
STEP = 0.01


@given(time=st.floats(0.0, 3.0), fastest=st.floats(0.0, 1.5))
def test_an_arm_that_keeps_to_its_share_stands_before_the_space_or_touches_gently(time, fastest):
    speed = speed_fraction(StaleSpace((0.0, 0.0, 0.0), time, fastest), PARAMS)
    assert 0.0 < speed <= 1.0
    passed = speed * PARAMS.reaction
    while speed * fastest > PARAMS.touch_speed + 1e-9 and speed > PARAMS.min_speed_fraction:
        passed += speed * STEP
        speed = changed_speed(speed, 0.0, STEP, PARAMS)
        if passed > time + 1.5 * STEP:
            pytest.fail("it is too fast where it cannot see")


def test_space_that_was_seen_slows_nothing_down_and_more_time_never_slows_down():
    assert speed_fraction(StaleSpace(), PARAMS) == 1.0
    times = np.linspace(0.0, 1.0, 50)
    shares = [speed_fraction(StaleSpace((0.0, 0.0, 0.0), t, 0.5), PARAMS) for t in times]
    assert np.all(np.diff(shares) >= 0.0)
    assert shares[0] == pytest.approx(PARAMS.touch_speed / 0.5)
    assert shares[-1] == 1.0


def test_the_supervisor_slows_the_arm_down_and_counts_the_movements_own_time():
    one = on_its_way()
    one.planner.stale = STALE._replace(time=0.4)
    begun = one.look().state.performed
    speeds = [one.step().speed for _ in range(12)]
    assert np.all(np.diff(speeds) <= 0.0)
    assert speeds[-1] < 0.3
    assert one.state.performed - begun < 0.4
    one.planner.stale = StaleSpace()
    one.look().advance(0.3)
    assert one.state.speed == 1.0
    assert one.state.mode == ReachMode.REACHING


def test_a_retreat_is_not_slowed_down():
    one = on_its_way(ahead=0.0, detour=NO_DETOUR)
    one.planner.stale = STALE._replace(time=0.0)
    one.image_time = None
    one.advance(1.0)
    assert one.state.suspended_plan is not None
    assert one.state.speed == 1.0


def test_the_speed_near_what_came_keeps_the_separation_distance():
    for distance in np.linspace(0.15, 1.0, 30):
        v = separated_speed(distance, PARAMS)
        braking = v / PARAMS.deceleration
        person = PARAMS.approach_speed * (PARAMS.reaction + braking)
        robot = v * PARAMS.reaction + v * braking / 2.0
        assert person + robot + PARAMS.intrusion == pytest.approx(distance)
    assert separated_speed(0.0, PARAMS) == 0.0
    assert separated_speed(np.inf, PARAMS) == np.inf


@pytest.mark.parametrize("shrunk", [1.0, 0.2])
def test_near_what_came_the_arm_is_as_slow_as_a_touch_may_be(shrunk):
    one = on_its_way()
    near = StaleSpace(fastest=0.5, distance=0.05)
    one.planner.stale_after_a_visit = near
    one.image_time = None
    one.advance(0.5)
    assert one.state.speed == 1.0
    middle = THING.mean(axis=0)
    one.set(cloud=np.concatenate((CLOUD, middle + shrunk * (THING - middle))))
    one.advance(0.5)
    # Many points at one place are noise.
    slow = PARAMS.touch_speed / near.fastest if shrunk == 1.0 else 1.0
    assert one.state.speed == pytest.approx(slow)


@pytest.mark.parametrize("hidden", [True, False])
def test_near_what_may_come_along_its_axis_unseen_the_arm_is_as_slow(hidden):
    """A person's arm behind the goal object reaches farther than it is seen to."""
    one = on_its_way()
    near = StaleSpace(fastest=0.5, distance=0.05)
    one.planner.stale_after_a_visit = near
    one.image_time = None
    space = SimpleNamespace(
        views=[],
        hanging=lambda cloud, *_: np.ones(len(cloud), dtype=bool),
        end_hidden=lambda cloud, *_: np.full(len(cloud), hidden),
    )
    one.set(space=space)
    one.advance(0.5)
    assert one.state.speed == pytest.approx(PARAMS.touch_speed / near.fastest if hidden else 1.0)


@pytest.mark.parametrize(
    ("distances", "slow"),
    [
        ({0.0: 0.02, 0.1: 0.02}, True),
        ({0.0: 0.02, 0.1: 0.12}, False),
        # First a little nearer: at 0.3 m/s what came covers 60 mm meanwhile.
        ({0.0: 0.12, 0.2: 0.11, 0.4: 0.13}, False),
        ({0.0: 0.12, 0.2: 0.08, 0.4: 0.13}, True),
        # After that it is gone: how near the path comes to its place later is seen later.
        ({0.0: 0.12, 0.2: 0.11, 0.4: 0.13, 0.8: 0.01}, False),
    ],
)
def test_a_retreat_is_slow_only_while_it_does_not_leave_what_came(distances, slow):
    one = on_its_way(ahead=0.0, detour=NO_DETOUR)
    one.set(cloud=np.concatenate((CLOUD, THING)))
    one.look().advance(0.3)
    assert one.state.suspended_plan is not None
    one.planner.stale_after_a_visit = StaleSpace(time=0.0, fastest=0.5, distance=0.05)
    # The distance to what came, now and after so long on the way back.
    one.planner.distances = distances
    stale = one.look().state.stale
    assert stale.time == np.inf  # It goes where it was, seen lately or not.
    assert stale.distance == (0.05 if slow else np.inf)
