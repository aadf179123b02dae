"""Services that look, listen and measure on behalf of their subscribers.

The simulation has nobody to see or hear: their results in ALMemory stay empty. The log says so when
the first client subscribes.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pepper_drake.robot_server.services.kept_settings import Setting, keep_settings
from pepper_drake.robot_server.services.waiting import Module

Log = Callable[[str], None]


class Extractor(Module):
    """A service with subscribers, whose results would be in ALMemory."""

    def __init__(
        self, name: str, log: Log | None = None, keys: Sequence[str] = (), finds: str = ""
    ) -> None:
        """Makes one without subscribers.

        Args:
            name: The service's name.
            log: Takes a line when the first client subscribes; None if the values are simulated.
            keys: Keys of ALMemory that it writes.
            finds: What it would find.
        """
        super().__init__(name)
        self._log, self._keys, self._finds = log, tuple(keys), finds
        self._subscribers: dict[str, tuple[int, float]] = {}

    def subscribe(self, name: str, period: int = 100, precision: float = 0.0) -> None:
        """Subscribes to the values."""
        self._subscribers[name] = (period, precision)
        if self._log is not None:
            self._log(f"{self.name} is asked for {self._finds}; there are none in the simulation")
            self._log = None

    def unsubscribe(self, name: str) -> None:
        """Ends a subscription."""
        if self._subscribers.pop(name, None) is None:
            raise ValueError(f"{name!r} has not subscribed")

    def get_subscribers_info(self) -> list[list[Any]]:
        """Returns name, period [ms] and precision of each subscriber."""
        return [[name, *wanted] for name, wanted in self._subscribers.items()]

    def get_current_period(self) -> int:
        """Returns the period of the values [ms]."""
        return min((period for period, _ in self._subscribers.values()), default=100)

    def get_current_precision(self) -> float:
        """Returns the precision of the values."""
        return max((precision for _, precision in self._subscribers.values()), default=0.0)

    def get_my_period(self, name: str) -> int:
        """Returns a subscriber's period [ms]."""
        return self._subscription(name)[0]

    def get_my_precision(self, name: str) -> float:
        """Returns a subscriber's precision."""
        return self._subscription(name)[1]

    def update_period(self, name: str, period: int) -> None:
        """Changes a subscriber's period [ms]."""
        self._subscribers[name] = (period, self._subscription(name)[1])

    def update_precision(self, name: str, precision: float) -> None:
        """Changes a subscriber's precision."""
        self._subscribers[name] = (self._subscription(name)[0], precision)

    def get_event_list(self) -> list[str]:
        """Returns the events that it raises here: none."""
        return []

    def get_output_names(self) -> list[str]:
        """Returns the keys of the values."""
        return list(self._keys)

    def get_memory_key_list(self) -> list[str]:
        """Returns the keys of the values."""
        return list(self._keys)

    def _subscription(self, name: str) -> tuple[int, float]:
        if name not in self._subscribers:
            raise ValueError(f"{name!r} has not subscribed")
        return self._subscribers[name]


class PausableExtractor(Extractor):
    """An extractor that its clients may pause."""

    _paused = False

    def pause(self, paused: bool) -> None:
        """Pauses or resumes it."""
        self._paused = paused

    def is_paused(self) -> bool:
        """Returns whether it is paused."""
        return self._paused

    def is_processing(self) -> bool:
        """Returns whether it runs: it has subscribers and is not paused."""
        return bool(self._subscribers) and not self._paused


class PeoplePerception(PausableExtractor):
    """ALPeoplePerception: its settings; it sees nobody."""

    def __init__(self, log: Log) -> None:
        keys = ("PeoplePerception/PeopleList", "PeoplePerception/VisiblePeopleList")
        super().__init__("ALPeoplePerception", log, keys, "people")
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

    def reset_population(self) -> None:
        """Has no effect: nobody was seen."""


class SpeechRecognition(PausableExtractor):
    """ALSpeechRecognition: its settings; it hears nothing."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALSpeechRecognition", log, ("WordRecognized",), "words")
        self._vocabulary: list[str] = []
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

    def _grammar(self, *_: Any) -> float:
        """Accepts a grammar, a context or a rule without effect."""
        return 0.0

    add_context = _grammar
    remove_context = _grammar
    remove_all_context = _grammar
    delete_all_contexts = _grammar
    save_context_set = _grammar
    load_context_set = _grammar
    erase_context_set = _grammar
    activate_rule = _grammar
    deactivate_rule = _grammar
    activate_all_rules = _grammar
    deactivate_all_rules = _grammar
    add_word_list_to_slot = _grammar
    remove_word_list_from_slot = _grammar
    compile = _grammar
    push_contexts = _grammar
    pop_contexts = _grammar
    load_vocabulary = _grammar

    def get_rules(self, _context: str, _kind: str) -> list[str]:
        """Returns the rules of a context: none."""
        return []

    def set_parameter(self, name: str, value: float) -> None:
        """Stores a parameter."""
        self._parameters[name] = value

    def get_parameter(self, name: str) -> float:
        """Returns a stored parameter."""
        if name not in self._parameters:
            raise ValueError(f"there is no parameter {name!r}")
        return self._parameters[name]


class Looker(PausableExtractor):
    """An extractor with stored settings: landmarks, barcodes, movement, gazes, sounds."""

    def __init__(
        self,
        name: str,
        log: Log,
        key: str,
        finds: str,
        settings: Mapping[str, Setting] | None = None,
    ) -> None:
        """Makes one without subscribers.

        Args:
            name: The service's name.
            log: Takes a line when the first client subscribes.
            key: Key of ALMemory that it writes.
            finds: What it would find.
            settings: Its own settings.
        """
        super().__init__(name, log, (key,), finds)
        keep_settings(
            self,
            {
                "set_resolution": ("get_resolution", 2),
                "set_active_camera": ("get_active_camera", 0),
                "set_frame_rate": ("get_frame_rate", 15),
            },
            True,
        )
        keep_settings(self, {"set_parameter": ("get_parameters", []), **(settings or {})})

    def reset_grid(self) -> None:
        """Has no effect."""

    def reset_detection(self) -> None:
        """Has no effect."""

    def get_circle(self) -> list[float]:
        """Returns the position of a blob: none is seen."""
        return []

    def get_top_of_blob(self, *_: Any) -> list[float]:
        """Returns the top of a blob: none is seen."""
        return []


class FaceDetection(Looker):
    """ALFaceDetection: it sees no face, so it can learn none."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALFaceDetection", log, "FaceDetected", "faces")
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

    def set_active_camera(self, camera: int) -> bool:
        """Returns whether there is a camera of that number."""
        return camera in (0, 1)


class FaceCharacteristics(Looker):
    """ALFaceCharacteristics."""

    def __init__(self, log: Log) -> None:
        settings = {"set_smiling_threshold": ("get_smiling_threshold", 0.7)}
        key, finds = "FaceCharacteristics/PersonSmiling", "faces"
        super().__init__("ALFaceCharacteristics", log, key, finds, settings)

    def analyze_face_characteristics(self, _person: int) -> bool:
        """Returns whether a face was there to be analysed: none is."""
        return False


class VisionRecognition(Looker):
    """ALVisionRecognition: it sees no picture that it knows, and can learn none."""

    def __init__(self, log: Log) -> None:
        settings = {
            "set_max_out_objs": ("get_max_out_objs", 1),
            "set_param": ("get_param_kept", []),
        }
        super().__init__("ALVisionRecognition", log, "PictureDetected", "pictures", settings)

    def get_size(self) -> int:
        """Returns how many pictures it knows: none."""
        return 0

    def clear_current_database(self) -> bool:
        """Forgets all pictures; returns that it was done."""
        return True

    def change_database(self, _folder: str, _name: str) -> bool:
        """Returns whether there is a database of that name: there is none."""
        return False

    def learn_from_file(self, *_: Any) -> bool:
        """Returns whether a picture was learned: it reads no files."""
        return False


class WavingDetection(Looker):
    """ALWavingDetection: nobody waves."""

    def __init__(self, log: Log) -> None:
        settings = {
            "set_max_distance": ("get_max_distance", 2.5),
            "set_min_size": ("get_min_size", 0.1),
        }
        key, finds = "WavingDetection/Waving", "people who wave"
        super().__init__("ALWavingDetection", log, key, finds, settings)
        keep_settings(self, {"set_threshold": ("get_threshold", 0.4)}, True)


def quiet_extractors(log: Log) -> list[Module]:
    """Returns the extractors that find nothing.

    Args:
        log: Takes a line at an extractor's first subscription.
    """
    return [
        FaceDetection(log),
        FaceCharacteristics(log),
        PeoplePerception(log),
        SpeechRecognition(log),
        VisionRecognition(log),
        *(Looker(f"AL{name}", log, *about) for name, about in _LOOKERS.items()),
        WavingDetection(log),
    ]


_LOOKERS: dict[str, tuple[Any, ...]] = {
    "LandMarkDetection": ("LandmarkDetected", "landmarks"),
    "BarcodeReader": ("BarcodeReader/BarcodeDetected", "barcodes"),
    "MovementDetection": (
        "MovementDetection/MovementInfo",
        "movements",
        {
            "set_color_sensitivity": ("get_color_sensitivity", 0.5),
            "set_depth_sensitivity": ("get_depth_sensitivity", 0.5),
        },
    ),
    "GazeAnalysis": (
        "GazeAnalysis/PeopleLookingAtRobot",
        "gazes",
        {
            "set_tolerance": ("get_tolerance", 0.5),
            "set_face_analysis_enabled": ("is_face_analysis_enabled", False),
        },
    ),
    "SoundLocalization": ("ALSoundLocalization/SoundLocated", "sounds"),
    "AudioSourceLocalization": ("ALAudioSourceLocalization/SoundLocated", "sounds"),
    "SoundDetection": ("SoundDetected", "sounds"),
    "VoiceEmotionAnalysis": ("ALVoiceEmotionAnalysis/EmotionRecognized", "voices"),
    "BacklightingDetection": ("BacklightingDetection/BacklightingDetected", "light from behind"),
    "DarknessDetection": (
        "DarknessDetection/DarknessDetected",
        "darkness",
        {"set_darkness_threshold": ("get_darkness_threshold", 10)},
    ),
    "CloseObjectDetection": ("CloseObjectDetection/ObjectInfo", "near objects"),
    "ColorBlobDetection": (
        "ALTracker/ColorBlobDetected",
        "blobs of a colour",
        {
            "set_color": ("get_color", []),
            "set_object_properties": ("get_object_properties", []),
            "set_auto_exposure": ("get_auto_exposure", True),
        },
    ),
    "RedBallDetection": ("redBallDetected", "red balls"),
    "EngagementZones": (
        "EngagementZones/PeopleInZone1",
        "people",
        {
            "set_limit_angle": ("get_limit_angle", 90.0),
            "set_first_limit_distance": ("get_first_limit_distance", 1.5),
            "set_second_limit_distance": ("get_second_limit_distance", 2.5),
        },
    ),
    "Segmentation3D": (
        "Segmentation3D/SegmentedBlobs",
        "blobs in depth images",
        {
            "set_blob_tracking_enabled": ("is_blob_tracking_enabled", False),
            "set_blob_tracking_distance": ("get_blob_tracking_distance", 1.0),
            "set_vertical_offset": ("get_vertical_offset", -0.2),
            "set_delta_depth_threshold": ("get_delta_depth_threshold", 0.05),
        },
    ),
    "SittingPeopleDetection": (
        "SittingPeopleDetection/PeopleSittingList",
        "people who sit",
        {"set_sitting_threshold": ("get_sitting_threshold", 1.5)},
    ),
    "VisualSpaceHistory": (
        "VisualSpaceHistory/VisualGrid",
        "places that were looked at",
        {"set_grid_precision": ("get_grid_precision", 2.0)},
    ),
}
"""By service: the key that it writes, what it would find, and settings with initial values."""

NOTHING_FOUND: dict[str, Any] = {
    "FaceDetected": [],
    "PictureDetected": [],
    "PeoplePerception/PeopleList": [],
    "PeoplePerception/VisiblePeopleList": [],
    "WordRecognized": ["", 0.0],
    "SpeechDetected": 0,
    "LastWordRecognized": ["", 0.0],
    "ALSpeechRecognition/Status": "Idle",
    "ALSpeechRecognition/IsRunning": False,
    "ALSpeechRecognition/ActiveListening": False,
    "Dialog/LastInput": "",
    "Dialog/CurrentString": "",
    "Dialog/IsStarted": False,
    "PeoplePerception/PeopleDetected": [],
    "PeoplePerception/NonVisiblePeopleList": [],
    "PeoplePerception/JustArrived": 0,
    "PeoplePerception/JustLeft": 0,
    "EngagementZones/PeopleInZone2": [],
    "EngagementZones/PeopleInZone3": [],
    "FaceCharacteristics/PersonSmiling": [],
    "WavingDetection/Waving": [],
    "WavingDetection/PersonWaving": 0,
    "ALBasicAwareness/HumanTracked": -1,
    "ALTextToSpeech/TextDone": 0,
    "ALTextToSpeech/TextStarted": 0,
    "ALTextToSpeech/CurrentSentence": "",
    "ALTextToSpeech/CurrentWord": "",
    "ALTextToSpeech/Status": [0, "done"],
    "ALMotion/Protection/DisabledDevicesChanged": [],
    "ALMotion/Protection/DisabledFeaturesChanged": [],
    **{about[0]: [] for about in _LOOKERS.values()},
}
"""Keys of ALMemory for the extractors' results, with the values of no result."""
