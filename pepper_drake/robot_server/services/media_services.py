"""Tablet, sound and animations: what programs show and play, as lines in the log."""

import itertools
from collections.abc import Callable
from pathlib import PurePosixPath
from typing import Any

from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.waiting import Module

Log = Callable[[str], None]


class Tablet(Module):
    """ALTabletService: its display is described in the log; nobody touches it."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALTabletService")
        self._log = log
        keep_settings(self, {"set_brightness": ("get_brightness", 1.0)}, True)
        keep_settings(self, {"set_volume": ("get_volume", 15)}, True)
        keep_settings(self, {"set_background_color": ("get_background_color", "#000000")}, True)
        keep_settings(self, {"configure_wifi": ("get_wifi", [])}, True)
        keep_settings(
            self, {"set_on_touch_webview_scale_factor": ("get_on_touch_scale_factor", 1.34)}
        )

    def robot_ip(self) -> str:
        """Returns the robot's address as the tablet sees it."""
        return "198.18.0.1"

    def get_wifi_status(self) -> str:
        """Returns the state of the tablet's own network."""
        return "DISCONNECTED"

    def get_wifi_mac_address(self) -> str:
        """Returns the MAC address of the tablet's network: it has none."""
        return ""

    def get_available_keyboards(self) -> list[str]:
        """Returns the keyboards: none."""
        return []

    def get_last_video_error_log(self) -> str:
        """Returns the last error of a video: none."""
        return ""

    def get_current_life_activity(self) -> str:
        """Returns the activity that is shown: none."""
        return ""

    def get_video_position(self) -> int:
        """Returns how much of a video was shown [ms]: none plays."""
        return 0

    def get_video_length(self) -> int:
        """Returns a video's duration [ms]: none plays."""
        return 0

    def _show(self, what: str, *arguments: Any) -> bool:
        self._log(f"tablet: {what}" + "".join(f" {argument}" for argument in arguments))
        return True


_SHOWN = {
    "show_image": "shows image",
    "show_image_no_cache": "shows image",
    "pre_load_image": "loads image",
    "hide_image": "hides the image",
    "hide": "shows nothing",
    "show_webview": "shows page",
    "hide_webview": "hides the page",
    "load_url": "loads page",
    "reload_page": "reloads the page",
    "load_application": "loads application",
    "play_video": "plays video",
    "stop_video": "stops the video",
    "pause_video": "pauses the video",
    "resume_video": "resumes the video",
    "clean_webview": "clears the page",
    "execute_js": "runs script",
    "go_to_sleep": "sleeps",
    "wake_up": "wakes up",
    "turn_screen_on": "switches its screen to",
    "reset_tablet": "restarts",
    "enable_wifi": "switches its network on",
    "disable_wifi": "switches its network off",
    "connect_wifi": "connects to network",
    "disconnect_wifi": "leaves its network",
    "forget_wifi": "forgets network",
    "pause_gif": "pauses the moving image",
    "resume_gif": "resumes the moving image",
    "hide_dialog": "hides the dialog",
    "show_alert_view": "shows alert",
    "show_input_dialog": "shows an input field",
    "show_input_text_dialog": "shows an input field",
    "set_keyboard": "takes keyboard",
    "set_tablet_language": "takes language",
    "post_event_to_application": "tells the application",
    "reset_to_default_value": "takes its first settings",
}
for _name, _what in _SHOWN.items():
    setattr(
        Tablet,
        _name,
        # Bound as a default, so that each method has its own words.
        lambda self, *arguments, _words=_what: self._show(_words, *arguments),
    )


class AudioPlayer(Module):
    """ALAudioPlayer: logs the names of files; no sound is played, and calls take no time."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALAudioPlayer")
        self._log = log
        self._numbers = itertools.count(1)
        self._files: dict[int, str] = {}
        self._volumes: dict[int, float] = {}
        keep_settings(self, {"set_master_volume": ("get_master_volume", 1.0)})

    def load_file(self, name: str) -> int:
        """Returns a number for a file."""
        number = next(self._numbers)
        self._files[number] = name
        return number

    def play(self, number: int, *_: float) -> None:
        """Plays a loaded file."""
        self._log(f"plays {self._file(number)} (no sound is simulated)")

    def play_file(self, name: str, *_: float) -> None:
        """Plays a file; volume and pan may follow."""
        self.play(self.load_file(name))

    def play_file_in_loop(self, name: str, *_: float) -> None:
        """Plays a file, once."""
        self.play_file(name)

    def play_in_loop(self, number: int, *_: float) -> None:
        """Plays a loaded file, once."""
        self.play(number)

    def play_sine(self, frequency: int, _gain: int, _pan: int, duration: float) -> None:
        """Plays a tone [Hz, s]."""
        self._log(f"plays a tone of {frequency} Hz for {duration:g} s (no sound is simulated)")

    def play_file_from_position(self, name: str, _begin: float, *_: float) -> None:
        """Plays a file from a time on [s]."""
        self.play_file(name)

    def play_web_stream(self, address: str, *_: float) -> None:
        """Plays a stream."""
        self.play_file(address)

    def play_sound_set_file(self, *names: Any) -> None:
        """Plays a file of a set of sounds."""
        self.play_file("/".join(str(name) for name in names if isinstance(name, str)))

    def load_sound_set(self, _name: str) -> None:
        """Loads a set of sounds."""

    def unload_sound_set(self, _name: str) -> None:
        """Unloads a set of sounds."""

    def get_loaded_sound_sets_list(self) -> list[str]:
        """Returns the loaded sets of sounds: there are none."""
        return []

    def get_sound_set_file_names(self, _name: str) -> list[str]:
        """Returns the files of a set of sounds: there are none."""
        return []

    def is_sound_set_file_installed(self, _name: str, _file: str) -> bool:
        """Returns whether a set of sounds has a file: there are no sets."""
        return False

    def is_sound_set_loaded(self, _name: str) -> bool:
        """Returns whether a set of sounds is loaded: none is."""
        return False

    def get_installed_sound_sets_list(self) -> list[str]:
        """Returns the sets of sounds: there are none."""
        return []

    def is_sound_set_installed(self, _name: str) -> bool:
        """Returns whether there is a set of sounds: there are none."""
        return False

    def pause(self, number: int) -> None:
        """Pauses a file."""
        self._file(number)

    def stop(self, number: int) -> None:
        """Stops a file, or an asynchronous call."""
        super().stop(number)

    def stop_all(self) -> None:
        """Stops all files."""

    def go_to(self, number: int, _position: float) -> None:
        """Seeks in a file [s]."""
        self._file(number)

    def get_current_position(self, number: int) -> float:
        """Returns the position in a file [s]: 0, as playing takes no time."""
        self._file(number)
        return 0.0

    def get_file_length(self, number: int) -> float:
        """Returns a file's duration [s]: 0, as no sound is read."""
        self._file(number)
        return 0.0

    def set_panorama(self, pan: float) -> None:
        """Checks the panorama, from -1 (left) to 1 (right)."""
        if not -1.0 <= pan <= 1.0:
            raise ValueError(f"the panorama is {pan:g}; it must be in [-1, 1]")

    def get_loaded_files_names(self) -> list[str]:
        """Returns the names of the loaded files."""
        return list(self._files.values())

    def get_loaded_files_ids(self) -> list[int]:
        """Returns the numbers of the loaded files."""
        return list(self._files)

    def unload_file(self, number: int) -> None:
        """Unloads a file."""
        self._file(number)
        del self._files[number]

    def unload_all_files(self) -> None:
        """Unloads all files."""
        self._files.clear()

    def set_volume(self, number: int, volume: float) -> None:
        """Sets a file's volume."""
        self._file(number)
        self._volumes[number] = volume

    def get_volume(self, number: int) -> float:
        """Returns a file's volume."""
        self._file(number)
        return self._volumes.get(number, 1.0)

    def _file(self, number: int) -> str:
        if number not in self._files:
            raise ValueError(f"no file {number} is loaded")
        return self._files[number]


class AnimationPlayer(Module):
    """ALAnimationPlayer: logs the names of animations; the maker's files are not available."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALAnimationPlayer")
        self._log = log

    def run(self, name: str) -> None:
        """Returns at once: no animation moves the simulated robot."""
        self._log(f"animation {name} is the maker's and not available: nothing moves")

    def run_tag(self, *names: str) -> None:
        """As `run`, for any animation with a tag."""
        self.run(" ".join(names))

    def add_tag_for_animations(self, _tags: Any) -> None:
        """Accepts tags without effect."""

    def declare_path_for_tags(self, _path: str) -> None:
        """Accepts a folder of animations without effect."""

    def reset(self) -> None:
        """Has no effect."""


class Notifications(Module):
    """ALNotificationManager."""

    def __init__(self) -> None:
        super().__init__("ALNotificationManager")
        self._numbers = itertools.count(1)
        self._all: dict[int, dict[str, Any]] = {}

    def add(self, notification: Any) -> int:
        """Adds a notification, a dict or [[key, value], ...]; returns its number."""
        try:
            content = dict(notification)
        except (TypeError, ValueError):
            raise ValueError("a notification is [[key, value], ...]") from None
        number = next(self._numbers)
        self._all[number] = content | {"id": number}
        return number

    def remove(self, number: int) -> None:
        """Removes a notification."""
        self._all.pop(number, None)

    def notifications(self) -> list[list[list[Any]]]:
        """Returns all notifications."""
        return [self.notification(number) for number in self._all]

    def notification(self, number: int) -> list[list[Any]]:
        """Returns a notification as [[key, value], ...]."""
        if number not in self._all:
            raise ValueError(f"there is no notification {number}")
        return [[key, value] for key, value in self._all[number].items()]


def topic_name(text: str) -> str:
    """Returns the name of a topic, from its text, or from its file's name without the language."""
    for line in text.splitlines():
        if line.strip().startswith("topic:"):
            return line.partition(":")[2].strip().lstrip("~").partition("(")[0].strip()
    stem = PurePosixPath(text.strip()).stem
    base, _, language = stem.rpartition("_")
    return base if base and len(language) == 3 else stem
