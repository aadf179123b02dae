"""The obstacles seen by the depth camera, as point clouds in the world and the torso frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.framework import BasicVector, Context, EventStatus, State
from pydrake.systems.sensors import ImageDepth16U

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, CameraIntrinsics
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.perception.mapping.cloud import SurfacePoints, to_point_cloud
from pepper_drake.perception.mapping.cloud_points import make_cloud
from pepper_drake.perception.mapping.depth_image_mapper import (
    DepthImage,
    DepthImageMapper,
    has_moved,
)
from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.obstacle_memory import ObstacleMemory
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.systems.framework import LeafSystem


class DepthPointCloudSource(LeafSystem):
    """Accumulates depth images into a point cloud of obstacles in the world frame.

    .. pydrake_system::

        name: DepthPointCloudSource
        input_ports:
        - depth_image
        - time_stamp
        - X_WC
        - X_WT
        - position (optional)
        - object_pose (optional)
        - object_valid (optional)
        - object_velocity (optional)
        output_ports:
        - cloud
        - cloud_torso
        - predicted_cloud
        - predicted_cloud_torso
        - space
        - time_stamp
        - age
        - fault

    `depth_image` (ImageDepth16U, whole millimetres), `time_stamp` [s], `X_WC` and `position` (the
    robot's joints, for removing its own body) come from a CameraModel and belong to the time of
    capture. The system checks for a new time stamp every `period` and does nothing without one.
    Invalid images are skipped: empty, of another size, blank, uniform, identical to the last, older
    than the last or dated in the future, or in contradiction to the floor or to earlier images (see
    `perception.mapping.depth_validity`). The last valid pose of the goal object is used;
    `object_velocity` widens the margin around it while it moves.

    `cloud` (PointCloud with normals, in W) and `cloud_torso` (its points near the torso, in T)
    depend on the state alone, so whatever a consumer computes from them stays cached until the next
    image, or until the torso has moved by 2 mm. Points are means of voxels; normals are NaN where
    unknown. `predicted_cloud` (PointCloud in W, whose z = 0 is the floor) has the predicted
    positions of moving obstacles, and possible obstacles below the camera's minimum range, see
    `perception.mapping.dynamic_obstacle_tracker`; it is empty while the torso moves.
    `predicted_cloud_torso` has its points near the torso, in T.
    `space` (`SeenSpace`) tells where space is free, occupied or unknown, and when that was seen;
    without images all is unknown.
    `time_stamp` [s] is that of the last image used, minus infinity before the first; `age` [s] is
    the time since then, infinite before the first. `fault` is the `DepthFault` of the last image
    received, 0 if it was used.

    State: voxel map, clouds and moving obstacles (abstract).
    Event: one periodic unrestricted update.

    Args:
        robot: The robot's collision shapes; without them its body is taken for an obstacle.
        marked: The goal object, removed by its shape.
        intrinsics: The depth camera.
        parameters: Detection and memory of obstacles.
        torso_range: `cloud_torso` has the points within this distance of the torso [m]: twice an
            arm's reach.
        period: Time between checks for a new image [s].
        offset: Time of the first check [s]; after the camera's.

    Examples:
        >>> from pydrake.math import RollPitchYaw
        >>> from pydrake.systems.analysis import Simulator
        >>> source = DepthPointCloudSource()
        >>> simulator = Simulator(source)
        >>> context = simulator.get_mutable_context()
        >>> camera = CAMERA_DEPTH.intrinsics
        >>> wall = ImageDepth16U(camera.width, camera.height)
        >>> wall.mutable_data[:] = 1000  # mm
        >>> wall.mutable_data[0, 0] = 0  # A uniform image counts as a camera fault.
        >>> forward = RollPitchYaw(-np.pi / 2, 0.0, -np.pi / 2)
        >>> _ = source.GetInputPort("depth_image").FixValue(context, wall)
        >>> _ = source.GetInputPort("time_stamp").FixValue(context, [0.0])
        >>> X_WC = RigidTransform(forward, [0.0, 0.0, 1.0])
        >>> _ = source.GetInputPort("X_WC").FixValue(context, X_WC)
        >>> _ = simulator.AdvanceTo(0.05)
        >>> points = source.GetOutputPort("cloud").Eval(context).xyzs()
        >>> print(points[0].min(), points[0].max())
        1.0 1.0
    """

    def __init__(
        self,
        robot: RobotSolids | None = None,
        marked: MarkedObject | None = None,
        *,
        intrinsics: CameraIntrinsics = CAMERA_DEPTH.intrinsics,
        parameters: ObstacleParameters | None = None,
        torso_range: float = 0.8,
        period: float = 0.02,
        offset: float = 0.01,
    ) -> None:
        super().__init__()
        self._torso_range = torso_range
        parameters = ObstacleParameters() if parameters is None else parameters
        solids = () if marked is None else tuple(marked.solids)
        self._mapper = DepthImageMapper(intrinsics, parameters, robot, solids)

        pose = Value(RigidTransform())
        num_positions = 0 if robot is None else robot.num_positions
        self._image = self.DeclareAbstractInputPort("depth_image", Value(ImageDepth16U()))
        self._time_stamp = self.DeclareVectorInputPort("time_stamp", 1)
        self._X_WC = self.DeclareAbstractInputPort("X_WC", pose)
        self._X_WT = self.DeclareAbstractInputPort("X_WT", pose)
        self._position = self.DeclareVectorInputPort("position", num_positions)
        self._object_pose = self.DeclareAbstractInputPort("object_pose", pose)
        self._object_valid = self.DeclareVectorInputPort("object_valid", 1)
        self._object_velocity = self.DeclareVectorInputPort("object_velocity", 3)

        self._memory = self.DeclareAbstractState(Value(ObstacleMemory.empty(parameters.memory)))
        state = {self.abstract_state_ticket(self._memory)}
        for name, calc in (
            ("cloud", self._calc_cloud),
            ("cloud_torso", self._calc_cloud_torso),
            ("predicted_cloud", self._calc_predicted_cloud),
            ("predicted_cloud_torso", self._calc_predicted_cloud_torso),
        ):
            self.DeclareAbstractOutputPort(
                name, lambda: Value(PointCloud()), calc, prerequisites_of_calc=state
            )
        self.DeclareAbstractOutputPort(
            "space",
            lambda: Value[object](SeenSpace(VoxelMap.empty())),
            self._calc_space,
            prerequisites_of_calc=state,
        )
        self.DeclareVectorOutputPort(
            "time_stamp", 1, self._calc_time_stamp, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "age", 1, self._calc_age, prerequisites_of_calc=state | {self.time_ticket()}
        )
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, prerequisites_of_calc=state)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset, self._look)

    def voxels(self, context: Context) -> VoxelMap:
        """Returns the voxel map in this context."""
        return self._get_memory(context).voxels

    def _get_memory(self, context: Context) -> ObstacleMemory:
        return context.get_abstract_state(int(self._memory)).get_value()

    def _look(self, context: Context, state: State) -> EventStatus:
        before = self._get_memory(context)
        X_WT = self._X_WT.Eval(context) if self._X_WT.HasValue(context) else before.X_WT
        moved = has_moved(before.X_WT, X_WT, self._mapper.parameters.validity)
        drives = moved and np.isfinite(before.time)
        memory = self._use_image(context, before, drives)
        if memory is not before or moved:
            memory = replace(memory, X_WT=RigidTransform(X_WT))
            state.get_mutable_abstract_state(int(self._memory)).set_value(memory)
            return EventStatus.Succeeded()
        return EventStatus.DidNothing()

    def _near(self, surface: SurfacePoints, X_WT: RigidTransform) -> SurfacePoints:
        """Selects the points within `torso_range` of the torso."""
        offset = surface.positions - X_WT.translation().astype(surface.positions.dtype)
        near = np.einsum("ij,ij->i", offset, offset) <= self._torso_range**2
        return SurfacePoints(surface.positions[near], surface.normals[near])

    def _use_image(self, context: Context, memory: ObstacleMemory, drives: bool) -> ObstacleMemory:
        if not (self._image.HasValue(context) and self._time_stamp.HasValue(context)):
            return memory
        stamp = float(self._time_stamp.Eval(context)[0])
        if stamp == memory.stamp or stamp == -np.inf:
            return memory
        if not memory.stamp < stamp <= context.get_time():
            is_reported = memory.fault == DepthFault.LATE
            return memory if is_reported else replace(memory, fault=DepthFault.LATE)
        image = DepthImage(
            self._image.Eval(context).data,
            stamp,
            X_WC=RigidTransform(self._X_WC.Eval(context)),
            X_WO=self._object_now(context),
            object_speed=self._object_speed(context),
            position=self._position.Eval(context) if self._position.HasValue(context) else None,
            drives=drives,
        )
        return self._mapper.with_image(memory, image)

    def _object_now(self, context: Context) -> RigidTransform | None:
        if not self._object_pose.HasValue(context):
            return None
        valid = self._object_valid
        if valid.HasValue(context) and not valid.Eval(context)[0] > 0:
            return None
        return RigidTransform(self._object_pose.Eval(context))

    def _object_speed(self, context: Context) -> float:
        port = self._object_velocity
        return float(np.linalg.norm(port.Eval(context))) if port.HasValue(context) else 0.0

    def _calc_cloud(self, context: Context, output: Value) -> None:
        output.set_value(self._get_memory(context).cloud)

    def _calc_cloud_torso(self, context: Context, output: Value) -> None:
        memory = self._get_memory(context)
        near = self._near(memory.surface, memory.X_WT)
        output.set_value(to_point_cloud(near, memory.X_WT.inverse()))

    def _calc_predicted_cloud(self, context: Context, output: Value) -> None:
        output.set_value(make_cloud(self._get_memory(context).tracker.expected))

    def _calc_predicted_cloud_torso(self, context: Context, output: Value) -> None:
        memory = self._get_memory(context)
        points, X_TW = memory.tracker.expected, memory.X_WT.inverse()
        offset = points - memory.X_WT.translation()
        near = points[np.einsum("ij,ij->i", offset, offset) <= self._torso_range**2]
        output.set_value(make_cloud(near @ X_TW.rotation().matrix().T + X_TW.translation()))

    def _calc_space(self, context: Context, output: Value) -> None:
        output.set_value(self._get_memory(context).space)

    def _calc_time_stamp(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self._get_memory(context).time)

    def _calc_age(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, context.get_time() - self._get_memory(context).time)

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, float(self._get_memory(context).fault))
