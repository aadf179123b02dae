import numpy as np
import pytest
from pydrake.math import RotationMatrix

from pepper_drake.evaluation import marker_false_positives
from pepper_drake.evaluation.marker_false_positives import count_false_positives
from pepper_drake.evaluation.perception_evaluation import PerceptionEvaluation
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.goal.imm_filter import GoalMeasurement
from pepper_drake.perception.goal.marker import detect_markers

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def study():
    return PerceptionEvaluation(load_scene("free"))


def test_nothing_else_is_ever_taken_for_the_goal(study):
    result = count_false_positives(study, 120, seed=2)
    assert result.frames == 120
    assert result.wrong == 0


def test_the_frames_show_what_they_say(study, monkeypatch):
    found = []

    def watch(image, *_arguments, **_options):
        found.append({marker.id for marker in detect_markers(image)})

    monkeypatch.setattr(marker_false_positives, "detect_goal", watch)
    count_false_positives(study, 6 * 20, seed=1)
    by_kind = [set().union(*found[20 * k : 20 * k + 20]) for k in range(6)]
    assert by_kind[0] == by_kind[3] == set()  # No marker at all.
    assert by_kind[1] | by_kind[4]  # Another marker, ...
    assert study.marked.marker_id not in by_kind[1] | by_kind[4]  # ... never the goal's.


def test_a_wrong_goal_would_be_counted(study, monkeypatch):
    def lie(_image, time, *_arguments, **_):
        p_WM = np.array([0.3, 0.3, 1.5])
        return GoalMeasurement(time, p_WM, RotationMatrix(), 1e-6 * np.eye(3), 1e-4)

    monkeypatch.setattr(marker_false_positives, "detect_goal", lie)
    result = count_false_positives(study, 20)
    assert result.measured == 20
    assert result.wrong >= 1
