"""All services of a served Pepper over one robot port."""

from collections.abc import Callable
from pathlib import Path

from pepper_drake.robot_server.robot.robot_port import RobotPort
from pepper_drake.robot_server.services.audio_device import AudioDevice, AudioRecorder
from pepper_drake.robot_server.services.dcm import Dcm
from pepper_drake.robot_server.services.dialog import Dialog
from pepper_drake.robot_server.services.expression_watcher import ExpressionWatcher
from pepper_drake.robot_server.services.extractors import quiet_extractors
from pepper_drake.robot_server.services.leds import Leds
from pepper_drake.robot_server.services.localization import Localization, VisualCompass
from pepper_drake.robot_server.services.log_manager import LogManager
from pepper_drake.robot_server.services.media_services import (
    AnimationPlayer,
    AudioPlayer,
    Notifications,
    Tablet,
)
from pepper_drake.robot_server.services.memory import Memory
from pepper_drake.robot_server.services.motion import Motion
from pepper_drake.robot_server.services.navigation import Navigation
from pepper_drake.robot_server.services.people_services import (
    Knowledge,
    Mood,
    UserInfo,
    UserSession,
)
from pepper_drake.robot_server.services.plain_services import (
    ABILITIES,
    Ability,
    AutonomousLife,
    AutonomousMoves,
    BasicAwareness,
    Battery,
    BodyTemperature,
    RobotModel,
    Sonar,
    Touch,
)
from pepper_drake.robot_server.services.posture import Posture
from pepper_drake.robot_server.services.recorders import PhotoCapture, RobotDisk, VideoRecorder
from pepper_drake.robot_server.services.sensor_keys import DEVICES, TouchEvents, install_keys
from pepper_drake.robot_server.services.speech import AnimatedSpeech, TextToSpeech
from pepper_drake.robot_server.services.store_services import (
    BehaviorManager,
    Laser,
    PackageManager,
    PreferenceManager,
    Recharge,
)
from pepper_drake.robot_server.services.system_services import (
    ConnectionManager,
    Diagnosis,
    Launcher,
    Logger,
    Preferences,
    ResourceManager,
    Sensors,
    ServiceManager,
    Store,
    System,
)
from pepper_drake.robot_server.services.tactile_gesture import TactileGesture
from pepper_drake.robot_server.services.tracker import Tracker
from pepper_drake.robot_server.services.video import Video
from pepper_drake.robot_server.services.waiting import Module, RobotTimer
from pepper_drake.robot_server.wire.service import Service, ServiceFinder
from pepper_drake.robot_server.wire.signatures import make_service, service_signatures

_POSTURE_CYCLES = 25
"""Cycles between checks of the robot's posture."""


class ServedPepper:
    """A Pepper's services, and the cycle that runs them.

    The server calls `step` every 20 ms of the robot's clock, on the event loop of the services'
    methods.

    Attributes:
        services: To register.
        finder: The directory; set by the server, so that events can call clients' modules.
        motion: ALMotion.
        memory: ALMemory.
        video: ALVideoDevice.
    """

    def __init__(
        self,
        port: RobotPort,
        *,
        log: Callable[[str], None] = lambda _: None,
        awake: bool = True,
        files: Path | None = None,
    ) -> None:
        """Makes the services.

        Args:
            port: The robot.
            log: Takes a line on what the robot says or shows, or on calls without effect.
            awake: Whether the joints are stiff from the start, as after booting.
            files: Folder for the robot's files, such as pictures; None for no files.
        """
        self.finder: ServiceFinder | None = None
        self._port = port
        manager = LogManager(log)

        def say(line: str) -> None:
            log(line)
            manager.tell(line)

        self._log = say
        self._unserved: set[str] = set()
        self._cycle = 0
        self._timer = RobotTimer(port.state().time)
        self.memory = Memory(lambda: self._timer.now, lambda: self.finder)
        tell = self.memory.raise_event
        self.motion = Motion(port, tell, log=say, awake=awake)
        self.video = Video(port, self._timer)
        self._posture = Posture(self.motion, tell)
        self._touch = TouchEvents(self.memory)
        speech = TextToSpeech(self._timer, tell, say)
        life = AutonomousLife(tell)
        self._gestures = TactileGesture(self.memory)
        self._expressions = ExpressionWatcher(self.memory.value_or_none, lambda: self._timer.now)
        disk = RobotDisk(files)
        animations = AnimationPlayer(say)
        leds = Leds(self._timer, say)
        dcm = Dcm(self.motion, leds, self._timer, say)
        tracker = Tracker(self.motion, self.memory, say)
        modules: list[Module] = [
            self.motion,
            self.memory,
            self.video,
            self._posture,
            tracker,
            speech,
            AnimatedSpeech(speech, tell),
            life,
            BasicAwareness(life),
            *(Ability(name, life) for name in ABILITIES if name != "BasicAwareness"),
            System(),
            Battery(),
            BodyTemperature(),
            RobotModel(),
            Sonar(),
            Touch(lambda: self.motion.state.touched),
            leds,
            AutonomousMoves(),
            *quiet_extractors(say),
            Dialog(say),
            Tablet(say),
            AudioPlayer(say),
            AudioDevice(say, self._timer, lambda: self.finder),
            AudioRecorder(say),
            animations,
            VideoRecorder(self.video, disk, self._timer),
            PhotoCapture(self.video, disk, self._timer),
            Notifications(),
            PreferenceManager(tell),
            PackageManager(),
            BehaviorManager(animations),
            UserSession(),
            UserInfo(),
            Knowledge(),
            Mood(),
            self._gestures,
            self._expressions,
            ResourceManager(),
            ConnectionManager(),
            Launcher(lambda: [service.name for service in self.services]),
            ServiceManager(),
            Logger(say),
            Preferences(),
            Store(),
            Diagnosis(),
            Sensors(),
            manager,
            Laser(),
            Recharge(tell),
            Navigation(self.motion, self._timer, disk),
            Localization(self.motion),
            VisualCompass(self.motion, say),
            dcm,
        ]
        install_keys(self.memory, self.motion)
        self.memory.compute({DEVICES + key: value for key, value in leds.keys().items()})
        self.memory.compute({"DCM/Time": lambda: dcm.get_time(0)})
        self.memory.put("robotIsWakeUp", awake)
        served = {module.name: module for module in modules}
        self.services: list[Service] = []
        for name in service_signatures():
            module = served.get(name) or Module(name)
            module.served = make_service(name, module, on_unserved=self._log_unserved)
            self.services.append(module.served)
        self._service("ALMotion").on_client_left = self.motion.client_left
        self._service("ALVideoDevice").on_client_left = self.video.client_left
        self._service("ALTracker").on_client_left = tracker.client_left

    def step(self) -> None:
        """Runs one cycle of 20 ms."""
        self.motion.step()
        state = self.motion.state
        self._timer.step(state.time)
        self._touch.step(state.touched, state.time)
        self._gestures.step(state.touched, state.time)
        self._expressions.step(state.time)
        if self._cycle % _POSTURE_CYCLES == 0:
            self._posture.step()
        self._cycle += 1

    def _service(self, name: str) -> Service:
        return next(service for service in self.services if service.name == name)

    def _log_unserved(self, name: str) -> None:
        if name not in self._unserved:
            self._unserved.add(name)
            self._log(f"{name} was asked for and is not simulated")
