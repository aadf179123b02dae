"""ALTextToSpeech and ALAnimatedSpeech: the robot's speech as text in the log."""

import asyncio
import re
from collections.abc import Callable
from typing import Any

from pepper_drake.robot_server.services.waiting import Module, RobotTimer

_CHARACTERS_PER_SECOND = 14.0
"""Speed of speech, an estimate [1/s]."""

_LEAST = 0.3
"""Duration of the shortest word [s]."""

LANGUAGES = ("Chinese", "English", "French", "German", "Italian", "Japanese", "Spanish")

_LOCALES = dict(
    zip(
        LANGUAGES,
        ("zh_CN", "en_US", "fr_FR", "de_DE", "it_IT", "ja_JP", "es_ES"),
        strict=True,
    )
)

_PARAMETERS = {"pitchShift": 1.0, "doubleVoice": 0.0, "speed": 100.0, "volume": 100.0}

_MARKS = re.compile(r"\\[^\\]*\\|\^\w+(\([^)]*\))?")
"""Tags of the voice, such as \\rspd=80\\, and of gestures, such as ^start(...)."""


def spoken(text: str) -> str:
    """Returns a text without its tags of voice and gestures."""
    return " ".join(_MARKS.sub(" ", text).split())


class TextToSpeech(Module):
    """ALTextToSpeech: sentences take time, one after the other."""

    def __init__(
        self,
        timer: RobotTimer,
        raise_event: Callable[[str, Any], None],
        log: Callable[[str], None],
    ) -> None:
        super().__init__("ALTextToSpeech")
        self._timer = timer
        self._raise_event = raise_event
        self._log = log
        self._mouth = asyncio.Lock()
        self._stop = 0
        self._sentence = 0
        self._language = "English"
        self._voice = "naoenu"
        self._volume = 1.0
        self._parameters = dict(_PARAMETERS)
        self._dictionary: dict[str, tuple[str, ...]] = {}

    async def say(self, text: Any, language: str = "") -> None:
        """Says a text; returns when it has been said or was stopped."""
        if language:
            _known(language)
        words = spoken(str(text))
        stops = self._stop
        async with self._mouth:
            if stops != self._stop:
                return
            self._sentence += 1
            number = self._sentence
            self._log(f'says "{words}"')
            self._raise_event("ALTextToSpeech/CurrentSentence", words)
            self._raise_event("ALTextToSpeech/TextStarted", 1)
            self._raise_event("ALTextToSpeech/Status", [number, "started"])
            left = max(len(words) / _CHARACTERS_PER_SECOND, _LEAST) if words else 0.0
            while left > 0.0 and stops == self._stop:
                await self._timer.sleep(min(left, 0.1))
                left -= 0.1
            ended = "done" if stops == self._stop else "stopped"
            self._raise_event("ALTextToSpeech/Status", [number, ended])
            if ended == "stopped":
                self._raise_event("ALTextToSpeech/TextInterrupted", 1)
            self._raise_event("ALTextToSpeech/TextDone", 1)
            self._raise_event("ALTextToSpeech/CurrentSentence", "")

    def say_to_file(self, text: str, name: str) -> None:
        """Logs that no file is written: no sound is simulated."""
        self._log(f'"{spoken(text)}" is to be written; no sound is simulated, and {name} is not')

    async def say_to_file_and_play(self, text: str) -> None:
        """Says a text; the file is only temporary on a robot."""
        await self.say(text)

    def load_voice_preference(self, _name: str) -> None:
        """Has no effect: there are no preferences."""

    def set_language_default_voice(self, language: str, _voice: str) -> None:
        """Only checks the language."""
        _known(language)

    def stop_all(self) -> None:
        """Stops the current and all waiting sentences."""
        self._stop += 1

    def set_language(self, language: str) -> None:
        """Sets the language."""
        self._language = _known(language)

    def get_language(self) -> str:
        """Returns the language."""
        return self._language

    def get_available_languages(self) -> list[str]:
        """Returns the languages."""
        return list(LANGUAGES)

    def get_supported_languages(self) -> list[str]:
        """Returns the languages."""
        return list(LANGUAGES)

    def get_language_encoding(self, language: str) -> str:
        """Returns the encoding of a language's texts."""
        _known(language)
        return "UTF-8"

    def locale(self) -> str:
        """Returns the language's locale."""
        return _LOCALES[self._language]

    def set_parameter(self, name: str, value: float) -> None:
        """Sets a parameter of the voice."""
        self._parameters[name] = value

    def get_parameter(self, name: str) -> float:
        """Returns a parameter of the voice."""
        if name not in self._parameters:
            raise ValueError(f"there is no parameter {name!r}")
        return self._parameters[name]

    def reset_speed(self) -> None:
        """Resets the speed."""
        self._parameters["speed"] = _PARAMETERS["speed"]

    def set_volume(self, volume: float) -> None:
        """Sets the volume, from 0 to 1."""
        if not 0.0 <= volume <= 1.0:
            raise ValueError(f"the volume is {volume:g}; it must be in [0, 1]")
        self._volume = volume

    def get_volume(self) -> float:
        """Returns the volume."""
        return self._volume

    def set_voice(self, voice: str) -> None:
        """Sets the voice."""
        self._voice = voice

    def get_voice(self) -> str:
        """Returns the voice."""
        return self._voice

    def get_available_voices(self) -> list[str]:
        """Returns the voices."""
        return ["naoenu", "naomnc"]

    def add_to_dictionary(self, *words: str) -> bool:
        """Sets the pronunciation of a word; returns True."""
        self._dictionary[words[0] if len(words) == 2 else words[1]] = words
        return True

    def delete_from_dictionary(self, *words: str) -> bool:
        """Removes the pronunciation of a word; returns whether it was known."""
        return self._dictionary.pop(words[-1], None) is not None

    def show_dictionary(self) -> None:
        """Logs the words with a pronunciation."""
        self._log(f"pronounces {', '.join(self._dictionary) or 'all words as usual'}")

    def enable_notifications(self) -> None:
        """Has no effect: notifications are always on."""

    def disable_notifications(self) -> None:
        """Has no effect: notifications are always on."""


class AnimatedSpeech(Module):
    """ALAnimatedSpeech: says the text; gestures are not simulated."""

    def __init__(self, speech: TextToSpeech, raise_event: Callable[[str, Any], None]) -> None:
        super().__init__("ALAnimatedSpeech")
        self._raise_event = raise_event
        self._speech = speech
        self._mode = 1
        self._enabled = True

    async def say(self, text: Any, _configuration: Any = None) -> None:
        """Says a text without its gestures."""
        await self._speech.say(text)
        self._raise_event("ALAnimatedSpeech/EndOfAnimatedSpeech", 1)

    def set_body_language_mode(self, mode: int) -> None:
        """Sets the mode of gestures: 0 none, 1 random, 2 contextual."""
        if mode not in (0, 1, 2):
            raise ValueError(f"there is no mode {mode}; it must be 0, 1 or 2")
        self._mode = mode

    def get_body_language_mode(self) -> int:
        """Returns the mode of gestures."""
        return self._mode

    def set_body_language_mode_from_str(self, mode: str) -> None:
        """Sets the mode of gestures by name."""
        if mode not in _MODES:
            raise ValueError(f"there is no mode {mode!r}; it must be one of {', '.join(_MODES)}")
        self._mode = _MODES.index(mode)

    def get_body_language_mode_to_str(self) -> str:
        """Returns the name of the mode of gestures."""
        return _MODES[self._mode]

    def set_body_language_enabled(self, enabled: bool) -> None:
        """Switches gestures."""
        self._enabled = enabled

    def is_body_language_enabled(self) -> bool:
        """Returns whether gestures are switched on."""
        return self._enabled

    def set_body_talk_enabled(self, enabled: bool) -> None:
        """As `setBodyLanguageEnabled`, its former name."""
        self._enabled = enabled

    def declare_animations_package(self, _package: str) -> None:
        """Accepts a package of gestures without effect."""

    def add_tags_to_words(self, _tags: Any) -> None:
        """Accepts gestures for words without effect."""

    def declare_tag_for_animations(self, _tags: Any) -> None:
        """Accepts gestures for tags without effect."""

    def is_body_talk_enabled(self) -> bool:
        """As `isBodyLanguageEnabled`, its former name."""
        return self._enabled


_MODES = ("disabled", "random", "contextual")


def _known(language: str) -> str:
    if language not in LANGUAGES:
        raise ValueError(f"there is no language {language!r}; it must be one of {LANGUAGES}")
    return language
