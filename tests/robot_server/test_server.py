"""The server against libqi's own client, and against clients that mean it harm."""

import asyncio
import json
import random
import subprocess
import sys
import textwrap
import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import pytest

from pepper_drake.errors import InputError
from pepper_drake.naoqi.wire import HEADER, Message, MessageType, decode, encode, read_header
from pepper_drake.robot_server.wire.connection import Credentials
from pepper_drake.robot_server.wire.server import QiServer
from pepper_drake.robot_server.wire.service import Service, ServiceError

CAPABILITIES = encode("{sm}", {"ClientServerSocket": True})


class Echo:
    """A service with one of each kind."""

    def __init__(self):
        self.left, self.cancelled, self.value = [], 0, 3.5
        self.server = None
        self.service = service = Service("Echo", on_client_left=self.left.append)
        service.add_method("add", "(ii)", "i", lambda a, b: a + b)
        service.add_method("same", "(m)", "m", lambda value: value)
        service.add_method("kind", "(s)", "s", lambda text: "text")
        service.add_method("kind", "(if)", "s", lambda a, b: "numbers")
        service.add_method("image", "()", "m", lambda: [2, 1, b"\xff\x00\xfe\x80\x81\x82"])
        service.add_method("wait", "(f)", "b", self.wait)
        service.add_method("refuse", "()", "v", self.refuse)
        service.add_method("fail", "()", "v", lambda: 1 / 0)
        service.add_method("child", "()", "o", self.child)
        service.add_method("call_client", "(s)", "m", self.call_client)
        service.add_method("call_object", "(o)", "m", lambda remote: remote.call("hello", 2))
        service.add_method("tell", "(i)", "v", lambda number: service.emit("told", number))
        service.add_signal("told", "(i)")
        service.add_property("gain", "f", lambda: self.value, self.set_gain)

    async def wait(self, duration):
        try:
            await asyncio.sleep(duration)
        except asyncio.CancelledError:
            self.cancelled += 1
            raise
        return True

    def refuse(self):
        raise ServiceError("Echo::refuse: not today")

    def child(self):
        child = Service()
        child.add_method("name", "()", "s", lambda: "child")
        return child

    def set_gain(self, value):
        self.value = value

    async def call_client(self, name):
        return await self.server.find(name).call("hello", 1)


@contextmanager
def serving(**options):
    """Runs a server on a thread; gives it, its loop, and its one service."""
    echo, loop, ready = Echo(), asyncio.new_event_loop(), threading.Event()
    server = QiServer([echo.service], port=0, **options)
    echo.server = server

    def run():
        asyncio.set_event_loop(loop)
        loop.run_until_complete(server.start())
        ready.set()
        loop.run_forever()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert ready.wait(10)
    try:
        yield server, loop, echo
    finally:
        asyncio.run_coroutine_threadsafe(server.close(), loop).result(10)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(10)


def libqi(address, body, user=None):
    """Runs a libqi client in a process of its own; it prints JSON last."""
    pytest.importorskip("qi", reason="libqi is in the naoqi extra")
    program = textwrap.dedent(
        """
        import json, os, sys, time, qi
        def leave(*error):
            # libqi's threads may keep a process that has failed from ending.
            sys.__excepthook__(*error); sys.stderr.flush(); os._exit(1)
        sys.excepthook = leave
        qi.logging.setLevel(qi.logging.FATAL)
        app = qi.Application(["test"], raw=True)
        session = qi.Session()
        USER = json.loads(sys.argv[2])
        if USER:
            class Authenticator:
                def initialAuthData(self):
                    return {"user": USER[0], "token": USER[1]}
            class Factory:
                def newAuthenticator(self):
                    return Authenticator()
            session.setClientAuthenticatorFactory(Factory())
        def attempt(call):
            try:
                return call()
            except Exception as error:
                return str(error)
        session.connect(sys.argv[1])
        echo = session.service("Echo")
        """
    )
    end = "\nprint(json.dumps(result)); sys.stdout.flush(); os._exit(0)\n"
    ran = subprocess.run(
        [sys.executable, "-c", program + textwrap.dedent(body) + end, address, json.dumps(user)],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ran.returncode == 0, ran.stderr[-2000:]
    return json.loads(ran.stdout.splitlines()[-1])


def wait_until(holds):
    for _ in range(200):
        if holds():
            return
        time.sleep(0.05)
    raise AssertionError("it never held")


def test_libqi_calls_and_gets_values_errors_and_images():
    body = """
        result = [
            echo.add(2, 3), echo.kind("a"), echo.kind(1, 2.5), list(echo.image()[2]),
            echo.same([1, "a", 0.5, {"k": [True, None]}]),
            attempt(echo.refuse), attempt(echo.fail),
        ]
    """
    with serving() as (server, _, _):
        result = libqi(server.address, body)
    assert result[:4] == [5, "text", "numbers", [255, 0, 254, 128, 129, 130]]
    assert result[4] == [1, "a", 0.5, {"k": [True, None]}]
    assert result[5] == "Echo::refuse: not today"
    assert result[6] == "Echo::fail: failed in the robot"  # No path, no line of our source.


def test_libqi_gets_signals_properties_and_objects():
    body = """
        told = []
        link = echo.told.connect(told.append)
        echo.tell(1); echo.tell(2); time.sleep(0.3)
        echo.told.disconnect(link); time.sleep(0.1); echo.tell(3); time.sleep(0.3)
        echo.gain.setValue(4.0)
        result = [told, echo.gain.value(), echo.child().name()]
    """
    with serving() as (server, _, echo):
        assert libqi(server.address, body) == [[1, 2], 4.0, "child"]
        assert echo.service.emitters == []


def test_a_cancelled_call_is_cancelled_in_the_robot_and_a_client_that_leaves_is_noticed():
    body = """
        future = echo.wait(30.0, _async=True)
        time.sleep(0.2); future.cancel(); time.sleep(0.3)
        echo.wait(30.0, _async=True); time.sleep(0.2)
        result = [future.isCanceled(), [s["name"] for s in session.services()]]
    """
    with serving() as (server, _, echo):
        assert libqi(server.address, body) == [True, ["ServiceDirectory", "Echo"]]
        wait_until(lambda: echo.left)
        assert [caller.client for caller in echo.left] == [1]
        assert echo.cancelled == 2  # The second when its client left.


def test_the_robot_calls_services_and_objects_of_clients():
    body = """
        class Mine:
            def hello(self, number):
                return f"hello {number}"
        class Any:
            def hello(self, *arguments):
                return list(arguments)
        class Nothing:
            def hello(self):
                return "nothing"
        class Two:
            def hello(self, one, two):
                return two
        session.registerService("Mine", Mine())
        twice = attempt(lambda: session.registerService("Mine", Mine()))
        result = [echo.call_client("Mine"), "Mine" in twice]
        for it in (Mine(), Any(), Nothing(), Two()):
            result.append(attempt(lambda: echo.call_object(it)))
    """
    with serving() as (server, _, _):
        *answers, refused = libqi(server.address, body)
        assert answers == ["hello 1", True, "hello 2", [2], "nothing"]
        assert "has no hello of 1 arguments" in refused
        wait_until(lambda: server.find("Mine") is None)


def test_a_password_is_demanded():
    options = {"credentials": Credentials("nao", "secret")}
    with serving(**options) as (server, _, _):
        assert libqi(server.address, "result = echo.add(1, 1)", ["nao", "secret"]) == 2
        with pytest.raises(AssertionError, match="disconnected"):
            libqi(server.address, "result = 0", ["nao", "wrong"])
        with pytest.raises(AssertionError, match="disconnected"):
            libqi(server.address, "result = 0")


def test_an_encrypted_door():
    pytest.importorskip("cryptography", reason="it makes the certificate; it is an extra")
    from pepper_drake.robot_server.wire.tls import server_context

    with serving(tls=server_context("127.0.0.1")) as (server, _, _):
        assert server.address.startswith("tcps://")
        assert libqi(server.address, "result = echo.add(2, 5)") == 7


def test_other_machines_need_a_password():
    with pytest.raises(InputError, match="--password-file"):
        QiServer([], host="0.0.0.0")


class Client:
    """A client that sends the bytes that it is told to."""

    def __init__(self, server):
        self._server = server

    async def __aenter__(self):
        self.reader, self.writer = await asyncio.open_connection("127.0.0.1", self._server.port)
        return self

    async def __aexit__(self, *_):
        self.writer.close()

    async def send(self, data):
        self.writer.write(data)
        await self.writer.drain()

    async def receive(self):
        message, size = read_header(await self.reader.readexactly(HEADER.size))
        return message, await self.reader.readexactly(size)

    async def greet(self):
        await self.send(Message(MessageType.CALL, 1, 0, 0, 8, CAPABILITIES).to_bytes())
        return decode("{sm}", (await self.receive())[1])

    async def add(self):
        payload = encode("(ii)", (20, 22))
        await self.send(Message(MessageType.CALL, 2, 2, 1, 100, payload).to_bytes())
        return decode("i", (await self.receive())[1])

    async def closed(self):
        return await asyncio.wait_for(self.reader.read(), 10) == b""


async def lives(server):
    async with Client(server) as client:
        assert (await client.greet())["__qi_auth_state"] == 3
        assert await client.add() == 42
    return True


HOSTILE = {
    "no header": b"GET / HTTP/1.1\r\nHost: robot\r\nAccept: everything\r\n\r\n",
    "call before the handshake": Message(MessageType.CALL, 1, 2, 1, 100).to_bytes(),
    "too large before the handshake": HEADER.pack(b"\x42\xde\xad\x42", 1, 2**20, 0, 1, 0, 0, 0, 8),
    "garbage in the handshake": Message(MessageType.CALL, 1, 0, 0, 8, b"\xff" * 9).to_bytes(),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_who_breaks_the_protocol_is_let_go_and_nobody_else(name):
    async def attack():
        async with Client(server) as bystander:
            await bystander.greet()
            async with Client(server) as client:
                await client.send(HOSTILE[name])
                assert await client.closed()
            assert await bystander.add() == 42

    with serving() as (server, _, _):
        asyncio.run(attack())


def test_calls_that_make_no_sense_are_answered_with_errors():
    calls = [
        Message(MessageType.CALL, 5, 77, 1, 100),
        Message(MessageType.CALL, 5, 2, 1, 4000),
        Message(MessageType.CALL, 5, 2, 9, 100),
        Message(MessageType.CALL, 5, 2, 1, 100, b"\0"),
        Message(MessageType.CALL, 5, 2, 1, 0, encode("(IIL)", (2, 999, 1))),
        Message(MessageType.CALL, 5, 2, 1, 5, encode("(m)", ("nothing",))),
    ]

    async def call():
        async with Client(server) as client:
            await client.greet()
            for message in calls:
                await client.send(message.to_bytes())
                answer, payload = await client.receive()
                assert (answer.type, answer.id) == (MessageType.ERROR, 5)
                assert decode("m", payload)
            assert await client.add() == 42

    with serving() as (server, _, _):
        asyncio.run(call())


def test_arguments_that_the_caller_could_not_convert_are_converted_or_refused():
    async def call():
        async with Client(server) as client:
            await client.greet()
            for arguments in (("20", 22), (20,), [20, None], (20.9, True), {"a": 1}):
                payload = encode("m", arguments)
                message = Message(MessageType.CALL, 6, 2, 1, 100, payload, flags=1)
                await client.send(message.to_bytes())
                answers.append(await client.receive())

    answers = []
    with serving(log=pytest.fail) as (server, _, _):
        asyncio.run(call())
    assert [decode("i", p) for a, p in answers if a.type == MessageType.REPLY] == [21]
    refused = [decode("m", p) for a, p in answers if a.type == MessageType.ERROR]
    assert len(refused) == 4
    assert all(text.startswith("the arguments do not fit (ii)") for text in refused)


def test_a_cancellation_that_names_no_call_is_ignored():
    async def call():
        async with Client(server) as client:
            await client.greet()
            wait = Message(MessageType.CALL, 4, 2, 1, 105, encode("(f)", (0.2,)))
            await client.send(wait.to_bytes())
            await client.send(replace(wait, type=MessageType.CANCEL, payload=b"").to_bytes())
            assert await client.add() == 42
            answer, payload = await client.receive()
            assert (answer.type, answer.id, decode("b", payload)) == (MessageType.REPLY, 4, True)

    with serving() as (server, _, echo):
        asyncio.run(call())
        assert echo.cancelled == 0


def test_random_frames_disturb_nobody():
    rng = random.Random(0)

    def frame():
        payload = rng.randbytes(rng.choice((0, 4, 30, 300)))
        kind, action = rng.randrange(12), rng.choice((0, 1, 2, 3, 5, 6, 7, 8, 82, 100, 104, 9999))
        message = Message(kind, rng.randrange(9), rng.randrange(4), rng.randrange(3), action)
        data = message.to_bytes()[:8] + len(payload).to_bytes(4, "little")
        data += message.to_bytes()[12:] + payload
        return data if rng.random() < 0.9 else data[: rng.randrange(len(data))]

    async def attack():
        for _ in range(60):
            async with Client(server) as client:
                if rng.random() < 0.8:
                    await client.greet()
                try:
                    for _ in range(20):
                        await client.send(frame())
                except ConnectionError:
                    pass
        assert await lives(server)

    with serving() as (server, _, _):
        asyncio.run(attack())


def test_who_does_not_read_is_let_go():
    async def flood():
        async with Client(server) as client:
            await client.greet()
            payload = encode("(m)", (b"\0" * 2**20,))
            call = Message(MessageType.CALL, 2, 2, 1, 101, payload).to_bytes()
            try:
                for _ in range(200):
                    await asyncio.wait_for(client.send(call), 5)
            except (ConnectionError, TimeoutError):
                pass
        assert await lives(server)

    said = []
    with serving(log=said.append) as (server, _, _):
        asyncio.run(flood())
    assert any("does not read" in line for line in said)
