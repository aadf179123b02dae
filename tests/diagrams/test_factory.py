import numpy as np
import pytest

from pepper_drake.diagrams.factory import (
    SHIPPED_DEMONSTRATION,
    make_coupling,
    make_primitive,
    prepare_scene,
)
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling, ReportCoupling
from pepper_drake.models.scene import load_scene


def test_couplings_have_names():
    assert isinstance(make_coupling("barrier"), BarrierCoupling)
    assert isinstance(make_coupling("report"), ReportCoupling)
    assert make_coupling("none") is None
    with pytest.raises(InputError, match="'magic' is unknown; use one of barrier, report"):
        make_coupling("magic")


def test_the_left_arms_primitive_mirrors_the_rights():
    right, left = (make_primitive(None, arm).rollout(time_step=0.02) for arm in ("right", "left"))
    np.testing.assert_allclose(left.positions, right.positions * [1, -1, 1], atol=1e-9)
    # Pitch joints (shoulder pitch) are the same on both sides, all others change sign.
    np.testing.assert_allclose(left.joints, right.joints * [1, -1, -1, -1, -1], atol=1e-9)
    mirrored = right.rotations * [1, -1, 1, -1]
    signs = np.sign(np.sum(mirrored * left.rotations, axis=1, keepdims=True))
    np.testing.assert_allclose(left.rotations, signs * mirrored, atol=1e-9)


def test_the_shipped_primitive_repeats_its_demonstration():
    demo = Demonstration.load(SHIPPED_DEMONSTRATION)
    path = make_primitive(None, "right").rollout(time_step=demo.times[1] - demo.times[0])
    count = min(len(path.positions), len(demo.positions))
    np.testing.assert_allclose(path.positions[:count], demo.positions[:count], atol=2e-3)


def test_a_demonstration_without_orientation_and_joints_takes_them_from_the_shipped(tmp_path):
    times = np.linspace(0, 2, 201)
    s = (times / 2) ** 3 * (10 - 15 * times / 2 + 6 * (times / 2) ** 2)
    rows = np.column_stack((times, 0.1 + 0.2 * s, -0.2 + 0 * s, 0.3 * s))
    np.savetxt(tmp_path / "own.txt", rows)
    own, shipped = make_primitive(tmp_path / "own.txt", "right"), make_primitive(None, "right")
    np.testing.assert_allclose(own.goal, [0.3, -0.2, 0.3], atol=1e-3)
    ours, theirs = (p.rollout(time_step=0.01, duration=2.0) for p in (own, shipped))
    np.testing.assert_allclose(ours.rotations, theirs.rotations)
    np.testing.assert_allclose(ours.joints, theirs.joints)
    left = make_primitive(tmp_path / "own.txt", "left")
    np.testing.assert_allclose(left.goal, own.goal * [1, -1, 1], atol=1e-9)


def test_the_scene_is_mirrored_for_the_other_arm_only():
    scene = load_scene("table")
    assert prepare_scene(scene, arm="right") == scene == prepare_scene(scene)
    left = prepare_scene(scene, arm="left")
    assert left.arm == "left"
    assert left.goal.position[1] == -scene.goal.position[1]
    assert prepare_scene(left, arm="right").goal.position == scene.goal.position


@pytest.mark.parametrize(
    ("motion", "offset"), [("up", [0, 0, 0.08]), ("aside", [0, -0.08, 0]), ("away", [0.08, 0, 0])]
)
def test_a_goal_motion_moves_8_cm_once(motion, offset):
    scene = load_scene("table")
    path = prepare_scene(scene, motion=motion).goal.path
    np.testing.assert_allclose(path[0][1:], [0, 0, 0])
    np.testing.assert_allclose(path[-1][1:], offset)
    assert scene.goal.path == [], "the scene that was handed in stays as it was"
    left = prepare_scene(scene, arm="left", motion="aside").goal.path
    assert left[-1][2] == pytest.approx(0.08), "aside is to the side of the arm that reaches"


def test_a_goal_motion_may_be_a_file(tmp_path):
    file = tmp_path / "motion.txt"
    file.write_text("0 0 0 0\n1 0.01 0.02 0.03  # m\n")
    path = prepare_scene(load_scene("free"), motion=str(file)).goal.path
    assert path == [[0, 0, 0, 0], [1, 0.01, 0.02, 0.03]]


def test_an_unknown_goal_motion_names_the_known_ones():
    with pytest.raises(InputError, match=r'"sideways".*up, aside, away'):
        prepare_scene(load_scene("free"), motion="sideways")
