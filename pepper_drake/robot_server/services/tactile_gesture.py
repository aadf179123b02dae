"""ALTactileGesture: sequences of touches of the head, by their names."""

from typing import Any

from pepper_drake.robot_server.services.memory import Memory
from pepper_drake.robot_server.services.waiting import Module

_SENSORS = ("Head/Touch/Front", "Head/Touch/Middle", "Head/Touch/Rear")
_REST = "000"

_GESTURES: dict[str, str] = {
    "SingleFront": "000 100 000",
    "SingleMiddle": "000 010 000",
    "SingleRear": "000 001 000",
    "DoubleFront": "000 100 000 100 000",
    "DoubleMiddle": "000 010 000 010 000",
    "DoubleRear": "000 001 000 001 000",
    "SingleTap": "000 111 000",
    "DoubleTap": "000 111 000 111 000",
    "CaressFtoR": "000 100 010 001 000",
    "CaressRtoF": "000 001 010 100 000",
    "ZoomIn": "000 101 010 000",
    "ZoomOut": "000 010 101 000",
    "TheClaw": "000 101 000",
    "SingleFrontHold": "000 100",
    "SingleMiddleHold": "000 010",
    "SingleRearHold": "000 001",
    "SingleTapHold": "000 111",
    "TheClawHold": "000 101",
}
"""The maker's gestures: sequences of patterns, a digit each for front, middle and rear."""

_LONGEST = 40
"""Most touches in a sequence, and most gestures that programs may add."""


class TactileGesture(Module):
    """ALTactileGesture.

    The times are estimates; the maker's documentation does not give them.
    """

    def __init__(self, memory: Memory) -> None:
        """Makes the service with the maker's gestures.

        Args:
            memory: Gets the events `ALTactileGesture/Gesture` and `Release`.
        """
        super().__init__("ALTactileGesture")
        self._memory = memory
        self._gestures = {name: text.split() for name, text in _GESTURES.items()}
        self._times = {"settle": 0.1, "hold": 0.8, "sequence": 0.4}
        self._raw = self._pattern = _REST
        self._changed = self._settled = 0.0
        self._sequence = [_REST]
        self._held = False

    def create_gesture(self, sequence: list[str]) -> str:
        """Adds a gesture; returns its name."""
        if sequence in self._gestures.values():
            raise ValueError(f"the sequence is that of {self.get_gesture(sequence)}")
        if not _is_sequence(sequence):
            raise ValueError("a sequence is 000 and then other patterns such as 100")
        if len(self._gestures) >= len(_GESTURES) + _LONGEST:
            raise ValueError("there are too many gestures")
        name = "_".join(sequence)
        self._gestures[name] = list(sequence)
        return name

    def get_sequence(self, name: str) -> list[str]:
        """Returns the sequence of a gesture, empty if there is no such gesture."""
        return list(self._gestures.get(name, ()))

    def get_gesture(self, sequence: list[str]) -> str:
        """Returns the name of a sequence's gesture, or ""."""
        return next((n for n, known in self._gestures.items() if known == list(sequence)), "")

    def get_gestures(self) -> dict[str, list[str]]:
        """Returns all gestures."""
        return {name: list(sequence) for name, sequence in self._gestures.items()}

    def set_settle_time(self, seconds: float) -> bool:
        """Sets the debounce time of a touch [s]."""
        return self._set("settle", seconds)

    def set_hold_time(self, seconds: float) -> bool:
        """Sets the time after which a touch counts as held [s]."""
        return self._set("hold", seconds)

    def set_sequence_time(self, seconds: float) -> bool:
        """Sets the time without touch that ends a sequence [s]."""
        return self._set("sequence", seconds)

    def step(self, touched: frozenset[str], now: float) -> None:
        """Updates the state from the head's sensors."""
        raw = "".join(str(int(sensor in touched)) for sensor in _SENSORS)
        if raw != self._raw:
            self._raw, self._changed = raw, now
        if raw != self._pattern and now - self._changed >= self._times["settle"]:
            self._pattern, self._settled = raw, now
            if self._held:
                # A held touch is a complete gesture; its release is not part of another one.
                self._held, self._sequence = raw != _REST, [_REST]
                self._release()
            elif len(self._sequence) < _LONGEST:
                self._sequence.append(raw)
        lasted = now - self._settled
        if self._pattern != _REST and lasted >= self._times["hold"]:
            self._settled = now
            if not self._held:
                self._held = True
            self._emit_gesture()
        elif self._pattern == _REST and lasted >= self._times["sequence"]:
            if len(self._sequence) > 1:
                self._emit_gesture()
                self._release()
            self._sequence = [_REST]

    def _emit_gesture(self) -> None:
        name = self.get_gesture(self._sequence)
        if name:
            self._emit("onGesture", name)
            self._memory.raise_event("ALTactileGesture/Gesture", name)

    def _release(self) -> None:
        self._emit("onRelease")
        self._memory.raise_event("ALTactileGesture/Release", 1)

    def _set(self, what: str, seconds: float) -> bool:
        if not 0.0 < seconds <= 10.0:
            return False
        self._times[what] = seconds
        return True


def _is_sequence(sequence: Any) -> bool:
    patterns = {f"{number:03b}" for number in range(8)}
    return 1 < len(sequence) <= _LONGEST and sequence[0] == _REST and set(sequence) <= patterns
