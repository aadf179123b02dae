import numpy as np
import pytest

from pepper_drake.diagrams import marker_teaching
from pepper_drake.diagrams.marker_teaching import follow, record_marker, watch
from pepper_drake.diagrams.recording import RecordOptions
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.workspace_map import WorkspaceMap
from pepper_drake.models.guide import ViaPoint
from pepper_drake.models.marker_script import load_marker_script
from pepper_drake.models.pepper import JOINT_GROUPS, posture_positions
from pepper_drake.systems.guiding.scripted_guide import GuidePath


@pytest.fixture
def script():
    script = load_marker_script("marker")
    script.path, script.rest = script.path[:3], 0.3
    for k, via in enumerate(script.path):
        via.time = 0.6 * k
    return script


@pytest.mark.render
def test_a_marker_that_is_shown_moves_the_arm_in_the_same_way(script, tmp_path):
    result = record_marker(script, RecordOptions(folder=tmp_path))
    # Half a per cent of the distance; every image counts.
    assert result.tracking_error_rms < 5e-3
    assert len(result.sightings.times) == 18
    demo = result.recording.demonstration
    assert result.recording.final_distance < 2e-3
    shift = np.subtract(script.path[-1].position, script.path[0].position)
    expected = script.scale * shift * [-1, -1, 1]  # Face to face.
    np.testing.assert_allclose(demo.positions[-1] - demo.positions[0], expected, atol=8e-3)
    loaded = Demonstration.load(tmp_path)
    assert loaded.joint_names == JOINT_GROUPS["right_arm"]
    np.testing.assert_array_equal(loaded.positions, demo.positions)


@pytest.mark.render
def test_a_marker_out_of_view_is_not_seen(script, monkeypatch):
    script.path[1].position[1] = 0.7  # Far to the side, and back.
    script.path[2] = ViaPoint(2.4, script.path[0].position, [0, 0, 0])
    script.path[1].time = 1.2
    sightings = watch(script, GuidePath(*script.poses()))
    gap = np.diff(sightings.times).max()
    assert 0.5 < gap < 2.0
    assert sightings.times[-1] > 2.0  # Found again.
    monkeypatch.setattr(marker_teaching, "watch", lambda *_, **__: sightings)
    with pytest.raises(InputError, match="not seen from"):
        record_marker(script)


def test_a_motion_beyond_the_arms_reach_is_refused_with_a_scale_that_would_do():
    s = np.linspace(0, 1, 200)
    bell = s**2 * (3 - 2 * s)
    shown = Demonstration.from_positions(
        0.01 * np.arange(200),
        np.outer(bell, [-0.6, 0.2, 0.3]),
        rotations=np.tile([1.0, 0, 0, 0], (200, 1)),
        name="stretch",
    )
    stand = posture_positions("stand")
    start = np.array([stand[name] for name in JOINT_GROUPS["right_arm"]])
    with pytest.raises(InputError, match=r"stretch: at scale 0\.8 .* beyond its reach") as error:
        follow(shown, WorkspaceMap(0.8), "right", start)
    scale = float(str(error.value).split("scale ")[-1].split()[0])
    assert 0.2 < scale < 0.8
    wanted, joints = follow(shown, WorkspaceMap(scale), "right", start)
    assert joints.shape == (200, 5)
    assert np.linalg.norm(np.ptp(wanted.positions, axis=0)) == pytest.approx(0.7 * scale, rel=1e-6)
