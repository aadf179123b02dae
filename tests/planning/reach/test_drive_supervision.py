import numpy as np
import pytest

from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.reach.swept_space import UnseenSpaceParams
from tests.planning.reach.scripted_planner import (
    TIMING,
    ScriptedPlanner,
    Supervised,
    plan,
    unseen_plan,
)


def test_what_the_robot_would_pass_on_its_drive_is_looked_at_first():
    planner = ScriptedPlanner(placement=unseen_plan(), drive=unseen_plan())
    one = Supervised(planner).advance(2.0)
    assert one.modes == [ReachMode.LOOKING]
    np.testing.assert_allclose(one.state.look_at, [1.0, -0.3, 0.8])
    assert np.isnan(one.state.base_goal).all()
    planner.drive = plan()
    one.until(ReachMode.DRIVING)
    assert np.isnan(one.state.look_at).all()
    assert one.state.places == 1
    one.until(ReachMode.REACHING)


@pytest.mark.parametrize("drive", [True, False])
def test_while_it_plans_where_to_stand_it_looks_along_the_likely_drive(drive):
    way = np.array([0.5, 0.1, 0.4])
    params = ReachPlannerParams(unseen=UnseenSpaceParams(check_drive=drive))
    one = Supervised(ScriptedPlanner(params=params, way=way)).advance(TIMING.looking + 0.05)
    assert one.state.is_planning
    assert np.isnan(one.state.look_at).all()  # Where to look takes time to find, too.
    one.advance(TIMING.latency.drive)
    assert np.array_equal(one.state.look_at, way) == drive
    one.planner.way = np.full(3, np.nan)
    one.look().advance(TIMING.latency.drive)
    assert np.isnan(one.state.look_at).all()
    # Between two images nothing changes.
    one.planner.asked.clear()
    one.advance(0.05)
    assert one.state.is_planning
    assert not one.planner.asked


def test_a_robot_does_not_drive_through_what_stays_unseen():
    planner = ScriptedPlanner(placement=unseen_plan(), drive=unseen_plan())
    one = Supervised(planner).failed("not_seen", limit=20.0)
    assert one.modes == [ReachMode.LOOKING, ReachMode.FAILED]
    looked = TIMING.unseen_timeout + TIMING.latency.base_placement + TIMING.looking
    assert one.state.since == pytest.approx(looked, abs=0.3)


def test_before_it_drives_on_to_another_place_it_looks_along_that_way_too():
    planner = ScriptedPlanner(reach=plan(PlanStatus.OUT_OF_REACH, "too far"))
    one = Supervised(planner).until(ReachMode.SETTLING)
    planner.placement = planner.drive = unseen_plan()
    planner.way = np.array([0.5, 0.1, 0.4])
    while not one.state.is_placing:
        one.step()
    one.advance(TIMING.latency.drive)
    assert one.state.mode == ReachMode.SETTLING
    np.testing.assert_allclose(one.state.look_at, planner.way)
    one.until(ReachMode.LOOKING).advance(0.3)
    np.testing.assert_allclose(one.state.look_at, [1.0, -0.3, 0.8])
    planner.drive = plan()
    one.until(ReachMode.DRIVING)
    assert one.state.places == 2


def test_what_is_seen_where_it_was_going_to_drive_leads_to_another_place():
    blocked = plan(PlanStatus.NO_STANDING_ROOM, "something stands there")
    planner = ScriptedPlanner(placement=unseen_plan(), drive=blocked)
    one = Supervised(planner).advance(1.5)
    assert planner.questions().count("plan_base_placement") == 2
    planner.placement = plan()
    one.until(ReachMode.DRIVING)
    # Without end it does not go on like this.
    planner = ScriptedPlanner(placement=unseen_plan(), drive=blocked)
    Supervised(planner).failed("no_standing_room", limit=30.0)
    assert planner.questions().count("plan_base_placement") == TIMING.max_base_placements + 1


@pytest.mark.parametrize("lasts", [0.8, 5.0])
def test_without_depth_images_it_does_not_know_where_to_drive(lasts):
    planner = ScriptedPlanner(placement=unseen_plan(), drive=unseen_plan())
    one = Supervised(planner).advance(1.5).look().advance(0.3)
    planner.drive = plan()
    one.advance(lasts)
    if lasts < TIMING.cloud_lost:
        assert one.state.mode == ReachMode.LOOKING
        one.image_time = None
        one.until(ReachMode.DRIVING)
    else:
        assert one.state.reason == "cloud_missing"
