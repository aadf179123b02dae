"""DCM: devices by their keys. Lights and joints follow commands; other devices only accept them.

A command is `[device or alias, update, [[value, time], ...]]`, with times by `getTime` [ms].
Earlier commands that are not over yet are dropped, whatever the update type.
"""

from collections.abc import Callable
from typing import Any

from pepper_drake.naoqi.constants import CYCLE, JOINTS
from pepper_drake.robot_server.robot.joint_controller import PathMotion
from pepper_drake.robot_server.robot.time_laws import sample_ramp
from pepper_drake.robot_server.services.leds import Leds
from pepper_drake.robot_server.services.motion import Motion
from pepper_drake.robot_server.services.motion_arguments import number
from pepper_drake.robot_server.services.sensor_keys import DEVICES
from pepper_drake.robot_server.services.waiting import Module, RobotTimer

_UPDATES = ("Merge", "ClearAll", "ClearAfter", "ClearBefore")
_MOST_ALIASES = 200
_LONGEST = 600.0
"""Latest time of a command from now [s]; later ones, as by another clock, are refused."""
_END = "/Actuator/Value"

Key = tuple[float, float]
"""A value and its time from now [s]."""


class Dcm(Module):
    """DCM."""

    def __init__(
        self, motion: Motion, leds: Leds, timer: RobotTimer, log: Callable[[str], None]
    ) -> None:
        """Makes the service without aliases; `motion` drives the joints, `leds` the lights."""
        super().__init__("DCM")
        self._motion, self._leds, self._timer, self._log = motion, leds, timer, log
        self._start = timer.now
        self._aliases: dict[str, list[str]] = {}
        self._logged: set[str] = set()

    def get_time(self, offset: int) -> int:
        """Returns the time since the robot started plus an offset [ms]."""
        return round(1000 * (self._timer.now - self._start)) + offset

    def get_prefix(self) -> list[str]:
        """Returns the common prefix of all keys."""
        return [DEVICES]

    def create_alias(self, alias: Any) -> Any:
        """Gives devices a common name, `[name, [device, ...]]`; returns the alias."""
        name, devices = _list(alias, 2)
        if len(self._aliases) >= _MOST_ALIASES:
            raise ValueError("there are too many aliases")
        self._aliases[str(name)] = [self._key(device) for device in _list(devices)]
        return alias

    def set(self, command: Any) -> None:
        """Commands a device, or all devices of an alias alike."""
        name, update, timed = _list(command, 3)
        keys = self._timed(timed)
        _known_update(update)
        for key in self._aliases.get(str(name)) or [self._key(name)]:
            self._do(key, keys)

    def set_alias(self, command: Any) -> None:
        """Commands the devices of an alias, each individually.

        `[alias, update, "time-mixed", [[[value, time], ...] of each device]]`, or
        `[alias, update, "time-separate", importance, [time, ...], [[value, ...] of each device]]`.
        """
        name, update, kind, *rest = _list(command)
        _known_update(update)
        devices = self._aliases.get(str(name))
        if devices is None:
            raise ValueError(f"there is no alias {name!r:.60}")
        if kind == "time-separate" and len(rest) == 3:
            times = _list(rest[1])
            timed = [
                [[value, time] for value, time in zip(_list(values), times, strict=False)]
                for values in _list(rest[2])
            ]
        elif kind == "time-mixed" and len(rest) == 1:
            timed = _list(rest[0])
        else:
            raise ValueError('the times are "time-mixed" or "time-separate"')
        if len(timed) != len(devices):
            raise ValueError(f"{name} has {len(devices)} devices, but {len(timed)} are commanded")
        for key, keys in zip(devices, map(self._timed, timed), strict=True):
            self._do(key, keys)

    def _do(self, key: str, keys: list[Key]) -> None:
        device, _, quantity = key.removesuffix(_END).rpartition("/")
        if quantity == "Position" and device in JOINTS:
            self._lead(device, keys)
        elif quantity == "Hardness" and device in JOINTS:
            self._motion.set_stiffnesses(device, keys[-1][0])
        elif not self._leds.lead(key, keys) and key not in self._logged and len(self._logged) < 100:
            self._logged.add(key)
            self._log(f"DCM takes commands of {key}, which changes nothing in the simulation")

    def _lead(self, joint: str, keys: list[Key]) -> None:
        """Moves a joint along straight lines through its values [rad]."""
        values, times = zip(*keys, strict=True)
        after = [max(time, (k + 1) * CYCLE) for k, time in enumerate(times)]
        tasks = self._motion.tasks
        tasks.kill_where(lambda task: joint in task.resources)
        ramp = PathMotion(
            self._motion.joints, {joint: lambda start, _: sample_ramp(start, after, values)}
        )
        tasks.add("DCM", [joint], ramp)

    def _key(self, device: Any) -> str:
        key = str(device).removeprefix(DEVICES)
        if not key.endswith(_END):
            raise ValueError(f"there is no actuator {device!r:.80}")
        return key

    def _timed(self, timed: Any) -> list[Key]:
        now = self.get_time(0)
        pairs = [_list(pair, 2) for pair in _list(timed)]
        keys = [(number(v, "values"), (number(t, "times") - now) / 1000) for v, t in pairs]
        if not keys:
            raise ValueError("there is no value")
        if max(time for _, time in keys) > _LONGEST:
            raise ValueError(f"a time is more than {_LONGEST:g} s from now; getTime tells the time")
        return sorted(keys, key=lambda key: key[1])


def _list(value: Any, length: int = 0) -> list[Any]:
    if not isinstance(value, list | tuple) or (length and len(value) != length):
        raise ValueError(f"{value!r:.60} is not a list" + (f" of {length}" if length else ""))
    return list(value)


def _known_update(update: Any) -> None:
    if update not in _UPDATES:
        raise ValueError(f"there is no update {update!r:.40}; it is one of {', '.join(_UPDATES)}")
