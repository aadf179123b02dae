"""The demonstration that ships: what it must be for the main job."""

import numpy as np
import pytest
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.learning import Demonstration
from pepper_drake.models import add_pepper, add_scene, load_scene
from pepper_drake.models.pepper import (
    MODELS_DIR,
    POSTURES,
    elbow_roll_limits,
    set_joint_positions,
)


@pytest.fixture(scope="module")
def demo():
    return Demonstration.load(MODELS_DIR / "demonstrations" / "reach")


def distances(demo, scene, reach=0.18):
    """Least distances of the moving arm to the scene and to the body, per sample."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(MultibodyPlantConfig(time_step=0.01), builder)
    model = add_pepper(plant, posture="upright")
    if scene is not None:
        models = add_scene(plant, scene)
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyContextFromRoot(context)
    if scene is not None:
        edge = scene.obstacles[0].position[0] - scene.obstacles[0].size[0] / 2
        set_joint_positions(plant, plant_context, model, {"BaseX": edge - reach})
        obstacles = {plant.GetBodyByName(name).index() for name in models.obstacles}
    side = demo.joint_names[0][0]
    query_port = scene_graph.get_query_output_port()
    result = []
    for q in demo.joints[::5]:
        set_joint_positions(
            plant, plant_context, model, dict(zip(demo.joint_names, q, strict=True))
        )
        query = query_port.Eval(scene_graph.GetMyContextFromRoot(context))
        inspector = query.inspector()
        least = 0.2
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(0.2):
            bodies = [
                plant.GetBodyFromFrameId(inspector.GetFrameId(g)) for g in (pair.id_A, pair.id_B)
            ]
            arm = [b for b in bodies if b.name().startswith((side, side.lower()))]
            other = [b for b in bodies if b not in arm]
            if arm and (scene is None or any(b.index() in obstacles for b in other)):
                least = min(least, pair.distance)
        result.append(least)
    return np.array(result)


def test_it_starts_beside_the_body_and_rests_at_both_ends(demo):
    stand = [POSTURES["stand"][name] for name in demo.joint_names]
    np.testing.assert_allclose(demo.joints[0], stand, atol=2e-3)
    assert np.linalg.norm(demo.velocities[[0, -1]], axis=1).max() < 0.005
    assert 2.5 < demo.duration < 3.5
    np.testing.assert_allclose(np.diff(demo.times), 0.01, atol=1e-9)
    assert demo.positions[-1][0] > 0.24
    palm = demo.rotations[-1]
    w, x, y, z = palm
    assert 2 * (y * z - w * x) < -0.95  # The palm (-z of H) faces left: z_H is along -y.


def test_it_keeps_within_limits(demo):
    plant_limits = {
        "RShoulderPitch": 7.34, "RShoulderRoll": 9.23, "RElbowYaw": 7.34,
        "RElbowRoll": 9.23, "RWristYaw": 17.4,
    }  # fmt: skip
    speeds = np.abs(np.gradient(demo.joints, demo.times, axis=0)).max(axis=0)
    for name, speed in zip(demo.joint_names, speeds, strict=True):
        assert speed < 0.4 * plant_limits[name]
    yaw, roll = (demo.joints[:, demo.joint_names.index(f"RElbow{k}")] for k in ("Yaw", "Roll"))
    for elbow_yaw, elbow_roll in zip(yaw, roll, strict=True):
        lower, upper = elbow_roll_limits(elbow_yaw, "right")
        assert lower + 0.2 < elbow_roll < upper - 0.2  # away from the straight elbow


def test_it_touches_nothing_in_free_space_but_the_table_when_one_is_there(demo):
    assert distances(demo, None).min() > 0.003
    scene = load_scene("table")
    worst = distances(demo, scene).min()
    assert -0.06 < worst < -0.015


def test_its_mirror_image_does_the_same_with_the_left_arm(demo):
    right = distances(demo, load_scene("table"))
    left = distances(demo.mirrored(), load_scene("table").mirrored())
    np.testing.assert_allclose(left, right, atol=1e-3)
