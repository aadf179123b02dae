import json
import math
import re
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from pepper_drake.evaluation.perception_evaluation import GoalSample
from pepper_drake.perception.cameras.camera_files import load_intrinsics
from pepper_drake.perception.mapping.cloud_files import load_cloud
from pepper_drake.scenario import load_scenario
from tests.apps.conftest import load_app
from tests.printed import missing, shown_lines

APP = Path(__file__).parents[2] / "apps" / "perceive.py"


@pytest.fixture
def app():
    return load_app("perceive")


@pytest.fixture
def run(app, call_app):
    return partial(call_app, app)


@pytest.mark.render
def test_it_leaves_a_report_figures_and_a_page(run, app, monkeypatch, tmp_path):
    monkeypatch.setattr(app, "_DISTANCES", (0.4, 0.8))
    options = ["--output", tmp_path, "--samples", 1, "--frames", 2, "--seed", 3]
    options += ["--wrong-goal-frames", 3, "--poses", 1]
    code, out, err = run(*options)
    assert code == 0
    assert "depth" in out
    assert "stereo" in out
    assert "goal" in out
    assert "Traceback" not in err
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["depth"].pop("over_poses") == {"poses": 1, "robot_points": 0, "goal_points": 0}
    for name in ("depth", "stereo"):
        assert set(report[name]) == {
            "points",
            "rms_error",
            "bias",
            "coverage",
            "outlier_share",
            "robot_points",
            "goal_points",
            "milliseconds",
        }
        assert set(report[name]["bias"]) == {"x", "y", "z"}
    goal = report["goal"]
    assert {"position_error", "orientation_error", "detection_rate", "milliseconds"} <= set(goal)
    assert len(goal["by_distance_and_camera"]) == 4
    assert goal["wrong_goals"] == {"frames": 3, "measured": 0, "wrong": 0}
    assert report["seed"] == load_scenario(tmp_path / "scenario.yaml").seed == 3
    for name in ("images.png", "clouds.png", "goal.png"):
        assert (tmp_path / name).stat().st_size > 5_000
    page = (tmp_path / "clouds.html").read_text()
    assert "meshcat" in page.lower()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scene", "nowhere"), "nowhere"),
        (("--samples", "0"), "at least 1"),
        (("--poses", "-1"), "negative"),
        (("--texture", "wool"), "wool"),
        (("--frames", "many"), "many"),
    ],
)
def test_bad_input_is_one_sentence_and_code_2(run, tmp_path, arguments, message):
    code, _, err = run("--output", tmp_path / "out", *arguments)
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_marker_that_was_never_found_is_said_so(app):
    sample = GoalSample("CameraTop", 0.5, 0.1, False, math.nan, math.nan, 4.0)
    report = app.make_report({}, [sample])
    assert report["goal"]["detection_rate"] == 0
    assert report["goal"]["position_error"]["median"] is None
    json.dumps(report, allow_nan=False)
    cloud = {"points": 0, "rms_error": 0.0, "bias": {"x": 0.0}, "coverage": 0.0}
    cloud |= {"outlier_share": 0.0, "milliseconds": 1.0}
    assert "never found" in app.summary(report | {"depth": cloud, "stereo": cloud})


CAMERA_YAML = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [598.5, 0, 319.5, 0, 598.5, 239.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""


@pytest.fixture
def own(tmp_path, draw_marker, facing):
    """Files as a user brings them: a photo, its camera, a depth image and a cloud."""
    (tmp_path / "camera.yaml").write_text(CAMERA_YAML)
    camera = load_intrinsics(tmp_path / "camera.yaml")
    photo = draw_marker(facing([0.05, 0.02, 0.7], 0.3), camera, marker_id=7, size=0.06)
    cv2.imwrite(str(tmp_path / "photo.png"), photo)
    depth = np.full((480, 640), 1200, np.uint16)
    depth[:, :100] = 0
    cv2.imwrite(str(tmp_path / "depth.png"), depth)
    np.save(tmp_path / "cloud.npy", [1, 1, 0] * np.random.default_rng(0).uniform(0, 1, (500, 3)))
    return tmp_path


def test_it_finds_a_marker_in_a_photo(run, own):
    options = ["--image", own / "photo.png", "--camera", own / "camera.yaml", "--marker", 7]
    options += ["--size", 0.06, "--output", own / "out"]
    code, out, _ = run(*options)
    assert code == 0
    assert "marker 7 at (0.05" in out
    report = json.loads((own / "out" / "report.json").read_text())
    (found,) = report["markers"]
    np.testing.assert_allclose(found["position"], [0.05, 0.02, 0.7], atol=0.003)
    drawn = cv2.imread(str(own / "out" / "image.png"))
    assert drawn.shape == (480, 640, 3)
    assert np.ptp(drawn, axis=2).max() > 100, "axes in colour"


def test_a_photo_without_the_marker_says_what_it_shows(run, own):
    options = ["--image", own / "photo.png", "--camera", own / "camera.yaml", "--marker", 8]
    options += ["--size", 0.06, "--output", own / "out"]
    code, out, _ = run(*options)
    assert code == 1
    assert "7 of DICT_4X4_1000" in out


def test_a_depth_image_of_nothing_near_says_which_values_it_holds(run, own):
    depth = cv2.imread(str(own / "depth.png"), cv2.IMREAD_UNCHANGED)
    for image, words in (
        (30 * depth, "its values, 36000 to 36000, are not 0.05 to 10 m; say .*--scale"),
        (0 * depth + 65535, "0 % measured, 0 points\n"),
    ):
        cv2.imwrite(str(own / "other.png"), image)
        options = ["--depth", own / "other.png", "--camera", own / "camera.yaml"]
        code, out, _ = run(*options, "--output", own / "out")
        assert code == 1
        assert re.search(words, out)


def test_it_makes_a_cloud_of_a_depth_image(run, own):
    options = ["--depth", own / "depth.png", "--camera", own / "camera.yaml"]
    code, out, _ = run(*options, "--output", own / "out")
    assert code == 0
    assert "84 % measured" in out
    positions = load_cloud(own / "out" / "cloud.npz")
    np.testing.assert_allclose(positions[:, 2], 1.2, atol=1e-5)
    assert (own / "out" / "cloud.html").stat().st_size > 1000
    # Of the same numbers in half millimetres.
    code, out, _ = run(*options, "--scale", 0.0005, "--output", own / "half")
    assert "0.60 m" in out


def test_it_reads_a_cloud(run, own):
    options = ["--cloud", own / "cloud.npy", "--output", own / "out"]
    code, out, _ = run(*options)
    assert code == 0
    assert missing(shown_lines("docs/howto/cameras.md"), out) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--image", "photo.png", "--marker", 7, "--size", 0.06], "--camera"),
        (["--image", "photo.png", "--camera", "camera.yaml", "--marker", 7], "--size"),
        (["--image", "photo.png", "--camera", "camera.yaml", "--marker", 70, "--size", 1], "49"),
        (["--image", "photo.png", "--camera", "camera.yaml", "--marker", 7, "--size", 0], "--size"),
        (["--depth", "photo.png", "--camera", "camera.yaml"], "uint8"),
        (["--depth", "none.png", "--camera", "camera.yaml"], "none.png"),
        (["--cloud", "photo.png"], ".pcd"),
        (["--cloud", "cloud.npy", "--scale", -1], "--scale"),
        (["--marker", 7], "--image"),
        (["--depth", "depth.png", "--cloud", "cloud.npy"], "not allowed"),
    ],
)
def test_bad_own_data_is_one_sentence(run, own, options, words):
    placed = [own / str(o) if "." in str(o) and str(o)[0].isalpha() else o for o in options]
    code, _, err = run(*placed, "--output", own / "out")
    assert code == 2
    assert words in err
    assert err.count("\n") == 1
