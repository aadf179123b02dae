import json

import pytest

from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.errors import InputError


def test_a_result_comes_back_as_it_was_saved(tmp_path):
    result = MethodResult("random_3", "d", "reached", first_motion_seconds=0.1, clearance=0.02)
    file = tmp_path / "random_3" / "d.json"
    result.save(file)
    assert MethodResult.load(file) == result
    assert [path.name for path in file.parent.iterdir()] == ["d.json"]


def test_what_is_not_finite_is_nothing(tmp_path):
    MethodResult("x", "a", "refused", jerk=float("nan")).save(tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text())["jerk"] is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not a result"),
        ("[1, 2]", "not a result"),
        ('{"speed": 3}', "not a result"),
        ('{"outcome": "won"}', '"won"'),
    ],
)
def test_a_file_that_is_no_result_is_named(text, words, tmp_path):
    file = tmp_path / "d.json"
    file.write_text(text)
    with pytest.raises(InputError, match=words) as error:
        MethodResult.load(file)
    assert "d.json" in str(error.value)
    assert "remove it" in str(error.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"d\.json"):
        MethodResult.load(tmp_path / "d.json")
