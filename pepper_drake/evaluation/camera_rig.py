"""A posed Pepper in a scene with rendered camera images, to measure perception without motion."""

import weakref
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Mesh, Role
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.sensors import RgbdSensor

from pepper_drake.models.pepper import set_joint_positions
from pepper_drake.models.scene import Scene
from pepper_drake.perception.cameras.camera import (
    CAMERA_BOTTOM,
    CAMERA_DEPTH,
    CAMERA_TOP,
    CameraIntrinsics,
    HeadCamera,
    make_render_cameras,
)
from pepper_drake.perception.cloud_evaluation import TrueSurfaces
from pepper_drake.systems.framework import build, release
from pepper_drake.systems.sensing.rendered_scene import RENDERER, RenderedScene


class CameraRig:
    """A static scene with Pepper and its head cameras, without control.

    Images are ideal: `pepper_drake.perception.cameras.noise` adds noise and lens distortion.

    Args:
        scene: The scene, which includes Pepper's initial positions.
        cameras: The cameras on the head.

    Attributes:
        plant: The plant with Pepper and the scene.
        scene_graph: The plant's geometry.
        pepper: Pepper's model instance.
        scene_models: The scene's bodies.
        cameras: The cameras by name.
    """

    def __init__(
        self,
        scene: Scene,
        cameras: Sequence[HeadCamera] = (CAMERA_TOP, CAMERA_BOTTOM, CAMERA_DEPTH),
    ) -> None:
        builder = DiagramBuilder()
        self.cameras = {camera.name: camera for camera in cameras}
        rendered = RenderedScene(builder, scene, self.cameras)
        self.plant, self.scene_graph = rendered.plant, rendered.scene_graph
        self.pepper, self.scene_models = rendered.pepper, rendered.models
        self._sensors = rendered.sensors
        self._diagram = build(builder)
        weakref.finalize(self, release, self._diagram, self.plant).atexit = False
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.CreateDefaultContext()
        self.set_positions(scene.robot.positions())

    def set_positions(self, positions: Mapping[str, float]) -> None:
        """Sets Pepper's joints by name, rad and m; others keep their position."""
        set_joint_positions(self.plant, self._plant_context, self.pepper, positions)
        self._show_positions()

    def move_object(self, name: str, offset: npt.ArrayLike) -> None:
        """Moves an object with a path to an offset (3,) [m] from its position in the scene."""
        for axis, value in zip("xyz", np.asarray(offset, dtype=float), strict=True):
            joint = self.plant.GetJointByName(f"{name}_{axis}")
            joint.set_translation(self._plant_context, value)
        self._show_positions()

    def pepper_positions(self) -> npt.NDArray[np.float64]:
        """Returns Pepper's positions (18,), in the order of a plant with only Pepper."""
        return self.plant.GetPositions(self._plant_context, self.pepper)

    def pose(self, frame: str) -> RigidTransform:
        """Returns the pose in W of a frame of Pepper, such as `torso`, or of a camera by name."""
        if frame in self.cameras:
            return self.pose("Head") @ self.cameras[frame].X_HeadC
        return self.plant.GetFrameByName(frame).CalcPoseInWorld(self._plant_context)

    def body_pose(self, name: str) -> RigidTransform:
        """Returns the pose in W of a body, such as the goal object."""
        return self.plant.EvalBodyPoseInWorld(self._plant_context, self.plant.GetBodyByName(name))

    def surfaces(self, bodies: Sequence[str]) -> TrueSurfaces:
        """Returns the true surfaces of the shapes of some bodies that cameras see."""
        inspector = self.scene_graph.model_inspector()
        shapes = []
        for name in bodies:
            X_WB = self.body_pose(name)
            frame = self.plant.GetBodyFrameIdOrThrow(self.plant.GetBodyByName(name).index())
            for geometry in inspector.GetGeometries(frame, Role.kPerception):
                shape = inspector.GetShape(geometry)
                if isinstance(shape, Mesh) and shape.source().is_in_memory():
                    continue  # The marker's texture, flush with its plate.
                shapes.append((shape, X_WB @ inspector.GetPoseInFrame(geometry)))
        return TrueSurfaces(shapes)

    def pepper_bodies(self) -> list[str]:
        """Returns the names of Pepper's links that cameras see."""
        inspector = self.scene_graph.model_inspector()
        names = []
        for index in self.plant.GetBodyIndices(self.pepper):
            frame = self.plant.GetBodyFrameIdIfExists(index)
            if frame is not None and inspector.GetGeometries(frame, Role.kPerception):
                names.append(self.plant.get_body(index).name())
        return names

    def shows(self, camera: str, bodies: Sequence[str]) -> npt.NDArray[np.bool_]:
        """Renders a mask (height, width) of a camera's pixels that show one of some bodies."""
        labels = [int(self.plant.GetBodyByName(name).index()) for name in bodies]
        return np.isin(self.label(camera), labels)

    def color(self, camera: str) -> npt.NDArray[np.uint8]:
        """Renders a colour image (height, width, 4)."""
        sensor = self._sensors[camera]
        return self._eval(sensor, sensor.color_image_output_port())

    def depth(self, camera: str) -> npt.NDArray[np.float32]:
        """Renders a depth image (height, width) [m]: infinite beyond far, 0 below near."""
        sensor = self._sensors[camera]
        return self._eval(sensor, sensor.depth_image_32F_output_port())[..., 0]

    def label(self, camera: str) -> npt.NDArray[np.int16]:
        """Renders the index of the body in each pixel (height, width)."""
        sensor = self._sensors[camera]
        return self._eval(sensor, sensor.label_image_output_port())[..., 0]

    def color_from(
        self, intrinsics: CameraIntrinsics, X_WC: RigidTransform
    ) -> npt.NDArray[np.uint8]:
        """Renders a colour image (height, width, 4) of a camera at any pose."""
        camera, _ = make_render_cameras(intrinsics, RENDERER)
        query = self.scene_graph.get_query_output_port().Eval(
            self.scene_graph.GetMyContextFromRoot(self._context)
        )
        world = self.scene_graph.world_frame_id()
        return query.RenderColorImage(camera, world, X_WC).data.copy()

    def _show_positions(self) -> None:
        positions = self.plant.GetPositions(self._plant_context)
        self._diagram.GetInputPort("positions").FixValue(self._context, positions)

    def _eval(self, sensor: RgbdSensor, port: OutputPort) -> npt.NDArray:
        return port.Eval(sensor.GetMyContextFromRoot(self._context)).data.copy()
