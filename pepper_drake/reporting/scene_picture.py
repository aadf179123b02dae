"""A picture of the robot in its scene, from an external camera."""

import weakref
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngine,
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
from pepper_drake.perception.cameras.image_files import write_image
from pepper_drake.systems.framework import build, release

Vector = npt.NDArray[np.float64]

_RENDERER = "bystander"


def look_at(p_WC: Vector, p_WP: Vector) -> RigidTransform:
    """Returns the pose X_WC of a camera at p_WC that looks at p_WP, with the world's z up."""
    forward = (p_WP - p_WC) / np.linalg.norm(p_WP - p_WC)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    return RigidTransform(RotationMatrix(np.column_stack((right, down, forward))), p_WC)


class ExternalCamera:
    """A camera beside the robot, on the reaching arm's side, that renders illustration shapes.

    Attributes:
        plant: Pepper and the scene, at the positions of the last `picture`.
    """

    def __init__(
        self,
        scene: Scene | None,
        arm: str,
        base_pose: Vector,
        *,
        width: int,
        height: int,
        shadows: bool = True,
    ) -> None:
        """Places the camera beside the robot.

        Args:
            scene: The scene around the robot, if any.
            arm: The arm to look at, "left" or "right".
            base_pose: (3,) x, y, yaw in W of the base beside which the camera stands.
            width: Width of a picture, in pixels.
            height: Height of a picture, in pixels.
            shadows: Whether to render shadows, which take two thirds of a picture's time.
        """
        builder = DiagramBuilder()
        self.plant: MultibodyPlant
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
        self._scene_graph.AddRenderer(_RENDERER, _renderer(shadows))
        add_pepper(self.plant)
        if scene is not None:
            add_scene(self.plant, scene)
        self.plant.Finalize()
        _show_illustrations(self.plant, self._scene_graph)
        self._diagram = build(builder)
        weakref.finalize(self, release, self._diagram).atexit = False
        self._context = self._diagram.CreateDefaultContext()

        side = 1.0 if arm == "left" else -1.0
        cos, sin = np.cos(base_pose[2]), np.sin(base_pose[2])
        turn = np.array([[cos, -sin], [sin, cos]])
        eye = np.array([*(base_pose[:2] + turn @ [0.95, side * 1.75]), 1.35])
        target = np.array([*(base_pose[:2] + turn @ [0.15, 0.0]), 0.72])
        self._X_WC = look_at(eye, target)
        self._info = CameraInfo(width, height, np.radians(38))
        self._camera = ColorRenderCamera(
            RenderCameraCore(_RENDERER, self._info, ClippingRange(0.05, 20.0), RigidTransform())
        )

    def picture(self, positions: Vector) -> npt.NDArray[np.uint8]:
        """Returns a picture (height, width, 3), blue, green, red, for the plant's positions."""
        self.plant.SetPositions(self.plant.GetMyMutableContextFromRoot(self._context), positions)
        query = self._scene_graph.get_query_output_port().Eval(
            self._scene_graph.GetMyContextFromRoot(self._context)
        )
        image = query.RenderColorImage(self._camera, SceneGraph.world_frame_id(), self._X_WC)
        return np.ascontiguousarray(image.data[..., 2::-1])

    def project(self, points_W: Vector) -> Vector:
        """Projects points (K, 3) in W to the picture, (K, 2) pixels right and down."""
        points_C = points_W @ self._X_WC.inverse().rotation().matrix().T
        points_C = points_C + self._X_WC.inverse().translation()
        image = points_C @ self._info.intrinsic_matrix().T
        return np.asarray(image[:, :2] / image[:, 2:])


def save_scene_picture(
    scene: Scene,
    positions: Vector,
    base_pose: Vector,
    path: Path,
    *,
    width: int = 1280,
    height: int = 800,
) -> None:
    """Renders the robot with the illustration shapes, from the reaching arm's side.

    Args:
        scene: The scene around the robot.
        positions: Positions of the station's plant, of the robot and moving objects.
        base_pose: (3,) x, y, yaw of the base in W; the camera stands beside it.
        path: The PNG file to write.
        width: Width in pixels.
        height: Height in pixels.
    """
    camera = ExternalCamera(scene, scene.arm, base_pose, width=width, height=height)
    write_image(path, camera.picture(positions))


def save_start_picture(scene: Scene, path: Path, *, width: int = 480, height: int = 300) -> None:
    """Renders the robot at its start, without shadows; see `save_scene_picture`."""
    start, goal = scene.robot, scene.goal.position
    # Beside the midpoint between robot and goal, so that both are in the picture.
    base_pose = np.array([(start.x + goal[0]) / 2, (start.y + goal[1]) / 2, start.yaw])
    camera = ExternalCamera(scene, scene.arm, base_pose, width=width, height=height, shadows=False)
    q = camera.plant.GetPositions(camera.plant.CreateDefaultContext())
    for name, position in start.positions().items():
        q[camera.plant.GetJointByName(name).position_start()] = position
    write_image(path, camera.picture(q))


def _renderer(shadows: bool) -> RenderEngine:
    lights = [
        LightParameter(type="directional", frame="world", direction=direction, intensity=intensity)
        for direction, intensity in (
            (np.array([0.5, 0.35, -0.8]), 0.75),
            (np.array([-0.4, 0.7, -0.6]), 0.45),
        )
    ]
    return MakeRenderEngineVtk(
        RenderEngineVtkParams(
            default_clear_color=np.array([0.93, 0.95, 0.97]),
            lights=lights,
            cast_shadows=shadows,
            shadow_map_size=2048,
        )
    )


def _show_illustrations(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    """Lets the renderer draw illustration shapes, as meshcat does, not perception shapes."""
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
