"""The served table against the data, and every method called as programs call it."""

import asyncio
import re
from typing import Any

import numpy as np
import pytest
from program_calls import CALLS, WRONG_CALLS
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
        for method, *arguments in CALLS:
            answer = await _answer(pepper, method, *arguments)
            service, name = method.split(".")
            returns = {m.returns for m in pepper.services[service].overloads(name)}
            assert any(_conforms(answer, r) for r in returns), f"{method} answered {answer!r}"

    virtual(scenario)


def test_what_is_wrong_is_answered_with_the_method_and_a_sentence_and_moves_nothing():
    async def scenario(pepper):
        before = pepper.motion.joints.command.copy()
        for method, *arguments in WRONG_CALLS:
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
