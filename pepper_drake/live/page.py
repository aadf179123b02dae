"""The page: buttons, tabs and pictures on viser, and what a person does with mouse and keys."""

import queue
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import viser
import viser.uplot
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.live.controls import BUTTONS, plain_name
from pepper_drake.models.movable_objects import SPARES
from pepper_drake.web.viser_page import ViserPage

Vector = npt.NDArray[np.float64]

VIEWS = ("Front", "Shoulder", "Top", "Camera")
CLEARANCE_SHOWN = 0.5
"""Clearances are shown up to this [m]: beyond it, or where nothing is seen, they are cut."""
_SIGNALS = (("phase", ""), ("clearance", " [cm], cut at 50"), ("coupling", " [m/s²]"))
_LEGEND = """
| seen | meaning |
| --- | --- |
| rings and arrows at the hand | drag them: the hand follows |
| green line | from the hand to where it is led |
| black path | the demonstration; grey: those before it |
| green path | prediction: what was learned, to where the goal is now, without obstacles |
| pale hand | ghost: the hand of the demonstration that is played back |
| blue path | the hand while it reaches; violet once the goal has moved |
| dots | obstacles as Pepper sees them, red near the hand and blue far from it |
| red arrow | push of the obstacles: the coupling's acceleration |

Drag the goal and obstacles themselves with the mouse. Drag beside them to turn the view.

Keys: R record, Space stop, L learn, G reach, U undo, S save; arrows, PgUp and PgDn move the hand as
you see it; Z X, C V, B N turn it. A game pad leads the hand, too.
"""


@dataclass(frozen=True)
class Action:
    """Something that a person did on the page.

    Attributes:
        kind: "press", "hand", "drag", "add", "remove", "trim", "play", "scrub", "discard", "view",
            "key" or "pad".
        name: What it was done with: a button, an object, a view.
        values: Numbers that go with it.
        client: Whose view changes.
    """

    kind: str
    name: str = ""
    values: tuple[Any, ...] = ()
    client: viser.ClientHandle | None = None


class LivePage:
    """The controls of a live session on a viser page.

    Viser remembers its controls and shapes: whoever opens the page late sees them as they are.

    Attributes:
        server: To draw into.
        shows_prediction: Whether the prediction is to be drawn.
        shows_camera: Whether the camera's picture is asked for.
    """

    def __init__(self, page: ViserPage, *, cameras: bool, spares: bool) -> None:
        """Adds the controls.

        Args:
            page: With nothing on it.
            cameras: Whether there is a camera's picture.
            spares: Whether obstacles can be added.
        """
        self._page, self.server = page, page.server
        self._actions: queue.SimpleQueue[Action] = queue.SimpleQueue()
        self._status = ""
        gui = self.server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        gui.set_panel_label("Teach Pepper")
        self._words = gui.add_markdown("Pepper wakes up")
        for name, key in BUTTONS.items():
            button = gui.add_button(f"{name} ({key.removeprefix('Key')})")
            self._on_click(button, Action("press", name))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Legend"):
            gui.add_markdown(_LEGEND)
        with tabs.add_tab("Demonstrations"):
            self._add_demonstrations()
        with tabs.add_tab("Scene"):
            views = gui.add_button_group("View from", VIEWS)
            views.on_click(lambda event: self._view(event))
            if spares:
                for name in SPARES:
                    button = gui.add_button(f"Add {plain_name(name)}")
                    self._on_click(button, Action("add", name))
                self._on_click(gui.add_button("Remove what was added"), Action("remove"))
        with tabs.add_tab("Signals"):
            times = np.array([0.0, 1.0])
            self._plots = {
                name: gui.add_uplot(
                    (times, np.zeros(2)),
                    (
                        viser.uplot.Series(label="time [s]"),
                        viser.uplot.Series(label=name + unit, stroke="#2060c0", width=2),
                    ),
                    title=name + unit,
                    scales={"x": viser.uplot.Scale(time=False, auto=True)},
                    height=170,
                )
                for name, unit in _SIGNALS
            }
        self.shows_camera = False
        if cameras:
            with tabs.add_tab("Camera"):
                shown = gui.add_checkbox("Show what the head's camera sees", False)
                shown.on_update(lambda event: self._show_camera(bool(event.target.value)))
                self._picture = gui.add_image(np.zeros((240, 320, 3), np.uint8))
                self._seen = gui.add_markdown("")
        self._add_hand()

    def _on_click(self, button: viser.GuiButtonHandle, action: Action) -> None:
        button.on_click(lambda event: self._actions.put(action))

    def _add_demonstrations(self) -> None:
        gui = self.server.gui
        self._list = gui.add_markdown("None yet: Record keeps what you show.")
        self._on_click(gui.add_button("Play the last"), Action("play"))
        self._scrub = gui.add_slider("at [%]", 0, 100, 1, 0)
        self._scrub.on_update(self._take_share)
        self._part = gui.add_multi_slider("keep [%]", 0, 100, 1, (0, 100))
        trim = gui.add_button("Trim the last")
        trim.on_click(lambda event: self._take_part())
        self._on_click(gui.add_button("Discard the last"), Action("discard"))
        self.shows_prediction = True
        predicted = gui.add_checkbox("Show the prediction", True)
        predicted.on_update(lambda event: self._show_prediction(bool(event.target.value)))

    def _take_share(self, event: viser.GuiEvent) -> None:
        if event.client is not None:  # Moved by a person, and not by the playback.
            self._actions.put(Action("scrub", values=(event.target.value / 100,)))

    def _take_part(self) -> None:
        self._actions.put(Action("trim", values=tuple(share / 100 for share in self._part.value)))

    def _show_prediction(self, shown: bool) -> None:
        self.shows_prediction = shown

    def _show_camera(self, shown: bool) -> None:
        self.shows_camera = shown

    def _view(self, event: viser.GuiEvent) -> None:
        if event.target.value in VIEWS:
            self._actions.put(Action("view", event.target.value, client=event.client))

    def _add_hand(self) -> None:
        """The rings and arrows by which the hand is dragged."""
        self._hand = self.server.scene.add_transform_controls(
            "/hand", scale=0.16, line_width=3.0, depth_test=False
        )

        async def moved(event: viser.TransformControlsEvent) -> None:
            if event.client is not None:
                pose = (np.array(event.target.position), np.array(event.target.wxyz))
                self._actions.put(Action("hand", values=pose))

        self._hand.on_update(moved)

    def dragged(self, name: str, event: viser.SceneNodeDragEvent) -> None:
        """Takes note of a drag of what can be moved."""
        values = (event.phase, np.array(event.start_position), np.array(event.end_position))
        self._actions.put(Action("drag", name, values))

    def actions(self) -> list[Action]:
        """Returns what was done since this was last asked, keys and game pad included.

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
        """Puts the rings to a pose of the hand's guide, which can be led if they are visible."""
        if self._hand.visible != visible:
            self._hand.visible = visible
        self._hand.position = X_WG.translation()
        self._hand.wxyz = X_WG.rotation().ToQuaternion().wxyz()

    def sight(self) -> tuple[Vector, Vector]:
        """Returns right and ahead along the floor, (3,) in W, of who last turned a view."""
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
        """The status as it is on the page."""
        return self._status

    def show_status(self, mode: str, words: str, hint: str = "") -> None:
        """Shows what Pepper is doing, and what one can do next."""
        status = f"### {mode}\n{_escaped(words)}\n\n<small>{_escaped(hint)}</small>"
        if status != self._status:
            self._status = self._words.content = status

    def show_demonstrations(self, text: str) -> None:
        """Shows what is known of the demonstrations, as Markdown."""
        self._list.content = text

    def show_progress(self, share: float) -> None:
        """Puts the slider of the playback to a share of the demonstration."""
        self._scrub.value = round(100 * share)  # type: ignore[misc] # Viser has a setter.

    def show_signals(self, times: Vector, signals: dict[str, Vector]) -> None:
        """Draws signals (N,) over times (N,) [s]."""
        for name, values in signals.items():
            self._plots[name].data = (times, values)

    def show_picture(self, picture: npt.NDArray[np.uint8], words: str) -> None:
        """Shows the camera's picture (H, W, 3), and what was found in it."""
        self._picture.image = picture
        self._seen.content = words


def _escaped(text: str) -> str:
    return "".join(f"\\{letter}" if letter in "\\`*_{}[]<>#|!" else letter for letter in text)
