import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from pepper_drake.errors import InputError
from pepper_drake.evaluation.fault_table import (
    FaultCase,
    FaultResult,
    fault_cases,
    fault_result,
    load_results,
    markdown_table,
    run_fault,
)
from pepper_drake.results.reach_report import ReachReport
from pepper_drake.systems.faults.fault import parse_fault, sensible_faults

CASE = FaultCase("depth:stuck@reach", "table", 3)
REPORT = ReachReport(
    outcome="failed",
    reason="cloud_missing",
    message="the depth camera gave no image for 0.5 s",
    minimum_clearance=0.0342,
    command_acceleration=10.0000000001,
    stopping_seconds=0.18,
)


def test_every_sensible_fault_comes_from_both_starts_in_every_scene():
    cases = fault_cases(["table", "shelf"], 5)
    assert len(cases) == len(set(cases)) == 2 * 2 * len(sensible_faults())
    assert {case.seed for case in cases} == {5, 6}
    for case in cases:
        parse_fault(case.fault)


def parse_row(line):
    """A row of the table, as the result that it was written from."""
    cells = [cell.strip() for cell in line.strip().strip("|").split(" |")]
    fault, scene, outcome, why, contacts, *numbers = cells
    clearance, touch, stop, error = (float(cell) if cell else None for cell in numbers)
    reason, _, message = why.partition(": ")

    def metres(millimetres):
        return None if millimetres is None else millimetres / 1000

    return FaultResult(
        *(fault.strip("`"), scene, 0, outcome, reason, message, int(contacts)),
        *(metres(clearance), None, metres(touch), 0.0, 0.0, stop, metres(error)),
    )


def test_the_published_page_has_every_fault_and_counts_what_it_shows():
    page = (Path(__file__).parents[2] / "docs" / "faults.md").read_text()
    results = [parse_row(line) for line in page.splitlines() if line.startswith("| `")]
    assert {result.fault for result in results} == {c.fault for c in fault_cases(["table"], 0)}
    assert markdown_table(results) == page


@pytest.mark.parametrize(
    ("field", "value"), [("contacts", "3"), ("contact_force", "1e300"), ("seed", True), ("new", 1)]
)
def test_results_are_read_back_and_others_are_refused(tmp_path, field, value):
    path, row = tmp_path / "faults.json", asdict(fault_result(CASE, REPORT))
    path.write_text(json.dumps([row]))
    assert load_results(path) == {CASE: fault_result(CASE, REPORT)}
    path.write_text(json.dumps([row | {field: value}]))
    with pytest.raises(InputError, match=r"faults\.json"):
        load_results(path)


def test_a_named_stop_without_a_touch_is_safe():
    result = fault_result(CASE, REPORT)
    assert result.is_safe
    assert (result.fault, result.scene, result.reason) == (
        "depth:stuck@reach",
        "table",
        "cloud_missing",
    )


def test_a_fast_touch_a_hard_command_and_an_exception_are_not():
    slow = replace(REPORT, contacts=2, own_touch_speed=0.04, touch_speed=0.3)
    assert fault_result(CASE, slow).is_safe
    for report in (
        replace(REPORT, contacts=2, own_touch_speed=0.06),
        replace(REPORT, command_acceleration=12.0),
        replace(REPORT, reason="simulation_failed"),
    ):
        assert not fault_result(CASE, report).is_safe


def test_a_run_that_ends_by_an_exception_is_a_row_of_the_table(monkeypatch):
    def broken(scene):
        raise TypeError("a\nlong story")

    monkeypatch.setattr("pepper_drake.evaluation.fault_table.load_scene", broken)
    result = run_fault(CASE)
    assert (result.reason, result.is_safe) == ("simulation_failed", False)
    assert result.message == "TypeError: a long story"


def test_the_page_has_a_row_for_each_run_and_says_what_is_refused():
    fast = replace(REPORT, contacts=5, own_touch_speed=0.2, minimum_clearance=-0.003)
    page = markdown_table([fault_result(CASE, REPORT), fault_result(CASE, fast)])
    rows = [line for line in page.splitlines() if line.startswith("| `depth:stuck@reach`")]
    assert len(rows) == 2
    assert "cloud_missing: the depth camera gave no image for 0.5 s" in rows[0]
    assert "| 34.2 |" in rows[0]
    assert "| -3.0 | 200.0 |" in rows[1]
    assert "2 runs; touched something: 1" in page
    assert "`actuators:garbage`" in page
