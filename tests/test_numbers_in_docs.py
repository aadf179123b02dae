"""Numbers in the prose of README and docs that are the code's own are those that the code has now.

Measured numbers are not here: scripts write them, tests run the commands that print them, or they
are said to be of a day.
"""

import math
import re
from pathlib import Path

import pytest

from pepper_drake.hardware import dead_man, hand_over, preflight, robot_recording, slow_motion
from pepper_drake.learning.demonstrations.recording import CUTOFF
from pepper_drake.models.control_model import CONTROL_PERIOD
from pepper_drake.models.pepper import head_pitch_limits
from pepper_drake.models.scene import HandMarker
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.near_field_occlusion import NearFieldParameters
from pepper_drake.robot_server.robot import floor_map, range_sensors
from pepper_drake.robot_server.services import navigation
from pepper_drake.robot_server.wire.server import PORT
from pepper_drake.scenario import Scenario, load_scenario

ROOT = Path(__file__).parents[1]
SCENARIO: Scenario = load_scenario(None, [])
PLANNER, TIMING = SCENARIO.planner, SCENARIO.supervisor
UNSEEN, NEW, SEPARATION = PLANNER.unseen, PLANNER.new_obstacle, TIMING.separation
NEAR = f"{CAMERA_DEPTH.intrinsics.near:g} m"
TOUCH = f"{1000 * SEPARATION.touch_speed:g} mm/s"
WORDS = {1.0: "one", 2.0: "two", 0.5: "half a"}

SAID = {
    "README.md": [
        f"{1 / CONTROL_PERIOD:g} times a second, as often as NAOqi takes them",
        f"halves what shakes at {CUTOFF:g} Hz",
    ],
    "docs/limitations.md": [
        f"Its range begins at {NEAR}",
        f"has not been seen for {UNSEEN.recent:g} s (`planner.unseen.recent`)",
        f"slows down, to as little as {TOUCH}",
        f"A person's arm that stays within {NEAR} of the camera",
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
    ],
    "docs/howto/calibrate.md": [
        f"number {HandMarker().id}, the black square {1000 * HandMarker().size:g} mm wide",
        f"sees nothing nearer than {NEAR}",
    ],
    "docs/howto/scenario.md": [
        f"| `{name}` | {getattr(PLANNER.clearance, name):.3f} |"
        for name in ("stop", "start", "replan", "resume", "want", "optimise", "retreat")
    ],
}
"""For each page, what it says of the code."""


@pytest.mark.parametrize("page", SAID)
def test_the_code_has_the_numbers_that_the_prose_says(page):
    text = re.sub(r"\s+", " ", (ROOT / page).read_text())
    assert [said for said in SAID[page] if said not in text] == []
