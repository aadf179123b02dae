"""Faults of robot and link that are made on purpose: each has its word, and the arm holds."""

import asyncio
import os
import struct
import time

import numpy as np
import pytest
from served import delayed, served
from test_link import ARM, NAOQI, START, Led, led

import pepper_drake.hardware.link
from pepper_drake.errors import InputError
from pepper_drake.hardware import camera_reader, dead_man
from pepper_drake.hardware.link import RobotLink
from pepper_drake.hardware.link_config import LATE_CYCLES, LinkConfig
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.mailbox import END, HAND_OVER, HOLD, Mailbox
from pepper_drake.hardware.preflight import PreflightOptions, check_robot
from pepper_drake.hardware.state_reader import FROZEN
from pepper_drake.hardware.transport import RobotAccess, make_transport
from pepper_drake.robot_server.robot.robot_model import MAX_VELOCITY
from pepper_drake.robot_server.robot.robot_port import CameraImage
from pepper_drake.robot_server.wire.service import Caller

JS_BUTTON = struct.Struct("IhBB")
"""Linux's joystick event: time, value, type, number."""


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


def test_an_arm_that_is_on_its_way_to_a_far_command_is_not_taken_over():
    async def scenario(it):
        # As after a pause: with a tenth of its speed the robot is late for two looks and more.
        await it.play(lambda t: START, 0.3)
        there = lambda: np.allclose(it.arm(), START - 0.5, atol=0.005)  # noqa: E731
        await it.play(lambda t: START - 0.5, 10.0, still=there)
        assert not str(it.state()["fault"]), it.state()["detail"]
        np.testing.assert_allclose(it.arm(), START - 0.5, atol=0.01)

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


def test_a_robot_that_does_not_answer_though_its_socket_is_open_is_told():
    async def scenario(it):
        since = cycles(it)
        playing = asyncio.ensure_future(it.play(lambda t: START, 4.0))
        await asyncio.sleep(0.1)
        it.robot.loop.call_soon_threadsafe(time.sleep, FROZEN + 0.3)
        assert await it.fault() == "link_frozen"
        playing.cancel()
        await asyncio.sleep(0.4)  # It answers again, and is not led any more.
        await holds_soon(it, since)

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
        # An answer in more than 0.21 s, the longest lookahead without its margin, is too late.
        async with delayed(robot.address, 0.11) as address:
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


def test_a_robot_that_was_started_anew_is_told():
    async def scenario(it):
        since = cycles(it)
        playing = asyncio.ensure_future(it.play(lambda t: START + 0.2 * t, 5.0))
        await asyncio.sleep(0.3)
        # As after a start: the same address, another session.
        it.robot.do(it.robot.server.restart)
        assert await it.fault() in ("link_lost", "robot_rebooted")
        end = time.monotonic() + 3.0
        while str(it.state()["fault"]) == "link_lost" and time.monotonic() < end:
            await asyncio.sleep(0.02)
        assert str(it.state()["fault"]) == "robot_rebooted"
        await holds_soon(it, since)
        playing.cancel()

    led(scenario)


def test_a_computer_that_is_too_slow_is_told():
    async def scenario(it):
        playing = asyncio.ensure_future(it.play(lambda t: START + 0.2 * t, 5.0))
        await asyncio.sleep(0.3)
        since = cycles(it)
        # The link's own loop stands still for more than five of its periods.
        time.sleep(0.25)
        assert await it.fault() == "loop_late"
        await holds_soon(it, since)
        playing.cancel()

    led(scenario, late_cycles=LATE_CYCLES)


def test_a_planner_that_is_silent_for_long_is_told(monkeypatch):
    monkeypatch.setattr(pepper_drake.hardware.link, "SILENT", 0.3)

    async def scenario(it):
        await it.play(lambda t: START + 0.2 * t, 0.3)
        since = cycles(it)
        assert await it.fault() == "planner_silent"
        await holds_soon(it, since)

    led(scenario)


@pytest.mark.parametrize("kind", ["pad", "keyboard"])
def test_an_arm_whose_dead_mans_key_is_let_go_holds(kind, monkeypatch, tmp_path):
    if kind == "pad":
        device = tmp_path / "js0"
        os.mkfifo(device)
        ours = os.open(device, os.O_RDWR)
        name, press, release = str(device), JS_BUTTON.pack(1, 1, 1, 3), JS_BUTTON.pack(2, 0, 1, 3)
    else:
        ours, terminal = os.openpty()
        monkeypatch.setattr(dead_man.SpaceBar.__init__, "__defaults__", (os.ttyname(terminal),))
        name, press, release = dead_man.KEYBOARD, b" ", b""

    async def scenario(it):
        await it.play(lambda t: START + 0.2 * t, 0.3)
        np.testing.assert_allclose(it.arm(), START, atol=1e-6)  # Nobody holds it yet.
        assert not str(it.state()["fault"])
        os.write(ours, press)
        repeating = asyncio.ensure_future(repeat(ours, press if kind == "keyboard" else b""))
        await it.play(lambda t: START + 0.2 * t, 1.2)
        assert not str(it.state()["fault"])
        assert np.abs(it.arm() - START).max() > 0.1
        playing = asyncio.ensure_future(it.play(lambda t: START + 0.24 + 0.2 * t, 5.0))
        repeating.cancel()
        begin, since = time.monotonic(), cycles(it)
        os.write(ours, release)
        assert await it.fault() == "dead_man"
        assert time.monotonic() - begin < (0.1 if kind == "pad" else 0.4)
        playing.cancel()
        await holds_soon(it, since)
        # A person is there: the arm is handed over, as at any other end.
        it.command(START, mode=HAND_OVER)
        while str(it.state()["phase"]) == "running":
            await asyncio.sleep(0.02)
        assert str(it.state()["phase"]) == "handing over"
        it.command(START, mode=HOLD)
        while str(it.state()["phase"]) != "running":
            await asyncio.sleep(0.02)
        stiffness = it.robot.do(lambda: it.robot.pepper.motion.get_stiffnesses(ARM))
        assert stiffness == [1.0] * 5  # Called off: it is held, and stiff.

    try:
        led(scenario, dead_man=name)
    finally:
        os.close(ours)


async def repeat(file, data):
    while True:
        os.write(file, data)
        await asyncio.sleep(0.04)


def test_without_a_terminal_nobody_can_hold_the_key():
    with pytest.raises(InputError, match="--unattended"):
        dead_man.SpaceBar("/dev/null")
    with pytest.raises(InputError, match="--pad /dev/input/none: No such file"):
        dead_man.dead_man_key("/dev/input/none")


def test_the_arms_protection_is_off_for_the_run_only():
    async def scenario(it):
        get = "getExternalCollisionProtectionEnabled"
        assert await it.transport.call("ALMotion", get, "Arms") is False
        it.mailbox.command.write(mode=END)
        while str(it.state()["phase"]) != "ended":
            await asyncio.sleep(0.02)
        await asyncio.sleep(0.2)
        assert await it.transport.call("ALMotion", get, "Arms") is True

    led(scenario, protects_arms=False)


def test_a_command_that_is_no_number_ends_the_run():
    async def scenario(it):
        since = cycles(it)
        for _ in range(20):
            it.command(START * np.nan)
            await asyncio.sleep(0.02)
        assert str(it.state()["fault"]) == "planner_silent"
        await holds_soon(it, since)

    led(scenario)


def test_measurements_that_do_not_change_while_it_moves_are_told():
    async def scenario(it):
        since = cycles(it)
        it.robot.do(lambda: setattr(it.robot.robot, "follow", 0.0))
        await it.play(lambda t: START + 0.2 * t, 2.0, still=lambda: bool(it.state()["fault"]))
        assert await it.fault() == "state_frozen"
        await holds_soon(it, since)

    led(scenario)


def test_a_robot_whose_clock_stands_still_is_told():
    async def scenario(it):
        it.robot.do(lambda: setattr(it.robot, "frozen", True))
        since = cycles(it)
        await it.play(lambda t: START + 0.2 * t, 3.0, still=lambda: bool(it.state()["fault"]))
        assert await it.fault() == "state_stale"
        it.robot.do(lambda: setattr(it.robot, "frozen", False))
        await holds_soon(it, since)  # Nothing was left for it to do when it wakes.

    led(scenario)


def test_a_clock_that_jumps_is_told():
    async def scenario(it):
        since = cycles(it)
        playing = asyncio.ensure_future(it.play(lambda t: START + 0.2 * t, 5.0))
        await asyncio.sleep(0.3)
        it.robot.do(lambda: setattr(it.robot.robot, "now", it.robot.robot.now + 3600.0))
        assert await it.fault() == "clock_jump"
        await holds_soon(it, since)
        playing.cancel()

    led(scenario)


def test_an_arm_that_goes_limp_is_told():
    async def scenario(it):
        playing = asyncio.ensure_future(it.play(lambda t: START, 5.0))
        it.robot.do(lambda: it.robot.pepper.motion.set_stiffnesses("RArm", 0.0))
        assert await it.fault() == "stiffness_lost"
        playing.cancel()
        # Its motors stay limp: a person may hold it.
        await asyncio.sleep(0.3)
        assert it.robot.do(lambda: it.robot.pepper.motion.get_stiffnesses("RArm")) == [0.0] * 6

    led(scenario)


def test_an_arm_that_does_not_follow_is_told():
    async def scenario(it):
        since = cycles(it)
        it.robot.do(lambda: setattr(it.robot.robot, "follow", 1e-4))
        playing = asyncio.ensure_future(it.play(lambda t: START + min(0.4 * t, 0.3), 5.0))
        assert await it.fault() == "arm_stalled"
        # Its command comes back to where the arm is; the arm stays.
        before = it.arm()
        await asyncio.sleep(0.6)
        np.testing.assert_allclose(it.arm(), before, atol=1e-3)
        commands = it.robot.do(lambda: [c.positions[NAOQI] for c in it.robot.robot.commands])
        path = np.array(commands[since:])
        assert np.all(np.abs(np.diff(path, axis=0)) <= MAX_VELOCITY[NAOQI] * 0.02 + 1e-9)
        np.testing.assert_allclose(path[-1], before, atol=0.01)
        playing.cancel()

    led(scenario)


def test_a_frozen_camera_is_told(monkeypatch):
    monkeypatch.setattr(camera_reader, "WARM_UP", 0.3)

    async def scenario(it):
        since = cycles(it)
        image = CameraImage(it.robot.robot.now, np.zeros((480, 640, 3), np.uint8))
        it.robot.robot.images = {0: image}
        playing = asyncio.ensure_future(it.keep_looking())
        assert await it.fault(12.0) == "camera_frozen"
        await holds_soon(it, since)
        playing.cancel()

    led(scenario)


def test_a_link_that_is_lost_is_told_and_the_arm_stops():
    async def scenario(it):
        playing = asyncio.ensure_future(it.play(lambda t: START + 0.2 * t, 3.0))
        await asyncio.sleep(0.4)
        since = cycles(it)
        it.robot.do(lambda: [c.abort() for c, _, _ in it.robot.server._connections.values()])
        begin = time.monotonic()
        assert await it.fault() == "link_lost"
        assert time.monotonic() - begin < 0.1
        await holds_soon(it, since)
        playing.cancel()

    led(scenario)
