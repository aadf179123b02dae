import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.cameras.camera import pixel_rays
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.perception.stereo.matching import stereo_obstacle_parameters
from pepper_drake.systems.robot.robot_kinematics import RobotKinematics
from pepper_drake.systems.sensing.depth_point_cloud_source import DepthPointCloudSource

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def seen():
    """A station with a stereo pair after its first pair of images, and the cloud made of it."""
    scene = load_scene("table")
    scene.robot.joints = {"HeadPitch": 0.3}
    model = shared_control_model()
    station = PepperStation(scene, StationConfig(stereo=True, camera_period=0.4), model)
    robot = RobotSolids(model.plant, model.diagram.scene_graph())
    builder = DiagramBuilder()
    builder.AddSystem(station)
    source = builder.AddSystem(
        DepthPointCloudSource(
            robot,
            intrinsics=station.depth_intrinsics,
            parameters=station.obstacle_parameters(stereo_obstacle_parameters()),
        )
    )
    for port, name in (
        ("image", "depth_image"),
        ("time_stamp", "time_stamp"),
        ("pose", "X_WC"),
        ("position", "position"),
    ):
        builder.Connect(station.GetOutputPort(f"camera_depth.{port}"), source.GetInputPort(name))
    builder.Connect(station.GetOutputPort("torso_pose"), source.GetInputPort("X_WT"))
    for name in ("top", "bottom"):
        builder.ExportInput(station.GetInputPort(f"camera_{name}.enabled"), name)
    hold = station.GetInputPort("joint_position_command")
    builder.ExportInput(hold, "joints")
    builder.ExportInput(station.GetInputPort("base_velocity_command"), "base")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    for name in ("top", "bottom"):
        diagram.GetInputPort(name).FixValue(context, [0.0])
    measured = station.GetOutputPort("joint_position").Eval(station.GetMyContextFromRoot(context))
    diagram.GetInputPort("joints").FixValue(context, measured)
    diagram.GetInputPort("base").FixValue(context, np.zeros(3))
    simulator.AdvanceTo(0.25)
    return (
        station,
        station.GetMyContextFromRoot(context),
        source,
        source.GetMyContextFromRoot(context),
    )


def test_depth_image_has_the_stamp_and_pose_of_its_capture(seen):
    station, context, _, _ = seen
    assert station.GetOutputPort("camera_depth.time_stamp").Eval(context)[0] == pytest.approx(0.2)
    X_WC = station.GetOutputPort("camera_depth.pose").Eval(context)
    kinematics = station.GetSubsystemByName("kinematics")
    assert isinstance(kinematics, RobotKinematics)
    X_WD = kinematics.GetOutputPort("camera_depth_pose").Eval(
        station.GetSubsystemContext(kinematics, context)
    )
    assert X_WC.IsNearlyEqualTo(X_WD, 1e-3)
    position = station.GetOutputPort("camera_depth.position").Eval(context)
    assert position.shape == (18,)


def test_depth_image_shows_the_table_top(seen):
    station, context, _, _ = seen
    image = station.GetOutputPort("camera_depth.image").Eval(context)
    assert (image.width(), image.height()) == (1280, 720)
    depth = image.data[..., 0].astype(float) / 1000
    shown = depth > 0
    assert shown.mean() > 0.1
    X_WC = station.GetOutputPort("camera_depth.pose").Eval(context)
    p_C = pixel_rays(station.depth_intrinsics)[shown] * depth[shown][:, None]
    p_W = (X_WC @ p_C.T).T
    top = (p_W[:, 2] > 0.70) & (p_W[:, 2] < 0.78) & (p_W[:, 0] < 1.2)
    assert top.sum() > 5_000
    assert abs(np.median(p_W[top, 2]) - 0.74) < 0.005


def test_cloud_is_made_of_it(seen):
    _, _, source, context = seen
    points = source.GetOutputPort("cloud").Eval(context).xyzs().T
    assert len(points) > 2_000
    near_top = np.abs(points[:, 2] - 0.74) < 0.015
    assert near_top.mean() > 0.4
    assert points[:, 2].min() > 0.02
