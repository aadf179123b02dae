import copy
import json

import publish_speed
from marked_section import with_section
from publish_speed import BEGIN, END, PERFORMANCE, SPEED, section


def test_the_tables_of_the_performance_page_are_those_of_the_results():
    page, speed = PERFORMANCE.read_text(), json.loads(SPEED.read_text())
    assert with_section(page, BEGIN, END, section(speed)) == page
    other = copy.deepcopy(speed)
    other["diagram"]["runs"]["with cameras"]["share_by_clock"] += 0.01
    other["planner"]["answers"]["replan"]["p99_ms"] += 1.0
    changed = set(section(other).splitlines()) - set(section(speed).splitlines())
    assert len(changed) == 2


def test_every_goal_is_of_something_measured():
    speed = json.loads(SPEED.read_text())
    measured = {"control tick", *speed["planner"]["answers"], *speed["diagram"]["runs"]}
    assert measured >= {*publish_speed._GOALS_MS, *publish_speed._GOALS_OF_PHYSICS}
