"""A marker on a plate that moves in front of the cameras as if held in a hand."""

from pydrake.common.value import Value
from pydrake.geometry import (
    Box,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    MakePhongIllustrationProperties,
    PerceptionProperties,
    Rgba,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder

from pepper_drake.models.markers import marker_mesh, plate_size
from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.guiding.scripted_guide import GuidePath

_THICKNESS = 0.004
_WHITE = Rgba(1.0, 1.0, 1.0)


class MovingMarker(LeafSystem):
    """Moves a frame of a scene graph along a path.

    .. pydrake_system::

        name: MovingMarker
        output_ports:
        - geometry_pose

    `geometry_pose` is the FramePoseVector of the marker's frame M (x right, y up, z out of the
    face) in the scene graph's world. No state.

    Args:
        path: Pose of M over time.
        frame: Frame id of M in the scene graph.
    """

    def __init__(self, path: GuidePath, frame: FrameId) -> None:
        super().__init__()
        self._path, self._frame = path, frame
        self.geometry_pose_output = self.DeclareAbstractOutputPort(
            "geometry_pose", lambda: Value(FramePoseVector()), self._calc_pose, {self.time_ticket()}
        )

    @staticmethod
    def add_to_builder(
        builder: DiagramBuilder,
        scene_graph: SceneGraph,
        path: GuidePath,
        marker_id: int,
        size: float,
    ) -> "MovingMarker":
        """Adds a marker on its plate to a scene graph, and the system that moves it.

        Args:
            builder: Builder of the diagram that contains the scene graph.
            scene_graph: The scene graph, with its renderers.
            path: Poses of M in the scene graph's world.
            marker_id: In DICT_4X4_50.
            size: Edge of the black square [m].
        """
        source = scene_graph.RegisterSource("moving_marker")
        frame = scene_graph.RegisterFrame(source, GeometryFrame("marker"))
        edge = plate_size(size)
        # The plate's face lies slightly behind the marker's, to avoid z-fighting.
        X_MP = RigidTransform([0.0, 0.0, -0.0005 - _THICKNESS / 2])
        shapes: tuple[tuple[str, Shape, RigidTransform], ...] = (
            ("plate", Box(edge, edge, _THICKNESS), X_MP),
            ("picture", marker_mesh(marker_id, size), RigidTransform()),
        )
        for name, shape, X_MG in shapes:
            instance = GeometryInstance(X_MG, shape, name)
            perception = PerceptionProperties()
            if name == "plate":
                perception.AddProperty("phong", "diffuse", _WHITE)
            instance.set_perception_properties(perception)
            instance.set_illustration_properties(MakePhongIllustrationProperties(_WHITE.rgba))
            scene_graph.RegisterGeometry(source, frame, instance)
        marker = builder.AddNamedSystem("moving_marker", MovingMarker(path, frame))
        builder.Connect(marker.geometry_pose_output, scene_graph.get_source_pose_port(source))
        return marker

    def _calc_pose(self, context: Context, output: Value) -> None:
        poses = FramePoseVector()
        poses.set_value(self._frame, self._path.pose(context.get_time()))
        output.set_value(poses)
