import re

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.models import Obstacle, Scene, load_scene, save_scene
from pepper_drake.models.scene import SCENES, HandPose, default_pre_grasp
from pepper_drake.models.shapes import overlaps

GOOD = """\
name: small
arm: left
robot: {x: 0.1, posture: stand, joints: {HeadYaw: 0.2}}
goal:
  position: [1.0, 0.1, 0.7]
obstacles:
- name: board
  shape: box
  size: [0.4, 1, 0.02]
  position: [1.1, 0, 0.69]
"""


def load_text(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return load_scene(path)


@pytest.mark.parametrize("name", SCENES)
def test_shipped_scenes_load_without_overlaps_and_mirror(name):
    scene = load_scene(name)
    assert scene.name == name
    assert scene.description
    pairs = [pair for pair in overlaps(scene.solids()) if set(pair) != {"pole", "foot"}]
    assert not pairs
    mirrored = scene.mirrored()
    mirrored.check()
    assert mirrored.arm != scene.arm
    assert mirrored.goal.position[1] == -scene.goal.position[1]
    back = mirrored.mirrored()
    np.testing.assert_allclose(back.goal.marker.rpy, scene.goal.marker.rpy, atol=1e-12)
    assert back.obstacles == scene.obstacles


@pytest.mark.parametrize("name", SCENES)
def test_goal_object_stands_on_something_within_reach_from_its_edge(name):
    scene = load_scene(name)
    tops = [
        (o.position[2] + o.size[2] / 2, o.position[0] - o.size[0] / 2)
        for o in scene.obstacles
        if o.shape == "box" and o.size[0] > 0.1
    ]
    standing = [edge for top, edge in tops if abs(top - scene.goal.position[2]) < 1e-3]
    assert standing
    assert 0.05 <= scene.goal.position[0] - standing[0] <= 0.14


def test_a_file_says_only_what_differs(tmp_path):
    scene = load_text(tmp_path, GOOD)
    assert scene.arm == "left"
    assert scene.goal.radius == 0.033
    assert scene.robot.positions()["HeadYaw"] == 0.2
    assert scene.robot.positions()["BaseX"] == 0.1
    assert scene.robot.positions()["LShoulderPitch"] == 1.58


def test_saved_scene_comes_back(tmp_path):
    scene = load_scene("table")
    scene.goal.path = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.05, 0.1]]
    scene.robot.joints = {"HeadYaw": 0.3}
    save_scene(scene, tmp_path / "copy.yaml")
    assert load_scene(tmp_path / "copy.yaml") == scene


def test_the_usual_pre_grasp_is_beside_the_cylinder_with_the_palm_to_it():
    for arm, side in (("left", 1), ("right", -1)):
        X_OH = default_pre_grasp(arm, 0.033).pose()
        assert X_OH.translation()[1] == pytest.approx(side * 0.085)
        palm = -X_OH.rotation().matrix()[:, 2]
        fingers = X_OH.rotation().matrix()[:, 0]
        assert palm @ [0, -side, 0] > 0.99
        assert fingers[0] > 0.95
        assert fingers[2] > 0.2


def test_the_default_marker_faces_the_robot_and_leans_back():
    X_OM = Scene().goal.marker.pose()
    right, up, out = X_OM.rotation().matrix().T
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-9)
    np.testing.assert_allclose(out, [-np.cos(np.radians(20)), 0, np.sin(np.radians(20))], atol=1e-9)
    assert up[2] > 0.9


def test_a_mesh_is_looked_for_beside_the_scene_first(tmp_path):
    (tmp_path / "thing.obj").write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    text = GOOD + "- {name: thing, shape: mesh, mesh: thing.obj, position: [1.2, -0.3, 0.7]}\n"
    scene = load_text(tmp_path, text)
    assert scene.obstacles[1].mesh == str(tmp_path / "thing.obj")
    assert scene.obstacles[1].size == [1.0]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("posture: stand", "posutre: stand", 'line 3: robot has no field "posutre"'),
        ("posture: stand", "posture: sit", 'line 3: robot.posture is "sit"; it must be one of'),
        ("HeadYaw", "HeadJaw", 'line 3: robot.joints names "HeadJaw"'),
        ("arm: left", "arm: both", 'line 2: arm is "both"'),
        ("arm: left", "arm: 3", 'line 2: arm is "3"; it must be a text'),
        ("x: 0.1", "x: near", 'line 3: robot.x is "near"; it must be a number'),
        ("x: 0.1", "x: .nan", "line 3: robot.x is .nan; it must be a finite number"),
        ("x: 0.1", "x: [1]", "line 3: robot.x is a list or a mapping; it must be a number"),
        ("[1.0, 0.1, 0.7]", "[1.0, 0.1]", "line 5: goal.position has 2 numbers"),
        ("[1.0, 0.1, 0.7]", "4", "line 5: goal.position must be a list"),
        ("[1.0, 0.1, 0.7]", "[1.0, 0.1, 0.6]", 'inside the obstacle "board"'),
        ("[1.0, 0.1, 0.7]", "[1.0, 0.1, -0.7]", "goal.position is 0.7 m below the floor"),
        ("[0.4, 1, 0.02]", "[0.4, -1, 0.02]", r"line 9: obstacles\[0\].size has -1"),
        ("[0.4, 1, 0.02]", "[0.4, 1]", r"obstacles\[0\].size has 2 numbers; it must have 3"),
        ("shape: box", "shape: cube", 'is "cube"; it must be one of box, cylinder, sphere, mesh'),
        ("name: board", "name: a board", "letters, digits and underscores"),
        ("name: board", "name: pepper", "is taken"),
        ("shape: box", "mesh: no.obj\n  shape: mesh", r"obstacles\[0\].size has 3 numbers"),
        ("name: small", "name: [small", "not valid YAML"),
        ("name: small", "coupling: none", 'coupling is "none"; it must be one of barrier, report'),
        ("goal:", "goal:\n  marker: {id: 50}", "line 5: goal.marker.id is 50"),
        ("goal:", "goal:\n  radius: -1", "line 5: goal.radius is -1 m"),
        ("goal:", "goal:\n  path: [[0, 0, 0, 0]]", "goal.path has one row"),
        (
            "goal:",
            "goal:\n  path: [[1, 0, 0, 0], [1, 0, 0, 0]]",
            r"line 5: goal.path\[1\] must be later",
        ),
        ("goal:", "goal:\n  pre_grasp: {position: [0, 0, 0]}", "goal.pre_grasp.rpy has 0 numbers"),
        ("x: 0.1", "yaw: 90", "line 3: robot.yaw has an angle of 90, .*in radians"),
        ("HeadYaw: 0.2", "HeadYaw: 20", "line 3: robot.joints has an angle of 20, .*in radians"),
        ("HeadYaw: 0.2", "HeadPitch: 2", "line 3: robot.joints has HeadPitch at 2, beyond its lim"),
        ("[1.0, 0.1, 0.7]", "[0.2, 0, 0.6]", "line 5: goal.position puts goal inside Pepper's"),
        ("[1.1, 0, 0.69]", "[0.1, 0, 0.69]", r"line 10: obstacles\[0\].position puts board inside"),
        ("goal:", "goal:\n  yaw: -45", "line 5: goal.yaw has an angle of -45"),
        ("goal:", "goal:\n  marker: {rpy: [70, 0, -90]}", "line 5: goal.marker.rpy has an angle"),
        ("shape: box", "rpy: [0, 0, 34]\n  shape: box", r"line 8: obstacles\[0\].rpy has an angle"),
        ("goal:", "goal:\n  color: [2, 0, 0, 1]", "goal.color must hold numbers from 0 to 1"),
    ],
)
def test_bad_scenes_get_one_sentence_with_file_line_and_field(tmp_path, old, new, sentence):
    assert GOOD.count(old) == 1
    with pytest.raises(InputError, match=sentence) as caught:
        load_text(tmp_path, GOOD.replace(old, new))
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "scene.yaml"))
    assert "\n" not in message
    assert re.search(r"line \d+", message)


def test_meshes_in_millimetres_and_broken_ones_are_refused_by_file_and_field(tmp_path):
    mesh = tmp_path / "thing.obj"
    text = GOOD + "- {name: thing, shape: mesh, mesh: thing.obj, position: [1.2, -9, 0.7]}\n"
    corners = "v 0 0 0\nv 80 0 0\nv 0 80 0\nv 0 0 80\n"
    mesh.write_text(f"{corners}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    with pytest.raises(InputError, match=r"line 11: obstacles\[1\].size makes .* 80 m .*0.001"):
        load_text(tmp_path, text)
    assert load_text(tmp_path, text.replace("mesh: th", "size: [0.001], mesh: th"))
    mesh.write_text("v 0 0\n")
    with pytest.raises(InputError, match=rf"line 11: obstacles\[1\].mesh: {re.escape(str(mesh))} "):
        load_text(tmp_path, text)


def test_two_obstacles_of_one_name(tmp_path):
    text = GOOD + "- {name: board, shape: sphere, size: [0.1], position: [0, 3, 1]}\n"
    with pytest.raises(
        InputError, match=r"line 11: obstacles\[1\].name is \"board\" a second time"
    ):
        load_text(tmp_path, text)


def test_a_mesh_that_is_not_there():
    scene = load_scene("free")
    scene.obstacles.append(
        Obstacle(name="cup", shape="mesh", mesh="cup.obj", position=[0.0, 3.0, 0.0])
    )
    with pytest.raises(InputError, match=r'mesh is "cup.obj".*bottle.obj, mug.obj'):
        scene.check()


def test_missing_and_empty_files(tmp_path):
    with pytest.raises(InputError, match="table, shelf, clutter, free"):
        load_scene("tabel")
    with pytest.raises(InputError, match="is empty"):
        load_text(tmp_path, "# nothing\n")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ("axis: [0, 0]", "goal.pre_grasp.axis has 2 numbers"),
        ("axis: [0, 0, 0]", "goal.pre_grasp.axis has no length"),
        ("tolerance: 0", "goal.pre_grasp.tolerance is 0 rad"),
        ("tolerance: 4", "at most pi"),
    ],
)
def test_an_axis_that_cannot_count_is_refused(tmp_path, fields, words):
    text = GOOD.replace("obstacles:", f"  pre_grasp: {{{fields}}}\nobstacles:")
    with pytest.raises(InputError, match=re.escape(words)):
        load_text(tmp_path, text)


def test_a_turn_about_the_axis_that_counts_is_no_error():
    task = HandPose(axis=[0.0, 0.0, -2.0])
    assert task.axis_error(RotationMatrix.MakeZRotation(1.2)) == pytest.approx(0.0, abs=1e-9)
    assert task.axis_error(RotationMatrix.MakeXRotation(0.3)) == pytest.approx(0.3)
    assert task.axis_error(RotationMatrix.MakeXRotation(np.pi)) == pytest.approx(np.pi)


def test_the_axis_of_the_usual_pose_points_at_the_object():
    for arm, side in (("right", 1.0), ("left", -1.0)):
        task = default_pre_grasp(arm, 0.033)
        pointing = task.pose().rotation().multiply(np.array(task.axis))
        assert pointing[1] * side > 0.99


def test_the_mirrored_axis_is_the_other_hands():
    scene = load_scene("free")
    scene.goal.pre_grasp.axis = [0.1, 0.2, -0.9]
    assert scene.mirrored().goal.pre_grasp.axis == [0.1, -0.2, -0.9]
