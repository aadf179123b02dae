"""Services that look, listen and measure on behalf of who subscribed to them.

Nobody is there to be seen or heard in the simulation: what they would find stays empty in
ALMemory. The log says so when the first client subscribes.
"""

from collections.abc import Callable, Sequence
from typing import Any

from pepper_drake.robot_server.kept_settings import keep_settings
from pepper_drake.robot_server.waiting import Module

Log = Callable[[str], None]


class Extractor(Module):
    """A service that is subscribed to; what it finds would stand in ALMemory."""

    def __init__(
        self, name: str, log: Log | None = None, keys: Sequence[str] = (), finds: str = ""
    ) -> None:
        """Makes one without subscribers.

        Args:
            name: The service's name.
            log: Told when the first client subscribes; None for one whose values are simulated.
            keys: Keys of ALMemory that it writes.
            finds: What it would find.
        """
        super().__init__(name)
        self._log, self._keys, self._finds = log, tuple(keys), finds
        self._subscribers: dict[str, tuple[int, float]] = {}

    def subscribe(self, name: str, period: int = 100, precision: float = 0.0) -> None:
        """Asks for values."""
        self._subscribers[name] = (period, precision)
        if self._log is not None:
            self._log(f"{self.name} is asked for {self._finds}; there are none in the simulation")
            self._log = None

    def unsubscribe(self, name: str) -> None:
        """Asks for values no more."""
        if self._subscribers.pop(name, None) is None:
            raise ValueError(f"{name!r} has not subscribed")

    def get_subscribers_info(self) -> list[list[Any]]:
        """Returns who wants values, how often [ms] and how exactly."""
        return [[name, *wanted] for name, wanted in self._subscribers.items()]

    def get_current_period(self) -> int:
        """Returns how often values come [ms]."""
        return min((period for period, _ in self._subscribers.values()), default=100)

    def get_current_precision(self) -> float:
        """Returns how exact values are."""
        return max((precision for _, precision in self._subscribers.values()), default=0.0)

    def get_my_period(self, name: str) -> int:
        """Returns how often one wants values [ms]."""
        return self._wanted(name)[0]

    def get_my_precision(self, name: str) -> float:
        """Returns how exactly one wants values."""
        return self._wanted(name)[1]

    def update_period(self, name: str, period: int) -> None:
        """Changes how often one wants values [ms]."""
        self._subscribers[name] = (period, self._wanted(name)[1])

    def update_precision(self, name: str, precision: float) -> None:
        """Changes how exactly one wants values."""
        self._subscribers[name] = (self._wanted(name)[0], precision)

    def get_event_list(self) -> list[str]:
        """Returns the events that it raises here: none."""
        return []

    def get_output_names(self) -> list[str]:
        """Returns where the values are."""
        return list(self._keys)

    def get_memory_key_list(self) -> list[str]:
        """Returns where the values are."""
        return list(self._keys)

    def _wanted(self, name: str) -> tuple[int, float]:
        if name not in self._subscribers:
            raise ValueError(f"{name!r} has not subscribed")
        return self._subscribers[name]


class FaceDetection(Extractor):
    """ALFaceDetection: it sees no face, so it can learn none."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALFaceDetection", log, ("FaceDetected",), "faces")
        tracking, recognition = ("is_tracking_enabled", False), ("is_recognition_enabled", True)
        keep_settings(
            self,
            {
                "enable_tracking": tracking,
                "set_tracking_enabled": tracking,
                "enable_recognition": recognition,
                "set_recognition_enabled": recognition,
                "set_recognition_confidence_threshold": (
                    "get_recognition_confidence_threshold",
                    0.4,
                ),
            },
        )

    def learn_face(self, _name: str) -> bool:
        """Returns whether a face was learned: none is seen."""
        return False

    def re_learn_face(self, _name: str) -> bool:
        """Returns whether a face was learned again: none is seen."""
        return False

    def forget_person(self, _name: str) -> bool:
        """Returns whether somebody was known: nobody is."""
        return False

    def clear_database(self) -> bool:
        """Forgets all faces; returns that it was done."""
        return True

    def get_learned_faces_list(self) -> list[str]:
        """Returns who is known: nobody."""
        return []

    def set_resolution(self, _resolution: int) -> bool:
        """Takes the resolution to look with."""
        return True

    def set_active_camera(self, camera: int) -> bool:
        """Takes the camera to look with; returns whether it has one of that number."""
        return camera in (0, 1)


class FaceCharacteristics(Module):
    """ALFaceCharacteristics."""

    def __init__(self) -> None:
        super().__init__("ALFaceCharacteristics")

    def analyze_face_characteristics(self, _person: int) -> bool:
        """Returns whether a face was there to be analysed: none is."""
        return False


class PeoplePerception(Extractor):
    """ALPeoplePerception: its settings; it sees nobody."""

    def __init__(self, log: Log) -> None:
        keys = ("PeoplePerception/PeopleList", "PeoplePerception/VisiblePeopleList")
        super().__init__("ALPeoplePerception", log, keys, "people")
        self._paused = False
        keep_settings(
            self,
            {
                "set_maximum_detection_range": ("get_maximum_detection_range", 3.5),
                "set_minimum_body_height": ("get_minimum_body_height", 0.3),
                "set_maximum_body_height": ("get_maximum_body_height", 2.5),
                "set_time_before_person_disappears": ("get_time_before_person_disappears", 10.0),
                "set_time_before_visible_person_disappears": (
                    "get_time_before_visible_person_disappears",
                    3.0,
                ),
                "set_face_detection_enabled": ("is_face_detection_enabled", True),
                "set_fast_mode_enabled": ("is_fast_mode_enabled", False),
                "set_graphical_display_enabled": ("is_graphical_display_enabled", False),
                "set_movement_detection_enabled": ("is_movement_detection_enabled", True),
            },
        )

    def pause(self, paused: bool) -> None:
        """Pauses it, or goes on."""
        self._paused = paused

    def is_paused(self) -> bool:
        """Returns whether it is paused."""
        return self._paused

    def is_processing(self) -> bool:
        """Returns whether it looks for people."""
        return bool(self._subscribers) and not self._paused

    def reset_population(self) -> None:
        """Forgets the people seen: none."""


class SpeechRecognition(Extractor):
    """ALSpeechRecognition: its settings; it hears nothing."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALSpeechRecognition", log, ("WordRecognized",), "words")
        self._vocabulary: list[str] = []
        self._paused = False
        self._parameters: dict[str, float] = {}
        keep_settings(
            self,
            {
                "set_language": ("get_language", "English"),
                "set_audio_expression": ("get_audio_expression", True),
                "set_visual_expression": ("get_visual_expression", True),
            },
        )

    def get_available_languages(self) -> list[str]:
        """Returns the languages."""
        return ["Chinese", "English", "French", "German", "Italian", "Japanese", "Spanish"]

    def set_vocabulary(self, words: list[str], _spotting: bool) -> None:
        """Sets the words to listen for; refused, as on a robot, while it listens."""
        if self._subscribers and not self._paused:
            raise ValueError("the vocabulary cannot be changed while it listens: pause it first")
        self._vocabulary = list(words)

    def set_word_list_as_vocabulary(self, words: list[str]) -> None:
        """As `setVocabulary`, its former name."""
        self.set_vocabulary(words, False)

    def pause(self, paused: bool) -> None:
        """Pauses it, or goes on."""
        self._paused = paused

    def remove_all_context(self) -> None:
        """Forgets contexts; there are none."""

    def delete_all_contexts(self) -> None:
        """Forgets contexts; there are none."""

    def set_parameter(self, name: str, value: float) -> None:
        """Keeps a parameter."""
        self._parameters[name] = value

    def get_parameter(self, name: str) -> float:
        """Returns a parameter that was kept."""
        if name not in self._parameters:
            raise ValueError(f"there is no parameter {name!r}")
        return self._parameters[name]


class Looker(Extractor):
    """An extractor with a camera: landmarks, barcodes, pictures, movement, gazes, sounds."""

    def __init__(self, name: str, log: Log, keys: Sequence[str], finds: str) -> None:
        super().__init__(name, log, keys, finds)
        keep_settings(self, {"set_resolution": ("get_resolution", 2)}, True)
        keep_settings(self, {"set_active_camera": ("get_active_camera", 0)}, True)
        keep_settings(self, {"set_tolerance": ("get_tolerance", 0.5)})
        keep_settings(self, {"set_parameter": ("get_parameters", [])})


def quiet_extractors(log: Log) -> list[Module]:
    """Returns the extractors that find nothing.

    Args:
        log: Told when one is first subscribed to.
    """
    return [
        FaceDetection(log),
        FaceCharacteristics(),
        PeoplePerception(log),
        SpeechRecognition(log),
        Looker("ALLandMarkDetection", log, ("LandmarkDetected",), "landmarks"),
        Looker("ALBarcodeReader", log, ("BarcodeReader/BarcodeDetected",), "barcodes"),
        Looker("ALVisionRecognition", log, ("PictureDetected",), "pictures"),
        Looker("ALMovementDetection", log, ("MovementDetection/MovementInfo",), "movements"),
        Looker("ALGazeAnalysis", log, ("GazeAnalysis/PeopleLookingAtRobot",), "gazes"),
        Looker("ALSoundLocalization", log, ("ALSoundLocalization/SoundLocated",), "sounds"),
        Looker("ALSoundDetection", log, ("SoundDetected",), "sounds"),
    ]


NOTHING_FOUND: dict[str, Any] = {
    "FaceDetected": [],
    "LandmarkDetected": [],
    "PictureDetected": [],
    "BarcodeReader/BarcodeDetected": [],
    "PeoplePerception/PeopleList": [],
    "PeoplePerception/VisiblePeopleList": [],
    "GazeAnalysis/PeopleLookingAtRobot": [],
    "MovementDetection/MovementInfo": [],
    "WordRecognized": ["", 0.0],
    "SpeechDetected": 0,
    "SoundDetected": [],
    "ALSoundLocalization/SoundLocated": [],
}
"""Keys of ALMemory under which extractors leave what they find, and that nothing was found."""
