"""Pad scripts: a sequence of game pad states; typed YAML files."""

from dataclasses import dataclass, field
from functools import partial
from typing import Self

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.models.teaching_script import TeachingScript, check_duration, load_script

PAD_SCRIPTS = ("pad",)
"""The names of the pad scripts that ship."""

_AXES, _BUTTONS = 4, 17
_LEFT_SHOULDER, _RIGHT_SHOULDER = 4, 5


@dataclass
class PadStep:
    """Sticks and buttons, held for a duration; numbered as in `gamepad_velocity`."""

    duration: float = 1.0  # [s].
    axes: list[float] = field(default_factory=lambda: [0.0] * _AXES)  # From -1 to 1.
    pressed: list[int] = field(default_factory=list)  # Numbers of the pressed buttons.

    def buttons(self) -> list[float]:
        """Returns the deflection of each button, from 0 to 1."""
        return [float(number in self.pressed) for number in range(_BUTTONS)]


@dataclass
class PadScript(TeachingScript):
    """A motion of the hand, steered with a game pad."""

    steps: list[PadStep] = field(default_factory=list)

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, if it makes no sense."""
        super().check()
        if not self.steps:
            raise InputError("steps holds none; it needs at least one")
        for index, step in enumerate(self.steps):
            name = f"steps[{index}]"
            check_duration(f"{name}.duration", step.duration, whole=self.end_time)
            if len(step.axes) != _AXES or not np.all(np.abs(step.axes) <= 1.0):
                raise InputError(f"{name}.axes must be {_AXES} numbers from -1 to 1")
            if not all(0 <= number < _BUTTONS for number in step.pressed):
                raise InputError(f"{name}.pressed must hold numbers from 0 to {_BUTTONS - 1}")

    @property
    def end_time(self) -> float:
        """Returns the end of the last step [s], including the rest at the start."""
        return self.rest + sum(step.duration for step in self.steps)

    def step_at(self, time: float) -> PadStep:
        """Returns the step at a time [s]; all released during the rest before and after."""
        start = self.rest
        if time < start:
            return PadStep()
        for step in self.steps:
            start += step.duration
            if time < start:
                return step
        return PadStep()

    def mirrored(self) -> Self:
        """Returns the script for the other arm, mirrored at the robot's x-z plane."""
        mirror = super().mirrored()
        swap = {_LEFT_SHOULDER: _RIGHT_SHOULDER, _RIGHT_SHOULDER: _LEFT_SHOULDER}
        for step in mirror.steps:
            step.axes[0], step.axes[2] = -step.axes[0], -step.axes[2]
            step.pressed = [swap.get(number, number) for number in step.pressed]
        return mirror


load_pad_script = partial(load_script, PadScript, shipped=PAD_SCRIPTS)
"""Loads and checks a pad script that ships (by its name) or a YAML file; see `load_script`."""
