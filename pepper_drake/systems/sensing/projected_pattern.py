"""A pattern projected on the scene, so that untextured walls can be matched."""

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.texture import project_pattern
from pepper_drake.systems.framework import LeafSystem


class ProjectedPattern(LeafSystem):
    """Darkens a rendered image according to a projected pattern.

    .. pydrake_system::

        name: ProjectedPattern
        input_ports:
        - color_image
        - depth_image
        output_ports:
        - color_image

    `color_image` (ImageRgba8U) and `depth_image` (ImageDepth32F) are an RgbdSensor's; the output
    (ImageRgba8U) is the sensor's image with the projector on.

    Args:
        intrinsics: The camera.
        X_CP: Pose of the projector, z along its optical axis, in the camera's frame.
        seed: Seed of the pattern; the same for all cameras that see it.
    """

    def __init__(
        self,
        intrinsics: CameraIntrinsics,
        X_CP: RigidTransform | None = None,
        *,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self._intrinsics = intrinsics
        self._X_CP = RigidTransform() if X_CP is None else X_CP
        self._seed = seed
        self._color = self.DeclareAbstractInputPort("color_image", Value(ImageRgba8U()))
        self._depth = self.DeclareAbstractInputPort("depth_image", Value(ImageDepth32F()))
        self.DeclareAbstractOutputPort(
            "color_image",
            lambda: Value(ImageRgba8U()),
            self._calc,
            prerequisites_of_calc={self._color.ticket(), self._depth.ticket()},
        )

    def _calc(self, context: Context, output: Value) -> None:
        color = self._color.Eval(context)
        lit = project_pattern(
            color.data,
            self._depth.Eval(context).data[..., 0],
            self._intrinsics,
            RigidTransform(),
            self._X_CP,
            seed=self._seed,
        )
        image = ImageRgba8U(color.width(), color.height())
        image.mutable_data[:] = lit
        output.set_value(image)
