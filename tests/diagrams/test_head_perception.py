import pytest
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.diagrams.head_perception import add_perception
from pepper_drake.diagrams.station import PepperStation, StationConfig
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.scene import SCENES_DIR, load_scene


@pytest.mark.parametrize("arm", ["right", "left"])
def test_without_cameras_the_goal_is_known(arm):
    scene = load_scene(SCENES_DIR / "teach.yaml")
    scene = scene if scene.arm == arm else scene.mirrored()
    builder = DiagramBuilder()
    station = builder.AddSystem(
        PepperStation(scene, StationConfig(cameras=False), shared_control_model())
    )
    perception = add_perception(builder, scene, station)
    builder.ExportOutput(perception.object_pose, "object_pose")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    X_WO = diagram.GetOutputPort("object_pose").Eval(context)
    assert X_WO.IsNearlyEqualTo(scene.goal.pose(), 1e-9)
    assert perception.goal_estimator is None
    assert perception.cloud_source is None
