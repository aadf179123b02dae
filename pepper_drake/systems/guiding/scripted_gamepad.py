"""A scripted game pad."""

from collections.abc import Callable

from pydrake.common.value import Value
from pydrake.systems.framework import Context

from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.guiding.gamepad_velocity import GamepadState


class ScriptedGamepad(LeafSystem):
    """Plays a script of game pad states.

    .. pydrake_system::

        name: ScriptedGamepad
        output_ports:
        - gamepad

    `gamepad` is a GamepadState; see GamepadVelocity.

    Args:
        state_at: The pad's state at a time [s].
    """

    def __init__(self, state_at: Callable[[float], GamepadState]) -> None:
        super().__init__()
        self._state_at = state_at
        self.gamepad_output = self.DeclareAbstractOutputPort(
            "gamepad", lambda: Value[object](GamepadState()), self._calc, {self.time_ticket()}
        )

    def _calc(self, context: Context, output: Value) -> None:
        output.set_value(self._state_at(context.get_time()))
