"""The page on viser: buttons, tabs and pictures, and the user's actions with mouse and keys."""

import queue
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt
import viser
import viser.uplot
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.live.controls import BUTTONS, plain_name
from pepper_drake.live.legend import LEGEND
from pepper_drake.live.session_file import SessionRecord
from pepper_drake.models.movable_objects import SPARES
from pepper_drake.web.viser_page import ViserPage

Vector = npt.NDArray[np.float64]

VIEWS = ("Front", "Shoulder", "Top", "Camera")
CLEARANCE_SHOWN = 0.5
"""Largest clearance that is shown [m]; larger or infinite ones are clipped."""
_NO_PICTURE = "What the camera in Pepper's head sees. Rendering it takes time, so ask for it."
_SIGNALS = (
    ("phase", "Phase: 1 at the start, towards 0 at the end", (0.0, 1.2)),
    ("clearance", "Clearance of the arm [cm], cut at 50", (0.0, 60.0)),
    ("coupling", "Coupling: push of the obstacles [m/s²]", (0.0, 1.2)),
)
"""Names, titles and least ranges of the plots."""
_NEXT = {name: f"Next: {name} ({key.removeprefix('Key')})" for name, key in BUTTONS.items()}
"""Text of the button of the next step: the step and its key."""
_GROUPS = {"Movement": ("Record", "Stop", "Learn", "Reach"), "Session": ("Undo", "Save")}
"""The buttons as they stand on the page, in rows."""
_WORDS_STYLE = "padding:0.3em 0.8em 0;line-height:1.35;min-height:7.6em"
"""High enough for all but the longest status: buttons stay where they are."""
_SIGNALS_WIDTH = 310
"""Width of the panel with the plots [pixels]."""
_PUT_BACK_PERIOD = 32
"""Number of frames after which the pose of the hand's rings is sent again."""
_NUDGE = 2e-5
"""Offset by which that pose differs [m]: viser does not send an unchanged one."""
_QUIET: tuple[int, int, int] = (118, 132, 150)
"""Colour of the buttons in the tabs."""


@dataclass(frozen=True)
class Action:
    """A user's action on the page.

    Attributes:
        kind: "press", "hand", "drag", "add", "remove", "trim", "play", "scrub", "discard", "view",
            "over", "key" or "pad".
        name: Name of the button, object, view or key.
        values: Numeric arguments.
        client: The browser whose view changes.
    """

    kind: str
    name: str = ""
    values: tuple[Any, ...] = ()
    client: viser.ClientHandle | None = None


class LivePage:
    """The controls of a live session on a viser page.

    Viser stores its controls and shapes: browsers that open the page later see their present state.

    Attributes:
        server: Server for drawing.
        shows_prediction: Whether to draw the prediction.
        shows_camera: Whether to show the camera's picture.
    """

    def __init__(
        self,
        page: ViserPage,
        *,
        cameras: bool,
        spares: bool,
        lesson: SessionRecord | None = None,
    ) -> None:
        """Adds the controls.

        Args:
            page: An empty page.
            cameras: Whether there is a camera's picture.
            spares: Whether obstacles can be added.
            lesson: The lesson with title and tasks, if any.
        """
        self._page, self.server = page, page.server
        self._actions: queue.SimpleQueue[Action] = queue.SimpleQueue()
        self._frames = 0
        self._status = ""
        gui = self.server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        gui.set_panel_label("Teach Pepper")
        self._words = gui.add_html("")
        self.show_status("starting", "")
        self._next = next(iter(BUTTONS))
        self._next_button = gui.add_button(_NEXT[self._next], color="blue")
        self._next_button.on_click(lambda event: self._press(self._next))
        for label, names in _GROUPS.items():
            buttons = gui.add_button_group(label, names)
            buttons.on_click(lambda event: self._press(str(event.target.value)))
        tabs = gui.add_tab_group()
        if lesson is not None:
            with tabs.add_tab("Lesson"):
                gui.add_markdown(f"{_as_markdown(lesson)}\n\n{_for_class(page)}")
                self._on_click(gui.add_button("Start over", color=_QUIET), Action("over"))
        with tabs.add_tab("Legend"):
            gui.add_html(LEGEND)
        with tabs.add_tab("Demos"):
            self._add_demonstrations()
        with tabs.add_tab("Scene"):
            views = gui.add_button_group("View from", VIEWS)
            views.on_click(lambda event: self._view(event))
            if spares:
                for name in SPARES:
                    button = gui.add_button(f"Add {plain_name(name)}", color=_QUIET)
                    self._on_click(button, Action("add", name))
                remove = gui.add_button("Remove what was added", color=_QUIET)
                self._on_click(remove, Action("remove"))
        self.shows_camera = False
        if cameras:
            with tabs.add_tab("Camera"):
                shown = gui.add_checkbox("Show the picture", False)
                shown.on_update(lambda event: self._show_camera(bool(event.target.value)))
                self._picture = gui.add_image(np.full((240, 320, 3), 235, np.uint8), visible=False)
                self._seen = gui.add_markdown(_NO_PICTURE)
        # Beside the controls, to watch the signals while other tabs are open.
        signals = gui.add_panel()
        with signals.add_tab("Signals over time [s]"):
            self._add_plots()
        signals.float(x=15, y=-15, width=_SIGNALS_WIDTH)
        self._add_hand()

    def _on_click(self, button: viser.GuiButtonHandle, action: Action) -> None:
        button.on_click(lambda event: self._actions.put(action))

    def _press(self, button: str) -> None:
        if button in BUTTONS:
            self._actions.put(Action("press", button))

    def _add_plots(self) -> None:
        gui = self.server.gui
        no_data = (np.array([0.0, 1.0]), np.full(2, np.nan))
        self._plots = {}
        for name, title, span in _SIGNALS:
            scales = {
                "x": viser.uplot.Scale(time=False, auto=True),
                "y": viser.uplot.Scale(range=span),
            }
            self._plots[name] = gui.add_uplot(
                no_data,
                (
                    viser.uplot.Series(label="time [s]"),
                    viser.uplot.Series(label=name, stroke="#2060c0", width=2),
                ),
                title=title,
                scales=scales,
                legend=viser.uplot.Legend(show=False),
                height=115,
            )
        self._coupling_shown = 1.0

    def _add_demonstrations(self) -> None:
        gui = self.server.gui
        self._list = gui.add_markdown("None yet: Record keeps what you show.")
        self._on_click(gui.add_button("Play the last", color=_QUIET), Action("play"))
        self._scrub = gui.add_slider("Playback [%]", 0, 100, 1, 0)
        self._scrub.on_update(self._take_share)
        self._part = gui.add_multi_slider("Keep [%]", 0, 100, 1, (0, 100))
        trim = gui.add_button("Trim the last to this range", color=_QUIET)
        trim.on_click(lambda event: self._take_part())
        self._on_click(gui.add_button("Discard the last", color=_QUIET), Action("discard"))
        self.shows_prediction = True
        predicted = gui.add_checkbox("Prediction", True, hint="Shows what was learned")
        predicted.on_update(lambda event: self._show_prediction(bool(event.target.value)))

    def _take_share(self, event: viser.GuiEvent) -> None:
        if event.client is not None:  # Moved by the user and not by the playback.
            self._actions.put(Action("scrub", values=(event.target.value / 100,)))

    def _take_part(self) -> None:
        self._actions.put(Action("trim", values=tuple(share / 100 for share in self._part.value)))

    def _show_prediction(self, shown: bool) -> None:
        self.shows_prediction = shown

    def _show_camera(self, shown: bool) -> None:
        self.shows_camera = shown
        self._picture.visible = False  # Until the next picture.
        self._seen.content = "The picture comes in a moment." if shown else _NO_PICTURE

    def _view(self, event: viser.GuiEvent) -> None:
        if event.target.value in VIEWS:
            self._actions.put(Action("view", event.target.value, client=event.client))

    def _add_hand(self) -> None:
        """Adds the rings and arrows for dragging the hand."""
        self._hand = self.server.scene.add_transform_controls(
            "/hand", scale=0.16, line_width=3.0, depth_test=False
        )

        async def moved(event: viser.TransformControlsEvent) -> None:
            if event.client is not None:
                pose = (np.array(event.target.position), np.array(event.target.wxyz))
                self._actions.put(Action("hand", values=pose))

        self._hand.on_update(moved)

    def dragged(self, name: str, event: viser.SceneNodeDragEvent) -> None:
        """Registers a drag of a movable object."""
        values = (event.phase, np.array(event.start_position), np.array(event.end_position))
        self._actions.put(Action("drag", name, values))

    def actions(self) -> list[Action]:
        """Returns the actions since the last call, including keys and gamepad.

        Those are of the kinds "key", with the key's name, and "pad", with axes and buttons.
        """
        actions = []
        while not self._actions.empty():
            actions.append(self._actions.get())
        keys = {key: name for name, key in BUTTONS.items()}
        for event in self._page.events():
            if "key" in event:
                key = event["key"]
                actions.append(Action("press", keys[key]) if key in keys else Action("key", key))
            elif "axes" in event:
                actions.append(Action("pad", values=(event["axes"], event["buttons"])))
        return actions

    def show_hand(self, X_WG: RigidTransform, *, visible: bool) -> None:
        """Moves the rings to a pose of the hand's guide; they can be dragged if visible."""
        if self._hand.visible != visible:
            self._hand.visible = visible
        # Spectators can drag the rings on their own screens: a new pose puts them back.
        self._frames += 1
        self._hand.position = X_WG.translation() + _NUDGE * (self._frames // _PUT_BACK_PERIOD % 2)
        self._hand.wxyz = X_WG.rotation().ToQuaternion().wxyz()

    def sight(self) -> tuple[Vector, Vector]:
        """Returns the directions right and ahead (3,) in W, along the floor, of the last view."""
        clients = [c for c in self.server.get_clients().values() if c.camera.update_timestamp > 0]
        if not clients:
            return np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
        camera = max(clients, key=lambda client: client.camera.update_timestamp).camera
        wxyz = np.array(camera.wxyz)
        R = RotationMatrix(Quaternion(wxyz / np.linalg.norm(wxyz))).matrix()
        right = np.array([R[0, 0], R[1, 0], 0.0])
        norm = float(np.linalg.norm(right))
        right = right / norm if norm > 1e-6 else np.array([0.0, -1.0, 0.0])
        return right, np.cross([0.0, 0.0, 1.0], right)

    @staticmethod
    def look(client: viser.ClientHandle, position: Vector, target: Vector, up: Vector) -> None:
        """Turns one browser's view."""
        with client.atomic():
            client.camera.up_direction = up
            client.camera.position = position
            client.camera.look_at = target

    @property
    def status(self) -> str:
        """The status shown on the page."""
        return self._status

    def show_status(self, mode: str, words: str, hint: str = "") -> None:
        """Shows mode, status and hint."""
        title = mode.capitalize()
        words = words.removeprefix(f"{title}: ").removeprefix(f"{title}, ")
        words = words[:1].upper() + words[1:]
        status = (
            f"<div style='{_WORDS_STYLE}'><b style='font-size:1.4em'>{title}</b><br>"
            f"{escape(words)}<br><span style='font-size:0.85em'>{escape(hint)}</span></div>"
        )
        if status != self._status:
            self._status = self._words.content = status

    def show_next(self, button: str) -> None:
        """Sets the large button to the next step: red for Stop, blue otherwise."""
        if button != self._next:
            self._next = button
            self._next_button.label = _NEXT[button]
            self._next_button.color = "red" if button == "Stop" else "blue"

    def show_demonstrations(self, text: str) -> None:
        """Shows the list of demonstrations, as Markdown."""
        self._list.content = text
        # What is left of a trimmed one is whole. Viser has a setter.
        self._part.value = (0, 100)  # type: ignore[misc]

    def show_progress(self, share: float) -> None:
        """Sets the playback slider to a fraction of the demonstration."""
        self._scrub.value = round(100 * share)  # type: ignore[misc] # Viser has a setter.

    def show_signals(self, times: Vector, signals: dict[str, Vector]) -> None:
        """Draws signals (N,) over times (N,) [s]."""
        for name, values in signals.items():
            self._plots[name].data = (times, values)
        # Rescale in steps, so that the axis does not change with every sample.
        top = float(2.0 ** np.ceil(np.log2(max(1.0, signals["coupling"].max()))))
        if top != self._coupling_shown:
            plot, self._coupling_shown = self._plots["coupling"], top
            plot.scales = {**(plot.scales or {}), "y": viser.uplot.Scale(range=(0.0, 1.2 * top))}

    def show_picture(self, picture: npt.NDArray[np.uint8], words: str) -> None:
        """Shows the camera's picture (H, W, 3) with a caption."""
        self._picture.image = picture
        self._picture.visible = True
        self._seen.content = words


def _for_class(page: ViserPage) -> str:
    """Tells where a class watches, or how it could."""
    if page.is_local:
        return "Start with `--host 0.0.0.0` to let a class watch on its own computers."
    return f"The class watches at `{page.class_url}`."


def _as_markdown(lesson: SessionRecord) -> str:
    tasks = [f"{number}. {_escaped(task)}" for number, task in enumerate(lesson.tasks, 1)]
    return "\n".join([f"**{_escaped(lesson.title or 'Lesson')}**", "", *tasks])


def _escaped(text: str) -> str:
    return "".join(f"\\{letter}" if letter in "\\`*_{}[]<>#|!" else letter for letter in text)
