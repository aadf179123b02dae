from types import SimpleNamespace

import pytest

from pepper_drake.diagrams.reach_simulation import ReachSimulation
from pepper_drake.models.scene import load_scene
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.results.reach_report import ReachReport

RUN = SimpleNamespace(
    reaching=SimpleNamespace(
        config=SimpleNamespace(planner=ReachPlannerParams()), scene=load_scene("table")
    ),
    _fault="",
    _is_over=True,
)


def judged(mode=ReachMode.DONE, reason="", message="", **measured):
    report = ReachReport(
        scene="table", arm="right", seed=0, coupling="barrier", final_position_error=0.001
    )
    for name, value in measured.items():
        setattr(report, name, value)
    ReachSimulation._judge(RUN, report, mode, reason, message)
    return report


def test_a_hand_at_its_goal_that_touched_nothing_has_reached():
    report = judged()
    assert (report.outcome, report.reason, report.message) == ("reached", "", "")


@pytest.mark.parametrize(("force", "reason"), [(9.0, ""), (11.0, "goal_pushed")])
def test_a_goal_object_that_is_pushed_is_not_reached(force, reason):
    report = judged(goal_force=force)
    assert report.reason == reason
    assert (report.outcome == "reached") == (reason == "")


@pytest.mark.parametrize(
    ("mode", "reason"), [(ReachMode.FAILED, "joint_held"), (ReachMode.DONE, "touched")]
)
def test_a_touch_is_reported_whatever_else_failed(mode, reason):
    report = judged(mode, "joint_held", "a joint is held", contacts=3, closest_pair="hand - box")
    assert report.reason == reason
    assert report.message.count("touched an obstacle (hand - box)") == 1
