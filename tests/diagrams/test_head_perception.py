import pytest
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.diagrams.head_perception import HeadPerception
from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
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
    perception = builder.AddSystem(HeadPerception(scene, station))
    perception.connect(builder, station)
    names = ("object_pose", "goal_valid", "cloud", "predicted_cloud_torso", "cloud_fault")
    for name in names:
        builder.ExportOutput(perception.GetOutputPort(name), name)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    X_WO, valid, cloud, predicted, fault = (
        diagram.GetOutputPort(name).Eval(context) for name in names
    )
    assert X_WO.IsNearlyEqualTo(scene.goal.pose(), 1e-9)
    assert (valid[0], cloud.size(), predicted.size(), fault[0]) == (1, 0, 0, 0)
