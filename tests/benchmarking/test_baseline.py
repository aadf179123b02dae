import json

import pytest

from pepper_drake.benchmarking.baseline import HIGHER, LOWER, Baseline, Metric
from pepper_drake.benchmarking.gate import GROUPS, _outcomes, _quality, gate_tasks, source_digest
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.errors import InputError

BASELINE = Baseline(
    {
        "reached": Metric(9, "1", HIGHER, 0.0),
        "jerk": Metric(10.0, "m/s³", LOWER, 1.0),
    },
    "the first",
)


def measured(reached, jerk):
    return {"reached": Metric(reached, "1", HIGHER, 0.0), "jerk": Metric(jerk, "m/s³", LOWER, 1.0)}


@pytest.mark.parametrize(("reached", "jerk"), [(9, 10.0), (10, 1.0), (9, 11.0)])
def test_what_is_as_good_or_better_passes(reached, jerk):
    assert BASELINE.failures(measured(reached, jerk)) == []


@pytest.mark.parametrize(
    ("reached", "jerk", "words"),
    [
        (8, 10.0, "reached: 8 1; the baseline 9 allows at least 9"),
        (9, 11.1, "jerk: 11.1 m/s³; the baseline 10 allows at most 11"),
        (9, float("nan"), "jerk: nan"),
    ],
)
def test_what_is_worse_is_one_line(reached, jerk, words):
    (line,) = BASELINE.failures(measured(reached, jerk))
    assert words in line


def test_a_metric_that_is_gone_or_new_is_said():
    lines = BASELINE.failures({"touched": Metric(0, "1", LOWER, 0.0)})
    assert [line.split(":")[0] for line in lines] == ["reached", "jerk", "touched"]
    assert "was not measured" in lines[0]
    assert "renew" in lines[2]


def test_a_baseline_comes_back_as_it_was_saved(tmp_path):
    BASELINE.save(tmp_path / "baseline.json")
    assert Baseline.load(tmp_path / "baseline.json") == BASELINE


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"value": "many"}, "value is not a number"),
        ({"value": None}, "value is not a number"),
        ({"value": 1e300}, "too large"),
        ({"tolerance": -1.0}, "tolerance is -1"),
        ({"direction": "up"}, '"up"; give higher or lower'),
        ({"weight": 1.0}, "not a baseline"),
    ],
)
def test_a_spoilt_baseline_is_named(change, words, tmp_path):
    file = tmp_path / "baseline.json"
    BASELINE.save(file)
    content = json.loads(file.read_text())
    content["metrics"]["jerk"] |= change
    file.write_text(json.dumps(content))
    with pytest.raises(InputError, match=words) as error:
        Baseline.load(file)
    assert "baseline.json" in str(error.value)


def test_what_is_no_number_is_not_kept(tmp_path):
    spoilt = Baseline({"jerk": Metric(float("nan"), "m/s³", LOWER, 1.0)}, "")
    with pytest.raises(InputError, match=r"jerk\.value is nan"):
        spoilt.save(tmp_path / "baseline.json")
    assert list(tmp_path.iterdir()) == []


def test_no_baseline_says_how_one_is_made(tmp_path):
    with pytest.raises(InputError, match="--update-baseline REASON"):
        Baseline.load(tmp_path / "nowhere.json")


def test_a_touch_instead_of_a_reach_fails_two_metrics_of_its_group():
    good = [MethodResult("a", "d", "reached"), MethodResult("b", "d", "reached")]
    baseline = Baseline(_outcomes("still", good), "")
    assert baseline.failures(_outcomes("still", good)) == []
    bad = [good[0], MethodResult("b", "d", "touched")]
    assert len(baseline.failures(_outcomes("still", bad))) == 2


def test_nothing_reached_passes_nothing():
    good = [MethodResult("a", "d", "reached", position_error=0.001, jerk=3.0)]
    baseline = Baseline(_quality(good), "")
    failed = {line.split(":")[0] for line in baseline.failures(_quality([]))}
    assert {"reach.largest position error", "reach.median jerk"} <= failed


def test_runs_of_the_gate_are_named_apart_and_depend_on_the_code(tmp_path):
    names = [task.case.name for task in gate_tasks()]
    assert len(set(names)) == len(names) == sum(map(len, GROUPS.values()))
    assert source_digest() == source_digest()
