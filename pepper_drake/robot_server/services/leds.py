"""ALLeds: the lights of eyes, ears and chest, with intensities that fade in time."""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pepper_drake.robot_server.services.waiting import Module, RobotTimer

_COLORS = ("Red", "Green", "Blue")
_SIDES = ("Left", "Right")
_EYE = {side: [f"Face/Led/{{}}/{side}/{k * 45}Deg" for k in range(8)] for side in _SIDES}
_EAR = {side: [f"Ears/Led/{side}/{k * 36}Deg" for k in range(10)] for side in _SIDES}
_CHEST = "ChestBoard/Led/{}"
_NAMED = {
    "white": 0xFFFFFF,
    "red": 0xFF0000,
    "green": 0x00FF00,
    "blue": 0x0000FF,
    "yellow": 0xFFFF00,
    "magenta": 0xFF00FF,
    "cyan": 0x00FFFF,
}
_RASTA = (0xFF0000, 0xFFFF00, 0x00FF00)
_LONGEST_GROUPS = 200


def _key(light: str) -> str:
    return f"{light}/Actuator/Value"


def _colored(lights: Iterable[str], colors: Sequence[str] = _COLORS) -> list[str]:
    """Returns the names of the lights of LEDs with three colours each."""
    return [_key(light.format(color)) for light in lights for color in colors]


def _first_groups() -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for side, ear in _EAR.items():
        groups[f"{side}EarLeds"] = list(map(_key, ear))
        groups[f"{side}EarLedsEven"] = list(map(_key, ear[1::2]))
        groups[f"{side}EarLedsOdd"] = list(map(_key, ear[::2]))
        groups |= {f"{side}EarLed{k + 1}": [_key(light)] for k, light in enumerate(ear)}
    for side, eye in _EYE.items():
        groups[f"{side}FaceLeds"] = _colored(eye)
        groups |= {f"{side}FaceLeds{color}": _colored(eye, (color,)) for color in _COLORS}
        for k in range(8):
            # The maker numbers the right eye's lights downwards from 45 degrees, the left eye's
            # upwards.
            place = eye[(1 - k) % 8] if side == "Right" else eye[k]
            groups[f"FaceLed{side}{k}"] = _colored([place])
        groups[f"FaceLeds{side}Top"] = _colored(eye[k] for k in (1, 2, 3))
        groups[f"FaceLeds{side}Bottom"] = _colored(eye[k] for k in (5, 6, 7))
        outside, inside = ((3, 4, 5), (7, 0, 1))
        if side == "Right":
            outside, inside = inside, outside
        groups[f"FaceLeds{side}External"] = _colored(eye[k] for k in outside)
        groups[f"FaceLeds{side}Internal"] = _colored(eye[k] for k in inside)
    for part in ("Top", "Bottom", "External", "Internal"):
        groups[f"FaceLeds{part}"] = [
            light for side in _SIDES for light in groups[f"FaceLeds{side}{part}"]
        ]
    groups["ChestLeds"] = _colored([_CHEST])
    groups |= {f"ChestLeds{color}": _colored([_CHEST], (color,)) for color in _COLORS}
    groups["EarLeds"] = groups["LeftEarLeds"] + groups["RightEarLeds"]
    groups["FaceLeds"] = groups["LeftFaceLeds"] + groups["RightFaceLeds"]
    groups["AllLeds"] = groups["EarLeds"] + groups["FaceLeds"] + groups["ChestLeds"]
    for color in _COLORS:
        ears = groups["EarLeds"] if color == "Blue" else []
        groups[f"AllLeds{color}"] = ears + [k for k in groups["AllLeds"] if f"/{color}" in k]
    return groups


@dataclass
class _Fade:
    """An intensity that changes from one value to another between two times [s]."""

    first: float = 1.0
    last: float = 1.0
    begin: float = 0.0
    end: float = 0.0

    def at(self, now: float) -> float:
        if now >= self.end:
            return self.last
        share = max(now - self.begin, 0.0) / (self.end - self.begin)
        return self.first + share * (self.last - self.first)


class Leds(Module):
    """ALLeds; methods with a duration return when it has passed, by the robot's clock."""

    def __init__(self, timer: RobotTimer, log: Callable[[str], None]) -> None:
        super().__init__("ALLeds")
        self._timer = timer
        self._log = log
        self._groups = _first_groups()
        self._lights = {light: _Fade() for light in self._groups["AllLeds"]}
        self._played: dict[str, asyncio.Task[None]] = {}

    def keys(self) -> dict[str, Callable[[], float]]:
        """Returns functions of the lights' intensities by device name."""
        return {light: partial(self._intensity, light) for light in self._lights}

    def lead(self, light: str, keys: Sequence[tuple[float, float]]) -> bool:
        """Fades a light through intensities, each at its time from now [s].

        Returns whether the light exists.
        """
        if light not in self._lights:
            return False

        async def play() -> None:
            before = 0.0
            for intensity, time in keys:
                self._begin([light], intensity, time - before)
                await self._timer.sleep(time - before)
                before = time

        played = self._played.pop(light, None)
        if played is not None:
            played.cancel()
        self._played[light] = asyncio.get_running_loop().create_task(play())
        return True

    async def fade(self, name: str, intensity: float, duration: float) -> None:
        """Changes an intensity, from 0 to 1, within a time [s]."""
        self._log(f"lights of {name}: {intensity:g}")
        self._begin(self._of(name), intensity, duration)
        await self._timer.sleep(duration)

    async def fade_rgb(self, name: str, *color_and_duration: Any) -> None:
        """Changes a colour, given as a name, a number or three shares, within a time [s]."""
        *color, duration = color_and_duration
        await self._to_color(name, _shares(color), duration)

    async def fade_list_rgb(self, name: str, colors: Any, times: Any) -> None:
        """Changes colours, given as numbers or names, each at its time from now [s]."""
        if not isinstance(colors, list | tuple) or not isinstance(times, list | tuple):
            raise ValueError("colours and times must be lists")
        if len(colors) != len(times):
            raise ValueError("there must be as many times as colours")
        before = 0.0
        for color, time in zip(colors, times, strict=True):
            if not isinstance(time, int | float):
                raise ValueError(f"{time!r:.40} is not a time")
            await self._to_color(name, _shares([color]), time - before)
            before = time

    def on(self, name: str) -> None:
        """Switches lights on."""
        self.set_intensity(name, 1.0)

    def off(self, name: str) -> None:
        """Switches lights off."""
        self.set_intensity(name, 0.0)

    def reset(self, name: str) -> None:
        """Resets lights to their initial state."""
        self.set_intensity(name, 1.0)

    def set_intensity(self, name: str, intensity: float) -> None:
        """Sets an intensity, from 0 to 1."""
        self._log(f"lights of {name}: {intensity:g}")
        self._begin(self._of(name), intensity, 0.0)

    def get_intensity(self, name: str) -> float:
        """Returns the intensity of a light, or of the brightest of a group."""
        return max(map(self._intensity, self._of(name)), default=0.0)

    async def rasta(self, duration: float) -> None:
        """Shows green, yellow and red in the eyes for a time [s]."""
        step = duration / 6
        for number in range(6):
            await self._to_color("FaceLeds", _shares([_RASTA[number % 3]]), step)

    async def random_eyes(self, duration: float) -> None:
        """Shows colours in the eyes for a time [s]."""
        colors = list(_NAMED.values())
        for number in range(4):
            await self._to_color("FaceLeds", _shares([colors[1 + number]]), duration / 4)

    async def rotate_eyes(self, rgb: int, rotation: float, duration: float) -> None:
        """Rotates a colour in the eyes with a period [s], for a duration [s]."""
        if rotation <= 0.0:
            raise ValueError(f"a turn takes {rotation:g} s; it must be above 0")
        step, left, number = max(rotation / 8, 0.05), duration, 0
        self._log(f"lights of FaceLeds: #{rgb:06x} turning")
        while left > 0.0:
            for side in _SIDES:
                self._begin(self._groups[f"{side}FaceLeds"], 0.0, 0.0)
                lights = self._groups[f"FaceLed{side}{number % 8}"]
                for light, share in zip(lights, _shares([rgb]), strict=True):
                    self._begin([light], share, 0.0)
            await self._timer.sleep(min(step, left))
            left, number = left - step, number + 1

    async def ear_leds_set_angle(self, degrees: int, duration: float, _leave_on: bool) -> None:
        """Lights the ears at an angle [degrees] within a time [s]."""
        for side in _SIDES:
            lights = self._groups[f"{side}EarLeds"]
            nearest = round(degrees / 36) % len(lights)
            for number, light in enumerate(lights):
                self._begin([light], float(number == nearest), duration)
        await self._timer.sleep(duration)

    def create_group(self, name: str, lights: list[str]) -> None:
        """Gives lights and groups a common name."""
        if len(self._groups) >= _LONGEST_GROUPS:
            raise ValueError("there are too many groups")
        self._groups[name] = [light for part in lights for light in self._of(part)]

    def list_groups(self) -> list[str]:
        """Returns the names of groups."""
        return sorted(self._groups)

    def list_group(self, name: str) -> list[str]:
        """Returns the lights of a group."""
        return list(self._of(name))

    def list_leds(self) -> list[str]:
        """Returns the short names of lights."""
        return sorted(name for name in self._groups if name[-1].isdigit())

    def list_led(self, name: str) -> list[str]:
        """Returns the lights of a short name."""
        return list(self._of(name))

    def _of(self, name: str) -> list[str]:
        """Returns the lights of a group, or a light itself."""
        device = name.removeprefix("Device/SubDeviceList/").removesuffix("/Actuator/Value")
        if _key(device) in self._lights:
            return [_key(device)]
        if name not in self._groups:
            raise ValueError(f"there is no group or light {name!r:.60}")
        return self._groups[name]

    def _intensity(self, light: str) -> float:
        return self._lights[light].at(self._timer.now)

    def _begin(self, lights: Iterable[str], intensity: float, duration: float) -> None:
        now, last = self._timer.now, min(max(float(intensity), 0.0), 1.0)
        for light in lights:
            end = now + max(duration, 0.0)
            self._lights[light] = _Fade(self._intensity(light), last, now, end)

    async def _to_color(self, name: str, shares: Sequence[float], duration: float) -> None:
        self._log(f"lights of {name}: #" + "".join(f"{round(255 * s):02x}" for s in shares))
        for light in self._of(name):
            color = next((k for k, c in enumerate(_COLORS) if f"/{c}" in light), 2)
            self._begin([light], shares[color], duration)
        await self._timer.sleep(duration)


def _shares(color: Sequence[Any]) -> tuple[float, float, float]:
    """Returns red, green and blue, from 0 to 1, from a name, 0xRRGGBB or three numbers."""
    if len(color) == 3:
        red, green, blue = (min(max(float(part), 0.0), 1.0) for part in color)
        return red, green, blue
    only = color[0]
    if isinstance(only, str):
        if only not in _NAMED:
            raise ValueError(f"there is no colour {only!r:.40}; it must be one of {list(_NAMED)}")
        only = _NAMED[only]
    if not isinstance(only, int) or isinstance(only, bool) or not 0 <= only <= 0xFFFFFFFF:
        raise ValueError(f"{only!r:.40} is not a colour; give 0xRRGGBB or a name")
    red, green, blue = ((only >> shift & 255) / 255 for shift in (16, 8, 0))
    return red, green, blue
