"""Checks before a robot is moved, each against a robot that fails it."""

import asyncio

import pytest
from served import served

from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.preflight import PreflightOptions, check_robot, preflight
from pepper_drake.hardware.transport import RobotAccess, make_transport

PREPARED = PreflightOptions(disable_life=True)


def checked(robot, options=PREPARED, wrap=lambda transport: transport):
    async def run():
        transport = make_transport(RobotAccess(robot.address))
        await transport.connect()
        try:
            return await preflight(wrap(transport), "right", options)
        finally:
            await transport.close()

    return asyncio.run(run())


class Changed:
    """A robot that answers some calls otherwise."""

    def __init__(self, transport, answers):
        self._transport, self._answers = transport, answers

    async def call(self, service, method, *arguments):
        key = (method, *arguments[:1]) if method == "getData" else (method,)
        if key in self._answers:
            answer = self._answers[key]
            if isinstance(answer, Exception):
                raise answer
            return answer
        return await self._transport.call(service, method, *arguments)


def test_a_robot_that_is_ready():
    with served() as robot:
        checks = checked(robot)
    assert [check.fault for check in checks] == [""] * 11
    by_name = {check.name: check for check in checks}
    assert by_name["model"].value == "Pepper, body V16"
    assert by_name["NAOqi"].value.startswith("2.5")
    assert float(by_name["hand"].value.split()[0]) < 1.0  # mm: two sources of the same arm.
    assert "disabled" in by_name["autonomous life"].value


@pytest.mark.parametrize(
    ("answers", "word", "text"),
    [
        ({("getData", "RobotConfig/Body/Type"): "Nao"}, "wrong_robot", "Nao"),
        ({("robotIsWakeUp",): False}, "robot_not_ready", "wake it up"),
        ({("getStiffnesses",): [1.0, 1.0, 0.0, 1.0, 1.0]}, "robot_not_ready", "stiffness"),
        ({("getListData",): [40.0, 80.0, None, 40.0, 40.0]}, "robot_not_ready", "80 degrees"),
        ({("getBatteryCharge",): 3}, "robot_not_ready", "charge it"),
        ({("getData", "BatteryTrapIsOpen"): True}, "robot_not_ready", "hatch"),
        ({("getPosition",): [0.3, 0.2, 0.1, 0.0, 0.0, 0.0]}, "wrong_robot", "our kinematics"),
        ({("getState",): "solitary", ("setState",): None}, "robot_not_ready", "life"),
    ],
)
def test_a_robot_that_is_not_ready_is_not_moved(answers, word, text):
    async def run():
        transport = make_transport(RobotAccess(robot.address))
        await transport.connect()
        try:
            await check_robot(Changed(transport, answers), "right", PREPARED)
        finally:
            await transport.close()

    with served() as robot, pytest.raises(LinkFault) as fault:
        asyncio.run(run())
    assert fault.value.word == word
    assert text in str(fault.value)


def test_an_error_that_is_no_answer_ends_the_checks():
    answers = {("getBatteryCharge",): LinkFault("link_lost")}
    with served() as robot, pytest.raises(LinkFault, match="ended"):
        checked(robot, wrap=lambda transport: Changed(transport, answers))


def test_what_the_robot_does_not_tell_is_a_warning_and_not_an_answer():
    answers = {
        ("getBatteryCharge",): LinkFault("call_failed", "no"),
        ("getData", "BatteryTrapIsOpen"): None,
        ("getListData",): [None] * 5,
    }
    with served() as robot:
        checks = checked(robot, wrap=lambda transport: Changed(transport, answers))
    unknown = {check.name for check in checks if check.is_warning}
    assert {"battery", "hatch", "motors"} <= unknown
