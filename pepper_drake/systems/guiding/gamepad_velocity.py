"""Maps a game pad's sticks and buttons to a hand velocity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context

from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GamepadState:
    """State of a game pad, numbered as in the browsers' "standard" mapping.

    Attributes:
        axes: From -1 to 1: left stick right and down (0, 1), right stick right and down (2, 3).
        buttons: From 0 to 1: left and right shoulder (4, 5), left and right trigger (6, 7); the
            directional pad up, down, left, right (12 to 15).
    """

    axes: tuple[float, ...] = ()
    buttons: tuple[float, ...] = ()

    @classmethod
    def of(cls, axes: Sequence[float], buttons: Sequence[float]) -> Self:
        """Makes a state; both sequences may be empty (no pad is plugged in)."""
        return cls(tuple(map(float, axes)), tuple(map(float, buttons)))


@dataclass(frozen=True)
class GamepadParams:
    """Parameters of guiding the hand with a game pad."""

    speed: float = 0.2
    """At full deflection, per axis [m/s]."""
    turn_rate: float = 1.0
    """At full deflection or while a button is held, per axis [rad/s]."""
    dead_zone: float = 0.15
    """Deflection of a stick that counts as none: sticks do not return exactly to zero."""
    exponent: float = 2.0
    """Above 1, small deflections are less than proportionally fast, for fine motion."""


def gamepad_velocity(state: GamepadState, params: GamepadParams) -> Vector:
    """Returns the commanded hand velocity (6,): angular, then linear.

    In the axes of T, x forward, y left, z up [rad/s, m/s]: the left stick moves the hand forward
    and sideways, the right stick moves it up and down and turns it about z (yaw), the shoulder
    buttons turn it about x (roll, left and right), the directional pad's up and down about y
    (pitch). Sticks and buttons that a pad lacks count as released.
    """
    right, down, turn, lower = (_deflection(state.axes, k, params) for k in range(4))
    roll = _pressed(state.buttons, 5) - _pressed(state.buttons, 4)
    pitch = _pressed(state.buttons, 13) - _pressed(state.buttons, 12)
    turning = params.turn_rate * np.array([roll, pitch, -turn])
    return np.concatenate((turning, params.speed * np.array([-down, -right, -lower])))


def _deflection(axes: Sequence[float], index: int, params: GamepadParams) -> float:
    """Applies dead zone and response curve to a stick's axis; continuous, from -1 to 1."""
    value = axes[index] if index < len(axes) else 0.0
    if not np.isfinite(value):
        return 0.0
    size = max(0.0, min(abs(value), 1.0) - params.dead_zone) / (1.0 - params.dead_zone)
    return float(np.copysign(size**params.exponent, value))


def _pressed(buttons: Sequence[float], index: int) -> float:
    value = buttons[index] if index < len(buttons) else 0.0
    return float(np.clip(value, 0.0, 1.0)) if np.isfinite(value) else 0.0


class GamepadVelocity(LeafSystem):
    """Maps a game pad to a hand velocity; see `gamepad_velocity`.

    .. pydrake_system::

        name: GamepadVelocity
        input_ports:
        - gamepad
        output_ports:
        - velocity_command

    `gamepad` is a GamepadState; `velocity_command` (6) angular and linear velocity in the axes of
    T [rad/s, m/s]. No state.

    Args:
        params: Speeds, dead zone and curve of the sticks; the defaults if omitted.
    """

    def __init__(self, params: GamepadParams | None = None) -> None:
        super().__init__()
        self._params = params or GamepadParams()
        self.gamepad_input = self.DeclareAbstractInputPort("gamepad", Value[object](GamepadState()))
        self.velocity_output = self.DeclareVectorOutputPort(
            "velocity_command", 6, self._calc_velocity, {self.gamepad_input.ticket()}
        )

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(gamepad_velocity(self.gamepad_input.Eval(context), self._params))
