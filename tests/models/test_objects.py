"""Scenes in a plant: they move as told, and the marker is seen by the camera."""

import base64
import re

import cv2
import numpy as np
import pytest
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    MakeRenderEngineVtk,
    Meshcat,
    MeshcatParams,
    MeshcatVisualizer,
    RenderCameraCore,
    RenderEngineVtkParams,
    Role,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.systems.sensors import CameraInfo

from pepper_drake.models import add_pepper, add_scene, load_scene, random_scene
from pepper_drake.models.markers import DICTIONARY, marker_png, plate_size
from pepper_drake.models.objects import GOAL_OBJECT
from pepper_drake.models.scene import SCENES


def build(scene, *, pepper=False):
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(
        MultibodyPlantConfig(time_step=0.002, discrete_contact_approximation="sap"), builder
    )
    if pepper:
        add_pepper(plant)
    models = add_scene(plant, scene)
    plant.Finalize()
    return builder, plant, scene_graph, models


@pytest.mark.parametrize("name", SCENES)
def test_pepper_starts_clear_of_everything_in_every_scene(name):
    scene = load_scene(name)
    builder, plant, scene_graph, models = build(scene, pepper=True)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyContextFromRoot(context)
    for joint, value in scene.robot.positions().items():
        positions = plant.GetPositions(plant_context)
        positions[plant.GetJointByName(joint).position_start()] = value
        plant.SetPositions(plant_context, positions)
    for body in (*models.obstacles, models.goal_object):
        assert plant.HasBodyNamed(body)
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    inspector = query.inspector()
    # In the scene for teaching Pepper stands at the table already.
    clear = 0.05 if name == "teach" else 0.2
    for pair in query.ComputeSignedDistancePairwiseClosestPoints(clear):
        owners = {
            plant.GetBodyFromFrameId(inspector.GetFrameId(g)).model_instance()
            for g in (pair.id_A, pair.id_B)
        }
        if owners & {*models.obstacle_models, models.goal_model}:
            assert owners <= {*models.obstacle_models, models.goal_model}


def test_bodies_stand_where_the_scene_says():
    scene = random_scene(3)
    builder, plant, _, models = build(scene)
    builder.Build()
    context = plant.CreateDefaultContext()
    for obstacle in scene.obstacles:
        X_WB = plant.GetBodyByName(obstacle.name).EvalPoseInWorld(context)
        assert X_WB.IsNearlyEqualTo(obstacle.pose(), 1e-12)
    X_WO = plant.GetBodyByName(models.goal_object).EvalPoseInWorld(context)
    assert X_WO.IsNearlyEqualTo(scene.goal.pose(), 1e-12)
    assert plant.num_positions() == 0
    assert not models.moving


def test_moving_things_follow_their_paths():
    scene = load_scene("table")
    scene.goal.path = [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, -0.05, 0.08]]
    scene.goal.yaw = 0.4
    mug = next(o for o in scene.obstacles if o.name == "mug")
    mug.path = [[0.1, 0.0, 0.0, 0.0], [0.4, 0.1, 0.0, 0.0]]
    builder, plant, _, models = build(scene)
    assert {moving.name for moving in models.moving} == {GOAL_OBJECT, "mug"}
    for moving in models.moving:
        source = builder.AddSystem(TrajectorySource(moving.path, output_derivative_order=1))
        builder.Connect(source.get_output_port(), plant.get_desired_state_input_port(moving.model))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    poses = {GOAL_OBJECT: scene.goal.pose(), "mug": mug.pose()}
    for time in (0.2, 0.35, 0.6):
        simulator.AdvanceTo(time)
        for moving in models.moving:
            X_WB = plant.GetBodyByName(moving.name).EvalPoseInWorld(context)
            start = poses[moving.name]
            expected = start.translation() + moving.path.value(time).ravel()
            # They lag by one plant step of 2 ms, at 0.5 m/s at most.
            np.testing.assert_allclose(X_WB.translation(), expected, atol=1.5e-3)
            np.testing.assert_allclose(
                X_WB.rotation().matrix(), start.rotation().matrix(), atol=1e-9
            )


def test_marker_picture_has_a_quiet_zone():
    picture = cv2.imdecode(np.frombuffer(marker_png(7), np.uint8), cv2.IMREAD_GRAYSCALE)
    margin = picture.shape[0] // 8
    assert picture[:margin].min() == 255
    assert picture[margin : 2 * margin, margin:-margin].max() == 0
    assert plate_size(0.06) == pytest.approx(0.08)


@pytest.mark.render
def test_the_camera_sees_the_marker_where_it_is_and_meshcat_gets_it_too():
    scene = load_scene("table")
    scene.goal.marker.id = 23
    builder, plant, scene_graph, models = build(scene)
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    meshcat = Meshcat(MeshcatParams(host="localhost", port=0))
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    # Half a metre in front of the marker, level with it and upright.
    X_MC = RigidTransform(np.diag([1.0, -1.0, -1.0, 1.0])) @ RigidTransform([0.0, 0.0, -0.5])
    X_WC = scene.goal.pose() @ scene.goal.marker.pose() @ X_MC
    focal, width, height = 600.0, 640, 480
    info = CameraInfo(width, height, focal, focal, width / 2, height / 2)
    core = RenderCameraCore("vtk", info, ClippingRange(0.05, 5.0), RigidTransform())
    image = query.RenderColorImage(ColorRenderCamera(core), scene_graph.world_frame_id(), X_WC)
    gray = cv2.cvtColor(np.asarray(image.data)[:, :, :3], cv2.COLOR_RGB2GRAY)
    detector = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(DICTIONARY), cv2.aruco.DetectorParameters()
    )
    corners, ids, _ = detector.detectMarkers(gray)
    assert ids.ravel().tolist() == [23]
    half = focal * 0.03 / 0.5
    expected = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half + [width / 2, height / 2]
    np.testing.assert_allclose(corners[0].reshape(4, 2), expected, atol=1.5)  # pixels

    diagram.ForcedPublish(context)
    messages = re.findall(r"octet-binary;base64,([A-Za-z0-9+/=]+)", meshcat.StaticHtml())
    assert any(b"marker.png" in base64.b64decode(m) for m in messages)
    inspector = scene_graph.model_inspector()
    frame = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(models.goal_object).index())
    for role in (Role.kPerception, Role.kIllustration):
        names = [inspector.GetName(g) for g in inspector.GetGeometries(frame, role)]
        assert any("marker" in name for name in names)
