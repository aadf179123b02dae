"""What Pepper sees: the goal object, the obstacles as a cloud, and the head that looks there."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.models.objects import GOAL_OBJECT
from pepper_drake.models.scene import Scene
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.perception.goal.imm_filter import GoalFilterParameters
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.systems.robot.body_pose import BodyPose
from pepper_drake.systems.sensing.depth_point_cloud_source import DepthPointCloudSource
from pepper_drake.systems.sensing.gaze_controller import GazeController
from pepper_drake.systems.sensing.goal_estimator import GoalEstimator

SEARCH_GAZE = (0.45, 0.3)
"""Head yaw (to the arm's side) and pitch with which what is within reach is looked for [rad]."""

NEAR_GAZE = 0.07
"""Of a goal within reach Pepper looks at a point so far beside it, to the side where the arm comes
from [m]."""


@dataclass(frozen=True, eq=False)
class Perception:
    """What was added to a diagram so that Pepper sees.

    Attributes:
        look_at: Turns the head to the goal.
        object_pose: The goal object's X_WO.
        goal_estimator: Finds the goal's marker; None where the goal is known.
        cloud_source: Sees obstacles; None without cameras.
    """

    look_at: GazeController
    object_pose: OutputPort
    goal_estimator: GoalEstimator | None = None
    cloud_source: DepthPointCloudSource | None = None


def add_perception(builder: DiagramBuilder, scene: Scene, station: PepperStation) -> Perception:
    """Adds what sees the goal and the obstacles; without cameras the goal's true pose is known."""
    marked = MarkedObject.from_scene(scene.goal)
    aside = NEAR_GAZE if scene.arm == "left" else -NEAR_GAZE
    p_OP = marked.X_OM.translation() + np.array([0.0, aside, 0.0])
    look_at = builder.AddNamedSystem("look_at", GazeController(p_OP))
    builder.Connect(station.GetOutputPort("torso_pose"), look_at.GetInputPort("X_WT"))
    if not station.config.cameras:
        body = station.plant.GetBodyByName(GOAL_OBJECT)
        known = builder.AddNamedSystem("known_goal", BodyPose(body.index()))
        builder.Connect(station.GetOutputPort("ground_truth.body_poses"), known.body_poses_input)
        builder.Connect(known.pose_output, look_at.GetInputPort("object_pose"))
        return Perception(look_at, known.pose_output)
    estimator = _add_goal_estimator(builder, station, marked, look_at, scene.arm)
    object_pose = estimator.GetOutputPort("object_pose")
    source = builder.AddNamedSystem(
        "cloud_source",
        DepthPointCloudSource(
            RobotSolids(station.control_model.plant, station.control_model.diagram.scene_graph()),
            marked,
            intrinsics=station.depth_intrinsics,
            parameters=station.obstacle_parameters,
        ),
    )
    _connect_camera(
        builder,
        station,
        "camera_depth",
        source,
        {
            "image": "depth_image",
            "time_stamp": "time_stamp",
            "pose": "X_WC",
            "position": "position",
        },
    )
    for port, name in (
        (object_pose, "object_pose"),
        (estimator.GetOutputPort("valid"), "object_valid"),
        (estimator.GetOutputPort("velocity"), "object_velocity"),
        (station.GetOutputPort("torso_pose"), "X_WT"),
    ):
        builder.Connect(port, source.GetInputPort(name))
    return Perception(look_at, object_pose, estimator, source)


def _add_goal_estimator(
    builder: DiagramBuilder,
    station: PepperStation,
    marked: MarkedObject,
    look_at: GazeController,
    arm: str,
) -> GoalEstimator:
    """Adds the estimator on both colour cameras, of which the head switches on the better one."""
    estimator = builder.AddNamedSystem(
        "goal_estimator",
        GoalEstimator(
            marked,
            # The hand's goal lies beside the object: a turn by this moves it by a millimetre.
            parameters=GoalFilterParameters(publish_angle=0.01),
            expects_noise=station.config.noise,
        ),
    )
    for camera in ("top", "bottom"):
        ports = {
            "image": f"color_image_{camera}",
            "time_stamp": f"time_stamp_{camera}",
            "pose": f"X_WC_{camera}",
        }
        _connect_camera(builder, station, f"camera_{camera}", estimator, ports)
        builder.Connect(
            look_at.GetOutputPort(f"{camera}_enabled"),
            station.GetInputPort(f"camera_{camera}.enabled"),
        )
    builder.Connect(estimator.GetOutputPort("object_pose"), look_at.GetInputPort("object_pose"))
    builder.Connect(estimator.GetOutputPort("valid"), look_at.GetInputPort("valid"))
    yaw, pitch = SEARCH_GAZE
    gaze = builder.AddNamedSystem(
        "head_search_pattern", ConstantVectorSource([yaw if arm == "left" else -yaw, pitch])
    )
    builder.Connect(gaze.get_output_port(), look_at.GetInputPort("resting_head"))
    return estimator


def _connect_camera(
    builder: DiagramBuilder,
    station: PepperStation,
    camera: str,
    system: System,
    ports: dict[str, str],
) -> None:
    for port, name in ports.items():
        builder.Connect(station.GetOutputPort(f"{camera}.{port}"), system.GetInputPort(name))
