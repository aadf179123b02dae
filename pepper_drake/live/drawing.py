"""Drawing of a live session apart from the robot: paths, cloud, guide, coupling, ghost."""

import matplotlib
import numpy as np
import numpy.typing as npt
import viser
from pydrake.geometry import Rgba, Role
from pydrake.math import RigidTransform

from pepper_drake.live.robot_drawing import triangles_of
from pepper_drake.live.session import LiveSession, Mode
from pepper_drake.models.pepper import hand_frame

Vector = npt.NDArray[np.float64]
Color = tuple[int, int, int]

BLACK, GREY, GREEN = (20, 20, 20), (150, 150, 150), (30, 160, 80)
BLUE, VIOLET, RED = (30, 90, 230), (170, 50, 200), (230, 50, 30)

_FAR = 0.3
"""Distance from the hand at which the cloud's colour saturates at blue [m]."""
_GOAL_MOVED = 0.003
"""Displacement of the goal below which it has not moved [m]."""
_ARROW, _LONGEST_ARROW = 0.04, 0.3
"""Length of the coupling's arrow per m/s², and its limit [m]."""
_ARROW_OFFSET = 0.07
"""Distance of the arrow's tail from the hand's control frame, outside the hand [m]."""
_LEAST_COUPLING = 0.2
"""Weakest coupling that is drawn [m/s²]."""
_POINT_SPACING = 0.005
_LIMP = (Mode.GUIDED, Mode.RECORDED)
_PERFORMS = (Mode.REACHING, Mode.WAITING, Mode.HOLDING)
_PATH_PERIOD, _CLOUD_PERIOD, _PREDICTION_PERIOD = 4, 6, 16
"""Numbers of frames between updates."""


def cloud_colors(distances: Vector) -> npt.NDArray[np.uint8]:
    """Returns colours (P, 3) for distances (P,) [m]: red is near, blue is far."""
    near = 1.0 - np.clip(distances / _FAR, 0.0, 1.0)
    colors: npt.NDArray[np.uint8] = matplotlib.colormaps["turbo"](0.08 + 0.84 * near, bytes=True)
    return colors[:, :3]


class LiveDrawing:
    """Draws a session on its page, frame by frame; the page has a legend."""

    def __init__(self, server: viser.ViserServer, session: LiveSession) -> None:
        self._scene = server.scene
        self._frame = 0
        self._mode: Mode | None = None
        self._path: list[Vector] = []
        self._name, self._color = "", BLUE
        self._count = 0
        self._goal_at_start = np.zeros(3)
        self._shown: tuple[object, ...] = ()
        self._predicted = self._has_cloud = self._has_arrow = False
        self._lines: set[str] = set()
        self._ghost = server.scene.add_frame("/ghost", show_axes=False, visible=False)
        self._add_ghost(session)

    def _add_ghost(self, session: LiveSession) -> None:
        """Adds a translucent copy of the hand."""
        simulation = session.simulation
        plant = simulation.diagram.station.plant
        wrist = plant.GetFrameByName(hand_frame(simulation.arm)).body()
        letter = "R" if simulation.arm == "right" else "L"
        joint = plant.GetJointByName(f"{letter}WristYaw").index()
        bodies = plant.GetBodiesKinematicallyAffectedBy([joint])
        query = simulation.query()
        inspector = query.inspector()
        X_WH = simulation.torso_pose() @ simulation.hand_pose()
        for body in {wrist.index(), *bodies}:
            frame = plant.GetBodyFrameIdOrThrow(body)
            X_HB = X_WH.InvertAndCompose(query.GetPoseInWorld(frame))
            for index, geometry in enumerate(inspector.GetGeometries(frame, Role.kIllustration)):
                mesh = triangles_of(inspector.GetShape(geometry))
                if mesh is None:
                    continue
                X = X_HB @ inspector.GetPoseInFrame(geometry)
                self._scene.add_mesh_simple(
                    f"/ghost/{int(body)}_{index}",
                    np.asarray(mesh.vertices, dtype=np.float32),
                    np.asarray(mesh.faces, dtype=np.uint32),
                    color=_rgb(Rgba(0.45, 0.75, 0.95)),
                    opacity=0.45,
                    wxyz=X.rotation().ToQuaternion().wxyz(),
                    position=X.translation(),
                )

    def show_ghost(self, X_WH: RigidTransform | None) -> None:
        """Shows the ghost of the hand at a pose in W, or hides it."""
        if X_WH is not None:
            self._ghost.position = X_WH.translation()
            self._ghost.wxyz = X_WH.rotation().ToQuaternion().wxyz()
        if self._ghost.visible != (X_WH is not None):
            self._ghost.visible = X_WH is not None

    def update(self, session: LiveSession, target_T: RigidTransform, *, predicts: bool) -> None:
        """Draws the changes since the last frame.

        Args:
            session: The session.
            target_T: X_TG, the pose to which the hand is guided.
            predicts: Whether to draw the prediction.
        """
        simulation = session.simulation
        X_WT = simulation.torso_pose()
        p_WH = X_WT @ simulation.hand_pose().translation()
        limp = session.mode in _LIMP
        self._line("pull", np.array([p_WH, X_WT @ target_T.translation()]), GREEN, 0.004, limp)
        self._draw_coupling(X_WT.rotation() @ simulation.coupling(), p_WH)
        self._follow(session, p_WH)
        if session.shown != self._shown:
            self._draw_demonstrations(session, X_WT)
        if self._frame % _CLOUD_PERIOD == 0:
            self._draw_cloud(simulation.cloud(), p_WH)
        if self._frame % _PREDICTION_PERIOD == 0:
            shown = predicts and session.mode == Mode.GUIDED
            path = session.predicted() if shown else np.zeros((0, 3))
            path = (X_WT.rotation().matrix() @ path.T).T + X_WT.translation()
            self._line("prediction", path, GREEN, 0.006, len(path) > 1)
        self._frame += 1

    def _line(self, name: str, points: Vector, color: Color, width: float, shown: bool) -> None:
        """Draws a line through points (N, 3) in W, or removes it."""
        if shown and len(points) > 1:
            segments = np.stack((points[:-1], points[1:]), axis=1).astype(np.float32)
            self._scene.add_line_segments(f"/lines/{name}", segments, color, thickness=width)
            self._lines.add(name)
        elif name in self._lines:
            self._scene.remove_by_name(f"/lines/{name}")
            self._lines.discard(name)

    def _draw_demonstrations(self, session: LiveSession, X_WT: RigidTransform) -> None:
        for name in [name for name in self._lines if name.startswith("demonstration")]:
            self._line(name, np.zeros((0, 3)), BLACK, 0.0, False)
        self._shown = session.shown
        for index, motion in enumerate(session.shown):
            path = (X_WT @ motion.thinned(200).positions.T).T
            last = index == len(session.shown) - 1
            self._line(f"demonstration/{index}", path, BLACK if last else GREY, 0.006, True)

    def _draw_coupling(self, acceleration_W: Vector, p_WH: Vector) -> None:
        size = float(np.linalg.norm(acceleration_W))
        if size > _LEAST_COUPLING:
            direction = acceleration_W / size
            start = p_WH + _ARROW_OFFSET * direction
            end = start + min(_ARROW * size, _LONGEST_ARROW) * direction
            points = np.array([[start, end]], dtype=np.float32)
            self._scene.add_arrows(
                "/coupling", points, RED, shaft_radius=0.006, head_radius=0.016, head_length=0.035
            )
            self._has_arrow = True
        elif self._has_arrow:
            self._scene.remove_by_name("/coupling")
            self._has_arrow = False

    def _follow(self, session: LiveSession, p_WH: Vector) -> None:
        """Draws the hand's path while it is recorded and while it reaches."""
        mode, before = session.mode, self._mode
        self._mode = mode
        performs, performed = mode in _PERFORMS, before in _PERFORMS
        if mode != before:
            if mode == Mode.RECORDED:
                self._begin("recorded", BLACK)
            elif performs and not performed:
                for index in range(self._count + 1):
                    self._line(f"performed/{index}", np.zeros((0, 3)), BLUE, 0.0, False)
                self._count = 0
                self._goal_at_start = session.simulation.goal_position()
                self._begin("performed/0", BLUE)
            elif not performs:
                self._end()
                self._line("recorded", np.zeros((0, 3)), BLACK, 0.0, False)
        if not self._name:
            return
        if performs and self._color is not VIOLET:
            moved = np.linalg.norm(session.simulation.goal_position() - self._goal_at_start)
            if moved > _GOAL_MOVED:
                self._add(p_WH)
                self._end()
                self._count += 1
                self._begin(f"performed/{self._count}", VIOLET)
        self._add(p_WH)
        if self._frame % _PATH_PERIOD == 0:
            self._draw_path()

    def _begin(self, name: str, color: Color) -> None:
        self._path, self._name, self._color = [], name, color

    def _end(self) -> None:
        if self._name:
            self._draw_path()
        self._name = ""

    def _add(self, point: Vector) -> None:
        if not self._path or np.linalg.norm(point - self._path[-1]) > _POINT_SPACING:
            self._path.append(point)

    def _draw_path(self) -> None:
        if len(self._path) > 1:
            self._line(self._name, np.array(self._path), self._color, 0.008, True)

    def _draw_cloud(self, points: Vector, p_WH: Vector) -> None:
        if len(points):
            colors = cloud_colors(np.linalg.norm(points - p_WH, axis=1))
            self._scene.add_point_cloud(
                "/cloud", points.astype(np.float32), colors, point_size=0.008, point_shape="circle"
            )
            self._has_cloud = True
        elif self._has_cloud:
            self._scene.remove_by_name("/cloud")
            self._has_cloud = False


def _rgb(color: Rgba) -> Color:
    return round(255 * color.r()), round(255 * color.g()), round(255 * color.b())
