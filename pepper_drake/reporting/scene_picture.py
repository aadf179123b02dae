"""A picture of the robot in its scene, as seen by a bystander."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from pepper_drake.models.objects import add_scene
from pepper_drake.models.pepper import add_pepper
from pepper_drake.models.scene import Scene

Vector = npt.NDArray[np.float64]

_RENDERER = "bystander"


def look_at(p_WC: Vector, p_WP: Vector) -> RigidTransform:
    """The pose X_WC of a camera at p_WC that looks at p_WP, with the world's z up."""
    forward = (p_WP - p_WC) / np.linalg.norm(p_WP - p_WC)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    return RigidTransform(RotationMatrix(np.column_stack((right, down, forward))), p_WC)


def save_scene_picture(
    scene: Scene,
    positions: Vector,
    base_pose: Vector,
    path: Path,
    *,
    width: int = 1280,
    height: int = 800,
) -> None:
    """Renders the robot with the shapes made for people, from the reaching arm's side.

    Args:
        scene: What is around it.
        positions: Of the station's plant, robot and moving things.
        base_pose: (3,) x, y, yaw of the base in W; the bystander stands beside it.
        path: The PNG file to write.
        width: Pixels.
        height: Pixels.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
    lights = [
        LightParameter(type="directional", frame="world", direction=direction, intensity=intensity)
        for direction, intensity in (
            (np.array([0.5, 0.35, -0.8]), 0.75),
            (np.array([-0.4, 0.7, -0.6]), 0.45),
        )
    ]
    scene_graph.AddRenderer(
        _RENDERER,
        MakeRenderEngineVtk(
            RenderEngineVtkParams(
                default_clear_color=np.array([0.93, 0.95, 0.97]),
                lights=lights,
                cast_shadows=True,
                shadow_map_size=2048,
            )
        ),
    )
    add_pepper(plant)
    add_scene(plant, scene)
    plant.Finalize()
    _show_illustrations(plant, scene_graph)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), positions)

    side = 1.0 if scene.arm == "left" else -1.0
    cos, sin = np.cos(base_pose[2]), np.sin(base_pose[2])
    turn = np.array([[cos, -sin], [sin, cos]])
    eye = np.array([*(base_pose[:2] + turn @ [0.95, side * 1.75]), 1.35])
    target = np.array([*(base_pose[:2] + turn @ [0.15, 0.0]), 0.72])
    camera = ColorRenderCamera(
        RenderCameraCore(
            _RENDERER,
            CameraInfo(width, height, np.radians(38)),
            ClippingRange(0.05, 20.0),
            RigidTransform(),
        )
    )
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    image = query.RenderColorImage(camera, SceneGraph.world_frame_id(), look_at(eye, target))
    cv2.imwrite(str(path), image.data[..., 2::-1])


def _show_illustrations(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    """Lets the renderer draw what meshcat draws, and not the plain shapes made for cameras."""
    inspector = scene_graph.model_inspector()
    source = plant.get_source_id()
    for geometry in inspector.GetAllGeometryIds():
        illustration = inspector.GetIllustrationProperties(geometry)
        perceived = inspector.GetPerceptionProperties(geometry) is not None
        if illustration is None and perceived:
            scene_graph.RemoveRole(source, geometry, Role.kPerception)
        elif illustration is not None and not perceived:
            properties = PerceptionProperties()
            color = illustration.GetPropertyOrDefault("phong", "diffuse", Rgba(0.9, 0.9, 0.9, 1.0))
            properties.AddProperty("phong", "diffuse", color)
            properties.AddProperty("label", "id", RenderLabel.kDontCare)
            scene_graph.AssignRole(source, geometry, properties)
