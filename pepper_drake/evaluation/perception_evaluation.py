"""Accuracy of perception in a scene: depth cloud, stereo cloud and goal, against the truth."""

import dataclasses
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.evaluation.camera_rig import CameraRig
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.pepper import clamp_coupled_limits
from pepper_drake.models.scene import Scene
from pepper_drake.perception.cameras.camera import (
    CAMERA_DEPTH,
    CAMERA_TOP,
    CameraIntrinsics,
    HeadCamera,
)
from pepper_drake.perception.cameras.noise import (
    NO_DEPTH_NOISE,
    ColorNoise,
    DepthNoise,
    apply_color_noise,
    apply_depth_noise,
)
from pepper_drake.perception.cameras.texture import paint_texture, project_pattern
from pepper_drake.perception.cloud_evaluation import CloudReport, evaluate_cloud, visible_surface
from pepper_drake.perception.gaze.head_aiming import look_at
from pepper_drake.perception.goal.detection import MarkedObject, detect_goal
from pepper_drake.perception.mapping.cloud import SurfacePoints
from pepper_drake.perception.mapping.obstacle_map import (
    ExcludedSolids,
    ObstacleParameters,
    update_obstacles,
)
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.perception.stereo.matching import (
    make_stereo_cameras,
    rectify,
)
from pepper_drake.perception.stereo.pipeline import compute_stereo_depth

Image = npt.NDArray[np.uint8]
Images = dict[str, npt.NDArray[np.generic]]

_VISIBLE_RANGE = 1.2
"""Range [m] within which true surfaces count as visible."""

_SUPERSAMPLING = 2
"""Rendered pixels along one edge of a sensor's pixel, which integrates light over its area."""


@dataclass(frozen=True)
class CloudStudy:
    """A cloud, its accuracy and the images that it was made from.

    Attributes:
        report: Comparison with the truth.
        milliseconds: Median computing time per image, or pair.
        surface: The cloud, in W.
        visible: Visible points on the true surfaces (M, 3) [m], in W.
        images: Images by name (height, width[, 3]).
    """

    report: CloudReport
    milliseconds: float
    surface: SurfacePoints
    visible: npt.NDArray[np.float32]
    images: Images


@dataclass(frozen=True)
class GoalSample:
    """Result of one image of the marker.

    Attributes:
        camera: Name of the camera.
        distance: Distance from the camera to the marker [m].
        angle: Angle between the line of sight and the marker's normal [rad].
        found: Whether the marker was found.
        position_error: Distance of the hand's goal from the true one [m]; NaN if not found.
        orientation_error: Angle between the two [rad]; NaN if not found.
        milliseconds: Computing time.
    """

    camera: str
    distance: float
    angle: float
    found: bool
    position_error: float
    orientation_error: float
    milliseconds: float


class PerceptionEvaluation:
    """Evaluation of every sensor in one scene.

    Args:
        scene: The scene; Pepper stands at its initial pose and looks at the goal.
        seed: Seed of noise and of camera poses for the goal.
        config: Parameters of simulated cameras and perception.

    Attributes:
        scene: The scene.
        marked: The scene's goal object.
        rig: Pepper in the scene.
        head: Head angles (2,) [rad] that look at the goal.
        color_noise: Noise of the colour cameras.
    """

    def __init__(self, scene: Scene, seed: int = 0, config: ReachingConfig | None = None) -> None:
        self.scene, self._seed = scene, seed
        self.config = config = config or ReachingConfig()
        self.color_noise = ColorNoise() if config.station.noise else ColorNoise(sigma=0.0)
        self._depth_noise = DepthNoise() if config.station.noise else NO_DEPTH_NOISE
        self._stereo = make_stereo_cameras()
        # Truth is sampled finer than any camera under test.
        self._truth = HeadCamera(
            "truth", CAMERA_DEPTH.intrinsics.scaled(2), CAMERA_DEPTH.p_HeadC, 0.0
        )
        self._near = HeadCamera(
            "near",
            dataclasses.replace(CAMERA_DEPTH.intrinsics, near=0.1),
            CAMERA_DEPTH.p_HeadC,
            0.0,
        )
        cameras = (CAMERA_TOP, CAMERA_DEPTH, self._truth, self._near, *self._stereo)
        self.rig = CameraRig(scene, cameras)
        self.marked = MarkedObject.from_scene(scene.goal)
        model = shared_control_model()
        self._robot = RobotSolids(model.plant, model.diagram.scene_graph())
        p_WM = (scene.goal.pose() @ self.marked.X_OM).translation()
        p_TM = self.rig.pose("torso").inverse() @ p_WM
        self.head = look_at(CAMERA_TOP, p_TM).head
        self.look(self.head)

    def look(self, head: Sequence[float] | npt.NDArray[np.float64]) -> None:
        """Turns the head to angles (2,) [rad]."""
        self.rig.set_positions({"HeadYaw": float(head[0]), "HeadPitch": float(head[1])})

    def depth(self, frames: int = 5) -> CloudStudy:
        """Evaluates the depth camera's cloud after some images from one pose."""
        rig, name = self.rig, CAMERA_DEPTH.name
        perfect, X_WC = rig.depth(name), rig.pose(name)
        parameters = self.config.perception.obstacles
        ignored, p_WO = self._ignored(parameters), self.scene.goal.pose().translation()
        voxels, durations = VoxelMap.empty(), []
        for frame in range(frames):
            image = apply_depth_noise(
                perfect, CAMERA_DEPTH.intrinsics, self._depth_noise, seed=self._seed, frame=frame
            )
            start = time.perf_counter()
            voxels = update_obstacles(
                voxels,
                image,
                0.2 * frame,
                X_WC,
                CAMERA_DEPTH.intrinsics,
                ignored,
                parameters,
                p_WO,
            )
            surface = voxels.surface()
            durations.append(time.perf_counter() - start)
        images: Images = {"color": rig.color(CAMERA_TOP.name)[..., :3], "depth": image}
        return self._study(surface, durations, images)

    def foreign_points(self, poses: int) -> tuple[int, int]:
        """Counts points of the robot and the goal that remain in clouds of single depth images.

        Poses are random: the base up to the table, arms and head in front of the body. The camera
        measures from 0.1 m on, so that it sees the arms.

        Args:
            poses: Number of poses.

        Returns:
            Points of the robot and of the goal, over all poses.
        """
        rig, rng = self.rig, np.random.default_rng([self._seed, 6])
        parameters, near = self.config.perception.obstacles, self._near
        obstacles = rig.surfaces(rig.scene_models.obstacles)
        robot_points = goal_points = 0
        for number in range(poses):
            rig.set_positions(_draw_pose(rng))
            image = apply_depth_noise(
                rig.depth(near.name),
                near.intrinsics,
                self._depth_noise,
                seed=self._seed,
                frame=number,
            )
            voxels = update_obstacles(
                VoxelMap.empty(),
                image,
                0.0,
                rig.pose(near.name),
                near.intrinsics,
                self._ignored(parameters),
                parameters,
            )
            report = evaluate_cloud(
                voxels.positions,
                obstacles,
                np.zeros((0, 3)),
                rig.surfaces(rig.pepper_bodies()),
                rig.surfaces([rig.scene_models.goal_object]),
            )
            robot_points += report.robot_points
            goal_points += report.goal_points
        rig.set_positions(self.scene.robot.positions())
        self.look(self.head)
        return robot_points, goal_points

    def stereo(self, texture: str = "painted") -> CloudStudy:
        """Evaluates the stereo cloud of one pair of images.

        Args:
            texture: "painted" on the surfaces, a projected "pattern", or "none".
        """
        rig, (left, right) = self.rig, self._stereo
        rectification = rectify(left, right)
        images = [self._photograph(camera, texture, k) for k, camera in enumerate((left, right))]
        X_WC = rectification.rectified_pose(rig.pose(left.name))
        parameters, pair = self.config.perception.stereo_obstacles, self.config.station.stereo_pair
        ignored = self._ignored(parameters)
        start = time.perf_counter()
        view = compute_stereo_depth(
            images[0],
            images[1],
            rectification,
            X_WC,
            ignored[0].solids,
            ignored[0].poses,
            pair.matching,
            pair.segmentation,
        )
        voxels = update_obstacles(
            VoxelMap.empty(),
            view.depth,
            0.0,
            X_WC,
            rectification.intrinsics,
            ignored,
            parameters,
            self.scene.goal.pose().translation(),
        )
        duration = time.perf_counter() - start
        pictures: Images = {
            "stereo_left": view.image,
            "disparity": view.disparity,
            "segmentation": view.things,
            "body": view.body,
        }
        return self._study(voxels.surface(), [duration], pictures)

    def goal(
        self,
        cameras: Sequence[HeadCamera],
        distances: Sequence[float],
        count: int = 10,
        largest_angle: float = math.radians(50),
    ) -> list[GoalSample]:
        """Detects the goal's marker from all sides, with image noise and the lens of each camera.

        Args:
            cameras: Cameras whose lenses to simulate.
            distances: Distances from camera to marker [m].
            count: Images from each distance with each camera.
            largest_angle: Largest angle between the line of sight and the marker's normal [rad].
        """
        rng = np.random.default_rng([self._seed, 4])
        return [
            self._look_at_marker(camera, distance, largest_angle, rng)
            for camera in cameras
            for distance in distances
            for _ in range(count)
        ]

    def _look_at_marker(
        self, camera: HeadCamera, distance: float, largest_angle: float, rng: np.random.Generator
    ) -> GoalSample:
        X_WM = self.scene.goal.pose() @ self.marked.X_OM
        angle = rng.uniform(0, largest_angle)
        X_WC = camera_before_marker(X_WM, distance, angle, camera.intrinsics, rng)
        rendered = self.rig.color_from(camera.intrinsics.ideal().scaled(_SUPERSAMPLING), X_WC)
        image = apply_color_noise(
            rendered,
            camera.intrinsics,
            self.color_noise,
            seed=self._seed,
            frame=int(rng.integers(1 << 30)),
        )
        start = time.perf_counter()
        detection = detect_goal(
            image,
            0.0,
            X_WC,
            camera.intrinsics,
            self.marked,
            params=self.config.perception.marker,
        )
        milliseconds = 1000 * (time.perf_counter() - start)
        position_error = orientation_error = math.nan
        if detection is not None:
            p_OM = self.marked.X_OM.translation()
            X_WO = RigidTransform(detection.R_WO, detection.p_WM - detection.R_WO.multiply(p_OM))
            X_OG = self.scene.pre_grasp()
            error = (self.scene.goal.pose() @ X_OG).InvertAndCompose(X_WO @ X_OG)
            position_error = float(np.linalg.norm(error.translation()))
            orientation_error = abs(error.rotation().ToAngleAxis().angle())
        return GoalSample(
            camera.name,
            distance,
            angle,
            detection is not None,
            position_error,
            orientation_error,
            milliseconds,
        )

    def _photograph(self, camera: HeadCamera, texture: str, number: int) -> Image:
        """Returns an image of one of the stereo cameras."""
        image, depth = self.rig.color(camera.name), self.rig.depth(camera.name)
        X_WC = self.rig.pose(camera.name)
        if texture == "painted":
            image = paint_texture(image, depth, camera.intrinsics, X_WC, seed=self._seed)
        elif texture == "pattern":
            X_WP = self.rig.pose(self._stereo[0].name)
            image = project_pattern(image, depth, camera.intrinsics, X_WC, X_WP, seed=self._seed)
        noise = ColorNoise(sigma=2.0) if self.config.station.noise else self.color_noise
        return apply_color_noise(image, camera.intrinsics, noise, seed=self._seed, frame=number)

    def _ignored(self, parameters: ObstacleParameters) -> list[ExcludedSolids]:
        """Returns the solids of robot and goal object at their poses."""
        poses = self._robot.poses(self.rig.pepper_positions())
        cloud, X_WO = parameters.cloud, self.scene.goal.pose()
        return [
            ExcludedSolids(self._robot.solids, poses, cloud.robot_margin, keep_known_voxels=True),
            ExcludedSolids(
                self.marked.solids, [X_WO] * len(self.marked.solids), cloud.object_margin
            ),
        ]

    def _study(
        self,
        surface: SurfacePoints,
        durations: Sequence[float],
        images: Images,
    ) -> CloudStudy:
        rig, name = self.rig, self._truth.name
        obstacles = rig.scene_models.obstacles
        visible = visible_surface(
            rig.depth(name),
            self._truth.intrinsics,
            rig.pose(name),
            rig.shows(name, obstacles),
            max_range=_VISIBLE_RANGE,
        )
        report = evaluate_cloud(
            surface.positions,
            rig.surfaces(obstacles),
            visible,
            rig.surfaces(rig.pepper_bodies()),
            rig.surfaces([rig.scene_models.goal_object]),
        )
        return CloudStudy(report, 1000 * float(np.median(durations)), surface, visible, images)


def _draw_pose(rng: np.random.Generator) -> dict[str, float]:
    """Draws random joints with the arms in front of the body, and a base pose before the table."""
    pose = {
        "BaseX": rng.uniform(0, 0.4),
        "BaseYaw": rng.uniform(-0.3, 0.3),
        "HeadYaw": rng.uniform(-0.9, 0.9),
        "HeadPitch": rng.uniform(0, 0.44),
    }
    for side, sign in (("L", 1), ("R", -1)):
        pose |= {
            f"{side}ShoulderPitch": rng.uniform(-0.3, 1.2),
            f"{side}ShoulderRoll": sign * rng.uniform(0.02, 0.6),
            f"{side}ElbowYaw": rng.uniform(-1.5, 1.5),
            f"{side}ElbowRoll": -sign * rng.uniform(0.02, 1.4),
            f"{side}WristYaw": rng.uniform(-1.5, 1.5),
        }
    return clamp_coupled_limits(pose)


def camera_before_marker(
    X_WM: RigidTransform,
    distance: float,
    angle: float,
    intrinsics: CameraIntrinsics,
    rng: np.random.Generator,
) -> RigidTransform:
    """Returns a random pose of a camera in front of a marker, upright but for a small roll.

    The marker is anywhere in its image except close to the border. The camera is not below the
    marker, where the table would be.

    Args:
        X_WM: Pose of the marker.
        distance: Distance from the camera to the marker [m].
        angle: Angle between the line of sight and the marker's normal [rad].
        intrinsics: Intrinsics of the camera.
        rng: Draws the side, the place in the image and the roll.
    """
    while True:
        azimuth = rng.uniform(0, 2 * np.pi)
        aside = math.sin(angle) * np.array([math.cos(azimuth), math.sin(azimuth)])
        p_MC = distance * np.array([*aside, math.cos(angle)])
        p_WC = X_WM @ p_MC
        if p_WC[2] >= X_WM.translation()[2] - 0.02:
            break
    forward = X_WM.translation() - p_WC
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    R_WC = RotationMatrix(np.column_stack([right, np.cross(forward, right), forward]))
    # Turned away from the marker by up to two thirds of half the field of view.
    half = np.array([intrinsics.width / intrinsics.focal_x, intrinsics.height / intrinsics.focal_y])
    turn = np.arctan(rng.uniform(-0.67, 0.67, 2) * half / 2)
    R_CC2 = RotationMatrix(RollPitchYaw(turn[1], turn[0], rng.uniform(-0.15, 0.15)))
    return RigidTransform(R_WC @ R_CC2, p_WC)
