"""The served table against the data, and every method called as programs call it."""

import asyncio
import re
from typing import Any

import numpy as np
import pytest
from virtual_pepper import CALLER, VirtualPepper, virtual

from pepper_drake.naoqi.wire import parse_signature
from pepper_drake.robot_server.robot.robot_port import CameraImage
from pepper_drake.robot_server.services.waiting import Module
from pepper_drake.robot_server.wire.service import Service, ServiceError
from pepper_drake.robot_server.wire.signatures import make_service, python_name, service_signatures

# As scanned from a robot; the rest of the table is held to in the calls below.
_SCANNED = {
    ("ALMotion", "wakeUp", "()"): 113,
    ("ALMotion", "setStiffnesses", "(mm)"): 124,
    ("ALMotion", "angleInterpolation", "(mmmb)"): 127,
    ("ALMotion", "angleInterpolationBezier", "([s]mm)"): 129,
    ("ALMotion", "setAngles", "(mmf)"): 130,
    ("ALMotion", "getAngles", "(mb)"): 132,
    ("ALMotion", "moveTo", "(fff)"): 143,
    ("ALMotion", "getPosition", "(sib)"): 195,
    ("ALMotion", "getLimits", "(s)"): 257,
    ("ALMotion", "killTask", "(i)"): 286,
    ("ALMemory", "getData", "(s)"): 115,
    ("ALMemory", "getListData", "(m)"): 126,
    ("ALMemory", "subscriber", "(s)"): 117,
    ("ALRobotPosture", "goToPosture", "(sf)"): 114,
    ("ALVideoDevice", "subscribeCamera", "(siiii)"): 113,
    ("ALVideoDevice", "getImageRemote", "(s)"): 162,
}


def test_the_served_table_is_the_data():
    async def scenario(pepper):
        assert set(pepper.services) == set(service_signatures())
        for name, signature in service_signatures().items():
            service = pepper.services[name]
            served = {(m.uid, m.name, m.parameters, m.returns) for m in service.methods.values()}
            data = {(m.uid, m.name, m.parameters, m.returns) for m in signature.methods}
            assert served == data
            assert {(s.uid, s.name) for s in service.signals.values()} == {
                (s.uid, s.name) for s in signature.signals
            }
        for (name, method, parameters), uid in _SCANNED.items():
            found = pepper.services[name].methods[uid]
            assert (found.name, found.parameters) == (method, parameters)

    virtual(scenario)


@pytest.mark.parametrize(
    ("name", "python"),
    [
        ("setAngles", "set_angles"),
        ("getHorizontalFOV", "get_horizontal_fov"),
        ("fadeRGB", "fade_rgb"),
        ("listLEDs", "list_leds"),
        ("_getSensorTransformAtTime", "get_sensor_transform_at_time"),
        ("__pCall", "p_call"),
        ("ping", "ping"),
    ],
)
def test_names_in_both_styles(name, python):
    assert python_name(name) == python


# Calls in the shapes in which programs make them, in an order in which each makes sense.
_MOTION = [
    ("wakeUp",),
    ("robotIsWakeUp",),
    ("setAngles", "HeadYaw", 0.1, 0.2),
    ("setAngles", ["HeadYaw", "HeadPitch"], [0.1, 0.0], 0.2),
    ("setAngles", "Head", [0.1, 0.0], 0.2),
    ("setAngles", "Body", [0.0] * 17, 0.2),
    ("setAngles", "Body", [0.0] * 20, 0.2),
    ("setAngles", ["LArm", "HeadYaw"], [0.0] * 7, 0.2),
    ("setAngles", "RArm", 0.2, 0.2),
    ("setAngles", ("HeadYaw",), (0,), 1),
    ("changeAngles", "HeadYaw", 0.1, 0.2),
    ("changeAngles", ["HeadYaw"], [0.1], 0.2),
    ("getAngles", "HeadYaw", True),
    ("getAngles", ["HeadYaw", "RArm"], False),
    ("getAngles", "Body", True),
    ("angleInterpolation", "HeadYaw", 0.2, 0.1, True),
    ("angleInterpolation", "HeadYaw", [0.2, 0.0], [0.1, 0.3], True),
    ("angleInterpolation", ["HeadYaw"], [[0.2, 0.0]], [[0.1, 0.3]], True),
    ("angleInterpolation", ["HeadYaw", "HeadPitch"], [0.2, 0.1], [0.3, 0.4], False),
    (
        "angleInterpolation",
        ["HeadYaw", "HeadPitch"],
        [[0.2], [0.1, 0.0]],
        [[0.3], [0.3, 0.6]],
        True,
    ),
    ("angleInterpolation", ["HeadYaw", "HeadPitch"], [0.2, 0.1], 0.3, True),
    ("angleInterpolation", "Head", [0.2, 0.1], [0.3, 0.3], True),
    ("angleInterpolation", "Head", 0.0, 0.3, True),
    ("angleInterpolation", "Body", [0.0] * 17, 0.5, True),
    ("angleInterpolationWithSpeed", "HeadYaw", 0.2, 0.5),
    ("angleInterpolationWithSpeed", ["HeadYaw", "HeadPitch"], [0.2, 0.0], 0.5),
    ("angleInterpolationWithSpeed", "Body", [0.0] * 20, 0.5),
    ("angleInterpolationBezier", ["HeadYaw"], [[0.3, 0.6]], [[0.2, [0.0, [3, -0.1, 0.0]]]]),
    ("stiffnessInterpolation", "RArm", 0.5, 0.1),
    ("stiffnessInterpolation", ["RArm", "Head"], [1.0] * 8, [0.1] * 8),
    ("stiffnessInterpolation", "HeadYaw", [0.5, 1.0], [0.1, 0.2]),
    ("setStiffnesses", "Body", 1.0),
    ("setStiffnesses", ["HeadYaw", "LArm"], [0.9] * 7),
    ("setStiffnesses", ["Head", "RArm"], 1.0),
    ("setStiffnesses", ["Head", "RArm"], [0.9, 1.0]),
    ("getStiffnesses", "Body"),
    ("getStiffnesses", ["HeadYaw"]),
    ("openHand", "RHand"),
    ("closeHand", "LHand"),
    ("moveInit",),
    ("moveTo", 0.1, 0.0, 0.0),
    ("moveTo", 0.0, 0.0, 0.2, 1.0),
    ("moveTo", 0.1, 0.0, 0.0, [["MaxVelXY", 0.3]]),
    ("moveTo", 0.1, 0.0, 0.0, 1.0, [["MaxVelXY", 0.3], ["MaxAccXY", 0.5]]),
    ("moveTo", [0.1, 0.0, 0.0]),
    ("moveTo", [[0.1, 0.0, 0.0], [0.2, 0.0, 0.1]], [["MaxVelTheta", 0.5]]),
    ("moveToward", 0.5, 0.0, 0.0),
    ("moveToward", 0.5, 0.0, 0.0, [["Frequency", 1.0]]),
    ("move", 0.1, 0.0, 0.0),
    ("move", 0.1, 0.0, 0.0, [["MaxAccXY", 0.3]]),
    ("moveIsActive",),
    ("stopMove",),
    ("waitUntilMoveIsFinished",),
    ("killMove",),
    ("getRobotPosition", True),
    ("getRobotPosition", False),
    ("getNextRobotPosition",),
    ("getRobotVelocity",),
    ("getPosition", "RArm", 0, True),
    ("getPosition", "CameraTop", 2, False),
    ("getTransform", "Head", 1, True),
    ("getBodyNames", "Body"),
    ("getBodyNames", "Chains"),
    ("getBodyNames", "JointActuators"),
    ("getJointNames", "LArm"),
    ("getSensorNames",),
    ("getLimits", "Body"),
    ("getLimits", "HeadYaw"),
    ("getRobotConfig",),
    ("getSummary",),
    ("getTaskList",),
    ("areResourcesAvailable", ["HeadYaw", "LArm"]),
    ("killTask", 12345),
    ("killTasksUsingResources", ["HeadYaw"]),
    ("killAll",),
    ("setBreathEnabled", "Body", False),
    ("setCollisionProtectionEnabled", "Arms", False),
    ("setExternalCollisionProtectionEnabled", "All", False),
    ("setExternalCollisionProtectionEnabled", "Arms", False),
    ("getExternalCollisionProtectionEnabled", "LArm"),
    ("setOrthogonalSecurityDistance", 0.1),
    ("setTangentialSecurityDistance", 0.05),
    ("setMoveArmsEnabled", True, False),
    ("setSmartStiffnessEnabled", False),
    ("setIdlePostureEnabled", "Body", False),
    ("setMotionConfig", [["ENABLE_FOOT_CONTACT_PROTECTION", True]]),
    ("getMoveConfig", "Default"),
    ("rest", "RArm"),
    ("rest",),
]

_OTHERS = [
    ("ALMemory.getData", "Device/SubDeviceList/HeadYaw/Position/Sensor/Value"),
    ("ALMemory.getData", "Device/SubDeviceList/RElbowRoll/Hardness/Actuator/Value", 0),
    ("ALMemory.getData", "Device/SubDeviceList/LHand/ElectricCurrent/Sensor/Value"),
    ("ALMemory.getData", "Device/SubDeviceList/HipPitch/Temperature/Sensor/Value"),
    ("ALMemory.getData", "Device/SubDeviceList/WheelFL/Speed/Sensor/Value"),
    ("ALMemory.getData", "Device/SubDeviceList/Platform/Back/Bumper/Sensor/Value"),
    ("ALMemory.getData", "Device/SubDeviceList/Head/Touch/Front/Sensor/Value"),
    ("ALMemory.getData", "Device/SubDeviceList/InertialSensorBase/AngleX/Sensor/Value"),
    ("ALMemory.getData", "Device/SubDeviceList/Battery/Charge/Sensor/Value"),
    ("ALMemory.getData", "RobotConfig/Body/Type"),
    ("ALMemory.getData", "RobotConfig/Body/BaseVersion"),
    ("ALMemory.getListData", ["RobotConfig/Head/Type", "no such key"]),
    ("ALMemory.getTimestamp", "Device/SubDeviceList/HeadYaw/Position/Sensor/Value"),
    ("ALMemory.insertData", "mine", 3),
    ("ALMemory.insertListData", [["one", 1.5], ["two", "b"]]),
    ("ALMemory.raiseEvent", "mine", [1, "a"]),
    ("ALMemory.subscriber", "FrontTactilTouched"),
    ("ALMemory.declareEvent", "mine"),
    ("ALMemory.getDataList", "Bumper"),
    ("ALMemory.getEventList",),
    ("ALMemory.removeData", "mine"),
    ("ALRobotPosture.goToPosture", "StandInit", 0.8),
    ("ALRobotPosture.goToPosture", "StandInit", 100.0),
    ("ALRobotPosture.applyPosture", "Stand", 0.8),
    ("ALRobotPosture.getPostureList",),
    ("ALRobotPosture.getPosture",),
    ("ALRobotPosture.getPostureFamily",),
    ("ALRobotPosture.stopMove",),
    ("ALTracker.lookAt", [1.0, 0.2, 0.1], 0, 0.5, False),
    ("ALTracker.lookAt", [1.0, 0.2, 0.1], 0.5, False),
    ("ALTracker.pointAt", "RArm", [1.0, -0.2, 0.1], 0, 0.5),
    ("ALTracker.setMode", "Head"),
    ("ALTracker.setEffector", "None"),
    ("ALTracker.registerTarget", "Face", 0.1),
    ("ALTracker.unregisterAllTargets",),
    ("ALTracker.stopTracker",),
    ("ALTextToSpeech.say", "Hello \\rspd=80\\ there"),
    ("ALTextToSpeech.say", "Bonjour", "French"),
    ("ALTextToSpeech.setLanguage", "Dutch"),
    ("ALTextToSpeech.setLanguage", "English"),
    ("ALAnimatedSpeech._stopAll", True),
    ("ALTextToSpeech.setParameter", "speed", 90.0),
    ("ALTextToSpeech.setVolume", 0.5),
    ("ALTextToSpeech.getAvailableLanguages",),
    ("ALAnimatedSpeech.say", "^start(animations/Stand/Gestures/Hey_1) Hello"),
    ("ALAnimatedSpeech.say", "Hello", {"bodyLanguageMode": "contextual"}),
    ("ALAutonomousLife.setState", "disabled"),
    ("ALAutonomousLife.getState",),
    ("ALAutonomousLife.setAutonomousAbilityEnabled", "BasicAwareness", False),
    ("ALAutonomousLife.getAutonomousAbilitiesStatus",),
    ("ALBasicAwareness.setEnabled", False),
    ("ALBasicAwareness.setEngagementMode", "Unengaged"),
    ("ALBasicAwareness.setTrackingMode", "Head"),
    ("ALBasicAwareness.pauseAwareness",),
    ("ALBackgroundMovement.setEnabled", False),
    ("ALSpeakingMovement.setEnabled", False),
    ("ALListeningMovement.setEnabled", False),
    ("ALAutonomousBlinking.setEnabled", False),
    ("ALBattery.getBatteryCharge",),
    ("ALBodyTemperature.setEnableNotifications", False),
    ("ALSystem.systemVersion",),
    ("ALSystem.robotName",),
    ("ALRobotModel.getRobotType",),
    ("ALSonar.subscribe", "me"),
    ("ALSonar.unsubscribe", "me"),
    ("ALLeds.fadeRGB", "FaceLeds", 0x00FF00, 0.1),
    ("ALLeds.fadeRGB", "FaceLeds", "red", 0.1),
    ("ALLeds.fadeRGB", "FaceLeds", 1.0, 0.0, 0.0, 0.1),
    ("ALLeds.on", "FaceLeds"),
    ("ALLeds.off", "FaceLeds"),
    ("ALLeds.on", "FaceLed3"),
    ("ALLeds.on", "LeftFaceLed8"),
    ("ALLeds.on", "RightEarLedsFront"),
    ("ALLeds.listLEDs",),
    ("ALBehaviorManager.runBehavior", "animations/Stand/Gestures/Hey_1"),
    ("ALNavigation.startFreeZoneUpdate",),
    ("ALVisionRecognition.getDefaultDatabaseDirectory",),
    ("ALVisionRecognition.getParam", "db_name"),
    ("ALVideoDevice.getAngPosFromImgPos", [0.5, 0.5]),
    ("ALVideoDevice.getImgSizeFromAngSize", [0.1, 0.1]),
    ("ALTouch.getStatus",),
    ("ALVideoDevice.subscribeCamera", "me", 0, 2, 11, 10),
    ("ALVideoDevice.getImageRemote", "me_0"),
    ("ALVideoDevice.releaseImage", "me_0"),
    ("ALVideoDevice.setParameter", 0, 11, 1),
    ("ALVideoDevice.setParam", 18, 1),
    ("ALVideoDevice.getHorizontalFOV", 0),
    ("ALVideoDevice.unsubscribe", "me_0"),
    ("ALVideoDevice.subscribe", "old", 1, 11, 5),
    ("ALVideoDevice.unsubscribe", "old_0"),
    ("ALAudioPlayer.playFile", "/home/nao/sound.wav"),
    ("ALAudioPlayer.playFile", "/home/nao/sound.wav", 0.5, 0.0),
    ("ALAudioRecorder.startMicrophonesRecording", "/home/nao/a.wav", "wav", 16000, [0, 0, 1, 0]),
    ("ALAudioRecorder.stopMicrophonesRecording",),
    ("ALAudioDevice.sendRemoteBufferToOutput", 100, b"\0" * 400),
    ("ALBasicAwareness.resumeAwareness",),
    ("ALBasicAwareness.setStimulusDetectionEnabled", "Sound", True),
    ("ALBehaviorManager.getBehaviorNames",),
    ("ALDialog.setFocus", "topic"),
    ("ALFaceCharacteristics.analyzeFaceCharacteristics", 1),
    ("ALFaceDetection.enableTracking", True),
    ("ALLeds.setIntensity", "FaceLeds", 0.5),
    ("ALSpeechRecognition.removeAllContext",),
    ("ALSpeechRecognition.setAudioExpression", True),
    ("ALSpeechRecognition.setVisualExpression", True),
    ("ALSystem.setRobotName", "Pepper"),
    ("ALTabletService.stopVideo",),
    ("ALTracker.setRelativePosition", [-0.5, 0.0, 0.0, 0.1, 0.1, 0.3]),
]

_CALLS = [(f"ALMotion.{name}", *arguments) for name, *arguments in _MOTION] + _OTHERS


async def _answer(pepper: VirtualPepper, method: str, *arguments: Any) -> Any:
    answer = pepper.call(method, *arguments)
    if asyncio.iscoroutine(answer):
        task = asyncio.get_running_loop().create_task(answer)
        await pepper.finish(task)
        return task.result()
    return answer


def _pictured(pepper: VirtualPepper) -> None:
    image = CameraImage(pepper.robot.now, np.zeros((480, 640, 3), np.uint8))
    depth = CameraImage(pepper.robot.now, np.ones((240, 320), np.float32))
    pepper.robot.images = {0: image, 1: image, 2: depth}


def test_every_call_that_programs_make_is_answered_by_its_signature():
    async def scenario(pepper):
        _pictured(pepper)
        for method, *arguments in _CALLS:
            answer = await _answer(pepper, method, *arguments)
            service, name = method.split(".")
            returns = {m.returns for m in pepper.services[service].overloads(name)}
            assert any(_conforms(answer, r) for r in returns), f"{method} answered {answer!r}"

    virtual(scenario)


_WRONG = [
    ("ALMotion.setAngles", "Tail", 0.0, 0.1),
    ("ALMotion.setAngles", "HeadYaw", [0.0, 1.0], 0.1),
    ("ALMotion.setAngles", "HeadYaw", "far", 0.1),
    ("ALMotion.setAngles", "HeadYaw", float("nan"), 0.1),
    ("ALMotion.setAngles", "HeadYaw", 0.0, 1.5),
    ("ALMotion.setAngles", "HeadYaw", 0.0, -0.1),
    ("ALMotion.setAngles", 5, 0.0, 0.1),
    ("ALMotion.setAngles", ["HeadYaw", ["LArm"]], [0.0, 0.0], 0.1),
    (
        "ALMotion.angleInterpolation",
        ["HeadYaw", "HeadPitch"],
        [[0.1, 0.2], [0.1]],
        [[1.0], [1.0]],
        True,
    ),
    ("ALMotion.angleInterpolation", "HeadYaw", [0.1, 0.2], [1.0, 0.5], True),
    ("ALMotion.angleInterpolation", "HeadYaw", 0.1, 0.0, True),
    ("ALMotion.angleInterpolation", "HeadYaw", [], [], True),
    ("ALMotion.angleInterpolation", "HeadYaw", None, 1.0, True),
    ("ALMotion.angleInterpolationWithSpeed", "HeadYaw", 0.1, 0.0),
    ("ALMotion.angleInterpolationBezier", ["HeadYaw"], [[1.0]], [[[0.1, [3]]]]),
    ("ALMotion.moveTo", float("inf"), 0.0, 0.0),
    ("ALMotion.moveTo", [0.1, 0.0]),
    ("ALMotion.move", 0.1, 0.0, 0.0, [["MaxVelXY"]]),
    ("ALMotion.getPosition", "Tail", 0, True),
    ("ALMotion.getLimits", "Tail"),
    ("ALMotion.transformInterpolations", [], 0, [], 7, [], True),
    ("ALMotion.setPosition", "RArm", 0, [0.0] * 6, 0.5, 7),
    ("ALMemory.getData", "no such key"),
    ("ALVideoDevice.getResolution", "nobody"),
    ("ALAutonomousLife.setState", "asleep"),
    ("ALTextToSpeech.setLanguage", "Latin"),
    ("ALTracker.lookAt", [1.0, 0.0], 0, 0.5, False),
    ("ALTracker.track", "Face"),
    ("ALNavigation.navigateToInMap", [1.0, 0.0, 0.0]),
    ("ALSystem.reboot",),
    ("ALSystem.shutdown",),
    ("ALTracker.setRelativePosition", [-0.5, 0.0]),
    ("ALTracker.setMoveConfig", [["MaxVelXY"]]),
    ("ALMotion.setFootStepsWithSpeed", ["LLeg"], [[0.1, 0.0, 0.0]], [0.5], False),
    ("ALMotion.wbEnable", True),
    ("ALMotion.wbEnableBalanceConstraint", True, "Legs"),
    ("ALMotion.wbEnableEffectorControl", "Head", True),
    ("ALMotion.wbFootState", "Fixed", "Legs"),
    ("ALMotion.wbGoToBalance", "Legs", 1.0),
    ("ALMotion.wbSetEffectorControl", "Head", [0.1, 0.0, 0.0]),
]


def test_what_is_wrong_is_answered_with_the_method_and_a_sentence_and_moves_nothing():
    async def scenario(pepper):
        before = pepper.motion.joints.command.copy()
        for method, *arguments in _WRONG:
            with pytest.raises(ServiceError) as error:
                await _answer(pepper, method, *arguments)
            text = str(error.value)
            assert text.startswith(method.replace(".", "::") + ": "), text
            _check_text(text)
        await pepper.run(1.0)
        np.testing.assert_array_equal(pepper.motion.joints.command, before)
        assert pepper.call("ALMotion.getTaskList") == []
        assert pepper.call("ALMotion.getRobotVelocity") == [0, 0, 0]

    virtual(scenario)


def test_what_is_not_served_says_so_and_is_logged_once():
    async def scenario(pepper):
        for _ in range(2):
            with pytest.raises(ServiceError, match=r"^ALWorldRepresentation::getRootName: not s"):
                pepper.call("ALWorldRepresentation.getRootName")
        told = [line for line in pepper.lines if "World" in line]
        assert told == ["ALWorldRepresentation::getRootName was asked for and is not simulated"]

    virtual(scenario)


_ANYTHING = {"s": "HeadYaw", "f": 0.25, "d": 0.25, "i": 1, "I": 1, "b": True, "o": None}


def _anything(parameters: str, dynamic: Any) -> list[Any]:
    values: list[Any] = []
    k = 1
    while k < len(parameters) - 1:
        if parameters[k] == "(":
            values.append((1, 2))
            k = parameters.index(">", k) + 1
        elif parameters[k] in "[{":
            end = parameters.index("]" if parameters[k] == "[" else "}", k)
            values.append([] if parameters[k] == "[" else {})
            k = max(end, parameters.rfind("]", k, -1) if parameters[k + 1] == "[" else end) + 1
        else:
            values.append((_ANYTHING | {"m": dynamic})[parameters[k]])
            k += 1
    return values


async def _outcome(pepper: VirtualPepper, handler: Any, arguments: list[Any]) -> tuple[Any, Any]:
    try:
        answer = handler(*arguments)
        if asyncio.iscoroutine(answer):
            task = asyncio.get_running_loop().create_task(answer)
            await pepper.finish(task)
            answer = task.result()
    except ServiceError as error:
        return None, str(error)
    return answer, None


@pytest.mark.parametrize(
    "dynamic", [0.25, -3, True, None, "HeadYaw", "", [], [[]], [None], {"a": 1}, [1, 2, 3], b"raw"]
)
def test_no_method_whatever_it_is_given_fails_in_another_way(dynamic):
    async def scenario(pepper):
        _pictured(pepper)
        for service in pepper.services.values():
            for method in service.methods.values():
                inherited = hasattr(Module, python_name(method.name))
                if method.name == "__pCall" or (inherited and service.name != "ALSonar"):
                    continue  # What every module has is asked of one.
                arguments = _anything(method.parameters, dynamic)
                if method.wants_caller:
                    arguments.insert(0, CALLER)
                answer, error = await _outcome(pepper, method.handler, arguments)
                if error is None:
                    assert _conforms(answer, method.returns), (service.name, method, answer)
                else:
                    assert error.startswith(f"{service.name}::{method.name}: ")
                    _check_text(error)

    virtual(scenario)


def test_module_methods_call_beside_the_caller():
    async def scenario(pepper):
        uid = next(m.uid for m in pepper.services["ALMotion"].overloads("angleInterpolation"))
        number = pepper.call("ALMotion.__pCall", uid, ["HeadYaw", 0.5, 1.0, True])
        await pepper.run(0.5)
        assert pepper.call("ALMotion.isRunning", number)
        await pepper.run(1.0)
        assert not pepper.call("ALMotion.isRunning", number)
        assert await pepper.call("ALMotion.wait", number, 0) is False
        assert pepper.angle("HeadYaw") == pytest.approx(0.5)
        uid = next(m.uid for m in pepper.services["ALMotion"].overloads("setAngles"))
        pepper.call("ALMotion.__pCall", uid, ["HeadYaw", 0.2, 0.5])
        await pepper.run(1.0)
        assert pepper.angle("HeadYaw") == pytest.approx(0.2)
        assert "setAngles" in pepper.call("ALMotion.getMethodList")
        assert pepper.call("ALMotion.ping") is True
        assert pepper.call("ALMotion.version").startswith("2.5.")

    virtual(scenario)


def test_a_service_that_is_made_of_nothing_refuses_everything():
    service = make_service("ALFaceDetection", object())
    for method in service.methods.values():
        with pytest.raises(ServiceError, match="not simulated"):
            method.handler()


def _check_text(text: str) -> None:
    assert "\n" not in text
    assert not re.search(r"\.py|/\w+/\w+\.|0x[0-9a-f]{6}", text), text


def _conforms(value: Any, signature: str) -> bool:
    if "(" in signature:
        parsed = parse_signature(signature)
        if parsed.letter == "(":
            inside = zip(value, parsed.items, strict=True)
            return isinstance(value, tuple) and all(_conforms(v, str(item)) for v, item in inside)
    if signature == "v":
        return value is None
    if signature == "m":
        return _dynamic(value)
    if signature.startswith("["):
        return isinstance(value, list) and all(_conforms(v, signature[1:-1]) for v in value)
    if signature.startswith("{"):
        return isinstance(value, dict)
    kinds: dict[str, Any] = {"b": bool, "i": int, "I": int, "f": float, "s": str, "o": Service}
    if signature == "f":
        return isinstance(value, float | int) and not isinstance(value, bool | np.generic)
    if signature in "iI":
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, kinds[signature])


def _dynamic(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return all(map(_dynamic, value))
    if isinstance(value, dict):
        return all(map(_dynamic, [*value.keys(), *value.values()]))
    return value is None or type(value) in (bool, int, float, str, bytes)
