import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.systems.guiding.scripted_guide import GuidePath
from pepper_drake.systems.sensing.moving_marker import MovingMarker


def test_its_geometry_is_where_the_path_has_it():
    poses = [
        RigidTransform(RotationMatrix.MakeZRotation(0.2 * k), [0.5 + 0.1 * k, 0, 0])
        for k in range(3)
    ]
    path = GuidePath([0.0, 1.0, 2.0], poses)
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    MovingMarker.add_to_builder(builder, scene_graph, path, 5, 0.06)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    inspector = scene_graph.model_inspector()
    picture, plate = sorted(inspector.GetAllGeometryIds(), key=inspector.GetName)
    for time in (0.0, 0.7, 3.0):
        context.SetTime(time)
        query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
        X_WM = query.GetPoseInWorld(picture)
        assert X_WM.IsNearlyEqualTo(path.pose(time), 1e-12)
        # The plate is behind the picture: on its -z side.
        behind = (X_WM.inverse() @ query.GetPoseInWorld(plate)).translation()
        np.testing.assert_allclose(behind[:2], 0, atol=1e-12)
        assert behind[2] < -0.002
