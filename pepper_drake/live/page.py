"""The page: buttons, sliders, keys and a game pad in Drake's meshcat, and a status line."""

import html
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from pepper_drake.systems.guiding.gamepad_velocity import (
    GamepadParams,
    GamepadState,
    gamepad_velocity,
)

Vector = npt.NDArray[np.float64]

BUTTONS = {
    "Record": "KeyR",
    "Stop": "Space",
    "Learn": "KeyL",
    "Reach": "KeyG",
    "Save": "KeyS",
}
"""The buttons and the key of each, as browsers name keys."""


@dataclass(frozen=True)
class Slider:
    """A slider: its label tells its keys, which move it by a step."""

    label: str
    lower: float
    upper: float
    step: float
    less: str = ""
    more: str = ""


HAND_SLIDERS = (
    Slider("hand ahead ↓↑", -0.30, 0.50, 0.005, "ArrowDown", "ArrowUp"),
    Slider("hand to the left →←", -0.65, 0.65, 0.005, "ArrowRight", "ArrowLeft"),
    Slider("hand up PgDn PgUp", -0.45, 0.45, 0.005, "PageDown", "PageUp"),
    Slider("hand roll ° Z X", -180, 180, 2, "KeyZ", "KeyX"),
    Slider("hand pitch ° C V", -180, 180, 2, "KeyC", "KeyV"),
    Slider("hand yaw ° B N", -180, 180, 2, "KeyB", "KeyN"),
)
"""Sliders of the guide, in the torso frame: position [m], then roll, pitch, yaw [degrees]."""

_AXES = ("ahead", "to the left", "up")
_FARTHEST = 0.2
"""Range in which objects can be moved [m]."""

_TITLE = (
    "<style>"
    ".dg.main,.dg.main .close-button{width:400px!important}"
    ".dg .property-name{width:47%!important;font-size:12px}"
    ".dg .c{width:53%!important}"
    ".dg .function .property-name{width:100%!important;font-size:13px}"
    ".dg .c input[type=text]{width:17%!important}.dg .c .slider{width:76%!important}"
    ".dg li:has(#status){height:0!important;border:0!important}"
    "#status{position:fixed;left:0;right:400px;bottom:0;padding:14px 24px;height:auto;"
    "background:rgba(20,22,28,.85);color:#fff;font:18px/1.4 sans-serif;white-space:normal;"
    "text-shadow:none;pointer-events:none}"
    "#status b{color:#8fd3ff;margin-right:14px}"
    "#status i{float:right;margin-left:24px;font-size:14px;color:#aaa;font-style:normal}"
    "</style>"
    '<img src="data:," style="display:none" onerror="viewer.gui.open();'
    'viewer.gui.__folders.Scene.close()">'
    "Teach Pepper"
)
"""The first control's label. Meshcat's labels are HTML: this one widens the panel, makes the status
line a bar across the page in front of the scene that lets every click through, and opens the panel,
which starts closed: an image without data is an error, and what is to be done then is said."""


def status_label(mode: str, words: str, hint: str = "") -> str:
    """Returns the label of the button that is the status line, as HTML (see `_TITLE`)."""
    # Meshcat puts a label between quotes into a script, where a backslash would begin an escape.
    mode, words, hint = (
        html.escape(text, quote=True).replace("\\", "&#92;") for text in (mode, words, hint)
    )
    return f'<div id="status"><i>{hint}</i><b>{mode}</b>{words}</div>'


class LivePage:
    """The controls of a live session on a meshcat page.

    Meshcat remembers its controls itself: whoever opens the page late sees them as they are.

    Attributes:
        meshcat: The page's server.
    """

    def __init__(self, meshcat: Meshcat, movables: list[str]) -> None:
        """Adds the controls.

        Args:
            meshcat: With no other controls.
            movables: What can be moved, by name.
        """
        self.meshcat = meshcat
        self._clicks = dict.fromkeys(BUTTONS, 0)
        self._status = ""
        self._pad_params = GamepadParams()
        meshcat.AddButton(_TITLE)
        for name, key in BUTTONS.items():
            meshcat.AddButton(_label(name), key)
        self._hand = HAND_SLIDERS
        for slider in self._hand:
            self._add(slider, 0.0)
        self._objects = {
            name: [Slider(f"{_plain(name)} {axis}", -_FARTHEST, _FARTHEST, 0.005) for axis in _AXES]
            for name in sorted(movables, key=lambda name: name != "goal_object")
        }
        for sliders in self._objects.values():
            for slider in sliders:
                self._add(slider, 0.0)
        self._zero = np.zeros(6)
        self._X_TG = RigidTransform()

    def _add(self, slider: Slider, value: float) -> None:
        self.meshcat.AddSlider(
            slider.label,
            slider.lower,
            slider.upper,
            slider.step,
            value,
            slider.less,
            slider.more,
        )

    def pressed(self) -> list[str]:
        """Returns the buttons that were pressed since this was last asked, in the page's order."""
        names = []
        for name, before in self._clicks.items():
            clicks = self.meshcat.GetButtonClicks(_label(name))
            names += [name] * min(clicks - before, 1)
            self._clicks[name] = clicks
        return names

    def set_hand(self, X_TG: RigidTransform) -> None:
        """Puts the hand's sliders to a pose of the guide in T."""
        self._X_TG = RigidTransform(X_TG)
        angles = np.degrees(RollPitchYaw(X_TG.rotation()).vector())
        for slider, value in zip(self._hand, [*X_TG.translation(), *angles], strict=True):
            self.meshcat.SetSliderValue(slider.label, value)
        self._zero = self._hand_values()

    def hand(self) -> RigidTransform:
        """Returns the pose in T that the hand's sliders ask for.

        It is the pose of `set_hand`, moved as far as the sliders were moved since: what the
        sliders' steps cannot tell is not lost.
        """
        moved = self._hand_values() - self._zero
        if not moved.any():
            return self._X_TG
        rpy = RollPitchYaw(self._X_TG.rotation()).vector() + np.radians(moved[3:])
        position = self._X_TG.translation() + moved[:3]
        return RigidTransform(RotationMatrix(RollPitchYaw(rpy)), position)

    def _hand_values(self) -> Vector:
        return np.array([self.meshcat.GetSliderValue(slider.label) for slider in self._hand])

    def offsets(self) -> dict[str, Vector]:
        """Returns the offset (3,) in W [m] of all that can be moved, by name."""
        return {
            name: np.array([self.meshcat.GetSliderValue(slider.label) for slider in sliders])
            for name, sliders in self._objects.items()
        }

    def set_offset(self, name: str, offset: Vector) -> None:
        """Puts the sliders of an object to an offset (3,) in W [m]."""
        for slider, value in zip(self._objects[name], offset, strict=True):
            self.meshcat.SetSliderValue(slider.label, float(value))

    def pad_velocity(self) -> Vector:
        """Returns the velocity (6,) that a game pad asks for, angular and linear in T."""
        pad = self.meshcat.GetGamepad()
        if pad.index is None:
            return np.zeros(6)
        return gamepad_velocity(GamepadState.of(pad.axes, pad.button_values), self._pad_params)

    @property
    def status(self) -> str:
        """The label of the status line as it is on the page."""
        return self._status

    def show_status(self, mode: str, words: str, hint: str = "") -> None:
        """Shows what Pepper is doing, and what one can do next."""
        label = status_label(mode, words, hint)
        if label == self._status:
            return
        self.meshcat.AddButton(label)
        if self._status:
            self.meshcat.DeleteButton(self._status)
        self._status = label


def _label(button: str) -> str:
    """A button's label, which tells its key."""
    return f"{button} ({BUTTONS[button].removeprefix('Key')})"


def _plain(name: str) -> str:
    return "goal" if name == "goal_object" else name.replace("_", " ")
