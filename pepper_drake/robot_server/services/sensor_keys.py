"""Keys of Pepper's sensors in ALMemory, and touch events."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from pepper_drake.naoqi.constants import HANDS, JOINTS, WHEELS
from pepper_drake.robot_server.robot.range_sensors import MEASURED
from pepper_drake.robot_server.robot.robot_port import SENSORS
from pepper_drake.robot_server.services.extractors import NOTHING_FOUND
from pepper_drake.robot_server.services.memory import Memory
from pepper_drake.robot_server.services.motion import Motion
from pepper_drake.robot_server.services.motion_base import WHEEL_PLACES

DEVICES = "Device/SubDeviceList/"

RANGES: tuple[str, ...] = (
    *MEASURED,
    "Platform/InfraredSpot/Left",
    "Platform/InfraredSpot/Right",
)
"""Devices that measure distances [m]; reading one that is not simulated is an error."""

_TOUCH_EVENTS = {
    "Head/Touch/Front": "FrontTactilTouched",
    "Head/Touch/Middle": "MiddleTactilTouched",
    "Head/Touch/Rear": "RearTactilTouched",
    "LHand/Touch/Back": "HandLeftBackTouched",
    "RHand/Touch/Back": "HandRightBackTouched",
    "ChestBoard/Button": "ChestButtonPressed",
    "Platform/FrontLeft/Bumper": "LeftBumperPressed",
    "Platform/FrontRight/Bumper": "RightBumperPressed",
    "Platform/Back/Bumper": "BackBumperPressed",
}
"""Event by sensor; its value is 1.0 when touched and 0.0 when released."""

_TOUCH_PARTS = {
    "Head/Touch/Front": ("Head", "Head/Touch/Front"),
    "Head/Touch/Middle": ("Head", "Head/Touch/Middle"),
    "Head/Touch/Rear": ("Head", "Head/Touch/Rear"),
    "LHand/Touch/Back": ("LArm", "LHand/Touch/Back"),
    "RHand/Touch/Back": ("RArm", "RHand/Touch/Back"),
    "Platform/FrontLeft/Bumper": ("Leg", "Bumper/FrontLeft"),
    "Platform/FrontRight/Bumper": ("Leg", "Bumper/FrontRight"),
    "Platform/Back/Bumper": ("Leg", "Bumper/Back"),
}

_CLICKS = ("SimpleClickOccurred", "DoubleClickOccurred", "TripleClickOccurred")
_CLICK_GAP = 0.5
"""Longest time between the clicks of a multiple click [s]."""

_TEMPERATURE = 35.0
"""Temperature of every motor [degrees Celsius]: heating is not simulated."""

_GRAVITY = 9.81

CONSTANTS: dict[str, Any] = {
    "RobotConfig/Body/Type": "Juliette",
    "RobotConfig/Body/BaseVersion": "V16",
    "RobotConfig/Body/Version": "VERSION_16",
    "RobotConfig/Head/Type": "Juliette",
    "RobotConfig/Head/BaseVersion": "V16",
    "RobotConfig/Head/Version": "VERSION_16",
    "RobotConfig/Head/FullHeadId": "pepper_drake",
    "RobotConfig/Body/BodyId": "pepper_drake",
    "Device/DeviceList/ChestBoard/BodyId": "pepper_drake",
    "Device/SubDeviceList/Battery/Charge/Sensor/Value": 1.0,
    "Device/SubDeviceList/Battery/Charge/Sensor/Status": 0,
    "Device/SubDeviceList/Battery/Current/Sensor/Value": 0.0,
    "Device/SubDeviceList/Battery/Temperature/Sensor/Value": _TEMPERATURE,
    "Device/SubDeviceList/Platform/ILS/Sensor/Value": 0.0,
    "BatteryChargeChanged": 100,
    "BatteryPowerPluggedChanged": False,
    "BatteryFullChargedFlagChanged": True,
    "BatteryTrapIsOpen": False,
    "robotIsWakeUp": False,
    "ALMotion/RobotIsStand": True,
}
"""Keys with initial values."""


def install_keys(memory: Memory, motion: Motion) -> None:
    """Puts the robot's keys into ALMemory."""
    keys: dict[str, Callable[[], Any]] = {}
    for k, joint in enumerate(JOINTS):
        device = DEVICES + joint
        keys[f"{device}/Position/Sensor/Value"] = partial(_sensor, motion, k)
        keys[f"{device}/Position/Actuator/Value"] = partial(_command, motion, k)
        keys[f"{device}/Hardness/Actuator/Value"] = partial(_stiffness, motion, k)
        keys[f"{device}/ElectricCurrent/Sensor/Value"] = partial(_current, motion, k, joint)
        if joint not in HANDS:
            keys[f"Motion/Velocity/Sensor/{joint}"] = partial(_velocity, motion, k)
            keys[f"Motion/Torque/Sensor/{joint}"] = partial(_torque, motion, k, joint)
        keys[f"{device}/Temperature/Sensor/Value"] = lambda: _TEMPERATURE
        keys[f"{device}/Temperature/Sensor/Status"] = lambda: 0
    for k, wheel in enumerate(WHEELS):
        device = DEVICES + wheel
        keys[f"{device}/Speed/Sensor/Value"] = partial(_wheel_speed, motion, k, True)
        keys[f"{device}/Speed/Actuator/Value"] = partial(_wheel_speed, motion, k, False)
        keys[f"{device}/Stiffness/Actuator/Value"] = lambda: float(motion.robot_is_wake_up())
        keys[f"{device}/Temperature/Sensor/Value"] = lambda: _TEMPERATURE
        keys[f"{device}/Temperature/Sensor/Status"] = lambda: 0
    for sensor in SENSORS:
        keys[f"{DEVICES}{sensor}/Sensor/Value"] = partial(_touched, motion, sensor)
    inertial = f"{DEVICES}InertialSensorBase/"
    level: dict[str, Callable[[], float]] = {
        "AngleX": lambda: 0.0,
        "AngleY": lambda: 0.0,
        "AngleZ": lambda: motion.state.base_pose[2],
        "GyroscopeX": lambda: 0.0,
        "GyroscopeY": lambda: 0.0,
        "GyroscopeZ": lambda: motion.state.base_velocity[2],
        "AccelerometerX": lambda: 0.0,
        "AccelerometerY": lambda: 0.0,
        "AccelerometerZ": lambda: -_GRAVITY,
    }
    keys |= {f"{inertial}{name}/Sensor/Value": value for name, value in level.items()}
    for name in RANGES:
        keys[f"{DEVICES}{name}/Sensor/Value"] = partial(_range, motion, name)
    memory.compute(keys)
    for key, value in (CONSTANTS | NOTHING_FOUND).items():
        memory.put(key, value)
    clicks = (f"ALChestButton/{name}" for name in _CLICKS)
    for event in (*NOTHING_FOUND, *_TOUCH_EVENTS.values(), *clicks):
        memory.declare_event(event)
    for event in _TOUCH_EVENTS.values():
        memory.put(event, 0.0)
    memory.put("TouchChanged", [])


class TouchEvents:
    """Raises the events of touch, bumpers and the chest button."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._touched: frozenset[str] = frozenset()
        self._clicks = 0
        self._released = -math.inf

    def step(self, touched: frozenset[str], now: float) -> None:
        """Raises the events of changes since the last step."""
        changed = [sensor for sensor in SENSORS if (sensor in touched) != (sensor in self._touched)]
        parts = []
        for sensor in changed:
            self._memory.raise_event(_TOUCH_EVENTS[sensor], float(sensor in touched))
            for part in _TOUCH_PARTS.get(sensor, ()):
                parts.append([part, sensor in touched, []])
        if parts:
            self._memory.raise_event("TouchChanged", parts)
        if "ChestBoard/Button" in changed and "ChestBoard/Button" not in touched:
            self._clicks += 1
            self._released = now
        self._touched = touched
        waiting = "ChestBoard/Button" in touched or now - self._released < _CLICK_GAP
        if self._clicks and not waiting:
            name = _CLICKS[min(self._clicks, len(_CLICKS)) - 1]
            self._memory.raise_event(f"ALChestButton/{name}", self._clicks)
            self._clicks = 0


def _sensor(motion: Motion, k: int) -> float:
    return float(motion.state.positions[k])


def _command(motion: Motion, k: int) -> float:
    return float(motion.joints.command[k])


def _stiffness(motion: Motion, k: int) -> float:
    return float(motion.joints.stiffness[k])


def _velocity(motion: Motion, k: int) -> float:
    return float(motion.state.velocities[k])


def _torque(motion: Motion, k: int, joint: str) -> float:
    if motion.state.torques is None:
        raise ValueError(f"the torque of {joint} is not simulated")
    return float(motion.state.torques[k])


def _current(motion: Motion, k: int, joint: str) -> float:
    if motion.state.currents is None:
        raise ValueError(f"the current of {joint} is not simulated")
    return float(motion.state.currents[k])


def _touched(motion: Motion, sensor: str) -> float:
    return float(sensor in motion.state.touched)


def _range(motion: Motion, name: str) -> float:
    if name not in motion.state.ranges:
        # Not measured, which is not the same as nothing being near.
        raise ValueError(f"{DEVICES}{name}/Sensor/Value: not simulated")
    return float(motion.state.ranges[name])


_WHEEL_RADIUS = 0.07


def _wheel_speed(motion: Motion, k: int, measured: bool) -> float:
    """Returns a wheel's speed from the base's velocity [rad/s]."""
    vx, vy, wz = motion.state.base_velocity if measured else motion.base.velocity
    x, y, axle = WHEEL_PLACES[k]
    along = (vx - wz * y) * math.sin(axle) - (vy + wz * x) * math.cos(axle)
    return along / _WHEEL_RADIUS
