import numpy as np
import pytest

from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.summary import Rate, Scenes, markdown_table, solvable, summarise
from pepper_drake.reporting.benchmark_figure import draw_benchmark


def result(case, method, outcome, **numbers):
    return MethodResult(case, method, outcome, **numbers)


RESULTS = [
    result("s1", "c", "reached", first_motion_seconds=0.1, clearance=0.02),
    result("s2", "c", "touched", clearance=-0.01),
    result("s3", "c", "refused"),
    result("s4", "c", "failed"),
    result("s5", "c", "touched"),
    result("s1", "f", "reached", first_motion_seconds=0.3, clearance=0.03),
    result("s2", "f", "reached", first_motion_seconds=0.5, clearance=0.01),
    result("s3", "f", "reached", first_motion_seconds=0.4, clearance=0.05),
    result("s4", "f", "reached", first_motion_seconds=0.7, clearance=0.04),
    result("s5", "f", "refused"),
]


def test_a_scene_can_be_solved_if_some_method_solves_it():
    assert solvable(RESULTS) == {"s1", "s2", "s3", "s4"}


def test_rates_are_of_the_scenes_that_can_be_solved():
    c, f = summarise(RESULTS)
    assert (c.method, f.method) == ("c", "f")
    assert {name: rate.count for name, rate in c.rates.items()} == {
        "reached": 1,
        "touched": 1,
        "refused": 1,
        "failed": 1,
        "error": 0,
    }
    assert all(rate.total == 4 for rate in c.rates.values())
    assert c.touched_elsewhere == Rate(1, 1)
    assert f.rates["reached"].value == 1.0


def test_what_can_be_solved_is_said_only_where_someone_who_knows_all_was_asked():
    scenes = Scenes.of(RESULTS)
    assert (len(scenes.all), scenes.counted) == (5, {"s1", "s2", "s3", "s4"})
    assert str(scenes).startswith("4 of 5 scenes can be solved")
    blind = [r for r in RESULTS if r.method == "c"]
    scenes = Scenes.of(blind)
    assert (scenes.solvable, scenes.counted) == (None, scenes.all)
    assert str(scenes).startswith("Of 5 scenes; solvability was not asked")
    (c,) = summarise(blind)
    assert c.rates["reached"] == Rate(1, 5)
    assert c.rates["touched"] == Rate(2, 5)
    assert c.touched_elsewhere == Rate(0, 0)


@pytest.mark.parametrize(("methods", "label"), [("cf", "that can be solved"), ("c", "all scenes")])
def test_the_picture_says_what_its_rates_are_of(methods, label):
    results = [r for r in RESULTS if r.method in methods]
    figure = draw_benchmark(summarise(results), results)
    assert str(Scenes.of(results)) in figure.get_suptitle()
    assert label in figure.axes[0].get_xlabel()


def test_medians_are_over_the_runs_that_reached():
    c, f = summarise(RESULTS)
    assert c.medians["clearance"] == 0.02
    assert f.medians["first_motion_seconds"] == pytest.approx(0.45)
    assert f.medians["clearance"] == pytest.approx(0.035)
    assert f.first_motion_90 == pytest.approx(np.percentile([0.3, 0.5, 0.4, 0.7], 90))
    assert np.isnan(c.medians["jerk"])


@pytest.mark.parametrize(("count", "total"), [(0, 10), (7, 10), (290, 300), (300, 300)])
def test_the_interval_is_wilsons(count, total):
    z = 1.959964
    share = count / total
    middle = (share + z**2 / (2 * total)) / (1 + z**2 / total)
    half = z * np.sqrt(share * (1 - share) / total + z**2 / (4 * total**2)) / (1 + z**2 / total)
    assert Rate(count, total).interval() == pytest.approx((middle - half, middle + half), abs=1e-6)


def test_a_rate_of_nothing_says_nothing():
    assert str(Rate(0, 0)) == "-"
    assert Rate(0, 0).interval() == (0.0, 1.0)


def test_the_table_has_a_row_for_each_method_and_dashes_for_what_is_not_known():
    lines = markdown_table(summarise(RESULTS)).splitlines()
    assert len({line.count("|") for line in lines}) == 1
    assert len(lines) == 4
    assert "ours, reactive" in lines[2]
    assert "25.0 % (4.6 to 69.9)" in lines[2]
    assert "100 (100)" in lines[2]
    assert "450 (640)" in lines[3]
    assert lines[3].rstrip(" |").endswith("35")
    assert "| -" in lines[2]


@pytest.mark.parametrize("method", ["f", "d"])
@pytest.mark.filterwarnings("error")
def test_nothing_reached_is_a_table_and_a_picture_all_the_same(method, tmp_path):
    results = [result("s1", method, "touched"), result("s2", method, "refused")]
    summaries = summarise(results)
    assert f"| {0 if method == 'f' else 2} " in markdown_table(summaries)
    draw_benchmark(summaries, results).savefig(tmp_path / "nothing.png")
    assert (tmp_path / "nothing.png").stat().st_size > 1000
