"""Pepper in a scene as pure geometry, with a renderer and cameras: one wiring for all of them."""

from collections.abc import Mapping

from pydrake.geometry import (
    FrameId,
    MakeRenderEngineVtk,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.rendering import MultibodyPositionToGeometryPose
from pydrake.systems.sensors import RgbdSensor

from pepper_drake.models.objects import SceneModels, add_scene
from pepper_drake.models.pepper import add_pepper
from pepper_drake.models.scene import Scene
from pepper_drake.perception.cameras.camera import (
    CameraIntrinsics,
    HeadCamera,
    make_render_cameras,
)

RENDERER = "vtk"
"""Name of the render engine in every scene graph."""


def add_renderer(scene_graph: SceneGraph) -> None:
    """Adds the render engine of all cameras to a scene graph."""
    scene_graph.AddRenderer(RENDERER, MakeRenderEngineVtk(RenderEngineVtkParams()))


def make_rgbd_sensor(
    intrinsics: CameraIntrinsics, parent: FrameId, X_PC: RigidTransform
) -> RgbdSensor:
    """Returns a camera that `add_renderer`'s engine renders for.

    Args:
        intrinsics: Of its images.
        parent: The frame P in the scene graph that it is fixed to.
        X_PC: Its pose in P.
    """
    return RgbdSensor(parent, X_PC, *make_render_cameras(intrinsics, RENDERER))


class RenderedScene:
    """The systems with which a diagram renders Pepper in a scene; the diagram is the caller's.

    The diagram has the input `positions`, those of `plant`: Pepper's, then the scene's.

    Args:
        builder: Of the diagram.
        scene: The scene.
        cameras: The cameras on the head, by name.

    Attributes:
        plant: Of which only the kinematics are used; it is not in the diagram.
        scene_graph: Its geometry.
        pepper: Pepper's model instance.
        models: The scene's bodies.
        sensors: The cameras' sensors, by name.
    """

    def __init__(
        self, builder: DiagramBuilder, scene: Scene, cameras: Mapping[str, HeadCamera]
    ) -> None:
        self.plant = MultibodyPlant(time_step=0.01)
        self.scene_graph = builder.AddSystem(SceneGraph())
        add_renderer(self.scene_graph)
        self.plant.RegisterAsSourceForSceneGraph(self.scene_graph)
        self.pepper: ModelInstanceIndex = add_pepper(self.plant)
        self.models: SceneModels = add_scene(self.plant, scene)
        self.plant.Finalize()
        poses = builder.AddSystem(MultibodyPositionToGeometryPose(self.plant))
        builder.Connect(
            poses.get_output_port(),
            self.scene_graph.get_source_pose_port(self.plant.get_source_id()),
        )
        builder.ExportInput(poses.get_input_port(), "positions")
        head = self.plant.GetBodyFrameIdOrThrow(self.plant.GetBodyByName("Head").index())
        self.sensors: dict[str, RgbdSensor] = {}
        for name, camera in cameras.items():
            sensor = builder.AddSystem(make_rgbd_sensor(camera.intrinsics, head, camera.X_HeadC))
            builder.Connect(
                self.scene_graph.get_query_output_port(), sensor.query_object_input_port()
            )
            self.sensors[name] = sensor
