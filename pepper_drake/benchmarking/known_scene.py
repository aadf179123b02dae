"""The true scene, for planners with perfect knowledge."""

import itertools
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from pydrake.geometry import QueryObject, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import (
    CollisionCheckerParams,
    RobotDiagramBuilder,
    SceneGraphCollisionChecker,
)

from pepper_drake.benchmarking.scene_file import POSITION_TOLERANCE
from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.objects import add_scene
from pepper_drake.models.pepper import (
    BODY_JOINTS,
    JOINT_GROUPS,
    add_pepper,
    elbow_roll_limits,
    hand_frame,
)
from pepper_drake.models.scene import Scene
from pepper_drake.planning.collision.sphere_model import arm_link_names
from pepper_drake.planning.reach.base_placement import BasePlacement
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.systems.robot.true_clearance import TrueClearance

Array = npt.NDArray[np.float64]

_ELBOW_YAW, _ELBOW_ROLL = 2, 3


class GroundTruthScene:
    """Pepper in the true scene: collisions, distances, goals, and base poses.

    All joints except the base and the reaching arm keep their initial positions. Obstacles with a
    path stand where they start until `set_time` moves them.

    Attributes:
        scene: The scene.
        padding: Clearance of planners between robot and scene [m].
        plant: Pepper and the scene.
        checker: Drake's collision checker of the plant, with `padding` between robot and scene.
        arm_checker: The same without the resting body.
        arm_index: (5,) indices of the arm's joints in the plant's positions.
        lower: (5,) lower limits of the arm's joints [rad].
        upper: (5,) upper limits [rad].
        X_WG: Goal pose of the hand.
    """

    def __init__(self, scene: Scene, *, padding: float = 0.01) -> None:
        """Builds the model.

        Args:
            scene: The scene.
            padding: Clearance of planners between robot and scene [m].
        """
        self.scene, self.padding = scene, padding
        builder = RobotDiagramBuilder(time_step=0.0)
        self.plant = builder.plant()
        self._pepper = add_pepper(self.plant)
        self._models = add_scene(self.plant, scene)
        self.plant.Finalize()
        self.checker = SceneGraphCollisionChecker(
            CollisionCheckerParams(
                model=builder.Build(),
                robot_model_instances=[self._pepper],
                edge_step_size=0.05,
                env_collision_padding=padding,
                implicit_context_parallelism=False,
            )
        )
        self.arm_checker = self.checker.Clone()
        self._hold_body(self.arm_checker)
        self._context = self.checker.model_context()
        self._moving = [m for m in self._models.moving if m.name != self._models.goal_object]
        self._start = self._start_positions()
        self.arm_index = self._indices(arm_joints(scene.arm))
        self._base_index = self._indices(JOINT_GROUPS["base"])
        joints = [self.plant.GetJointByName(name) for name in arm_joints(scene.arm)]
        self.lower = np.array([joint.position_lower_limit() for joint in joints])
        self.upper = np.array([joint.position_upper_limit() for joint in joints])
        self.X_WG = scene.goal.pose() @ scene.pre_grasp()
        self._monitor = TrueClearance(
            robot=self._geometries(self.plant.GetBodyIndices(self._pepper)),
            obstacles=self._geometries(
                self.plant.GetBodyByName(name).index() for name in self._models.obstacles
            ),
        )

    def _start_positions(self) -> Array:
        q = np.zeros(self.plant.num_positions())
        for name, angle in self.scene.robot.positions().items():
            q[self.plant.GetJointByName(name, self._pepper).position_start()] = angle
        return q

    def _indices(self, names: tuple[str, ...]) -> list[int]:
        return [self.plant.GetJointByName(name).position_start() for name in names]

    def _geometries(self, bodies: Iterator[BodyIndex] | list[BodyIndex]) -> set:
        return {
            geometry
            for index in bodies
            for geometry in self.plant.GetCollisionGeometriesForBody(self.plant.get_body(index))
        }

    @property
    def start(self) -> Array:
        """(5,) the arm's joints at the start [rad]."""
        return self._start[self.arm_index]

    def positions(self, joints: Array, base_pose: Array) -> Array:
        """Returns the plant's positions for the arm's joints (5,) [rad] and a base pose (3,)."""
        q = self._start.copy()
        q[self.arm_index], q[self._base_index] = joints, base_pose
        return q

    def free(self, joints: Array, base_pose: Array) -> bool:
        """True if the arm keeps the padding to all obstacles, and the elbow its limits.

        Args:
            joints: (5,) of the arm [rad].
            base_pose: (3,) x, y, yaw in W.
        """
        low, high = elbow_roll_limits(float(joints[_ELBOW_YAW]), self.scene.arm)
        if not low - 1e-9 <= joints[_ELBOW_ROLL] <= high + 1e-9:
            return False
        return self.arm_checker.CheckConfigCollisionFree(self.positions(joints, base_pose))

    def _hold_body(self, checker: SceneGraphCollisionChecker) -> None:
        """Filters all collision pairs without a link of the arm."""
        arm = self._arm_links()
        bodies = [BodyIndex(k) for k in range(self.plant.num_bodies())]
        resting = [k for k in bodies if self.plant.get_body(k).name() not in arm]
        for one, other in itertools.combinations(resting, 2):
            has_robot = checker.IsPartOfRobot(one) or checker.IsPartOfRobot(other)
            if has_robot and not checker.IsCollisionFilteredBetween(one, other):
                checker.SetCollisionFilteredBetween(one, other, True)

    def _arm_links(self) -> set[str]:
        return {*arm_link_names(self.scene.arm), f"{self.scene.arm[0].upper()}Shoulder"}

    def resting_links(self) -> list[str]:
        """Returns the names of Pepper's links with a shape that do not move with the arm."""
        bodies = [self.plant.get_body(k) for k in self.plant.GetBodyIndices(self._pepper)]
        shaped = [b.name() for b in bodies if self.plant.GetCollisionGeometriesForBody(b)]
        return [name for name in shaped if name not in self._arm_links()]

    def solids(self) -> list[tuple[str, Shape, RigidTransform]]:
        """Returns name, shape and current pose X_WS of all solids of scene and goal object."""
        self.checker.UpdatePositions(self._start)
        query = self._query()
        inspector = query.inspector()
        found: list[tuple[str, Shape, RigidTransform]] = []
        for index in range(self.plant.num_bodies()):
            body = self.plant.get_body(BodyIndex(index))
            if body.model_instance() != self._pepper:
                for geometry in self.plant.GetCollisionGeometriesForBody(body):
                    shape, X_WS = inspector.GetShape(geometry), query.GetPoseInWorld(geometry)
                    found.append((f"{body.name()}_{len(found)}", shape, X_WS))
        return found

    def candidate_base_poses(self) -> Iterator[Array]:
        """Yields the base poses (3,) that our own planner would try with perfect knowledge."""
        scene, params = self.scene, ReachPlannerParams()
        shown_goal = make_primitive(None, scene.arm).goal
        places = BasePlacement(
            shared_control_model(), scene.arm, scene.pre_grasp(), shown_goal, params
        )

        def has_room(poses_xy_yaw: Array) -> npt.NDArray[np.bool_]:
            q = [self.positions(self.start, place) for place in poses_xy_yaw]
            return np.array([self.checker.CheckConfigCollisionFree(one) for one in q])

        return places(
            self._start[self._base_index],
            self._start[self._indices(BODY_JOINTS)],
            scene.goal.pose(),
            has_room,
        )

    def hand_poses(self, path: Array, base_pose: Array) -> list[RigidTransform]:
        """Returns X_WH for each row of a path (N, 5) of the arm's joints [rad]."""
        plant_context = self.checker.plant_context()
        frame = self.plant.GetFrameByName(hand_frame(self.scene.arm))
        poses = []
        for joints in path:
            self.checker.UpdatePositions(self.positions(joints, base_pose))
            poses.append(frame.CalcPoseInWorld(plant_context))
        return poses

    def is_at_goal(self, joints: Array, base_pose: Array) -> bool:
        """True if the hand is where it should be and its task axis within the scene's tolerance.

        Args:
            joints: (5,) of the arm [rad].
            base_pose: (3,) x, y, yaw in W.
        """
        X_HG = self.hand_poses(joints[None], base_pose)[0].InvertAndCompose(self.X_WG)
        task = self.scene.goal.pre_grasp
        is_near = np.linalg.norm(X_HG.translation()) <= POSITION_TOLERANCE
        return bool(is_near and task.axis_error(X_HG.rotation()) <= task.tolerance)

    @property
    def quiet_after(self) -> float:
        """Time at which the last obstacle stops, from the arm's start [s]; 0 if none moves."""
        return max((moving.path.end_time() for moving in self._moving), default=0.0)

    def set_time(self, time: float) -> None:
        """Sets the moving obstacles to their positions at a time from the arm's start [s]."""
        for moving in self._moving:
            path = moving.path
            offset = path.value(np.clip(time, path.start_time(), path.end_time()))[:, 0]
            names = tuple(f"{moving.name}_{axis}" for axis in "xyz")
            self._start[self._indices(names)] = offset

    def clearance(
        self, path: Array, base_pose: Array, time_step: float = 0.01
    ) -> tuple[float, str]:
        """Returns the smallest true distance between Pepper and an obstacle along a path.

        Args:
            path: (N, 5) the arm's joints from its start [rad].
            base_pose: (3,) x, y, yaw in W.
            time_step: Time step of the path [s].

        Returns:
            The distance [m], at most 0.1, and the names of the two shapes.
        """
        smallest, names = 0.1, ""
        for number, joints in enumerate(path):
            self.set_time(number * time_step)
            self.checker.UpdatePositions(self.positions(joints, base_pose))
            distance, pair = self._monitor.closest_pair(self._query())
            if distance < smallest:
                smallest, names = distance, pair
        return smallest, names

    def _query(self) -> QueryObject:
        diagram = self.checker.model()
        context = self._context.scene_graph_context()
        return diagram.scene_graph().get_query_output_port().Eval(context)
