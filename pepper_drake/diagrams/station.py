"""PepperStation: the simulated robot in its scene, with the real robot's ports."""

import dataclasses
import functools
import gc
import math
import weakref
from collections.abc import Iterable, Mapping, Sequence

from pydrake.geometry import FrameId, GeometryId, SceneGraph
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex, PdControllerGains
from pydrake.systems.controllers import InverseDynamics
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import (
    MatrixGain,
    TrajectorySource,
)

from pepper_drake.diagrams.robot_signals import (
    add_camera_faults,
    add_measurements,
    add_servos,
    export_triggers,
    worn_camera,
)
from pepper_drake.diagrams.selection import add_selector
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.diagrams.stereo_camera import StereoCamera
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    ControlModel,
    arm_joints,
    body_indices,
)
from pepper_drake.models.objects import NO_SCENE, SceneModels, add_scene
from pepper_drake.models.pepper import JOINT_GROUPS, add_pepper, posture_positions
from pepper_drake.models.robot_wear import WearSizes
from pepper_drake.models.scene import Scene
from pepper_drake.perception.calibration.calibrated_cameras import (
    HEAD_CAMERA_MODELS,
    calibrated_cameras,
)
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.noise import NO_DEPTH_NOISE, ColorNoise, DepthNoise
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.systems.framework import Diagram, build_into
from pepper_drake.systems.robot.hand_motors import HandMotors
from pepper_drake.systems.robot.robot_kinematics import RobotKinematics
from pepper_drake.systems.sensing.async_renderer import AsyncRenderer
from pepper_drake.systems.sensing.async_rgbd_sensor import AsyncRgbdSensor
from pepper_drake.systems.sensing.camera_model import CameraModel
from pepper_drake.systems.sensing.rendered_scene import add_renderer

_STRENGTH = {"base": (40.0, 80.0), "body": (10.0, 10.0)}
"""Factors on proportional and derivative gain of the groups that carry the others."""
_GEAR_FRICTION = 0.3
"""Damping of a limp joint [N m s/rad]."""
_HAND_PORTS = tuple(
    f"{arm}_hand_{what}"
    for arm in ("left", "right")
    for what in ("pose", "position", "orientation")
)


_stations: "weakref.WeakSet[PepperStation]" = weakref.WeakSet()
"""Stations that are in memory, in use or not."""


def plant_config(time_step: float) -> MultibodyPlantConfig:
    """Returns the contact model and solver of the simulated robot.

    Args:
        time_step: Time step of the plant [s].
    """
    return MultibodyPlantConfig(
        time_step=time_step,
        contact_model="point",
        discrete_contact_approximation="sap",
        use_sampled_output_ports=False,
    )


def select_joints(
    builder: DiagramBuilder, joint_position: OutputPort, name: str, joints: Sequence[str]
) -> OutputPort:
    """Adds a selector of some joints from a port in the order of `BODY_JOINTS`."""
    return add_selector(builder, name, [joint_position], [(0, k) for k in body_indices(joints)])


def add_gravity_compensation(builder: DiagramBuilder, plant: MultibodyPlant) -> None:
    """Adds gravity compensation to every actuator of a finalized plant.

    Pepper's motor controllers do the same; objects that move along a path have actuators, too. A
    limp arm is compensated like all others. Gravity must not be switched off instead: the contact
    solver (SAP) stops when its residual is small compared with momenta and impulses. At rest
    without gravity both are zero, and rounding errors of stiff gains are never small enough.
    """
    weights = builder.AddNamedSystem(
        "gravity_compensation",
        InverseDynamics(plant, InverseDynamics.InverseDynamicsMode.kGravityCompensation),
    )
    efforts = builder.AddNamedSystem("efforts", MatrixGain(D=plant.MakeActuationMatrix().T))
    builder.Connect(plant.get_state_output_port(), weights.get_input_port_estimated_state())
    builder.Connect(weights.get_output_port(), efforts.get_input_port())
    builder.Connect(efforts.get_output_port(), plant.get_actuation_input_port())


class PepperStation(Diagram):
    """Pepper and a scene, simulated: position-controlled joints, a base, three head cameras.

    .. pydrake_system::

        name: PepperStation
        input_ports:
        - joint_position_command
        - base_velocity_command (optional)
        - hand_command (optional)
        - camera_top.enabled
        - camera_bottom.enabled
        - camera_depth.enabled
        - goal_object.desired_state (optional)
        - applied_forces (optional)
        output_ports:
        - joint_position
        - joint_velocity
        - hand_opening
        - base_pose
        - measurement_age
        - missing_joint
        - robot_position
        - torso_pose
        - left_hand_pose
        - left_hand_position
        - left_hand_orientation
        - right_hand_pose
        - right_hand_position
        - right_hand_orientation
        - camera_top.image
        - camera_top.pose
        - camera_top.time_stamp
        - camera_bottom.image
        - camera_bottom.pose
        - camera_bottom.time_stamp
        - camera_depth.image
        - camera_depth.pose
        - camera_depth.position
        - camera_depth.time_stamp
        - ground_truth.query
        - ground_truth.state
        - ground_truth.body_poses
        - ground_truth.body_velocities
        - ground_truth.contact_results

    The joint ports have 15 elements in the order of `BODY_JOINTS` (rad); `base_velocity_command`
    is vx, vy, yaw rate in the base frame, zero if unconnected; `hand_command` and `hand_opening`
    (2) are those of `HandMotors`; `base_pose` is x, y, yaw in W by odometry. Measurements are
    always finite: `measurement_age` (2) is the time since joints and base were last measured [s],
    `missing_joint` (1) the joint without a measurement, or -1. Poses are X_WT, X_TH and X_WC, from
    the measured joints. A camera's image, pose, time stamp (and the robot's positions, 18) all
    belong to the time of capture. The input `goal_object.desired_state` (6), the offset [m] and its
    rate, exists if configured, as does `NAME.desired_state` of each moving obstacle;
    `fault_trigger` (1) exists if a fault waits for the arm to start. `applied_forces` (list of
    ExternallyAppliedSpatialForce) are external forces on the robot. A real robot has all ports but
    `ground_truth.*`.

    Attributes:
        plant: The plant with Pepper and the scene.
        scene_graph: Its geometry.
        pepper: Pepper's model instance.
        scene_models: The scene's bodies; none without a scene.
        renderer: Renderer of the cameras' images, if there are cameras.
        depth_intrinsics: Intrinsics of the depth camera, or of the stereo pair used instead.
    """

    def __init__(
        self,
        scene: Scene | None,
        config: StationConfig,
        model: ControlModel,
        positions: Mapping[str, float] | None = None,
    ) -> None:
        """Makes the station.

        Args:
            scene: The scene; None for Pepper alone, without cameras.
            config: Configuration of the simulation.
            model: Pepper's kinematics.
            positions: Start positions of all joints by name [rad, m]; the scene's if omitted.
        """
        super().__init__()
        if _stations:
            # Each takes 100 MB, but has too few objects to trigger a collection soon.
            gc.collect()
        _stations.add(self)
        self.config, self.control_model = config, model
        self.renderer: AsyncRenderer | None = None
        cameras = HEAD_CAMERA_MODELS | calibrated_cameras(config.calibration)
        self.depth_intrinsics: CameraIntrinsics = cameras["camera_depth"].intrinsics
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlant(plant_config(config.time_step), builder)
        self.plant: MultibodyPlant = plant
        self.scene_graph: SceneGraph = scene_graph
        if scene is not None and config.cameras and config.stereo:
            add_renderer(scene_graph)
        self.pepper: ModelInstanceIndex = add_pepper(plant)
        for group in JOINT_GROUPS:
            self.set_stiffness(group, config.stiffness.get(group, 1.0))
        self.scene_models: SceneModels = NO_SCENE if scene is None else add_scene(plant, scene)
        plant.Finalize()
        plant.set_name("plant")
        scene_graph.set_name("scene_graph")
        if positions is None:
            positions = posture_positions("stand") if scene is None else scene.robot.positions()
        for name, position in positions.items():
            plant.GetJointByName(name, self.pepper).set_default_positions([position])

        arm = "right" if scene is None else scene.arm
        true = self._add_true_state(builder)
        gap = add_servos(
            builder,
            plant,
            self.pepper,
            true["base_pose"],
            positions,
            wear=config.wear,
            calibration=config.calibration,
            period=config.command_period,
        )
        measured = add_measurements(
            builder,
            true["joint_position"],
            true["base_pose"],
            dict(positions),
            gap=gap,
            wear=config.wear,
            calibration=config.calibration,
            faults=config.faults,
            failing_joints=body_indices([*JOINT_GROUPS["head"], *arm_joints(arm)]),
            limits=model.command_limits(BODY_JOINTS),
        )
        hands = builder.AddNamedSystem("hands", HandMotors(config.command_period))
        builder.ExportInput(hands.GetInputPort("command"), "hand_command")
        builder.ExportOutput(hands.GetOutputPort("opening"), "hand_opening")
        self._add_motions(builder)
        add_gravity_compensation(builder, plant)
        kinematics = builder.AddNamedSystem(
            "kinematics", RobotKinematics(model, calibrated_cameras(config.calibration))
        )
        builder.Connect(measured["joint_position"], kinematics.joint_position_input)
        builder.Connect(measured["base_pose"], kinematics.base_pose_input)
        for name in ("robot_position", "torso_pose", *_HAND_PORTS):
            builder.ExportOutput(kinematics.GetOutputPort(name), name)
        if scene is not None and config.cameras:
            self._add_cameras(builder, kinematics, scene)

        builder.ExportOutput(scene_graph.get_query_output_port(), "ground_truth.query")
        builder.ExportOutput(plant.get_state_output_port(), "ground_truth.state")
        builder.ExportOutput(plant.get_body_poses_output_port(), "ground_truth.body_poses")
        builder.ExportOutput(
            plant.get_body_spatial_velocities_output_port(), "ground_truth.body_velocities"
        )
        builder.ExportOutput(
            plant.get_contact_results_output_port(), "ground_truth.contact_results"
        )
        builder.ExportInput(plant.get_applied_spatial_force_input_port(), "applied_forces")
        export_triggers(builder, config.faults)
        build_into(builder, self)

    def obstacle_parameters(self, parameters: ObstacleParameters) -> ObstacleParameters:
        """Adapts the parameters of obstacle detection to this station's images and robot.

        Args:
            parameters: The parameters.
        """
        validity = dataclasses.replace(parameters.validity, expects_noise=self.config.noise)
        approach = parameters.approach
        if self.config.wear is not None:
            approach = approach.with_pointing_error(WearSizes().pointing_error)
        return dataclasses.replace(parameters, validity=validity, approach=approach)

    def robot_geometries(self) -> set[GeometryId]:
        """Returns Pepper's collision geometries."""
        return self._geometries(index for index in self.plant.GetBodyIndices(self.pepper))

    def obstacle_geometries(self) -> set[GeometryId]:
        """Returns the obstacles' collision geometries."""
        return self._geometries(
            self.plant.GetBodyByName(name).index() for name in self.scene_models.obstacles
        )

    def robot_bodies(self) -> set[BodyIndex]:
        """Returns the indices of Pepper's bodies."""
        return set(self.plant.GetBodyIndices(self.pepper))

    def goal_bodies(self) -> set[BodyIndex]:
        """Returns the index of the goal object's body."""
        return {self.plant.GetBodyByName(self.scene_models.goal_object).index()}

    def goal_geometries(self) -> set[GeometryId]:
        """Returns the goal object's collision geometries."""
        goal = self.plant.GetBodyByName(self.scene_models.goal_object)
        return self._geometries([goal.index()])

    def _geometries(self, bodies: Iterable[BodyIndex]) -> set[GeometryId]:
        plant = self.plant
        return {
            geometry
            for index in bodies
            for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
        }

    def set_stiffness(self, group: str, stiffness: float) -> None:
        """Sets the stiffness of a joint group, from 0 (limp) to 1, as in NAOqi.

        It belongs to the plant, not to a context: all simulations of this station use it from now.
        """
        for name in JOINT_GROUPS[group]:
            self.set_joint_stiffness(name, stiffness)

    def set_joint_stiffness(self, name: str, stiffness: float) -> None:
        """Sets the stiffness of one joint; see `set_stiffness`."""
        group = next(group for group, names in JOINT_GROUPS.items() if name in names)
        firmness, damping = _STRENGTH.get(group, (1.0, 1.0))
        gains = PdControllerGains(
            p=max(firmness * stiffness * self.config.proportional_gain, 1e-6),
            d=max(damping * self.config.derivative_gain * math.sqrt(stiffness), _GEAR_FRICTION),
        )
        actuator = self.plant.GetJointActuatorByName(name, self.pepper)
        self.plant.get_mutable_joint_actuator(actuator.index()).set_controller_gains(gains)

    def _add_true_state(self, builder: DiagramBuilder) -> dict[str, OutputPort]:
        """Splits the plant's state into joints and base, and exports the joints' velocities."""
        plant = self.plant
        num_positions = plant.num_positions(self.pepper)
        state = plant.get_state_output_port(self.pepper)
        model = self.control_model
        rows = {
            "joint_position": model.position_indices(BODY_JOINTS),
            "joint_velocity": [num_positions + k for k in model.position_indices(BODY_JOINTS)],
            "base_pose": model.position_indices(JOINT_GROUPS["base"]),
        }
        ports = {}
        for name, indices in rows.items():
            elements = [(0, index) for index in indices]
            ports[name] = add_selector(builder, f"true_{name}", [state], elements)
        builder.ExportOutput(ports["joint_velocity"], "joint_velocity")
        return ports

    def _add_motions(self, builder: DiagramBuilder) -> None:
        """Adds the motions of objects that have a path."""
        for moving in self.scene_models.moving:
            desired_state = self.plant.get_desired_state_input_port(moving.model)
            is_goal = moving.name == self.scene_models.goal_object
            if self.config.goal_motion_port if is_goal else self.config.obstacle_motion_ports:
                builder.ExportInput(desired_state, f"{moving.name}.desired_state")
                continue
            source = builder.AddNamedSystem(
                f"{moving.name}_path",
                TrajectorySource(
                    moving.path, output_derivative_order=1, zero_derivatives_beyond_limits=True
                ),
            )
            builder.Connect(source.get_output_port(), desired_state)

    def _add_cameras(
        self, builder: DiagramBuilder, kinematics: RobotKinematics, scene: Scene
    ) -> None:
        """Mounts the three cameras on the head."""
        config, plant = self.config, self.plant
        half = 0.5 * config.camera_period
        plan = {
            "camera_top": ("color", 0.0),
            "camera_bottom": ("color", 0.0),
        }
        if not config.stereo:
            plan["camera_depth"] = ("depth", half)
        self.renderer = renderer = AsyncRenderer(
            scene,
            {
                name: (worn_camera(config.wear, name, HEAD_CAMERA_MODELS[name]), kind)
                for name, (kind, _) in plan.items()
            },
        )
        elements = [(0, index) for index in range(plant.num_positions())]
        positions = add_selector(
            builder, "true_positions", [plant.get_state_output_port()], elements
        )
        for number, (name, (kind, offset)) in enumerate(plan.items()):
            sensor = builder.AddNamedSystem(
                f"{name}_sensor",
                AsyncRgbdSensor(functools.partial(renderer.render, name), plant.num_positions()),
            )
            builder.Connect(positions, sensor.get_input_port())
            noise: ColorNoise | DepthNoise
            if kind == "color":
                noise = ColorNoise() if config.noise else ColorNoise(sigma=0.0)
            else:
                noise = DepthNoise() if config.noise else NO_DEPTH_NOISE
            camera_model = builder.AddNamedSystem(
                name,
                CameraModel(
                    HEAD_CAMERA_MODELS[name].intrinsics,
                    kind=kind,
                    period=config.camera_period,
                    offset=offset,
                    latency=config.camera_latency,
                    background=True,
                    noise=noise,
                    seed=3 * config.seed + number,
                    num_positions=self.control_model.plant.num_positions(),
                ),
            )
            builder.Connect(sensor.get_output_port(), camera_model.get_image_input_port())
            renderer.prepare(camera_model.prepare)
            self._export_camera(builder, kinematics, name, camera_model, f"{kind}_image")
        if config.stereo:
            head = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName("Head").index())
            self._add_stereo(builder, kinematics, head)

    def _add_stereo(
        self, builder: DiagramBuilder, kinematics: RobotKinematics, head: FrameId
    ) -> None:
        """Mounts the stereo pair behind the eyes; its ports are the depth camera's."""
        config, model = self.config, self.control_model
        stereo = builder.AddNamedSystem(
            "camera_depth",
            StereoCamera(
                head,
                RobotSolids(model.plant, model.diagram.scene_graph()),
                period=config.camera_period,
                offset=0.5 * config.camera_period,
                noise=None if config.noise else ColorNoise(sigma=0.0),
                config=config.stereo_pair,
                seed=config.seed,
            ),
        )
        builder.Connect(self.scene_graph.get_query_output_port(), stereo.GetInputPort("query"))
        self._export_camera(builder, kinematics, "camera_depth", stereo, "depth_image")
        self.depth_intrinsics = stereo.intrinsics

    def _export_camera(
        self,
        builder: DiagramBuilder,
        kinematics: RobotKinematics,
        name: str,
        camera: System,
        image: str,
    ) -> None:
        """Connects a camera's pose and exports its ports."""
        builder.Connect(kinematics.GetOutputPort(f"{name}_pose"), camera.GetInputPort("X_WC"))
        builder.Connect(kinematics.GetOutputPort("robot_position"), camera.GetInputPort("position"))
        builder.ExportInput(camera.GetInputPort("enabled"), f"{name}.enabled")
        exports = ((image, "image"), ("X_WC", "pose"), ("time_stamp", "time_stamp"))
        ports = {
            export: camera.GetOutputPort(port)
            for port, export in (*exports, ("position", "position"))
        }
        for export, output in add_camera_faults(builder, self.config.faults, name, ports).items():
            builder.ExportOutput(output, f"{name}.{export}")
