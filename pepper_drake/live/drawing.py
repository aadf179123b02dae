"""Drawing of a live session beside the robot: paths, cloud, guide, coupling."""

import matplotlib
import numpy as np
import numpy.typing as npt
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.perception import BaseField, Fields, PointCloud

from pepper_drake.live.session import LiveSession, Mode
from pepper_drake.models.scene import Scene

Vector = npt.NDArray[np.float64]

BLACK, WHITE, BLUE = Rgba(0.0, 0.0, 0.0), Rgba(1.0, 1.0, 1.0, 0.7), Rgba(0.1, 0.35, 0.95, 0.8)
_GUIDE, _PULL = Rgba(0.1, 0.7, 0.3, 0.8), Rgba(0.1, 0.7, 0.3, 0.6)
_PUSH = Rgba(0.95, 0.2, 0.1)

_FAR = 0.3
"""At this distance from the hand the cloud is as blue as it gets [m]."""
_MOVED = 0.003
"""A goal that moved by less has not moved [m]."""
_ARROW = 0.04
"""Length of the coupling's arrow for each m/s² [m]."""
_LONGEST_ARROW = 0.3
_OUTSIDE = 0.07
"""Distance [m] of the arrow's foot from the hand's control frame: outside the hand."""
_HEAD = 0.035
_POINT_SPACING = 0.005
_RADII = (0.004, 0.0025)
"""Radii of paths [m]: Pepper's path lies as a thicker, translucent tube about what it was shown."""
_PERFORMS = (Mode.REACHING, Mode.WAITING, Mode.HOLDING)
_PATH_PERIOD, _CLOUD_PERIOD = 4, 6
"""Numbers of frames between two drawings of the paths, and of the cloud."""


def tube(points: Vector, radius: float, sides: int = 6) -> tuple[Vector, npt.NDArray[np.int64]]:
    """Returns a tube about a path as a triangle mesh: browsers draw all lines one pixel wide.

    Args:
        points: (N, 3) the path, N >= 2, neighbours apart.
        radius: m.
        sides: Of its cross-section.

    Returns:
        Vertices (N sides, 3) [m], and triangles (2 (N - 1) sides, 3).
    """
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    normal = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    normals = np.empty_like(points)
    for index, tangent in enumerate(tangents):  # Carried along, so that the tube does not twist.
        normal = normal - (normal @ tangent) * tangent
        normal /= np.linalg.norm(normal)
        normals[index] = normal
    across = np.cross(tangents, normals)
    angles = 2 * np.pi * np.arange(sides) / sides
    rings = (
        np.cos(angles)[None, :, None] * normals[:, None]
        + np.sin(angles)[None, :, None] * across[:, None]
    )
    vertices = (points[:, None] + radius * rings).reshape(-1, 3)
    ring = sides * np.arange(len(points) - 1)[:, None]
    here, beside = np.arange(sides), (np.arange(sides) + 1) % sides
    first = np.stack((ring + here, ring + beside, ring + sides + here), axis=-1)
    second = np.stack((ring + beside, ring + sides + beside, ring + sides + here), axis=-1)
    return vertices, np.concatenate((first.reshape(-1, 3), second.reshape(-1, 3)))


def colored_cloud(points: Vector, distances: Vector) -> PointCloud:
    """Returns points (P, 3) coloured by a distance (P,) [m]: red is near, blue is far."""
    near = 1.0 - np.clip(distances / _FAR, 0.0, 1.0)
    colors = matplotlib.colormaps["turbo"](0.08 + 0.84 * near, bytes=True)
    cloud = PointCloud(len(points), Fields(BaseField.kXYZs | BaseField.kRGBs))
    cloud.mutable_xyzs()[:] = points.T
    cloud.mutable_rgbs()[:] = colors[:, :3].T
    return cloud


def stretched(start: Vector, end: Vector) -> Vector:
    """Returns the transform (4, 4) that puts a cylinder of length 1 between two points (3,) [m]."""
    along = end - start
    length = max(float(np.linalg.norm(along)), 1e-6)
    X = RigidTransform(_towards(along), (start + end) / 2).GetAsMatrix4()
    X[:, 2] *= length
    return X


class LiveDrawing:
    """Draws a session on its page, frame by frame.

    The demonstration is black, the reproduction white, and blue from when the goal has moved. A
    green ball is the guide. The arrow at the hand is the coupling's acceleration.
    """

    def __init__(self, meshcat: Meshcat, scene: Scene) -> None:
        self._meshcat = meshcat
        self._frame = 0
        self._mode: Mode | None = None
        self._path: list[Vector] = []
        self._name, self._color = "", WHITE
        self._count = 0
        self._goal_at_start = np.zeros(3)
        self._points = np.zeros((0, 3))
        frame_workspace(meshcat, scene)
        meshcat.SetObject("live/guide", Sphere(0.016), _GUIDE)
        meshcat.SetObject("live/pull", Cylinder(0.003, 1.0), _PULL)
        meshcat.SetObject("live/coupling/shaft", Cylinder(0.006, 1.0), _PUSH)
        meshcat.SetObject("live/coupling/head", MeshcatCone(_HEAD, 0.016, 0.016), _PUSH)
        meshcat.SetProperty("live/coupling", "visible", False)
        self._pushed = False

    def update(self, session: LiveSession) -> None:
        """Draws what has changed since the last frame."""
        simulation = session.simulation
        X_WT = simulation.torso_pose()
        p_WH = X_WT @ simulation.hand_pose().translation()
        self._draw_guide(session, X_WT, p_WH)
        self._draw_coupling(X_WT.rotation() @ simulation.coupling(), p_WH)
        self._follow(session, p_WH)
        if self._frame % _CLOUD_PERIOD == 0:
            self._draw_cloud(simulation.cloud(), p_WH)
        self._frame += 1

    def _draw_guide(self, session: LiveSession, X_WT: RigidTransform, p_WH: Vector) -> None:
        limp = session.mode in (Mode.GUIDED, Mode.RECORDED)
        if session.mode != self._mode:
            for path in ("live/guide", "live/pull"):
                self._meshcat.SetProperty(path, "visible", limp)
        if limp:
            p_WG = X_WT @ session.simulation.guide_pose().translation()
            self._meshcat.SetTransform("live/guide", RigidTransform(p_WG))
            self._meshcat.SetTransform("live/pull", stretched(p_WH, p_WG))

    def _draw_coupling(self, acceleration_W: Vector, p_WH: Vector) -> None:
        size = float(np.linalg.norm(acceleration_W))
        pushed = size > 0.2
        if pushed != self._pushed:
            self._meshcat.SetProperty("live/coupling", "visible", pushed)
            self._pushed = pushed
        if pushed:
            direction = acceleration_W / size
            start = p_WH + _OUTSIDE * direction
            end = start + min(_ARROW * size, _LONGEST_ARROW) * direction
            self._meshcat.SetTransform("live/coupling/shaft", stretched(start, end))
            # The cone's tip is at its origin, its base ahead along z.
            X = RigidTransform(_towards(-direction), end + _HEAD * direction)
            self._meshcat.SetTransform("live/coupling/head", X)

    def _follow(self, session: LiveSession, p_WH: Vector) -> None:
        """Draws the hand's path while it is recorded and while it reaches."""
        mode, before = session.mode, self._mode
        self._mode = mode
        performs, performed = mode in _PERFORMS, before in _PERFORMS
        if mode != before:
            if mode == Mode.RECORDED:
                self._meshcat.Delete("live/paths")
                self._begin("demonstration", BLACK)
            elif performs and not performed:
                self._meshcat.Delete("live/paths/reproduction")
                self._count = 0
                self._goal_at_start = session.simulation.goal_position()
                self._begin("reproduction/0", WHITE)
            elif not performs:
                self._end()
        if not self._name:
            return
        if performs and self._color is not BLUE:
            moved = np.linalg.norm(session.simulation.goal_position() - self._goal_at_start)
            if moved > _MOVED:
                self._add(p_WH)
                self._end()
                self._count += 1
                self._begin(f"reproduction/{self._count}", BLUE)
        self._add(p_WH)
        if self._frame % _PATH_PERIOD == 0:
            self._draw_path()

    def _begin(self, name: str, color: Rgba) -> None:
        self._path, self._name, self._color = [], name, color

    def _end(self) -> None:
        if self._name:
            self._draw_path()
        self._name = ""

    def _add(self, point: Vector) -> None:
        if not self._path or np.linalg.norm(point - self._path[-1]) > _POINT_SPACING:
            self._path.append(point)

    def _draw_path(self) -> None:
        if len(self._path) < 2:
            return
        vertices, triangles = tube(np.array(self._path), _RADII[self._color is BLACK])
        self._meshcat.SetTriangleMesh(
            f"live/paths/{self._name}", vertices.T, triangles.T, self._color
        )

    def _draw_cloud(self, points: Vector, p_WH: Vector) -> None:
        if not len(points) and not len(self._points):
            return
        self._points = points
        if not len(points):
            self._meshcat.Delete("live/cloud")
            return
        distances = np.linalg.norm(points - p_WH, axis=1)
        self._meshcat.SetObject("live/cloud", colored_cloud(points, distances), 0.012)


def frame_workspace(meshcat: Meshcat, scene: Scene) -> None:
    """Looks at the taught arm's workspace from its side, without grid and axes."""
    side = 1.0 if scene.arm == "left" else -1.0
    target = np.array([scene.robot.x + 0.08, scene.robot.y + 0.1 * side, 0.86])
    away = np.array([0.66, 0.64 * side, 0.34])
    # The panel hides the right of the page: what matters is shown a little to the left.
    right = np.cross(-away, [0.0, 0.0, 1.0])
    target += 0.11 * right / np.linalg.norm(right)
    meshcat.SetCameraPose(target + away, target)
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)


def _towards(direction: Vector) -> RotationMatrix:
    """A rotation whose z axis is along a direction."""
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        return RotationMatrix()
    return RotationMatrix.MakeFromOneVector(direction / length, 2)
