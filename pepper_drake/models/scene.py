"""Scenes: Pepper's start pose, the goal object and obstacles; typed YAML files."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pydrake.geometry import Box, Capsule, Cylinder, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside
from pepper_drake.models.motion import FARTHEST, check_angles, check_path, path_trajectory
from pepper_drake.models.pepper import (
    ARMS,
    MODELS_DIR,
    POSTURES,
    mirror_joint_positions,
    posture_positions,
)
from pepper_drake.models.shapes import (
    PlacedShape,
    convex_hull,
    distances,
    mesh_path,
    overlaps,
    pepper_shapes,
    position_limits,
)
from pepper_drake.models.typed_yaml import line_of_field, load_yaml, save_yaml
from pepper_drake.short_repr import short_repr, short_signature

SCENES_DIR = MODELS_DIR / "scenes"
SCENES = ("table", "shelf", "clutter", "free", "post", "teach")
"""The names of the scenes that ship."""

COUPLINGS = ("barrier", "report")
"""The obstacle couplings that a scene may name: the default, and the report's equation 2.7."""

_SMALLEST = 1e-4
_MOST_OBSTACLES = 200
_ROBOT_OVERLAP = 0.005
"""Depth in Pepper's shapes, which are larger than its body, that still counts as beside it [m]."""
_LIMIT_SLACK = 0.01
"""Tolerance of a posture beyond the joints' limits [rad]: an elbow is never quite straight."""
_WIDEST_MESH = 10.0
"""Largest side of a mesh [m]; drawing programs write millimetres."""

_SIZES = {
    "box": "x, y and z lengths",
    "cylinder": "radius and length",
    "sphere": "radius",
    "mesh": "scale",
    "capsule": "radius and length between its round ends",
}


def make_pose(position: Sequence[float], rpy: Sequence[float]) -> RigidTransform:
    """Returns the pose of a position [m] and roll, pitch, yaw angles [rad]."""
    return RigidTransform(RollPitchYaw(np.asarray(rpy, dtype=float)), np.asarray(position))


@dataclass
class RobotStart:
    """Pose of Pepper's base at the start."""

    x: float = 0.0  # Base on the floor, world frame [m].
    y: float = 0.0
    yaw: float = 0.0  # [rad]; 0 faces the world's +x.
    posture: str = "stand"  # A name of pepper.POSTURES.
    joints: dict[str, float] = field(default_factory=dict)  # Changes to the posture [rad].

    def positions(self) -> dict[str, float]:
        """Returns the position of every joint by name [rad, m], the base's included."""
        base = {"BaseX": self.x, "BaseY": self.y, "BaseYaw": self.yaw}
        return posture_positions(self.posture, {**self.joints, **base})


@dataclass
class Marker:
    """An ArUco marker of DICT_4X4_50 on a white plate. Frame M: x right, y up, z out of it."""

    id: int = 7
    size: float = 0.06  # Edge of the black square [m].
    position: list[float] = field(default_factory=lambda: [-0.05, 0.0, 0.178])  # p_OM [m].
    # R_OM as roll, pitch, yaw [rad]: facing -x of O (the robot), leaning back by 20 degrees.
    rpy: list[float] = field(default_factory=lambda: [1.2217304763960306, 0.0, -1.5707963267948966])

    def pose(self) -> RigidTransform:
        """Returns X_OM."""
        return make_pose(self.position, self.rpy)


@dataclass
class HandMarker:
    """An ArUco marker on the hand of the scene's arm, placed there by a user for calibration."""

    id: int = 12
    size: float = 0.05  # Edge of the black square [m].
    # p_HM in the hand's control frame [m]: on the back of the hand.
    position: list[float] = field(default_factory=lambda: [-0.0172, 0.0, 0.0703])
    # R_HM as roll, pitch, yaw [rad]: its top towards the fingers.
    rpy: list[float] = field(default_factory=lambda: [0.0, 0.0, -1.5707963267948966])

    def pose(self) -> RigidTransform:
        """Returns X_HM."""
        return make_pose(self.position, self.rpy)


@dataclass
class HandPose:
    """Pre-grasp pose of the hand's control frame H in the goal object's frame O."""

    position: list[float] = field(default_factory=list)  # p_OH [m].
    rpy: list[float] = field(default_factory=list)  # R_OH as roll, pitch, yaw [rad].
    # Axis of the hand in H whose direction matters for the task, as five joints do not reach every
    # orientation. To close the hand on a cylinder, the palm's normal, -z, must point at it.
    axis: list[float] = field(default_factory=lambda: [0.0, 0.0, -1.0])
    tolerance: float = 0.5  # Largest angle between that axis and its goal [rad].

    def pose(self) -> RigidTransform:
        """Returns X_OH."""
        return make_pose(self.position, self.rpy)

    def axis_error(self, R_HG: RotationMatrix) -> float:
        """Returns the angle [rad] of `axis` from its goal, given the goal's rotation in H."""
        axis = np.asarray(self.axis)
        desired = R_HG.multiply(axis)
        return float(np.arctan2(np.linalg.norm(np.cross(axis, desired)), axis @ desired))


@dataclass
class GoalObject:
    """The cylinder to reach for. Frame O: centre of its bottom, z up, x away from the robot."""

    radius: float = 0.033  # [m]
    height: float = 0.22  # [m]
    position: list[float] = field(default_factory=list)  # p_WO [m].
    yaw: float = 0.0  # Yaw of O in the world [rad].
    color: list[float] = field(default_factory=lambda: [0.55, 0.56, 0.58, 1.0])  # RGBA.
    marker: Marker = field(default_factory=Marker)
    pre_grasp: HandPose = field(default_factory=HandPose)  # If omitted, the arm's default.
    path: list[list[float]] = field(default_factory=list)  # Rows time [s], x, y, z offset [m].

    __repr__ = short_repr

    def pose(self) -> RigidTransform:
        """Returns X_WO at the start."""
        return make_pose(self.position, [0.0, 0.0, self.yaw])


@dataclass
class Obstacle:
    """A solid that must not be touched."""

    name: str = ""
    shape: str = ""  # box, cylinder or capsule (along its z), sphere or mesh.
    size: list[float] = field(default_factory=list)  # [m] See _SIZES; a mesh's is its scale.
    mesh: str = ""  # An OBJ file: one that ships, or a path relative to the scene's file.
    position: list[float] = field(default_factory=list)  # Of its centre (a mesh's origin) [m].
    rpy: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [rad]
    color: list[float] = field(default_factory=lambda: [0.7, 0.6, 0.5, 1.0])  # RGBA.
    path: list[list[float]] = field(default_factory=list)  # Rows time [s], x, y, z offset [m].

    __repr__ = short_repr

    def pose(self) -> RigidTransform:
        """Returns its pose in the world at the start."""
        return make_pose(self.position, self.rpy)

    def poses_along(self, time_step: float) -> tuple[list[float], list[RigidTransform]]:
        """Returns times [s] along its path, at that time step, and its poses in W."""
        path = path_trajectory(self.path)
        times = np.linspace(
            path.start_time(),
            path.end_time(),
            2 + int((path.end_time() - path.start_time()) / time_step),
        )
        X = self.pose()
        poses = [
            RigidTransform(X.rotation(), X.translation() + path.value(time)[:, 0]) for time in times
        ]
        return times.tolist(), poses

    def solid(self) -> Shape:
        """Returns its collision shape; for a mesh the convex hull."""
        if self.shape == "box":
            return Box(*self.size)
        if self.shape == "cylinder":
            return Cylinder(*self.size)
        if self.shape == "capsule":
            return Capsule(*self.size)
        if self.shape == "sphere":
            return Sphere(*self.size)
        return convex_hull(self.mesh, self.size[0])


@dataclass
class Scene:
    """A scene: robot, goal object and obstacles."""

    name: str = ""
    description: str = ""
    arm: str = "right"  # The arm that reaches: left or right.
    coupling: str = "barrier"  # One of COUPLINGS, or FILE.py:NAME of one's own.
    robot: RobotStart = field(default_factory=RobotStart)
    goal: GoalObject = field(default_factory=GoalObject)
    obstacles: list[Obstacle] = field(default_factory=list)
    hand_marker: HandMarker | None = None  # None for none.

    __repr__ = short_repr
    __signature__ = short_signature

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, if the scene makes no sense."""
        if self.arm not in ARMS:
            raise InputError(f'arm is "{self.arm}"; it must be one of {", ".join(ARMS)}')
        if self.coupling not in COUPLINGS and ".py:" not in self.coupling:
            raise InputError(
                f'coupling is "{self.coupling}"; it must be one of {", ".join(COUPLINGS)}'
            )
        _check_robot(self.robot)
        _check_goal(self.goal)
        if self.hand_marker is not None:
            _check_marker(self.hand_marker, "hand_marker")
        if len(self.obstacles) > _MOST_OBSTACLES:
            raise InputError(f"obstacles are {len(self.obstacles)}; give at most {_MOST_OBSTACLES}")
        for index, obstacle in enumerate(self.obstacles):
            _check_obstacle(obstacle, f"obstacles[{index}]")
        names = [obstacle.name for obstacle in self.obstacles]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise InputError(f'obstacles[{index}].name is "{name}" a second time; rename one')
        for one, other in overlaps(self.solids()):
            if "goal" in (one, other):
                obstacle_name = other if one == "goal" else one
                raise InputError(
                    f'goal.position puts the goal object inside the obstacle "{obstacle_name}"; '
                    "move one of them"
                )
        self._check_robot_is_free()
        for index, obstacle in enumerate(self.obstacles):
            if obstacle.path:
                self._check_path_is_free(obstacle, f"obstacles[{index}].path")

    def _check_robot_is_free(self) -> None:
        """Raises InputError if Pepper would start inside the goal object or an obstacle."""
        solids = self.solids()
        names = ["goal.position", *(f"obstacles[{k}].position" for k in range(len(self.obstacles)))]
        fields = {solid.name: name for solid, name in zip(solids, names, strict=True)}
        robot = [
            replace(shape, name=f"Pepper's {shape.name}")
            for shape in pepper_shapes(self.robot.positions())
        ]
        for pair in overlaps([*solids, *robot], _ROBOT_OVERLAP):
            inside = [name for name in pair if name in fields]
            if len(inside) == 1:
                other = pair[1 - pair.index(inside[0])]
                raise InputError(
                    f"{fields[inside[0]]} puts {inside[0]} inside {other} at the start; move one of"
                    " them"
                )

    def _check_path_is_free(self, obstacle: Obstacle, field_name: str) -> None:
        """Raises InputError if an obstacle's path collides with a static object."""
        moving = {"goal"} if self.goal.path else set()
        moving |= {other.name for other in self.obstacles if other.path}
        still = [placed for placed in self.solids() if placed.name not in moving]
        if not still:
            return
        times, poses = obstacle.poses_along(0.05)
        inside = np.argwhere(distances(obstacle.solid(), poses, still) < -1e-3)
        if len(inside):
            row, column = inside[0]
            raise InputError(
                f'{field_name} runs into "{still[column].name}" at {times[row]:.2f} s; '
                "change the path or move one of them"
            )

    def solids(self) -> list[PlacedShape]:
        """Returns the goal object's cylinder ("goal") and all obstacles at their start poses."""
        X_OC = RigidTransform([0.0, 0.0, self.goal.height / 2])
        cylinder = Cylinder(self.goal.radius, self.goal.height)
        return [
            PlacedShape("goal", cylinder, self.goal.pose() @ X_OC),
            *(PlacedShape(o.name, o.solid(), o.pose()) for o in self.obstacles),
        ]

    def pre_grasp(self) -> RigidTransform:
        """Returns X_OH: the scene's own, or the arm's default."""
        if self.goal.pre_grasp.position:
            return self.goal.pre_grasp.pose()
        return default_pre_grasp(self.arm, self.goal.radius).pose()

    def mirrored(self) -> "Scene":
        """Returns the scene mirrored in the plane y = 0, for the other arm."""
        mirror = deepcopy(self)
        mirror.arm = "left" if self.arm == "right" else "right"
        mirror.robot.y, mirror.robot.yaw = -self.robot.y, -self.robot.yaw
        mirror.robot.joints = mirror_joint_positions(self.robot.joints)
        goal = mirror.goal
        goal.position[1], goal.yaw = -goal.position[1], -goal.yaw
        goal.path = _mirrored_path(goal.path)
        _mirror_marker(goal.marker)
        if mirror.hand_marker is not None:
            _mirror_marker(mirror.hand_marker)
        goal.pre_grasp.axis[1] *= -1
        if goal.pre_grasp.position:
            goal.pre_grasp.position[1] *= -1
            goal.pre_grasp.rpy[0::2] = [-angle for angle in goal.pre_grasp.rpy[0::2]]
        for obstacle in mirror.obstacles:
            obstacle.position[1] *= -1
            obstacle.rpy[0::2] = [-angle for angle in obstacle.rpy[0::2]]
            obstacle.path = _mirrored_path(obstacle.path)
        return mirror


def _mirror_marker(marker: Marker | HandMarker) -> None:
    """Mirrors a marker's pose; its x axis still points to the right of the printed face."""
    R = np.diag([1, -1, 1]) @ marker.pose().rotation().matrix() @ np.diag([-1, 1, 1])
    marker.rpy = RollPitchYaw(RotationMatrix(R)).vector().tolist()
    marker.position[1] *= -1


def default_pre_grasp(arm: str, radius: float) -> HandPose:
    """Returns the default pre-grasp X_OH: beside a cylinder, palm to it, fingers ahead and up.

    The effector is 52 mm off the cylinder's surface and 110 mm above its bottom, which gives the
    upright half-open hand a clearance of 2 cm to the cylinder and 3 cm to its support.
    """
    side = 1.0 if arm == "left" else -1.0
    return HandPose(
        position=[-0.015, side * (radius + 0.052), 0.11],
        rpy=[-side * np.pi / 2, -0.26, -side * 0.09],
    )


def load_scene(name_or_path: str | Path) -> Scene:
    """Loads and checks a scene that ships (by its name) or a YAML file.

    Raises:
        InputError: The message names the file and the field.
    """
    path = Path(name_or_path)
    if str(name_or_path) in SCENES:
        path = SCENES_DIR / f"{name_or_path}.yaml"
    elif not _is_there(path):
        raise InputError(
            f"{path} is neither a scene file nor one of the shipped scenes {', '.join(SCENES)}"
        )
    scene = load_yaml(Scene, path)
    for obstacle in scene.obstacles:
        if obstacle.mesh and _is_there(path.parent / obstacle.mesh):
            obstacle.mesh = str(path_inside(path.parent, obstacle.mesh).resolve())
    try:
        scene.check()
    except InputError as error:
        line = line_of_field(path, str(error).split()[0])
        raise InputError(f"{path} line {line}: {error}") from None
    return scene


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # An impossible file name.
        return False


def save_scene(scene: Scene, path: Path) -> None:
    """Writes a scene to a YAML file that `load_scene` reads back."""
    save_yaml(scene, path)


def _mirrored_path(path: list[list[float]]) -> list[list[float]]:
    return [[t, x, -y, z] for t, x, y, z in path]


def _check_vector(value: Sequence[float], length: int, name: str, what: str) -> None:
    if len(value) != length:
        raise InputError(f"{name} has {len(value)} numbers; it must have {length}: {what}")
    if not np.all(np.isfinite(value)):
        raise InputError(f"{name} must hold finite numbers")
    if np.abs(value).max() > FARTHEST:
        raise InputError(f"{name} must hold numbers of at most {FARTHEST:g}")


def _check_rpy(rpy: Sequence[float], name: str) -> None:
    _check_vector(rpy, 3, name, "roll, pitch, yaw")
    check_angles(rpy, name)


def _check_color(color: Sequence[float], name: str) -> None:
    _check_vector(color, 4, name, "red, green, blue and alpha")
    if min(color) < 0.0 or max(color) > 1.0:
        raise InputError(f"{name} must hold numbers from 0 to 1")


def _check_robot(robot: RobotStart) -> None:
    if not np.all(np.abs([robot.x, robot.y]) <= FARTHEST):
        raise InputError(f"robot must hold finite numbers of at most {FARTHEST:g}")
    check_angles([robot.yaw], "robot.yaw")
    check_angles(robot.joints.values(), "robot.joints")
    if robot.posture not in POSTURES:
        raise InputError(
            f'robot.posture is "{robot.posture}"; it must be one of {", ".join(POSTURES)}'
        )
    try:
        robot.positions()
    except InputError as error:
        raise InputError(f"robot.{error}") from None
    for name, value in robot.joints.items():
        lower, upper = position_limits(name)
        if not lower - _LIMIT_SLACK <= value <= upper + _LIMIT_SLACK:
            raise InputError(
                f"robot.joints has {name} at {value:g}, beyond its limits, {lower:g} to {upper:g}"
            )


def _check_goal(goal: GoalObject) -> None:
    _check_vector(goal.position, 3, "goal.position", "x, y, z of its bottom's centre")
    for name in ("radius", "height"):
        if not 0.0 < getattr(goal, name) < 1.0:
            raise InputError(
                f"goal.{name} is {getattr(goal, name):g} m; it must be above 0 and below 1"
            )
    if goal.position[2] < 0.0:
        raise InputError(f"goal.position is {-goal.position[2]:g} m below the floor; raise it")
    check_angles([goal.yaw], "goal.yaw")
    _check_color(goal.color, "goal.color")
    _check_marker(goal.marker, "goal.marker")
    if goal.pre_grasp.position or goal.pre_grasp.rpy:
        _check_vector(goal.pre_grasp.position, 3, "goal.pre_grasp.position", "x, y, z")
        _check_rpy(goal.pre_grasp.rpy, "goal.pre_grasp.rpy")
    _check_vector(goal.pre_grasp.axis, 3, "goal.pre_grasp.axis", "an axis of the hand")
    if np.linalg.norm(goal.pre_grasp.axis) < 1e-3:
        raise InputError("goal.pre_grasp.axis has no length; give a direction such as [0, 0, -1]")
    if not 0.0 < goal.pre_grasp.tolerance <= np.pi:
        raise InputError(
            f"goal.pre_grasp.tolerance is {goal.pre_grasp.tolerance:g} rad; it must be above 0 and "
            "at most pi"
        )
    check_path(goal.path, "goal.path")


def _check_marker(marker: Marker | HandMarker, name: str) -> None:
    if not 0 <= marker.id < 50:
        raise InputError(f"{name}.id is {marker.id}; DICT_4X4_50 has the ids 0 to 49")
    if not 0.005 <= marker.size <= 0.5:
        raise InputError(f"{name}.size is {marker.size:g} m; it must be 0.005 to 0.5")
    where = "the object's frame" if isinstance(marker, Marker) else "the hand's frame"
    _check_vector(marker.position, 3, f"{name}.position", f"x, y, z in {where}")
    _check_rpy(marker.rpy, f"{name}.rpy")


def _check_obstacle(obstacle: Obstacle, field_name: str) -> None:
    if not obstacle.name.isidentifier():
        raise InputError(
            f'{field_name}.name is "{obstacle.name}"; it must be letters, digits and underscores'
        )
    if obstacle.name in ("goal", "goal_object", "pepper", "scene", "floor"):
        raise InputError(f'{field_name}.name "{obstacle.name}" is taken; choose another')
    if obstacle.shape not in _SIZES:
        raise InputError(
            f'{field_name}.shape is "{obstacle.shape}"; it must be one of {", ".join(_SIZES)}'
        )
    if obstacle.shape == "mesh" and not obstacle.size:
        obstacle.size = [1.0]
    what = _SIZES[obstacle.shape]
    length = {"box": 3, "cylinder": 2, "capsule": 2}.get(obstacle.shape, 1)
    _check_vector(obstacle.size, length, f"{field_name}.size", what)
    if min(obstacle.size) < _SMALLEST:
        raise InputError(
            f"{field_name}.size has {min(obstacle.size):g}; sizes must be at least {_SMALLEST:g}"
        )
    if obstacle.shape == "mesh":
        try:
            mesh_path(obstacle.mesh)
        except InputError as error:
            name = "" if str(error).startswith("mesh ") else "mesh: "
            raise InputError(f"{field_name}.{name}{error}") from None
        hull = convex_hull(obstacle.mesh, obstacle.size[0]).GetConvexHull()
        width = float(hull.CalcBoundingBox()[1].max())
        if width > _WIDEST_MESH:
            raise InputError(
                f"{field_name}.size makes the mesh {width:g} m wide; is it in millimetres (size:"
                " [0.001])?"
            )
    _check_vector(obstacle.position, 3, f"{field_name}.position", "x, y, z of its centre")
    _check_rpy(obstacle.rpy, f"{field_name}.rpy")
    _check_color(obstacle.color, f"{field_name}.color")
    check_path(obstacle.path, f"{field_name}.path")
