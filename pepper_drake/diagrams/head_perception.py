"""Perception with the head: goal object, obstacle clouds and gaze."""

import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from pydrake.common.value import Value
from pydrake.perception import PointCloud
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import (
    TrajectorySource,
    ZeroOrderHold,
)
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.diagrams.robot_signals import export_triggers
from pepper_drake.diagrams.station import PepperStation, select_joints
from pepper_drake.models.objects import GOAL_OBJECT
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.scene import Scene
from pepper_drake.perception.calibration.calibrated_cameras import (
    HEAD_CAMERA_MODELS,
    calibrated_cameras,
)
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.gaze.gaze_params import GazeParams
from pepper_drake.perception.gaze.head_aiming import head_search_pattern
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.perception.goal.imm_filter import GoalFilterParameters
from pepper_drake.perception.goal.marker_params import MarkerParams
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.perception.stereo.matching import stereo_obstacle_parameters
from pepper_drake.systems.constant import Constant
from pepper_drake.systems.faults.fault_memory import Role
from pepper_drake.systems.faults.fault_set import FaultSet
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.robot.body_pose import BodyPose
from pepper_drake.systems.sensing.depth_point_cloud_source import DepthPointCloudSource
from pepper_drake.systems.sensing.estimate_guard import CloudGuard, PoseGuard
from pepper_drake.systems.sensing.gaze_controller import GazeController
from pepper_drake.systems.sensing.goal_estimator import GoalEstimator

_EVER = 1e9
"""Longer than any simulation [s]."""
_CAMERAS = {
    "camera_top": {
        "image": "color_image_top",
        "time_stamp": "time_stamp_top",
        "pose": "X_WC_top",
    },
    "camera_bottom": {
        "image": "color_image_bottom",
        "time_stamp": "time_stamp_bottom",
        "pose": "X_WC_bottom",
    },
    "camera_depth": {
        "image": "depth_image",
        "time_stamp": "time_stamp",
        "pose": "X_WC",
        "position": "position",
    },
}
"""Each camera's ports at the station, and the input ports that they are connected to."""
_GOAL = {"object_pose": "object_pose", "valid": "goal_valid", "age": "goal_age"}
_GOAL_ROLES = {
    "object_pose": Role.VALUE,
    "velocity": Role.CARRIED,
    "valid": Role.VALID,
    "age": Role.AGE,
}
_CLOUD_ROLES = {
    "cloud": Role.VALUE,
    "cloud_torso": Role.VALUE,
    "predicted_cloud": Role.CARRIED,
    "predicted_cloud_torso": Role.CARRIED,
    "time_stamp": Role.STAMP,
    "age": Role.AGE,
    "fault": Role.CARRIED,
}
"""Roles of the ports for faults of the signals "goal" and "cloud"."""
_CLOUD = {
    "cloud": "cloud",
    "cloud_torso": "cloud_torso",
    "predicted_cloud": "predicted_cloud",
    "predicted_cloud_torso": "predicted_cloud_torso",
    "time_stamp": "cloud_time",
    "age": "cloud_age",
    "fault": "cloud_fault",
}
"""Names under which the subsystems' output ports are exported."""


@dataclass
class PerceptionConfig:
    """Parameters of perception: goal, obstacles, head."""

    image_poll_period: float = 0.05
    """Period of polling for new images [s]: they come every 0.2 s, and each poll copies the
    state."""
    goal: GoalFilterParameters = field(
        # The hand's goal is beside the object: a rotation by this angle moves it by a millimetre.
        default_factory=lambda: GoalFilterParameters(publish_angle=0.01, hold_seconds=5.0)
    )
    marker: MarkerParams = field(default_factory=MarkerParams)
    """Detection of the goal's marker, and errors of its corners."""
    goal_latency: float = 0.04
    """Time from an image's arrival to the estimate based on it [s]: detection takes 25 ms."""
    obstacles: ObstacleParameters = field(default_factory=ObstacleParameters)
    """Obstacle detection in the depth camera's images ..."""
    stereo_obstacles: ObstacleParameters = field(default_factory=stereo_obstacle_parameters)
    """... and in those of a stereo pair used instead."""
    gaze: GazeParams = field(default_factory=GazeParams)
    """Motion of the head, which follows the goal object and scans around it."""


class HeadPerception(Diagram):
    """Goal estimator, cloud source and gaze controller.

    .. pydrake_system::

        name: HeadPerception
        input_ports:
        - head_position
        - torso_pose
        - scan_enabled (optional)
        - look_at (optional)
        - camera_top.image, .time_stamp, .pose
        - camera_bottom.image, .time_stamp, .pose
        - camera_depth.image, .time_stamp, .pose, .position
        - body_poses (without cameras)
        output_ports:
        - object_pose
        - goal_valid
        - goal_age
        - goal_gap
        - image_ages
        - search_delay
        - cloud
        - cloud_torso
        - predicted_cloud
        - predicted_cloud_torso
        - cloud_time
        - cloud_age
        - cloud_fault
        - space (with cameras)
        - head_position_command
        - camera_top.enabled
        - camera_bottom.enabled

    The inputs are a station's ports. `scan_enabled` (1) and `look_at` (3): see `GazeController`.
    Outputs: X_WO of the goal object, whether it is known (1), time since it was last seen, and time
    since its estimate was last valid [s]; the ages of the colour cameras' newest images [s] (2);
    obstacles and predicted positions of moving ones, in W and in T (PointCloud); time, age [s] and
    fault of the last depth image; `space`, observed space (SeenSpace); HeadYaw and HeadPitch [rad]
    (2); whether a colour camera is enabled (1).

    Without cameras the goal's true pose is used and there are no obstacles.
    """

    def __init__(
        self, scene: Scene, station: PepperStation, config: PerceptionConfig | None = None
    ) -> None:
        """Makes the perception.

        Args:
            scene: The scene, with goal object and reaching arm.
            station: The station to which it will be connected, for its cameras.
            config: Parameters of perception.
        """
        super().__init__()
        self._config = config = config or PerceptionConfig()
        self._has_cameras = station.config.cameras
        self._builder = builder = DiagramBuilder()
        marked = MarkedObject.from_scene(scene.goal)
        self._gaze = builder.AddNamedSystem(
            "gaze_controller",
            GazeController(
                marked.X_OM.translation(),
                secondary_camera=CAMERA_DEPTH,
                radius=marked.marker_size / np.sqrt(2),
                side=1.0 if scene.arm == "left" else -1.0,
                search=partial(head_search_pattern, params=config.gaze.search),
                params=config.gaze,
            ),
        )
        if self._has_cameras:
            self._add_estimators(marked, station)
        else:
            self._add_known_goal(station)
        builder.ExportInput(self._gaze.GetInputPort("X_WT"), "torso_pose")
        if self._has_cameras:
            builder.ConnectInput("torso_pose", self._cloud_source.GetInputPort("X_WT"))
        for name in ("scan_enabled", "look_at"):
            builder.ExportInput(self._gaze.GetInputPort(name), name)
        builder.ExportInput(self._gaze.GetInputPort("head_position"), "head_position")
        builder.ExportOutput(
            self._gaze.GetOutputPort("head_position_command"), "head_position_command"
        )
        builder.ExportOutput(self._gaze.GetOutputPort("search_delay"), "search_delay")
        for camera in ("top", "bottom"):
            builder.ExportOutput(
                self._gaze.GetOutputPort(f"{camera}_enabled"), f"camera_{camera}.enabled"
            )
        del self._builder
        build_into(builder, self)

    def connect(self, builder: DiagramBuilder, station: PepperStation) -> None:
        """Connects a station's measurements to the perception, and the perception to its cameras.

        Args:
            builder: Builder of the diagram that contains both.
            station: The station, simulated or real.
        """
        joint_position = station.GetOutputPort("joint_position")
        head = select_joints(builder, joint_position, "head_position", JOINT_GROUPS["head"])
        builder.Connect(head, self.GetInputPort("head_position"))
        builder.Connect(station.GetOutputPort("torso_pose"), self.GetInputPort("torso_pose"))
        if not self._has_cameras:
            builder.Connect(
                station.GetOutputPort("ground_truth.body_poses"), self.GetInputPort("body_poses")
            )
            return
        for camera, ports in _CAMERAS.items():
            for port in ports:
                name = f"{camera}.{port}"
                builder.Connect(station.GetOutputPort(name), self.GetInputPort(name))
        for camera in ("camera_top", "camera_bottom"):
            name = f"{camera}.enabled"
            builder.Connect(self.GetOutputPort(name), station.GetInputPort(name))

    def _add_estimators(self, marked: MarkedObject, station: PepperStation) -> None:
        """Adds the estimators of goal and obstacles from camera images."""
        builder = self._builder
        cameras = HEAD_CAMERA_MODELS | calibrated_cameras(station.config.calibration)
        stereo = station.config.stereo
        obstacles = self._config.stereo_obstacles if stereo else self._config.obstacles
        executor = ThreadPoolExecutor(1, thread_name_prefix="goal estimator")
        weakref.finalize(self, executor.shutdown, wait=False).atexit = False
        estimator = builder.AddNamedSystem(
            "goal_estimator",
            GoalEstimator(
                marked,
                top=cameras["camera_top"].intrinsics,
                bottom=cameras["camera_bottom"].intrinsics,
                parameters=self._config.goal,
                marker=self._config.marker,
                period=self._config.image_poll_period,
                latency=self._config.goal_latency,
                executor=executor,
                expects_noise=station.config.noise,
            ),
        )
        self._cloud_source = source = builder.AddNamedSystem(
            "cloud_source",
            DepthPointCloudSource(
                RobotSolids(
                    station.control_model.plant, station.control_model.diagram.scene_graph()
                ),
                marked,
                intrinsics=station.depth_intrinsics,
                parameters=station.obstacle_parameters(obstacles),
                period=self._config.image_poll_period,
            ),
        )
        for camera, ports in _CAMERAS.items():
            reader = source if camera == "camera_depth" else estimator
            for port, name in ports.items():
                builder.ExportInput(reader.GetInputPort(name), f"{camera}.{port}")
        ages = estimator.GetOutputPort("image_ages")
        builder.ExportOutput(ages, "image_ages")
        builder.Connect(ages, self._gaze.GetInputPort("image_ages"))
        goal = self._guarded_goal(estimator, station.config.faults)
        for name in ("object_pose", "valid", "age", "velocity"):
            builder.Connect(goal[name], self._gaze.GetInputPort(name))
        for name in ("object_pose", "valid", "velocity"):
            target = name if name == "object_pose" else f"object_{name}"
            builder.Connect(goal[name], source.GetInputPort(target))
        cloud = self._guarded_cloud(source, station.config.faults)
        builder.Connect(cloud["cloud"], self._gaze.GetInputPort("cloud"))
        builder.ExportOutput(source.GetOutputPort("space"), "space")
        for ports, names in ((goal, _GOAL), (cloud, _CLOUD)):
            for port, name in names.items():
                builder.ExportOutput(ports[port], name)
        export_triggers(builder, station.config.faults)

    def _guarded_goal(self, estimator: System, faults: FaultSet) -> dict[str, OutputPort]:
        """Returns the goal estimate's ports, behind fault injector and guard."""
        builder = self._builder
        ports = {name: (role, estimator.GetOutputPort(name)) for name, role in _GOAL_ROLES.items()}
        goal = faults.tap(builder, "goal", ports)
        guard = builder.AddNamedSystem(
            "goal_guard", PoseGuard(time_step=self._config.image_poll_period)
        )
        builder.Connect(goal["object_pose"], guard.pose_input)
        builder.ExportOutput(guard.GetOutputPort("age"), "goal_gap")
        return goal | {"object_pose": guard.GetOutputPort("pose")}

    def _guarded_cloud(self, source: System, faults: FaultSet) -> dict[str, OutputPort]:
        """Returns the clouds' ports, behind fault injector and guard."""
        builder = self._builder
        ports = {name: (role, source.GetOutputPort(name)) for name, role in _CLOUD_ROLES.items()}
        cloud = faults.tap(builder, "cloud", ports)
        guard = builder.AddNamedSystem(
            "cloud_guard", CloudGuard(time_step=self._config.image_poll_period)
        )
        guarded = {}
        for name in ("cloud", "cloud_torso", "time_stamp"):
            builder.Connect(cloud[name], guard.GetInputPort(name))
            guarded[name] = guard.GetOutputPort(name)
        return cloud | guarded

    def _add_known_goal(self, station: PepperStation) -> None:
        """Adds substitutes for the estimators of a station without cameras."""
        builder = self._builder
        body = station.plant.GetBodyByName(GOAL_OBJECT)
        known = builder.AddNamedSystem("known_goal", BodyPose(body.index()))
        builder.ExportInput(known.body_poses_input, "body_poses")
        builder.Connect(known.pose_output, self._gaze.GetInputPort("object_pose"))
        builder.ExportOutput(known.pose_output, "object_pose")

        def constant(name: str, source: System) -> OutputPort:
            return builder.AddNamedSystem(name, source).get_output_port()

        zero = constant("zero", Constant([0.0]))
        one = constant("one", Constant([1.0]))
        nothing = constant("no_obstacles", Constant(Value(PointCloud())))
        builder.ExportOutput(one, "goal_valid")
        never_old = constant("fresh_images", Constant([0.0, 0.0]))
        builder.ExportOutput(never_old, "image_ages")
        for name in ("goal_age", "goal_gap", "cloud_age", "cloud_fault"):
            builder.ExportOutput(zero, name)
        # New (empty) images arrive at the cameras' rate.
        times = PiecewisePolynomial.FirstOrderHold([0.0, _EVER], [[0.0, _EVER]])
        clock = constant("clock", TrajectorySource(times))
        images = builder.AddNamedSystem("images", ZeroOrderHold(station.config.camera_period, 1))
        builder.Connect(clock, images.get_input_port())
        builder.ExportOutput(images.get_output_port(), "cloud_time")
        for name in ("cloud", "cloud_torso", "predicted_cloud", "predicted_cloud_torso"):
            builder.ExportOutput(nothing, name)
