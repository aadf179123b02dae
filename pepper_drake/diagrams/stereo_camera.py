"""A stereo pair behind Pepper's eyes that replaces the depth camera."""

from dataclasses import dataclass, field

from pydrake.geometry import FrameId
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.sensors import RgbdSensor

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, HeadCamera
from pepper_drake.perception.cameras.noise import ColorNoise
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.perception.stereo.matching import StereoParameters, make_stereo_cameras
from pepper_drake.perception.stereo.segmentation import SegmentationParameters
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.sensing.camera_model import CameraModel
from pepper_drake.systems.sensing.projected_pattern import ProjectedPattern
from pepper_drake.systems.sensing.rendered_scene import make_rgbd_sensor
from pepper_drake.systems.sensing.stereo_depth import StereoDepth


@dataclass
class StereoConfig:
    """Parameters of stereo depth."""

    matching: StereoParameters = field(default_factory=StereoParameters)
    """Matching of the two images."""
    segmentation: SegmentationParameters = field(default_factory=SegmentationParameters)
    """Segmentation of the images into objects."""


class StereoCamera(Diagram):
    """Two colour cameras, an optional pattern projector, and the matching of their images.

    .. pydrake_system::

        name: StereoCamera
        input_ports:
        - query
        - X_WC
        - position
        - enabled
        output_ports:
        - depth_image
        - X_WC
        - time_stamp
        - position

    The ports are a depth CameraModel's, except that `query`, the scene graph's QueryObject,
    replaces the rendered image. The input `X_WC` is the measured pose of the depth camera's frame
    on the head, the output `X_WC` that of the rectified left camera.

    Args:
        head: The head's frame in the scene graph.
        robot: The robot's shapes, to mask its own body.
        period: Time between pairs of images [s].
        offset: Time of the first pair [s].
        noise: Noise of both cameras.
        config: Matching and segmentation of their images.
        pattern: Whether to project a pattern on the scene: untextured walls cannot be matched.
        seed: Seed of noise and pattern.

    Attributes:
        intrinsics: Intrinsics of the depth images.
    """

    def __init__(
        self,
        head: FrameId,
        robot: RobotSolids,
        *,
        period: float = 0.2,
        offset: float = 0.0,
        noise: ColorNoise | None = None,
        config: StereoConfig | None = None,
        pattern: bool = True,
        seed: int = 0,
    ) -> None:
        super().__init__()
        config = config or StereoConfig()
        self._noise = ColorNoise(sigma=2.0) if noise is None else noise
        self._pattern = pattern
        self._seed = seed
        left, right = make_stereo_cameras()
        builder = DiagramBuilder()
        depth = builder.AddNamedSystem(
            "stereo_depth",
            StereoDepth(
                left,
                right,
                robot,
                X_CL=CAMERA_DEPTH.X_HeadC.inverse() @ left.X_HeadC,
                parameters=config.matching,
                segmentation=config.segmentation,
                num_positions=robot.num_positions,
            ),
        )
        self.intrinsics = depth.intrinsics
        for number, (side, camera) in enumerate((("left", left), ("right", right))):
            sensor = builder.AddNamedSystem(
                f"{side}_sensor",
                make_rgbd_sensor(camera.intrinsics, head, camera.X_HeadC),
            )
            model = builder.AddNamedSystem(
                side,
                CameraModel(
                    camera.intrinsics,
                    kind="color",
                    period=period,
                    offset=offset,
                    noise=self._noise,
                    seed=2 * seed + number,
                    num_positions=robot.num_positions,
                ),
            )
            image = self._projected(builder, sensor, camera, left)
            builder.Connect(image, model.get_image_input_port())
            for name, port in (
                ("query", sensor.query_object_input_port()),
                ("enabled", model.GetInputPort("enabled")),
            ):
                if number == 0:
                    builder.ExportInput(port, name)
                else:
                    builder.ConnectInput(name, port)
            builder.Connect(
                model.get_image_output_port(), depth.GetInputPort(f"color_image_{side}")
            )
            if number == 0:
                for name in ("X_WC", "position"):
                    builder.ExportInput(model.GetInputPort(name), name)
                for name in ("X_WC", "position", "time_stamp"):
                    builder.Connect(model.GetOutputPort(name), depth.GetInputPort(name))
        for name in ("depth_image", "X_WC", "time_stamp", "position"):
            builder.ExportOutput(depth.GetOutputPort(name), name)
        build_into(builder, self)

    def _projected(
        self, builder: DiagramBuilder, sensor: RgbdSensor, camera: HeadCamera, projector: HeadCamera
    ) -> OutputPort:
        """Returns the sensor's image, with the pattern of a projector at the left eye if any."""
        if not self._pattern:
            return sensor.color_image_output_port()
        X_CP = camera.X_HeadC.inverse() @ projector.X_HeadC
        light = builder.AddNamedSystem(
            f"{camera.name}_light", ProjectedPattern(camera.intrinsics, X_CP, seed=self._seed)
        )
        builder.Connect(sensor.color_image_output_port(), light.GetInputPort("color_image"))
        builder.Connect(sensor.depth_image_32F_output_port(), light.GetInputPort("depth_image"))
        return light.get_output_port()
