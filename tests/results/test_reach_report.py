import json

import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.errors import InputError
from pepper_drake.results.movement_report import MovementReport
from pepper_drake.results.reach_report import CloudReport, ReachReport, pose_error


def test_a_report_is_json_with_null_for_what_is_not_finite(tmp_path):
    report = ReachReport(
        outcome="reached",
        final_position_error=0.0021,
        minimum_clearance=float("inf"),
        cloud=CloudReport(points=3, rms_error=float("nan")),
    )
    report.save(tmp_path / "report.json")
    data = json.loads((tmp_path / "report.json").read_text(), parse_constant=pytest.fail)
    assert data["outcome"] == "reached"
    assert data["final_position_error"] == 0.0021
    assert data["minimum_clearance"] is None
    assert data["cloud"] == {"points": 3, "rms_error": None, "robot_points": 0, "goal_points": 0}


def test_the_summary_says_the_figures_in_millimetres():
    report = ReachReport(
        outcome="reached",
        final_position_error=0.0021,
        goal_estimate_error=0.0012,
        minimum_clearance=0.0234,
        contacts=0,
        tracking_error_rms=0.0005,
        simulated_seconds=10.0,
        wall_seconds=4.0,
        realtime_factor=2.5,
    )
    summary = report.summary()
    assert summary.splitlines()[0] == "reached"
    for words in ("2.1 mm", "estimate 1.2 mm", "23.4 mm", "0 steps", "0.5 mm rms", "2.5 times"):
        assert words in summary


def test_the_summary_of_a_failure_begins_with_why():
    report = ReachReport(reason="goal_lost", message="the goal's marker was not seen for 12 s")
    assert report.summary().startswith("failed: the goal's marker was not seen for 12 s\n")
    for words in ("of the goal", "estimate", "rms"):
        assert words not in report.summary()


@pytest.mark.parametrize("angle", [0.0, 0.3, -0.3, 3.0])
def test_pose_error_is_distance_and_angle(angle):
    X_WA = RigidTransform(RollPitchYaw(0.4, -0.2, 1.0), [1.0, 2.0, 3.0])
    turn = RigidTransform(RollPitchYaw(0, angle, 0), [0.03, 0.0, -0.04])
    distance, error = pose_error(X_WA, X_WA @ turn)
    assert distance == pytest.approx(0.05)
    assert error == pytest.approx(abs(angle), abs=1e-7)
    assert pose_error(X_WA @ turn, X_WA) == pytest.approx((distance, error))


def test_a_report_comes_back_as_it_was_saved(tmp_path):
    report = ReachReport(
        outcome="reached",
        final_axis_error=0.1,
        movement=MovementReport(kind="bent", largest_coupling=2.0),
        cloud=CloudReport(points=3),
    )
    report.save(tmp_path / "report.json")
    assert ReachReport.load(tmp_path / "report.json") == report
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(InputError, match="not a report of a reach"):
        ReachReport.load(tmp_path / "report.json")


def test_the_summary_says_how_the_hand_is_turned():
    report = ReachReport(final_orientation_error=0.2, final_axis_error=0.1, axis_tolerance=0.5)
    for words in ("5.7°", "allowed 29°", "11.5°", "five joints"):
        assert words in report.summary()
