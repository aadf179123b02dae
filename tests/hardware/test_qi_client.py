"""Our own client against our server, and against libqi's."""

import asyncio
import socket
import subprocess
import sys
import textwrap

import pytest
from served import served

from pepper_drake.errors import InputError
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.qi_client import QiSession, RobotAddress
from pepper_drake.robot_server.wire.connection import Credentials


def using(address, act, **options):
    """Runs a coroutine function with a connected session."""

    async def run():
        session = QiSession(RobotAddress.parse(address), **options)
        await session.connect()
        try:
            return await act(session)
        finally:
            await session.close()

    return asyncio.run(run())


@pytest.mark.parametrize(
    ("text", "scheme", "host", "port"),
    [
        ("tcp://10.0.0.2:9559", "tcp", "10.0.0.2", 9559),
        ("tcps://pepper.local", "tcps", "pepper.local", 9503),
        ("10.0.0.2", "tcp", "10.0.0.2", 9559),
        ("tcp://[::1]:77", "tcp", "::1", 77),
    ],
)
def test_addresses(text, scheme, host, port):
    address = RobotAddress.parse(text)
    assert (address.scheme, address.host, address.port) == (scheme, host, port)


@pytest.mark.parametrize("text", ["", "http://a", "tcp://", "tcp://a:port", "tcp://a:1/b"])
def test_what_is_no_address_is_refused(text):
    with pytest.raises(InputError, match="not a robot's address"):
        RobotAddress.parse(text)


def test_overloads_values_and_errors():
    async def act(session):
        motion = await session.service("ALMotion")
        names = await motion.call("getBodyNames", "Body")
        angles = await motion.call("getAngles", "Body", True)
        await motion.call("setAngles", ["HeadYaw"], [0.2], 0.5)
        await asyncio.sleep(1.0)
        with pytest.raises(LinkFault, match="takes"):
            await motion.call("getAngles", 1, 2, 3)
        with pytest.raises(LinkFault, match="ALMotion") as error:
            await motion.call("getAngles", "NoSuchJoint", True)
        with pytest.raises(LinkFault, match="ALNothing"):
            await session.service("ALNothing")
        return names, angles, await motion.call("getAngles", "HeadYaw", True), error.value.word

    with served() as robot:
        names, angles, yaw, word = using(robot.address, act)
    assert len(names) == len(angles) == 20
    assert yaw == pytest.approx([0.2], abs=1e-6)
    assert word == "call_failed"


def test_events_come_through_a_returned_object():
    async def act(session):
        memory = await session.service("ALMemory")
        heard = []
        subscriber = await memory.call("subscriber", "Greeting")
        await subscriber.subscribe("signal", heard.append)
        await memory.call("raiseEvent", "Greeting", [1, "two"])
        await asyncio.sleep(0.2)
        return heard

    with served() as robot:
        assert using(robot.address, act) == [[1, "two"]]


def test_nobody_there_and_wrong_password():
    async def act(session):
        return True

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        with pytest.raises(LinkFault, match="no robot answers") as fault:
            using(address, act)
        assert fault.value.word == "robot_unreachable"
    with served(credentials=Credentials("nao", "secret")) as robot:
        assert using(robot.address, act, user="nao", password="secret")
        with pytest.raises(LinkFault) as fault:
            using(robot.address, act, user="nao", password="wrong")
        assert fault.value.word == "robot_refused"


def test_a_server_that_goes_is_noticed_during_a_call():
    async def act(session):
        motion = await session.service("ALMotion")
        call = asyncio.ensure_future(
            motion.call("angleInterpolation", ["HeadYaw"], [0.5], [20.0], True)
        )
        await asyncio.sleep(0.2)
        robot.do(lambda: [c.abort() for c, _, _ in robot.server._connections.values()])
        with pytest.raises(LinkFault) as fault:
            await call
        return fault.value.word, session.is_lost

    with served() as robot:
        assert using(robot.address, act) == ("link_lost", True)


def test_a_server_of_libqi():
    pytest.importorskip("qi", reason="libqi is in the naoqi extra")
    program = textwrap.dedent(
        """
        import os, sys, qi
        qi.logging.setLevel(qi.logging.FATAL)
        app = qi.Application(["test"], raw=True)
        session = qi.Session()
        session.listenStandalone("tcp://127.0.0.1:0")
        class Echo:
            def __init__(self):
                self.told = qi.Signal("(m)")
            def same(self, value):
                return value
            def tell(self, value):
                self.told(value)
            def fail(self):
                raise RuntimeError("no")
        session.registerService("Echo", Echo())
        print(session.endpoints()[0]); sys.stdout.flush()
        sys.stdin.read(); os._exit(0)
        """
    )
    server = subprocess.Popen(
        [sys.executable, "-c", program], stdin=-1, stdout=-1, stderr=subprocess.DEVNULL, text=True
    )

    async def act(session):
        echo = await session.service("Echo")
        heard = []
        await echo.subscribe("told", heard.append)
        await echo.call("tell", 7)
        values = [1, "a", 0.5, [True, None], {"k": 2}]
        same = [await echo.call("same", value) for value in values]
        with pytest.raises(LinkFault) as fault:
            await echo.call("fail")
        await asyncio.sleep(0.2)
        return heard, same, values, fault.value.word

    try:
        heard, same, values, word = using(server.stdout.readline().strip(), act)
    finally:
        server.kill()
        server.wait()
    assert heard == [7]
    assert same == values
    assert word == "call_failed"
