"""Services without effect in the simulation: they take calls, keep what is set, and say so."""

import asyncio
import re
from types import SimpleNamespace

import numpy as np
import pytest
from virtual_pepper import virtual

from pepper_drake.models.pepper import PEPPER_URDF
from pepper_drake.robot_server.wire.service import ServiceError

# What programs of the maker and of others do, and what a robot answers that sees nobody.
SESSIONS = [
    [
        ("ALFaceDetection.subscribe", ("me", 500, 0.0), None),
        ("ALMemory.getData", ("FaceDetected",), []),
        ("ALFaceDetection.setTrackingEnabled", (True,), None),
        ("ALFaceDetection.isTrackingEnabled", (), True),
        ("ALFaceDetection.learnFace", ("Ada",), False),
        ("ALFaceDetection.getSubscribersInfo", (), [["me", 500, 0.0]]),
        ("ALFaceDetection.unsubscribe", ("me",), None),
    ],
    [
        ("ALSpeechRecognition.setLanguage", ("French",), None),
        ("ALSpeechRecognition.getLanguage", (), "French"),
        ("ALSpeechRecognition.setVocabulary", (["oui", "non"], False), None),
        ("ALSpeechRecognition.subscribe", ("me",), None),
        ("ALSpeechRecognition.pause", (True,), None),
        ("ALSpeechRecognition.setVocabulary", (["oui"], False), None),
        ("ALMemory.getData", ("WordRecognized",), ["", 0.0]),
        ("ALSpeechRecognition.unsubscribe", ("me",), None),
    ],
    [
        ("ALDialog.setLanguage", ("English",), None),
        ("ALDialog.loadTopicContent", ("topic: ~greet()\nlanguage: enu\nu:(hi) hi",), "greet"),
        ("ALDialog.loadTopic", ("/home/nao/talk_enu.top",), "talk"),
        ("ALDialog.activateTopic", ("greet",), None),
        ("ALDialog.getActivatedTopics", (), ["greet"]),
        ("ALDialog.getLoadedTopics", ("English",), ["greet", "talk"]),
        ("ALDialog.setConcept", ("food", "English", ["rice"]), None),
        ("ALDialog.addToConcept", ("food", "English", ["bread"]), None),
        ("ALDialog.getConcept", ("food", "English"), ["rice", "bread"]),
        ("ALDialog.deactivateTopic", ("greet",), None),
        ("ALDialog.unloadTopic", ("greet",), None),
        ("ALDialog.getAllLoadedTopics", (), ["talk"]),
    ],
    [
        ("ALTabletService.showImage", ("http://198.18.0.1/a.png",), True),
        ("ALTabletService.hideImage", (), True),
        ("ALTabletService.setBrightness", (0.5,), True),
        ("ALTabletService.getBrightness", (), 0.5),
        ("ALAudioDevice.setOutputVolume", (70,), None),
        ("ALAudioDevice.getOutputVolume", (), 70),
        ("ALAudioPlayer.loadFile", ("/a.wav",), 1),
        ("ALAudioPlayer.play", (1,), None),
        ("ALAudioPlayer.getCurrentPosition", (1,), 0.0),
        ("ALTextToSpeech.addToDictionary", ("SQL", "sequel"), True),
        ("ALTextToSpeech.deleteFromDictionary", ("SQL",), True),
        ("ALTextToSpeech.deleteFromDictionary", ("SQL",), False),
        ("ALTextToSpeech.setParameter", ("speed", 200.0), None),
        ("ALTextToSpeech.setParameter", ("defaultVoiceSpeed", 80.0), None),
        ("ALTextToSpeech.getParameter", ("speed",), 80.0),
    ],
    [
        ("ALNotificationManager.add", ([["message", "hot"], ["severity", "error"]],), 1),
        (
            "ALNotificationManager.notifications",
            (),
            [[["message", "hot"], ["severity", "error"], ["id", 1]]],
        ),
        ("ALNotificationManager.remove", (1,), None),
        ("ALNotificationManager.notifications", (), []),
        ("ALPreferenceManager.setValue", ("me", "speed", 3), None),
        ("ALPreferenceManager.getValue", ("me", "speed"), 3),
        ("ALPreferenceManager.getValue", ("me", "none"), None),
        ("ALMemory.getData", ("preferenceAdded",), ["me", "speed"]),
        ("ALPreferenceManager.setValue", ("me", "speed", 4), None),
        ("ALMemory.getData", ("preferenceChanged",), ["me", "speed"]),
        ("ALPreferenceManager.removeValue", ("me", "speed"), None),
        ("ALMemory.getData", ("preferenceRemoved",), ["me", "speed"]),
        ("ALPreferenceManager.removeDomainValues", ("me",), None),
        ("ALMemory.getData", ("preferenceDomainRemoved",), "me"),
        ("ALBehaviorManager.getInstalledBehaviors", (), []),
        ("ALBehaviorManager.isBehaviorInstalled", ("animations/Stand",), False),
        ("ALRecharge.lookForStation", (), [False, []]),
        ("PackageManager.packages", (), []),
    ],
]


@pytest.mark.parametrize("calls", SESSIONS, ids=["faces", "speech", "dialog", "media", "stores"])
def test_programs_find_what_they_set(calls):
    async def scenario(pepper):
        for method, arguments, expected in calls:
            assert pepper.call(method, *arguments) == expected, method

    virtual(scenario)


@pytest.mark.parametrize(
    ("method", "arguments"),
    [
        ("ALBehaviorManager.startBehavior", ("dance",)),
        ("ALDialog.activateTopic", ("unknown",)),
        ("ALFaceDetection.unsubscribe", ("nobody",)),
        ("ALAudioPlayer.play", (7,)),
        ("ALNotificationManager.add", (5,)),
        ("ALMotion.getMass", ("Tail",)),
    ],
)
def test_what_cannot_be_done_is_refused_by_the_methods_name(method, arguments):
    async def scenario(pepper):
        with pytest.raises(ServiceError, match="^" + method.replace(".", "::") + ": "):
            pepper.call(method, *arguments)

    virtual(scenario)


def test_the_vocabulary_of_a_listener_is_not_changed():
    async def scenario(pepper):
        pepper.call("ALSpeechRecognition.subscribe", "me")
        with pytest.raises(ServiceError, match="pause it first"):
            pepper.call("ALSpeechRecognition.setVocabulary", ["yes"], False)

    virtual(scenario)


class Hearer:
    """A client's module that keeps what it hears."""

    def __init__(self):
        self.heard = []

    async def call(self, method, *arguments):
        self.heard.append((method, *arguments))


@pytest.mark.parametrize(
    ("preferences", "channels", "rate"), [(None, 4, 48000), ((16000, 3, 0), 1, 16000)]
)
def test_a_module_that_subscribed_hears_a_quiet_room(preferences, channels, rate):
    async def scenario(pepper):
        hearer, modules = Hearer(), {}
        pepper.pepper.finder = SimpleNamespace(find=modules.get)
        if preferences is not None:
            pepper.call("ALAudioDevice.setClientPreferences", "me", *preferences)
        pepper.call("ALAudioDevice.subscribe", "me")
        await pepper.run(0.3)
        modules["me"] = hearer  # Some programs register only then.
        await pepper.run(2.0)
        begin = hearer.heard[0][3]
        seconds = pepper.robot.now - begin[0] - 1e-6 * begin[1]
        samples = sum(buffer[2] for buffer in hearer.heard)
        assert samples / rate == pytest.approx(seconds, rel=0.2)
        for method, count, each, _, sound in hearer.heard:
            assert (method, count) == ("processRemote", channels)
            assert len(sound) == 2 * channels * each
            assert 0 < np.abs(np.frombuffer(sound, "<i2")).max() < 10
        pepper.call("ALAudioDevice.unsubscribe", "me")
        heard = len(hearer.heard)
        await pepper.run(0.5)
        assert len(hearer.heard) == heard

    virtual(scenario)


def test_what_is_asked_for_in_vain_stands_in_the_log_once():
    async def scenario(pepper):
        for name in ("a", "b"):
            pepper.call("ALFaceDetection.subscribe", name)
        assert sum("faces" in line for line in pepper.lines) == 1
        pepper.call("ALAnimationPlayer.run", "animations/Stand/Gestures/Hey_1")
        assert "nothing moves" in pepper.lines[-1]

    virtual(scenario)


def test_navigation_moves_the_base():
    async def scenario(pepper):
        call = pepper.start("ALNavigation.navigateTo", 0.3, 0.1)
        await pepper.finish(call)
        assert call.result() is True
        position = pepper.call("ALMotion.getRobotPosition", True)
        np.testing.assert_allclose(position, [0.3, 0.1, 0.0], atol=0.01)

    virtual(scenario)


def test_the_mass_is_the_models_and_its_center_moves_with_the_arm():
    masses = [float(v) for v in re.findall(r'<mass value="([^"]+)"', PEPPER_URDF.read_text())]

    async def scenario(pepper):
        total = pepper.call("ALMotion.getMass", "Body")
        assert total == pytest.approx(sum(masses), rel=1e-3)
        parts = [pepper.call("ALMotion.getMass", c) for c in ("Head", "LArm", "RArm", "Leg")]
        assert 0.0 < sum(parts) < total
        before = np.array(pepper.call("ALMotion.getCOM", "Body", 2, False))
        task = pepper.start("ALMotion.angleInterpolation", "RShoulderPitch", -1.5, 1.0, True)
        await pepper.finish(task)
        after = np.array(pepper.call("ALMotion.getCOM", "Body", 2, False))
        assert after[2] > before[2] + 0.005
        arm = np.array(pepper.call("ALMotion.getCOM", "RArm", 2, True))
        task = asyncio.ensure_future(pepper.call("ALMotion.moveTo", 0.2, 0.0, 0.0))
        await pepper.finish(task)
        world = np.array(pepper.call("ALMotion.getCOM", "RArm", 1, True))
        np.testing.assert_allclose(world, arm + [0.2, 0.0, 0.0], atol=5e-3)

    virtual(scenario)
