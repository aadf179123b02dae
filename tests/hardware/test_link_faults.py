"""Faults of robot and link that are made on purpose: each has its word, and the arm holds."""

import asyncio
import time

import numpy as np
import pytest
from served import delayed, served
from test_link import ARM, NAOQI, START, Led, led

from pepper_drake.hardware.link import LinkConfig, RobotLink
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.mailbox import END, Mailbox
from pepper_drake.hardware.preflight import PreflightOptions, check_robot
from pepper_drake.hardware.transport import RobotAccess, make_transport
from pepper_drake.robot_server.robot_model import MAX_VELOCITY
from pepper_drake.robot_server.robot_port import CameraImage
from pepper_drake.robot_server.service import Caller


def cycles(it):
    """Returns how many commands the robot's motors had."""
    return it.robot.do(lambda: len(it.robot.robot.commands))


async def holds_soon(it, since):
    """Sees that the arm rests 100 ms after the fault, and never jumped since a cycle."""
    await asyncio.sleep(0.1)
    first = cycles(it) - since
    await asyncio.sleep(0.3)
    commands = it.robot.do(lambda: [c.positions[NAOQI] for c in it.robot.robot.commands])
    path = np.array(commands[since:])
    assert np.ptp(path[first:], axis=0).max() < 0.01
    assert np.all(np.abs(np.diff(path, axis=0)) <= MAX_VELOCITY[NAOQI] * 0.02 + 1e-9)


def test_another_program_that_commands_the_arm_is_told():
    async def scenario(it):
        since = cycles(it)
        playing = asyncio.ensure_future(it.play(lambda t: START, 6.0))
        other = Caller(client=99)
        motion = it.robot.pepper.motion
        end = time.monotonic() + 5.0
        while not str(it.state()["fault"]) and time.monotonic() < end:
            it.robot.do(lambda: motion.set_angles(other, ARM, (START - 0.6).tolist(), 0.5))
            await asyncio.sleep(0.003)
        playing.cancel()
        assert str(it.state()["fault"]) == "taken_over"
        assert str(it.state()["detail"]).startswith("another program commands the arm: R")
        await holds_soon(it, since)

    led(scenario)


def test_an_arm_that_the_robot_slows_is_shown_and_goes_on():
    async def scenario(it):
        it.command(START)
        event = "ALMotion/Safety/ChainVelocityClipped"
        it.robot.do(lambda: it.robot.pepper.memory.raise_event(event, [["RArm", [0.5, 0, 1]]]))
        await it.play(lambda t: START, 0.2)
        assert bool(it.state()["slowed"])
        assert not str(it.state()["fault"])
        await it.play(lambda t: START, 1.0)
        assert not bool(it.state()["slowed"])

    led(scenario)


def test_a_camera_that_cannot_be_had_is_told():
    async def scenario(it):
        since = cycles(it)
        it.robot.pepper.video._subscribe = lambda *_: ""
        looking = asyncio.ensure_future(it.keep_looking())
        assert await it.fault() == "camera_missing"
        looking.cancel()
        await holds_soon(it, since)

    led(scenario)


def test_a_camera_of_another_size_is_told():
    async def scenario(it):
        since = cycles(it)
        video = it.robot.pepper.video
        image = CameraImage(it.robot.robot.now, np.zeros((480, 640, 3), np.uint8))
        it.robot.robot.images = {0: image}
        reply = video._reply

        async def smaller(stream):
            return await reply(type(stream)(stream.camera, 1, stream.color_space))

        video._reply = smaller
        looking = asyncio.ensure_future(it.keep_looking())
        assert await it.fault() == "camera_size"
        assert "gives 320x240, not 640x480" in str(it.state()["detail"])
        looking.cancel()
        await holds_soon(it, since)

    led(scenario)


def test_a_robot_that_answers_late_is_refused_and_not_led():
    async def run(robot):
        async with delayed(robot.address, 0.15) as address:
            robot.server.directory._endpoints = lambda _: [address]
            mailbox, transport = Mailbox(), make_transport(RobotAccess(address))
            await transport.connect()
            with pytest.raises(LinkFault) as refused:
                await check_robot(transport, "right", PreflightOptions(disable_life=True))
            assert refused.value.word == "link_slow"
            link = RobotLink(transport, mailbox, LinkConfig("right"))
            it = Led(robot, mailbox, link, transport)
            task = asyncio.ensure_future(link.run())
            try:
                assert await it.fault() == "link_slow"
                before = it.arm()
                it.command(START - 0.5)
                await asyncio.sleep(0.5)
                np.testing.assert_allclose(it.arm(), before, atol=1e-3)
            finally:
                mailbox.command.write(mode=END)
                await asyncio.wait_for(task, 10)
                await transport.close()
                mailbox.close()

    with served() as robot:
        asyncio.run(run(robot))
