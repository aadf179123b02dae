"""Can the hand get there, and from where? The whole reach, played through before the arm moves."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import BusValue, Context

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.coupling import Coupling
from pepper_drake.learning.obstacle_field import ObstacleField
from pepper_drake.learning.phase import relative_time_at
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.planning.arm_geometry import ArmGeometry
from pepper_drake.planning.arm_spheres import arm_link_names, make_link_spheres
from pepper_drake.planning.control_model import ControlModel, arm_joints, body_indices
from pepper_drake.planning.differential_ik import (
    DifferentialIkParams,
    hand_key,
    leading_pose,
    make_differential_ik,
)
from pepper_drake.planning.joint_command import step_arm_command
from pepper_drake.planning.movement import Movement
from pepper_drake.planning.self_clearance import SelfClearance

Vector = npt.NDArray[np.float64]


class ReachVerdict(StrEnum):
    """What playing the reach through says of it."""

    CLEAR = "clear"
    OUT_OF_REACH = "out_of_reach"
    NO_CLEAR_PATH = "no_clear_path"
    CANNOT_FOLLOW = "cannot_follow"
    SELF_COLLISION = "self_collision"
    NO_STANDING_ROOM = "no_standing_room"


@dataclass
class ReachPlannerParams:
    """What counts as a good reach, m and rad."""

    hand_x: float = 0.26
    """Where the hand's goal should be in the torso frame, ahead, if the demonstration's own end is
    not a place that the arm can reach (because it was recorded in another frame)."""
    hand_y: float = 0.20
    """The same to the arm's side."""
    reach: float = 0.39
    """Farthest distance of the hand from the shoulder."""
    slack: float = 0.08
    """How far the goal may move away and should still be within reach, if that can be had."""
    body_clearance: float = 0.02
    """Between the body (all but the reaching arm) and the cloud."""
    wanted_clearance: float = 0.016
    """Between the arm and the cloud: with this a place to stand is taken at once."""
    least_clearance: float = 0.006
    """With less the arm does not start."""
    position_tolerance: float = 0.006
    """Of the hand at the end of the motion played through."""
    following_error: float = 0.12
    """Farthest distance of the hand to the primitive's path on the way."""
    self_clearance: float = -0.012
    """Between the arm's spheres and the body (see `SelfClearance`)."""
    solid_depth: float = 0.03
    """How far what is seen is taken to reach down, for clearances."""
    settle: float = 0.4
    """How long the motion played through goes on after its end, in tau."""
    places_with_slack: int = 3
    """How many places with slack are played through at most."""
    places_tried: int = 8
    """How many others, at most."""


@dataclass(frozen=True, eq=False)
class ReachPlan:
    """A reach, played through.

    Attributes:
        verdict: Whether the robot may do it.
        sentence: Why not.
        base_pose: (3,) where the base stands, x, y, yaw in W.
        position_error: Of the hand at the end, m.
        clearance: Least distance of the arm to the cloud, m.
        joint_path: (N, 5) the arm's joints, rad, every 10 ms.
        movement: What was played through, and is to be performed.
    """

    verdict: ReachVerdict
    sentence: str
    base_pose: Vector
    position_error: float = np.inf
    clearance: float = -np.inf
    joint_path: Vector | None = None
    movement: Movement | None = None


class ReachPlanner:
    """Plays reaches through: primitive, coupling and inverse kinematics on what was seen.

    It moves nothing and remembers nothing: a call depends on its arguments alone.

    Args:
        model: Pepper.
        arm: "left" or "right".
        X_OG: The hand's pre-grasp pose in the goal object's frame.
        primitive: With orientation and posture.
        coupling: None to do without.
        ik: Parameters of the inverse kinematics.
        params: What counts as good.

    Raises:
        InputError: The primitive has no orientation or no posture.
    """

    def __init__(
        self,
        *,
        model: ControlModel,
        arm: str,
        X_OG: RigidTransform,
        primitive: MovementPrimitive,
        coupling: Coupling | None,
        ik: DifferentialIkParams,
        params: ReachPlannerParams,
    ) -> None:
        if primitive.orientation is None or primitive.posture is None:
            raise InputError(
                f"primitive {primitive.name}: it has no orientation or no posture; "
                "learn it from a demonstration with rotations and joints"
            )
        self._model, self._arm, self._X_OG = model, arm, X_OG
        self._primitive, self._coupling = primitive, coupling
        self._ik_params, self.params = ik, params
        self._geometry = ArmGeometry(model, arm)
        self._self_clearance = SelfClearance(model, self._geometry)
        self._ik = make_differential_ik(model, arm, ik)
        self._limits = model.command_limits(arm_joints(arm), speed_fraction=ik.speed_fraction)
        self._arm_in_body = body_indices(arm_joints(arm))
        self._arm_in_plant = model.position_indices(arm_joints(arm))
        body_links = {
            model.plant.get_body(index).name()
            for index in model.plant.GetBodyIndices(model.model_instance)
        } - set(arm_link_names(arm))
        self._body_spheres = make_link_spheres(model, tuple(sorted(body_links)))

    def plan_stand(
        self,
        *,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
    ) -> ReachPlan:
        """Finds a place to stand from which the reach is clear.

        Args:
            base_pose: Where the base is, x, y, yaw in W.
            joint_position: (15,) rad, in the order of `BODY_JOINTS`.
            X_WO: The goal object's pose.
            cloud_W: (P, 3) obstacles, m.

        Returns:
            The best plan found: clear if there is one.
        """
        params = self.params
        field = ObstacleField(cloud_W, extension=params.solid_depth)
        if next(self._places(base_pose, joint_position, X_WO, 0.0), None) is None:
            return ReachPlan(
                ReachVerdict.OUT_OF_REACH,
                "the goal is higher or lower than the arm can reach",
                base_pose,
            )

        def has_room(places: Vector) -> npt.NDArray[np.bool_]:
            return self._body_clearances(places, joint_position, field) >= params.body_clearance

        best: ReachPlan | None = None
        for pose in self.places_to_stand(base_pose, joint_position, X_WO, has_room):
            plan = self.check_reach(
                base_pose=pose, joint_position=joint_position, X_WO=X_WO, cloud_W=cloud_W
            )
            if best is None or _quality(plan) > _quality(best):
                best = plan
            if plan.verdict == ReachVerdict.CLEAR and plan.clearance >= params.wanted_clearance:
                break
        if best is None:
            return ReachPlan(
                ReachVerdict.NO_STANDING_ROOM,
                "nowhere near the goal is there room for the robot to stand",
                base_pose,
            )
        return best

    def places_to_stand(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        has_room: Callable[[Vector], npt.NDArray[np.bool_]],
    ) -> Iterator[Vector]:
        """Places (3,) from which a reach is tried, x, y, yaw in W, the most comfortable first.

        Args:
            base_pose: Where the base is.
            joint_position: (15,) rad.
            X_WO: The goal object's pose.
            has_room: Says at which of some places (N, 3) the body has room, (N,).
        """
        params = self.params
        for slack, count in ((params.slack, params.places_with_slack), (0.0, params.places_tried)):
            places = np.array(list(self._places(base_pose, joint_position, X_WO, slack)))
            yield from _spread(_free(places, has_room), count)

    def check_reach(
        self,
        *,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
    ) -> ReachPlan:
        """Plays the reach through from where the robot stands; see `plan_stand`."""
        params = self.params
        context = self._context(base_pose, joint_position)
        X_TW = self._model.pose(context, "torso").inverse()
        X_TG = X_TW @ X_WO @ self._X_OG
        points_T = cloud_W @ X_TW.rotation().matrix().T + X_TW.translation()
        near = points_T[np.linalg.norm(points_T, axis=1) < 1.0]
        joints = joint_position[self._arm_in_body]
        path = self.roll_out(self._geometry.hand_pose(joints), X_TG, near)
        joint_path = self.track(joints, *path)
        end = self._geometry.hand_pose(joint_path[-1]).translation()
        error = float(np.linalg.norm(end - X_TG.translation()))
        clearance = float(
            self._geometry.clearances(
                joint_path[::3], ObstacleField(near, extension=params.solid_depth)
            ).min()
        )
        behind = max(
            float(np.linalg.norm(self._geometry.hand_pose(q).translation() - p))
            for q, p in zip(joint_path[::5], path[0][::5], strict=True)
        )
        verdict, sentence = ReachVerdict.CLEAR, ""
        if error > params.position_tolerance:
            verdict = ReachVerdict.OUT_OF_REACH
            sentence = f"the hand would end {1000 * error:.0f} mm from its goal"
        elif behind > params.following_error:
            verdict = ReachVerdict.CANNOT_FOLLOW
            sentence = f"the hand would fall {1000 * behind:.0f} mm behind its movement"
        elif self._self_clearance(context, joint_path[::5]).min() < params.self_clearance:
            verdict = ReachVerdict.SELF_COLLISION
            sentence = "the arm would run into the robot's own body"
        elif self._coupling is not None and clearance < params.least_clearance:
            verdict = ReachVerdict.NO_CLEAR_PATH
            sentence = (
                f"the arm would come {1000 * clearance:.0f} mm near to what was seen, "
                f"less than {1000 * params.least_clearance:.0f} mm"
            )
        movement = Movement(self._primitive, self._coupling, self._X_OG)
        return ReachPlan(verdict, sentence, base_pose, error, clearance, joint_path, movement)

    def roll_out(
        self, X_TH: RigidTransform, X_TG: RigidTransform, points_T: Vector
    ) -> tuple[Vector, Vector, Vector]:
        """The hand's path from a pose to its goal.

        Returns:
            Positions (N, 3), m, orientations (N, 4), w, x, y, z, and nominal joints (N, 5), rad,
            every time step of the inverse kinematics.
        """
        path = self._primitive.rollout(
            time_step=self._ik_params.time_step,
            start=X_TH.translation(),
            goal=X_TG.translation(),
            start_velocity=np.zeros(3),
            start_rotation=X_TH.rotation().ToQuaternion().wxyz(),
            goal_rotation=X_TG.rotation().ToQuaternion().wxyz(),
            obstacles=ObstacleField(points_T) if self._coupling is not None else None,
            coupling=self._coupling if self._coupling is not None else "barrier",
            settle=self.params.settle,
        )
        assert path.rotations is not None
        assert path.joints is not None
        return path.positions, path.rotations, path.joints

    def track(self, start: Vector, positions: Vector, rotations: Vector, nominal: Vector) -> Vector:
        """The arm's joint commands (N, 5) along a hand path, as the diagram would give them."""
        ik = self._ik
        context = ik.CreateDefaultContext()
        position_port = ik.get_input_port_position()
        nominal_port = ik.get_input_port_nominal_posture()
        poses_port = ik.get_input_port_desired_cartesian_poses()
        key, gain = hand_key(self._arm), self._ik_params.tracking_gain
        q = np.zeros(self._model.plant.num_positions())
        q_nominal = q.copy()
        joints, velocity = start.copy(), np.zeros(5)
        path = np.empty((len(positions), 5))
        path[0] = joints
        for n in range(1, len(positions)):
            q[self._arm_in_plant] = joints
            q_nominal[self._arm_in_plant] = nominal[n - 1]
            bus = BusValue()
            X_TG = leading_pose(
                positions[n - 1], positions[n], rotations[n - 1], rotations[n], gain
            )
            bus.Set(key, Value(X_TG))
            position_port.FixValue(context, q)
            nominal_port.FixValue(context, q_nominal)
            poses_port.FixValue(context, Value(bus))
            joints, velocity = step_arm_command(
                joints,
                velocity,
                ik.get_output_port().Eval(context),
                arm=self._arm,
                limits=self._limits,
                time_step=self._ik_params.time_step,
            )
            path[n] = joints
        return path

    def posture(self, phase: float) -> Vector:
        """The nominal joints (5,), rad, at a phase of the primitive."""
        posture = self._primitive.posture
        assert posture is not None
        time = relative_time_at(np.array([phase]), self._primitive.translation.alpha_x)
        return posture.at(time)[0]

    def demonstrated_path(self, count: int = 200) -> Vector:
        """The primitive's own path (count, 3), from its own start to its own goal, m."""
        step = self._primitive.duration / (count - 1)
        return self._primitive.rollout(time_step=step).positions

    def _context(self, base_pose: Vector, joint_position: Vector) -> Context:
        context = self._model.create_context()
        self._model.plant.SetPositions(context, self._model.positions(joint_position, base_pose))
        return context

    def _places(
        self, base_pose: Vector, joint_position: Vector, X_WO: RigidTransform, slack: float
    ) -> Iterator[tuple[float, float, float]]:
        """Places to stand with the goal within the arm's reach, the most comfortable first.

        With some slack, places from which the goal may move away by that much [m] come first.
        """
        params = self.params
        side = 1.0 if self._arm == "left" else -1.0
        X_WG = X_WO @ self._X_OG
        X_BT = RigidTransform(
            RollPitchYaw(0, 0, base_pose[2]), [base_pose[0], base_pose[1], 0]
        ).inverse() @ self._model.pose(self._context(base_pose, joint_position), "torso")
        shoulder = self._model.plant.GetJointByName(
            JOINT_GROUPS[f"{self._arm}_arm"][0]
        ).frame_on_parent()
        p_TS = shoulder.GetFixedPoseInBodyFrame().translation()
        preferred = self._demonstrated_end(p_TS)
        # The robot faces where the fingers should point.
        fingers = X_WG.rotation().col(0)
        heading = np.arctan2(fingers[1], fingers[0])
        z_T = X_WG.translation()[2] - X_BT.translation()[2]
        ahead = np.array([slack, 0.0, 0.0])
        options = []
        for x in np.arange(0.16, 0.33, 0.02):
            for y in np.arange(0.08, 0.27, 0.04):
                p_TG = np.array([x, side * y, z_T])
                if np.linalg.norm(p_TG - p_TS) > params.reach:
                    continue
                stretched = float(np.linalg.norm(p_TG + ahead - p_TS)) - params.reach
                for turn in np.radians([0, -15, 15, -30, 30]):
                    discomfort = (
                        ((x - preferred[0]) / 0.05) ** 2
                        + ((y - side * preferred[1]) / 0.06) ** 2
                        + (turn / 0.35) ** 2
                        + (max(stretched, 0.0) / 0.01) ** 2
                    )
                    options.append((discomfort, x, side * y, heading + turn))
        for _, x, y, yaw in sorted(options):
            # p_WG = p_WB + R_WB (p_BT + p_TG), in the plane.
            forward, left = X_BT.translation()[0] + x, X_BT.translation()[1] + y
            yield (
                X_WG.translation()[0] - np.cos(yaw) * forward + np.sin(yaw) * left,
                X_WG.translation()[1] - np.sin(yaw) * forward - np.cos(yaw) * left,
                yaw,
            )

    def _demonstrated_end(self, p_TS: Vector) -> Vector:
        """Where the demonstration ended, x and y (2,) in T, if the arm can reach there."""
        params, goal = self.params, self._primitive.goal
        if np.linalg.norm(goal - p_TS) <= params.reach + 0.02 and goal[0] > 0.1:
            return goal[:2]
        side = 1.0 if self._arm == "left" else -1.0
        return np.array([params.hand_x, side * params.hand_y])

    def _body_clearances(
        self, base_poses: Vector, joint_position: Vector, field: ObstacleField
    ) -> Vector:
        """Least distance (N,) of the body to the obstacles for base poses (N, 3), m."""
        plant, context = self._model.plant, self._model.create_context()
        plant.SetPositions(context, self._model.positions(joint_position, np.zeros(3)))
        frames = [plant.GetFrameByName(name) for name in self._body_spheres.link_names]
        poses = [frame.CalcPoseInWorld(context) for frame in frames]
        p_B = self._body_spheres.place(
            np.array([X.rotation().matrix() for X in poses]),
            np.array([X.translation() for X in poses]),
        )
        cos, sin = np.cos(base_poses[:, 2, None]), np.sin(base_poses[:, 2, None])
        p_W = np.stack(
            (
                base_poses[:, 0, None] + cos * p_B[:, 0] - sin * p_B[:, 1],
                base_poses[:, 1, None] + sin * p_B[:, 0] + cos * p_B[:, 1],
                np.broadcast_to(p_B[:, 2], (len(base_poses), len(p_B))),
            ),
            axis=-1,
        )
        return (field.distance(p_W) - self._body_spheres.radii).min(axis=1)


def _quality(plan: ReachPlan) -> tuple[bool, bool, float]:
    """Order of plans: clear ones, then those that get there, then the most room."""
    arrives = plan.verdict in (ReachVerdict.CLEAR, ReachVerdict.NO_CLEAR_PATH)
    return (
        plan.verdict == ReachVerdict.CLEAR,
        arrives,
        plan.clearance if arrives else -plan.position_error,
    )


def _free(places: Vector, has_room: Callable[[Vector], npt.NDArray[np.bool_]]) -> Iterator[Vector]:
    """Those of some places (N, 3) where there is room, a few looked at ahead."""
    ahead = 12
    for first in range(0, len(places), ahead):
        some = places[first : first + ahead]
        yield from some[has_room(some)]


def _spread(poses: Iterable[Vector], count: int) -> Iterator[Vector]:
    """The first pose, then each next one that differs from all before it, up to `count`."""
    taken: list[Vector] = []
    for pose in poses:
        scaled = pose * [1.0, 1.0, 0.15]
        if all(np.linalg.norm(scaled - other) > 0.035 for other in taken):
            taken.append(scaled)
            yield pose
            if len(taken) == count:
                return
