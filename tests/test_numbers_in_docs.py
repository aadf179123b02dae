"""Every number in README and docs is one that the code has now, or that a command makes.

A number of the prose stands in `SAID`, made of the code's own; one that is in neither is found.
Tables between marks are written from results, and what commands print is compared with what they
print, by other tests.
"""

import inspect
import math
import re
from dataclasses import fields
from pathlib import Path

import pytest

from pepper_drake import cli
from pepper_drake.benchmarking import scene_file
from pepper_drake.benchmarking.summary import Rate
from pepper_drake.benchmarking.timed_path import timed_path
from pepper_drake.hardware import dead_man, hand_over, preflight, robot_recording, slow_motion
from pepper_drake.learning.demonstrations.conditioning import BOUND, BOUND_SHARE
from pepper_drake.learning.demonstrations.recording import CUTOFF
from pepper_drake.models.control_model import CONTROL_PERIOD
from pepper_drake.models.motion import goal_motion
from pepper_drake.models.pepper import head_pitch_limits
from pepper_drake.models.scene import HandMarker
from pepper_drake.optimization import ratings
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.depth_validity import ValidityParameters
from pepper_drake.perception.mapping.near_field_occlusion import NearFieldParameters
from pepper_drake.robot_server.robot import base_controller, floor_map, range_sensors
from pepper_drake.robot_server.services import navigation
from pepper_drake.robot_server.wire.server import PORT
from pepper_drake.scenario import Scenario, load_scenario
from pepper_drake.systems.guiding.motion_recorder import MotionRecorder
from pepper_drake.systems.robot.true_clearance import TrueClearance

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SCENARIO: Scenario = load_scenario(None, [])
PLANNER, TIMING = SCENARIO.planner, SCENARIO.supervisor
UNSEEN, NEW, SEPARATION = PLANNER.unseen, PLANNER.new_obstacle, TIMING.separation
NEAR = f"{CAMERA_DEPTH.intrinsics.near:g} m"
TOUCH = f"{1000 * SEPARATION.touch_speed:g} mm/s"
WORDS = {1.0: "one", 2.0: "two", 0.5: "half a", 0.25: "a quarter"}


def default(function, parameter):
    return inspect.signature(function).parameters[parameter].default


EXITS = f"{cli.EXIT_DONE} when it did its job, {{}}{cli.EXIT_FAILED} when the robot did not"
MOVED = f"by {100 * default(goal_motion, 'distance'):g} cm"
BASE_NEAR, BASE_TURNED = base_controller._NEAR

SAID = {
    "README.md": [
        f"{1 / CONTROL_PERIOD:g} times a second, as often as NAOqi takes them",
        f"halves what shakes at {CUTOFF:g} Hz",
        f"The goal object rises {MOVED}",
        f"exits with {EXITS.format('')}",
        f"says why), {cli.EXIT_BAD_INPUT} when its input was bad",
        f"gently: {TIMING.gentle_duration:g} times as slowly as taught, joints at "
        f"{100 * TIMING.gentle_speed:g} % of their rated speed",
        f"bridged within {100 * BOUND:g} cm or {WORDS[BOUND_SHARE]} of the distance",
    ],
    "docs/arena.md": [
        f"Wilson's {100 * default(Rate.interval, 'confidence'):g} %",
        f"cut at {default(TrueClearance, 'max_distance'):g} m",
        f"[rad] every {1000 * default(timed_path, 'time_step'):g} ms",
        f'`"{scene_file.FORMAT}"`, {scene_file.VERSION} |',
        "Time 0 is when the arm may start",
        f"the exit status is {cli.EXIT_FAILED}. Outcomes",
    ],
    "docs/howto/chains.md": ["closed (0) to open (1)"],
    "docs/howto/faults.md": [f"The exit code is {cli.EXIT_DONE} when every outcome is safe"],
    "docs/index.md": [
        f"exits with {EXITS.format('with ')}",
        f"with {cli.EXIT_BAD_INPUT} when its input was bad",
    ],
    "docs/tutorial.md": [
        f"a row for each {1000 * default(MotionRecorder, 'time_step'):g} ms",
        f"lift the goal object {MOVED}",
        f"ends with exit code {cli.EXIT_FAILED}",
        f"your own judgement from 0 to {ratings.BEST_SCORE:g}",
    ],
    "docs/limitations.md": [
        f"was seen before; errors below {100 * ValidityParameters.scale_error:g} % pass",
        f"Its range begins at {NEAR}",
        f"has not been seen for {UNSEEN.recent:g} s (`planner.unseen.recent`)",
        f"slows down, to as little as {TOUCH}",
        f"A person's arm that stays within {NEAR} of the camera",
        f"only what is within {NearFieldParameters.moved_extent:g} m of an object that moved",
        f"no floor behind it within {NearFieldParameters.farthest:g} m",
        f"within {UNSEEN.beside_movable:g} m (`planner.unseen.beside_movable`)",
        f"is passed at {TOUCH} even where",
        f"hangs less than {100 * NEW.hanging_above:g} cm above the table",
        f"a retreat is no faster than {TOUCH}",
        f"its head turns down by {math.degrees(head_pitch_limits(0.0)[1]):.1f} degrees",
        f"a goal object nearer than {NEAR} stands on",
        f"a disc that is {1000 * NearFieldParameters.support_rim:g} mm wider",
    ],
    "docs/your_robot.md": [
        f"tcp://127.0.0.1:{PORT}, what no robot knows at tcp://127.0.0.1:{PORT + 1}",
        f"keeps {floor_map._CLEARANCE:.1f} m from what was seen",
        f"a gap of less than {2 * (floor_map._CLEARANCE + floor_map.CELL / 2):.1f} m is none",
        f"a map reaches {floor_map.EXTENT:g} m each way",
        f"lies {navigation._WORST_MATCH:g} m and more from the map",
        f"reports a place {range_sensors._LASER_FAR:g} m away",
        f"takes the arm slowly ({slow_motion.SLOW:g} rad/s)",
        f"within {0.1 + dead_man._REPEATED:g} s with a keyboard",
        f"({0.1 + dead_man._FIRST:g} s after a single short press)",
        f"after {WORDS[hand_over.HELD]} second it is lowered",
        f"goes back the way that it came, at {slow_motion.SLOW:g} rad/s",
        f"relaxed in {WORDS[hand_over.RELAXING]} seconds to a stiffness of {hand_over.SOFT:g}",
        f"limp within {WORDS[robot_recording.RELAXING]} second",
        f"joints are read {1 / CONTROL_PERIOD:g} times a second",
        f"A stiffness of {hand_over.SOFT:g} holds a hanging arm",
        f"tells the difference, {1000 * preflight.WITNESS:g} mm at most",
        f"to {1000 * BASE_NEAR:g} mm and {math.degrees(BASE_TURNED):.1f} degrees by its odometry",
        f"held within {0.1:g} s with a pad",
    ],
    "docs/howto/calibrate.md": [
        f"number {HandMarker().id}, the black square {1000 * HandMarker().size:g} mm wide",
        f"sees nothing nearer than {NEAR}",
    ],
    "docs/howto/scenario.md": [
        f"moves no faster than {TOUCH}",
        *(
            f"| `{name}` | {getattr(PLANNER.clearance, name):.3f} |"
            for name in [one.name for one in fields(PLANNER.clearance)]
        ),
    ],
}
"""For each page, what it says of the code."""

HELD_ELSEWHERE = (
    r"<!-- (\w+): written by scripts/.*?<!-- \1: end -->",  # Compared with the results.
    r"<!--.*?-->",
    r"^(?P<indent> *)```.*?^(?P=indent)```$",  # Parsed, run, compared with what is printed.
    r"`[^`]+`",  # Commands and names: parsed, looked up.
    r"\]\([^)]*\)",
    r"^#[^\n]*$",
    r"^\d+\. ",  # Numbered lists.
    # Places in the report, versions of other programs, names of standards and of quantiles.
    r"\b(?:[Ee]quations?|[Ff]igures?|table|algorithm|version|Python|NAOqi|Drake|Debian|glibc|TS)"
    r" \d[\d.]*(?:(?:,| and| to) \d[\d.]*)*",
    r"\(SoftBank Robotics, 2018\)|BSD 3-Clause|\d+th percentile",
)
WRITTEN = {"docs/faults.md", "docs/report.md"}
"""By `make faults`, read back in tests/evaluation; and a page of the report's own numbers."""
PRINTED = {
    "docs/howto/calibrate.md": "apps/test_calibrate.py",
    "docs/howto/cameras.md": "apps/test_perceive.py",
    "docs/howto/chains.md": "apps/test_import.py",
    "docs/howto/parts.md": "test_example_scripts.py",
    "docs/howto/recordings.md": "apps/test_import.py",
    "docs/howto/teaching.md": "live/test_session.py",
    "docs/tutorial.md": "test_tutorial.py",
    "docs/your_robot.md": "test_numbers_in_docs.py",
}
"""For each page that shows what commands print, the test that compares."""


def one_line(text):
    return re.sub(r"\s+", " ", text)


@pytest.mark.parametrize("page", SAID)
def test_the_code_has_the_numbers_that_the_prose_says(page):
    text = one_line((ROOT / page).read_text())
    assert [said for said in SAID[page] if said not in text] == []


def unheld(text, said):
    """Returns the numbers of a page that nothing holds, each with the words around it."""
    for pattern in HELD_ELSEWHERE:
        text = re.sub(pattern, "", text, flags=re.DOTALL | re.MULTILINE)
    text = one_line(text)
    for one in said:
        text = text.replace(one_line(re.sub(r"`[^`]+`", "", one)), "")
    return [
        text[max(0, one.start() - 30) : one.end() + 20]
        for one in re.finditer(r"(?<![a-z\d])\d+", text)
    ]


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_each_number_is_held(path):
    page = str(path.relative_to(ROOT))
    if page not in WRITTEN:
        assert unheld(path.read_text(), SAID.get(page, [])) == []
    printed = re.findall(r"^```text\n(.*?)^```$", path.read_text(), re.DOTALL | re.MULTILINE)
    if re.search(r"\d", "".join(printed)):
        assert path.name in (ROOT / "tests" / PRINTED[page]).read_text()


def test_a_number_that_nothing_holds_is_found():
    text = "# 1 title\n\n1. As in figure 4.1, `x=2` and Python 3.11,\nit took 31 ms of 20 ms.\n"
    assert unheld(text, ["20 ms"]) == [" As in , and , it took 31 ms of . "]
    assert unheld("```sh\nrun 7\n```\nand 8\n```text\n9\n```\n", []) == [" and 8 "]


def test_each_field_of_the_scenario_that_is_named_is_there():
    named = {
        field
        for path in PAGES
        for field in re.findall(r"(?:`|--set )((?:planner|supervisor)(?:\.\w+)+)", path.read_text())
    }
    assert len(named) > 5
    for field in named - {"planner.clearence.want"}:  # A typing error that is answered.
        value = SCENARIO
        for name in field.split("."):
            value = getattr(value, name)
