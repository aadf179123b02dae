import json
import re

import pytest
from marked_section import with_section
from publish_benchmark import BEGIN, END, README, RESULTS, section

from pepper_drake.benchmarking.method_result import OUTCOMES


@pytest.fixture(scope="module")
def results():
    return json.loads(RESULTS.read_text())


def test_the_readmes_numbers_are_those_of_the_results(results):
    readme = README.read_text()
    assert with_section(readme, BEGIN, END, section(results)) == readme


def test_another_number_would_be_seen(results):
    readme = README.read_text()
    digits = re.search(r"\d", readme.partition(BEGIN)[2].partition("| --- |")[2]).start()
    place = readme.index("| --- |", readme.index(BEGIN)) + len("| --- |") + digits
    other = readme[:place] + str((int(readme[place]) + 1) % 10) + readme[place + 1 :]
    assert with_section(other, BEGIN, END, section(results)) != other


def test_no_number_of_a_benchmark_stands_outside_the_marks():
    readme = README.read_text()
    chapter = readme.partition("## How well does it reach?")[2].partition("\n## ")[0]
    outside = chapter.partition(BEGIN)[0] + chapter.partition(END)[2]
    assert re.findall(r"\d+(?:\.\d+)? (?:%|of|to)|\d+ reached", outside) == []


def test_the_counts_of_the_results_add_up(results):
    for content in results.values():
        counted = content["scenes"] if content["solvable"] is None else content["solvable"]
        assert set(counted) <= set(content["scenes"])
        for method in content["methods"]:
            rates = [method["rates"][outcome] for outcome in OUTCOMES]
            assert {rate["total"] for rate in rates} == {len(counted)}
            assert sum(rate["count"] for rate in rates) == len(counted)


def test_marks_that_are_gone_are_said():
    with pytest.raises(SystemExit, match="lacks"):
        with_section("no marks", BEGIN, END, "text")
