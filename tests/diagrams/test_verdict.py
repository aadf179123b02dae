import pytest

from pepper_drake.diagrams.verdict import RunEnd, judge, judge_by_robot
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import GoalTolerances
from pepper_drake.planning.reach.reach_state_machine import UNCONFIRMED
from pepper_drake.results.reach_report import ReachReport, TaskOutcome


def judged(mode=ReachMode.DONE, reason="", message="", **measured):
    report = ReachReport(
        scene="table", arm="right", seed=0, coupling="barrier", final_position_error=0.001
    )
    for name, value in measured.items():
        setattr(report, name, value)
    judge(report, RunEnd(mode, reason, message), GoalTolerances(), longest=60.0)
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


@pytest.mark.parametrize(("force", "times"), [(9.0, 0), (12.0, 1)])
@pytest.mark.parametrize("reason", ["joint_held", "goal_pushed"])
def test_a_goal_object_that_was_run_into_is_named_beside_the_joint_that_it_held(
    force, times, reason
):
    """The robot that takes its goal to be elsewhere knows only that the joint did not follow."""
    mode = ReachMode.FAILED if reason == "joint_held" else ReachMode.DONE
    report = judged(mode, "joint_held", "a joint is held", goal_force=force)
    if times:
        assert report.reason == reason
    assert report.message.count("the goal object was pushed with 12 N") == times


@pytest.mark.parametrize(
    ("end", "measured", "outcome", "reason", "words"),
    [
        (
            RunEnd(ReachMode.DONE, fault="The solver failed"),
            {},
            "failed",
            "simulation_failed",
            "sol",
        ),
        (RunEnd(ReachMode.REACHING, is_over=False), {}, "failed", "interrupted", "ended at 7.0 s"),
        (RunEnd(ReachMode.REACHING), {}, "failed", "timeout", "not over after 60 s"),
        (
            RunEnd(ReachMode.DONE),
            {"tasks": [TaskOutcome(final_position_error=0.011)]},
            "failed",
            "not_at_goal",
            "farther from the true goal",
        ),
        (
            RunEnd(ReachMode.DONE, UNCONFIRMED, "seen 9 s ago"),
            {"tasks": [TaskOutcome(final_position_error=0.2)]},
            "failed",
            "not_at_goal",
            "seen 9 s ago, and it is not there",
        ),
        (
            RunEnd(ReachMode.DONE),
            {"final_axis_error": 0.6, "axis_tolerance": 0.5},
            "failed",
            "turned_away",
            "34 degrees off",
        ),
        (
            RunEnd(ReachMode.DONE),
            {"final_axis_error": 0.4, "axis_tolerance": 0.5},
            "reached",
            "",
            "",
        ),
        (RunEnd(ReachMode.DONE, UNCONFIRMED, "seen 9 s ago"), {}, UNCONFIRMED, UNCONFIRMED, "9 s"),
    ],
)
def test_each_end_is_named(end, measured, outcome, reason, words):
    report = ReachReport(
        scene="table",
        arm="right",
        seed=0,
        coupling="barrier",
        final_position_error=0.001,
        simulated_seconds=7.0,
        **measured,
    )
    judge(report, end, GoalTolerances(), longest=60.0)
    assert (report.outcome, report.reason) == (outcome, reason)
    assert words in report.message


@pytest.mark.parametrize(
    ("reason", "outcome"), [("", "reached"), (UNCONFIRMED, UNCONFIRMED)], ids=["seen", "unseen"]
)
def test_a_robot_says_by_itself_whether_it_saw_that_it_reached(reason, outcome):
    """Nothing is known of the true goal, as on a real robot."""
    report = ReachReport(scene="", arm="right", seed=0, coupling="barrier")
    judge_by_robot(report, RunEnd(ReachMode.DONE, reason, "seen 9 s ago"), longest=60.0)
    assert (report.outcome, report.reason) == (outcome, reason)
    assert ("9 s" in report.message) == bool(reason)
