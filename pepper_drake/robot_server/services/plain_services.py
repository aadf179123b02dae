"""Services with little behind them: life, battery, abilities, sonar."""

from collections.abc import Callable
from typing import Any

from pepper_drake.robot_server.robot.robot_port import SENSORS
from pepper_drake.robot_server.services.extractors import Extractor
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.waiting import Module

_LIFE = ("solitary", "interactive", "safeguard", "disabled")

ABILITIES = (
    "AutonomousBlinking",
    "BackgroundMovement",
    "BasicAwareness",
    "ListeningMovement",
    "SpeakingMovement",
)


class AutonomousLife(Module):
    """ALAutonomousLife: the state, without a life.

    Attributes:
        abilities: Whether each autonomous ability is switched on.
    """

    def __init__(self, raise_event: Callable[[str, Any], None]) -> None:
        super().__init__("ALAutonomousLife")
        self._raise_event = raise_event
        self._state = "solitary"
        self._safeguards: dict[str, bool] = {}
        self._offset = 0.0
        self.abilities = dict.fromkeys(ABILITIES, True)

    def set_state(self, state: str) -> None:
        """Sets the state: solitary, interactive, safeguard or disabled."""
        if state not in _LIFE:
            raise ValueError(f"there is no state {state!r}; it must be one of {', '.join(_LIFE)}")
        if state != self._state:
            self._state = state
            self._raise_event("AutonomousLife/State", state)

    def get_state(self) -> str:
        """Returns the state."""
        return self._state

    def focused_activity(self) -> str:
        """Returns the activity that has the focus: none."""
        return ""

    def stop_focus(self) -> None:
        """Takes the focus from the activity; there is none."""

    def stop_all(self) -> None:
        """Stops the activities; there are none."""

    def set_autonomous_ability_enabled(self, ability: str, enabled: bool) -> None:
        """Switches an ability, or "All"; the simulated robot does not use them."""
        self.abilities |= dict.fromkeys(_abilities(ability), enabled)

    def get_autonomous_ability_enabled(self, ability: str) -> bool:
        """Returns whether an ability is switched on, for "All" whether all are."""
        return all(self.abilities[name] for name in _abilities(ability))

    def get_autonomous_abilities_status(self) -> list[dict[str, Any]]:
        """Returns each ability, whether it is on, and that it is not running."""
        return [
            {"name": name, "enabled": enabled, "running": False}
            for name, enabled in self.abilities.items()
        ]

    def set_safeguard_enabled(self, name: str, enabled: bool) -> None:
        """Switches a safeguard."""
        self._safeguards[name] = enabled

    def is_safeguard_enabled(self, name: str) -> bool:
        """Returns whether a safeguard is on."""
        return self._safeguards.get(name, True)

    def set_robot_offset_from_floor(self, offset: float) -> None:
        """Sets how high the robot stands [m]."""
        self._offset = offset

    def get_robot_offset_from_floor(self) -> float:
        """Returns how high the robot stands [m]."""
        return self._offset


class Ability(Module):
    """One of the services that switch an autonomous ability."""

    def __init__(self, name: str, life: AutonomousLife) -> None:
        super().__init__(f"AL{name}")
        self._ability = name
        self._life = life
        self._mode = ""

    def set_enabled(self, enabled: bool) -> None:
        """Switches the ability."""
        self._life.set_autonomous_ability_enabled(self._ability, enabled)

    def is_enabled(self) -> bool:
        """Returns whether the ability is switched on."""
        return self._life.get_autonomous_ability_enabled(self._ability)

    def is_running(self, *_call: int) -> bool:
        """Returns whether the ability is running: it never is."""
        return False

    def set_mode(self, mode: str) -> None:
        """Sets the mode, without effect."""
        self._mode = mode

    def get_mode(self) -> str:
        """Returns the mode."""
        return self._mode

    def add_tags_to_words(self, _tags: Any) -> None:
        """Accepts gestures for words without effect."""

    def reset_tags_to_words(self) -> None:
        """Has no effect."""


class AutonomousMoves(Module):
    """ALAutonomousMoves: its switches; the simulated robot makes no moves of its own."""

    def __init__(self) -> None:
        super().__init__("ALAutonomousMoves")
        keep_settings(
            self,
            {
                "set_expressive_listening_enabled": ("get_expressive_listening_enabled", True),
                "set_background_strategy": ("get_background_strategy", "none"),
            },
        )

    def start_small_displacements(self) -> None:
        """Has no effect."""

    def stop_small_displacements(self) -> None:
        """Has no effect."""


class BasicAwareness(Ability):
    """ALBasicAwareness: its switches; the simulated robot notices nobody."""

    def __init__(self, life: AutonomousLife) -> None:
        super().__init__("BasicAwareness", life)
        self._paused = False
        self._engagement = "Unengaged"
        self._tracking = "Head"
        self._stimuli = dict.fromkeys(("Sound", "Movement", "People", "Touch"), True)
        self._parameters: dict[str, Any] = {}

    def start_awareness(self) -> None:
        """Switches it on (old API)."""
        self.set_enabled(True)

    def stop_awareness(self) -> None:
        """Switches it off (old API)."""
        self.set_enabled(False)

    def is_awareness_running(self) -> bool:
        """Returns whether it is switched on and not paused."""
        return self.is_enabled() and not self._paused

    def pause_awareness(self) -> None:
        """Pauses it."""
        self._paused = True

    def resume_awareness(self) -> None:
        """Resumes after a pause."""
        self._paused = False

    def is_awareness_paused(self) -> bool:
        """Returns whether it is paused."""
        return self._paused

    def set_engagement_mode(self, mode: str) -> None:
        """Sets the engagement mode."""
        if mode not in ("Unengaged", "FullyEngaged", "SemiEngaged"):
            raise ValueError(f"there is no mode {mode!r}")
        self._engagement = mode

    def get_engagement_mode(self) -> str:
        """Returns the engagement mode."""
        return self._engagement

    def set_tracking_mode(self, mode: str) -> None:
        """Sets the tracking mode."""
        if mode not in ("Head", "BodyRotation", "WholeBody", "MoveContextually"):
            raise ValueError(f"there is no mode {mode!r}")
        self._tracking = mode

    def get_tracking_mode(self) -> str:
        """Returns the tracking mode."""
        return self._tracking

    def set_stimulus_detection_enabled(self, stimulus: str, enabled: bool) -> None:
        """Switches a stimulus."""
        self._stimuli[stimulus] = enabled

    def is_stimulus_detection_enabled(self, stimulus: str) -> bool:
        """Returns whether a stimulus is switched on."""
        if stimulus not in self._stimuli:
            raise ValueError(f"there is no stimulus {stimulus!r}")
        return self._stimuli[stimulus]

    def engage_person(self, _person: int) -> bool:
        """Returns whether it engaged a person: nobody is seen."""
        return False

    def trigger_stimulus(self, _position: Any) -> int:
        """Returns the person found at a stimulus: nobody."""
        return -1

    def trigger_stimulus_from_frame(self, *_: Any) -> int:
        """As `triggerStimulus`."""
        return -1

    def set_parameter(self, name: str, value: Any) -> None:
        """Stores a parameter."""
        self._parameters[name] = value

    def get_parameter(self, name: str) -> Any:
        """Returns a stored parameter."""
        if name not in self._parameters:
            raise ValueError(f"there is no parameter {name!r}")
        return self._parameters[name]

    def reset_all_parameters(self) -> None:
        """Removes the parameters."""
        self._parameters.clear()


class Battery(Module):
    """ALBattery: always full."""

    def __init__(self) -> None:
        super().__init__("ALBattery")

    def get_battery_charge(self) -> int:
        """Returns the charge [percent]."""
        return 100

    def enable_power_monitoring(self, _enabled: bool) -> None:
        """Switches monitoring."""


class BodyTemperature(Module):
    """ALBodyTemperature: no motor warms up."""

    def __init__(self) -> None:
        super().__init__("ALBodyTemperature")
        self._notify = True

    def get_temperature_diagnosis(self) -> list[Any]:
        """Returns which parts are hot: none."""
        return []

    def set_enable_notifications(self, enabled: bool) -> None:
        """Switches notifications."""
        self._notify = enabled

    def are_notifications_enabled(self) -> bool:
        """Returns whether notifications are on."""
        return self._notify


class RobotModel(Module):
    """ALRobotModel."""

    def __init__(self) -> None:
        super().__init__("ALRobotModel")

    def get_robot_type(self) -> str:
        """Returns the maker's name for Pepper."""
        return "Juliette"

    def get_config(self) -> str:
        """Returns the robot's configuration as XML."""
        return (
            '<ModulePreference name="RobotConfig">'
            '<Preference name="RobotType" value="Juliette"/>'
            "</ModulePreference>"
        )

    def get_microphone_config(self) -> int:
        """Returns the head's type of microphones: assumed 1 for Pepper; 0 is the older type."""
        return 1

    def has_arms(self) -> bool:
        """Returns whether the robot has arms."""
        return True

    def has_hands(self) -> bool:
        """Returns whether the robot has hands."""
        return True

    def has_legs(self) -> bool:
        """Returns whether the robot has legs to walk: it rolls."""
        return False


class Sonar(Extractor):
    """ALSonar: its subscribers; the values are in ALMemory, if they are simulated."""

    def __init__(self) -> None:
        device = "Device/SubDeviceList/Platform/{}/Sonar/Sensor/Value"
        super().__init__("ALSonar", keys=[device.format(side) for side in ("Front", "Back")])


class Touch(Module):
    """ALTouch."""

    def __init__(self, touched: Callable[[], frozenset[str]]) -> None:
        super().__init__("ALTouch")
        self._touched = touched

    def get_sensor_list(self) -> list[str]:
        """Returns the sensors."""
        return list(SENSORS)

    def get_status(self) -> list[list[Any]]:
        """Returns each sensor, whether it is touched, and its parts: none."""
        return [[sensor, sensor in self._touched(), []] for sensor in SENSORS]


def _abilities(name: str) -> tuple[str, ...]:
    if name == "All":
        return ABILITIES
    if name not in ABILITIES:
        raise ValueError(f"there is no ability {name!r}; it must be one of {', '.join(ABILITIES)}")
    return (name,)
