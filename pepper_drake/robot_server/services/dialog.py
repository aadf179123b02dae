"""ALDialog: topics and settings are stored; nobody speaks to the simulated robot."""

from collections.abc import Callable
from typing import Any

from pepper_drake.robot_server.services.extractors import Extractor
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.media_services import topic_name


class Dialog(Extractor):
    """ALDialog."""

    def __init__(self, log: Callable[[str], None]) -> None:
        super().__init__("ALDialog", log, ("Dialog/LastInput",), "words")
        self._say = log
        self._loaded: dict[str, str] = {}
        self._active: list[str] = []
        self._has_files = False
        self._concepts: dict[tuple[str, str], list[str]] = {}
        self._user_data: dict[tuple[int, str], str] = {}
        keep_settings(
            self,
            {
                "set_language": ("get_language", "English"),
                "set_focus": ("get_focus", ""),
                "set_asr_confidence_threshold": ("get_asr_confidence_threshold", 0.3),
                "set_confidence_threshold": ("get_confidence_thresholds", []),
                "set_delay": ("get_delay", []),
                "set_number_of_scopes": ("get_number_of_scopes", 0),
                "set_push_mode": ("get_push_mode", 0),
                "set_animated_speech_configuration": ("get_animated_speech_configuration", []),
                "enable_trigger_sentences": ("are_trigger_sentences_enabled", True),
                "enable_category": ("is_category_enabled", True),
                "enable_log_audio": ("is_log_audio_enabled", False),
                "enable_sending_log_to_cloud": ("is_sending_log_to_cloud", False),
                "add_blocking_event": ("get_blocking_event", ""),
                "remove_blocking_event": ("get_removed_blocking_event", ""),
                "open_session": ("get_session", 0),
            },
        )

    def load_topic(self, path: str) -> str:
        """Loads a topic's file on the robot; returns the topic's name, that of its file."""
        self._has_files = True
        return self._load(topic_name(path))

    def load_topic_content(self, content: str) -> str:
        """Loads a topic's text; returns the topic's name."""
        return self._load(topic_name(content))

    def unload_topic(self, topic: str) -> None:
        """Unloads a topic."""
        self._known(topic)
        self._loaded.pop(topic, None)
        if topic in self._active:
            self._active.remove(topic)

    def activate_topic(self, topic: str) -> None:
        """Activates a topic."""
        self._known(topic)
        if topic not in self._active:
            self._active.append(topic)

    def deactivate_topic(self, topic: str) -> None:
        """Deactivates a topic."""
        self._known(topic)
        if topic in self._active:
            self._active.remove(topic)

    def run_topics(self, paths: list[str]) -> None:
        """Loads topics' files and activates them."""
        for path in paths:
            self.activate_topic(self.load_topic(path))

    def stop_topics(self, topics: list[str]) -> None:
        """Unloads topics."""
        for topic in topics:
            self.unload_topic(topic_name(topic))

    def get_loaded_topics(self, language: str) -> list[str]:
        """Returns the topics of a language."""
        return [topic for topic, spoken in self._loaded.items() if spoken == language]

    def get_all_loaded_topics(self) -> list[str]:
        """Returns all topics."""
        return list(self._loaded)

    def get_activated_topics(self) -> list[str]:
        """Returns the topics that are active."""
        return list(self._active)

    def goto_topic(self, topic: str) -> None:
        """Only checks that the topic is loaded."""
        self._known(topic)

    def goto_tag(self, _tag: str, topic: str) -> None:
        """Only checks that the topic is loaded."""
        self._known(topic)

    def activate_tag(self, _tag: str, topic: str) -> None:
        """Only checks that the topic is loaded."""
        self._known(topic)

    def deactivate_tag(self, _tag: str, topic: str) -> None:
        """Only checks that the topic is loaded."""
        self._known(topic)

    def force_input(self, text: str) -> None:
        """Takes words as heard; no answer is simulated."""
        self._say(f'dialog: hears "{text}"; no answer is simulated')

    def tell(self, text: str) -> None:
        """As `forceInput`."""
        self.force_input(text)

    def force_output(self) -> None:
        """Logs that no proposal is simulated."""
        self._say("dialog: no proposal is simulated")

    def say(self, topic: str, tag: str) -> None:
        """Logs that the tagged sentence is not simulated."""
        self._known(topic)
        self._say(f"dialog: what {tag} marks in {topic} is not simulated")

    def set_concept(self, concept: str, language: str, words: list[str], *_: Any) -> None:
        """Sets a concept's words."""
        self._concepts[concept, language] = list(words)

    def set_concept_keep_in_cache(self, concept: str, language: str, words: list[str]) -> None:
        """As `setConcept`."""
        self.set_concept(concept, language, words)

    def add_to_concept(self, concept: str, language: str, words: list[str]) -> None:
        """Adds words to a concept."""
        self._concepts.setdefault((concept, language), []).extend(words)

    def get_concept(self, concept: str, language: str) -> list[str]:
        """Returns a concept's words."""
        return self._concepts.get((concept, language), [])

    def clear_concepts(self) -> None:
        """Forgets all concepts."""
        self._concepts.clear()

    def insert_user_data(self, name: str, value: str, user: int) -> None:
        """Stores data of a user."""
        self._user_data[user, name] = value

    def get_user_data(self, name: str, user: int) -> str:
        """Returns data of a user, or an empty text."""
        return self._user_data.get((user, name), "")

    def get_user_data_list(self, user: int) -> list[str]:
        """Returns the names of a user's data."""
        return [name for number, name in self._user_data if number == user]

    def get_user_list(self) -> list[int]:
        """Returns the users with data."""
        return sorted({user for user, _ in self._user_data})

    def remove_user_data(self, user: int) -> None:
        """Removes a user's data."""
        for key in [key for key in self._user_data if key[0] == user]:
            del self._user_data[key]

    def close_session(self) -> None:
        """Ends a user's session."""

    def compile_all(self) -> None:
        """Has no effect: topics need no compilation."""

    def run_dialog(self) -> None:
        """Starts the dialog; has no effect."""

    def stop_dialog(self) -> None:
        """Stops the dialog; has no effect."""

    def start_push(self) -> None:
        """Has no effect: no proposals are simulated."""

    def stop_push(self) -> None:
        """Has no effect: no proposals are simulated."""

    def reset_all(self) -> None:
        """Forgets topics and concepts."""
        self._loaded.clear()
        self._active.clear()
        self._concepts.clear()

    def _load(self, topic: str) -> str:
        self._loaded[topic] = str(self.get_language())  # type: ignore[attr-defined]
        return topic

    def _known(self, topic: str) -> None:
        # A file's own name of its topic is unknown, since the file is not on this machine.
        if topic not in self._loaded and not self._has_files:
            raise ValueError(f"topic {topic!r} is not loaded")
