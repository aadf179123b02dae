import json
from dataclasses import replace

import numpy as np
import pytest
import umsgpack
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.geometry import Capsule, Cylinder, Ellipsoid, HalfSpace

from pepper_drake.playback.bodies import replay_frames
from pepper_drake.playback.drawing import RUN_COLORS, draw, key_frames, run_color
from pepper_drake.playback.loading import load_motion
from pepper_drake.playback.meshcat_shapes import hex_color, meshcat_object


@pytest.fixture(scope="module")
def frames(runs):
    return [replay_frames(load_motion(run)) for run in runs]


@pytest.fixture(scope="module")
def both(frames):
    return [(command, umsgpack.unpackb(command.data)) for command in draw(frames)]


def objects(drawn):
    return {
        command.path: message["object"]
        for command, message in drawn
        if command.kind == "set_object"
    }


def the_only(drawn, kind):
    (message,) = [message for command, message in drawn if command.kind == kind]
    return message


def test_the_first_run_is_solid_and_the_second_a_ghost(both):
    first = objects(both)["/pepper_drake/1/torso/pepper_chest"]["materials"][0]
    second = objects(both)["/pepper_drake/2/torso/pepper_chest"]["materials"][0]
    assert (first["opacity"], first["transparent"]) == (1.0, False)
    assert second["transparent"]
    assert 0.2 < second["opacity"] < 0.6
    red, _, blue = (second["color"] >> shift & 255 for shift in (16, 8, 0))
    assert red > blue + 40, "white, tinted in the second run's orange"


def test_what_stands_in_both_scenes_is_drawn_once_and_what_moved_twice(both):
    paths = objects(both)
    assert any(path.startswith("/pepper_drake/1/pole/") for path in paths)
    assert not any(path.startswith("/pepper_drake/2/pole/") for path in paths)
    assert not any(path.startswith("/pepper_drake/2/world/") for path in paths), "one floor"
    assert any(path.startswith("/pepper_drake/2/goal_object/") for path in paths)


def test_ways_have_the_colours_of_their_runs_and_the_cloud_its_points(both):
    paths = objects(both)
    for run, code in zip("12", RUN_COLORS, strict=False):
        way = paths[f"/pepper_drake/{run}/hand path"]
        assert way["materials"][0]["color"] == int(code[1:], 16)
        points = np.array(way["geometries"][0]["path"]["points"])
        assert np.all(np.linalg.norm(np.diff(points, axis=0), axis=1) > 0.002)
    assert "/pepper_drake/1/demonstration" in paths
    assert paths["/pepper_drake/1/cloud"]["geometries"][0]["data"]["attributes"]["position"]


def test_the_animation_moves_what_moved_as_it_moved(both, frames):
    animation = the_only(both, "set_animation")
    clips = {clip["path"]: clip["clip"] for clip in animation["animations"]}
    assert "/pepper_drake/1/r_wrist" in clips
    assert "/pepper_drake/2/goal_object" in clips
    assert "/pepper_drake/1/l_wrist" not in clips, "the other arm rests"
    assert "/pepper_drake/1/pole" not in clips
    clip = clips["/pepper_drake/2/r_wrist"]
    (wrist,) = [body for body in frames[1].bodies if body.name == "r_wrist"]
    (track,) = [track for track in clip["tracks"] if track["name"] == ".position"]
    keys = [key["time"] for key in track["keys"]]
    values = np.array([key["value"] for key in track["keys"]])
    everywhere = np.arange(len(wrist.translations))
    played = np.column_stack([np.interp(everywhere, keys, column) for column in values.T])
    np.testing.assert_allclose(played, wrist.translations, atol=4e-4)
    (turns,) = [track for track in clip["tracks"] if track["name"] == ".quaternion"]
    w, x, y, z = wrist.quaternions[0]
    assert turns["keys"][0]["value"] == pytest.approx([x, y, z, w]), "three.js puts w last"


def test_the_control_bar_knows_the_figures_and_every_moment(both, frames):
    control = the_only(both, "set_control")
    callback = control["callback"]
    data = json.loads(callback[callback.rindex("(this, ") + len("(this, ") : -1])
    low, high = data["runs"]
    assert (low["name"], high["name"]) == ("low", "high")
    assert high["frames"] == len(frames[1].times)
    assert high["figures"]["hand to goal [mm]"] == "1.1"
    assert high["stages"] == [[0, "looking", 0], [30, "reaching", 1]]
    distances = high["signals"]["hand to goal"]["values"]
    assert len(distances) == high["frames"]
    assert (distances[0], distances[-1]) == (300.0, 50.0)
    eye, target = np.array(data["view"]["eye"]), np.array(data["view"]["target"])
    assert eye[1] < target[1], "one looks from the right arm's side"


def test_one_looks_at_the_arm_whichever_way_pepper_faces(frames):
    turned = replace(frames[0], yaw=np.pi / 2)
    commands = draw([turned])
    callback = umsgpack.unpackb(commands[-1].data)["callback"]
    view = json.loads(callback[callback.rindex("(this, ") + len("(this, ") : -1])["view"]
    sight = np.subtract(view["eye"], view["target"])
    np.testing.assert_allclose(sight, [1.9, 0.85, 0.75], atol=1e-9)


def test_a_drawing_replaces_the_one_before(both):
    assert both[0][0].kind == "delete"
    assert both[0][0].path == "/pepper_drake"
    assert all(
        command.path.startswith(("/pepper_drake", "/Grid", "/Axes", "/Background"))
        for command, _ in both
        if command.kind != "set_animation"
    )


def test_a_hand_that_never_moved_has_no_way(frames):
    still = replace(frames[0], hand_W=np.tile(frames[0].hand_W[:1], (20, 1)))
    drawn = [(command, umsgpack.unpackb(command.data)) for command in draw([still])]
    assert "/pepper_drake/1/hand path" not in objects(drawn)


@given(
    arrays(np.float64, st.tuples(st.integers(2, 60), st.just(3)), elements=st.floats(-1.0, 1.0)),
    st.floats(1e-6, 0.5),
)
def test_key_frames_give_all_other_frames_back(values, tolerance):
    keys = key_frames(values, tolerance)
    assert (keys[0], keys[-1]) == (0, len(values) - 1)
    assert np.all(np.diff(keys) > 0)
    frames = np.arange(len(values))
    again = np.column_stack([np.interp(frames, keys, column) for column in values[keys].T])
    assert np.max(np.abs(again - values)) <= 2.0 * tolerance


def test_a_straight_way_needs_few_key_frames_and_a_jump_keeps_its_own():
    straight = np.linspace(0.0, 1.0, 257)[:, None]
    assert len(key_frames(straight, 1e-6)) == 2
    jump = np.repeat([0.0, 1.0], 50)[:, None]
    assert {49, 50} <= set(key_frames(jump, 1e-6))


def test_runs_beyond_the_colours_start_again():
    assert run_color(0) == run_color(len(RUN_COLORS))
    assert hex_color(run_color(1)) == int(RUN_COLORS[1][1:], 16)


def corners(shape):
    """The farthest points of a shape along its own axes, as drawn."""
    drawn, X = meshcat_object(shape, (1.0, 1.0, 1.0, 1.0))
    geometry = drawn.lower()["geometries"][0]
    if geometry["type"] == "LatheGeometry":
        points = np.array([[point["x"], point["y"], 0.0] for point in geometry["points"]])
    elif geometry["type"] == "CylinderGeometry":
        points = np.array([[geometry["radiusTop"], geometry["height"] / 2, 0.0]])
    else:
        points = geometry["radius"] * np.eye(3)
    return points @ X[:3, :3].T


def test_round_shapes_have_drakes_size_and_axis():
    capsule = corners(Capsule(0.05, 0.3))
    assert np.max(capsule[:, 2]) == pytest.approx(0.2)
    assert np.min(capsule[:, 2]) == pytest.approx(-0.2)
    assert np.max(capsule[:, 0]) == pytest.approx(0.05)
    np.testing.assert_allclose(np.abs(corners(Cylinder(0.1, 0.6))), [[0.1, 0.0, 0.3]], atol=1e-12)
    np.testing.assert_allclose(np.diag(corners(Ellipsoid(0.1, 0.2, 0.3))), [0.1, 0.2, 0.3])


def test_a_shape_without_a_picture_is_an_error_of_our_own():
    with pytest.raises(TypeError, match="no picture of a HalfSpace"):
        meshcat_object(HalfSpace(), (1.0, 1.0, 1.0, 1.0))
