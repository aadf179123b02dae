import asyncio
import base64
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import psutil
import pytest
import umsgpack
import zmq
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from pepper_drake.errors import InputError
from pepper_drake.playback import server
from pepper_drake.playback.drawing import Command


def free_url():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


def command(kind, path, **fields):
    return Command(kind, path, umsgpack.packb({"type": kind, "path": path, **fields}))


CONTROL = command("set_control", "/pepper_drake/control", name="figures", callback="() => 1")


def shows(url, command):
    """True if a window that is opened now is sent a command."""
    with zmq.Context.instance().socket(zmq.REQ) as connection:
        connection.connect(url)
        connection.send(b"get_scene")
        return base64.b64encode(command.data).decode() in connection.recv().decode()


def test_a_server_keeps_what_it_is_sent_for_whoever_comes_later_and_ends_when_told():
    url = free_url()
    process = server.start_server(url)
    try:
        server.wait_for_server(url, process)
        web_url = server.send([CONTROL], url)
        with urllib.request.urlopen(web_url) as page:
            assert "MeshCat" in page.read().decode()
        assert server.send([], url) == web_url, "the window stays"
        assert shows(url, CONTROL)
        server.send([command("delete", "/pepper_drake")], url)
        assert not shows(url, CONTROL)
        server.quit_server(url)
        assert process.wait(10) == 0
        with pytest.raises(InputError, match="there is no server to stop"):
            server.quit_server(url)
    finally:
        process.kill()
        process.wait(10)


def test_a_stock_server_will_do_but_is_not_ours_to_end():
    url = free_url()
    stock = subprocess.Popen(
        [sys.executable, "-m", "meshcat.servers.zmqserver", "--zmq-url", url],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        server.wait_for_server(url, stock)
        server.send([CONTROL], url)
        assert shows(url, CONTROL)
        with pytest.raises(InputError, match=r"not started by play\.py"):
            server.quit_server(url)
        with pytest.raises(InputError, match="the server says error"):
            server.send([command("sing", "/")], url)
    finally:
        stock.terminate()
        stock.wait(10)


def test_who_listens_but_is_no_meshcat_server_is_told_apart(monkeypatch):
    monkeypatch.setattr(server, "_ANSWER_MS", 200)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        url = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(InputError, match="no meshcat server answers here"):
            server.send([], url)


def test_a_server_that_cannot_listen_is_reported():
    process = subprocess.Popen([sys.executable, "-c", "raise SystemExit(1)"])
    process.wait(10)
    with pytest.raises(InputError, match="no meshcat server can be started here"):
        server.wait_for_server(free_url(), process)


@pytest.mark.parametrize("url", ["6000", "tcp://", "http://127.0.0.1:6000", "tcp://here:port"])
def test_what_is_no_address_is_named(url):
    with pytest.raises(InputError, match=r"it must be like tcp://127\.0\.0\.1:6000"):
        server.is_listening(url)


@pytest.mark.parametrize(("kept", "code"), [(False, 1), (True, None)])
def test_a_server_outlives_who_started_it_only_if_its_window_is_shown(kept, code):
    process = server.start_server(free_url())
    try:
        if kept:
            server.keep_server(process)
            time.sleep(1.0)
        else:
            process.stdin.close()  # As the system does when a process ends, however it does.
            process.wait(10)
        assert process.poll() == code
    finally:
        process.kill()
        process.wait(10)


@pytest.fixture
def running():
    """A server, and where it takes commands."""
    url = free_url()
    process = server.start_server(url)
    server.wait_for_server(url, process)
    yield url, process
    process.kill()
    process.wait(10)


def ask(url, *frames):
    with zmq.Context.instance().socket(zmq.REQ) as connection:
        connection.linger, connection.rcvtimeo = 0, 5000
        connection.connect(url)
        connection.send_multipart(frames)
        return connection.recv()


@pytest.mark.parametrize(
    "frames",
    [
        (b"",),
        (b"\xff\xfe",),
        (b"set_object",),
        (b"set_object", b"/x"),
        (b"set_object", b"\xff", b"\x80"),
        (b"set_object", b"/x", b"\xc1"),
        (b"set_object", b"/x", b"\x80"),
        (b"set_object", b"/x", b"\x91" * 5000),
        (b"set_transform", b"/x", b""),
        (b"delete", b"", b"", b""),
        (b"capture_image",),
        (b"capture_image", b"", b""),
        (b"quit", b"now"),
        (b"sing", b"/", b""),
        (b"x" * 1_000_000,),
    ],
)
def test_a_bad_command_is_answered_and_the_next_one_done(running, frames):
    url, _ = running
    assert ask(url, *frames).startswith(b"error")
    assert server.send([CONTROL], url).startswith("http://127.0.0.1:")
    assert shows(url, CONTROL)


def test_the_window_is_for_this_computer_and_its_own_page(running):
    url, process = running
    web_url = server.send([CONTROL], url)
    listening = [
        connection.laddr.ip
        for connection in psutil.Process(process.pid).net_connections()
        if connection.status == psutil.CONN_LISTEN
    ]
    assert listening == ["127.0.0.1"] * 2
    for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
        request = urllib.request.Request(web_url, headers=headers)
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(request)


def test_what_a_browser_was_not_asked_for_closes_its_connection(running):
    url, _ = running
    web_url = server.send([CONTROL], url)

    async def say(message):
        socket_url = web_url.replace("http://", "ws://").replace("/static/", "/")
        connection = await websocket_connect(socket_url)
        assert await connection.read_message() == CONTROL.data
        await connection.write_message(message, binary=isinstance(message, bytes))
        while await connection.read_message() is not None:
            pass
        return connection.close_code

    for message in ("", "{}", '{"data": 1}', '{"data": "data:image/png,x"}', "[" * 9999, b"\xc1"):
        assert asyncio.run(say(message)) == 1008
    assert shows(url, CONTROL)


def test_other_computers_need_the_token():
    url = free_url()
    process = server.start_server(url, "0.0.0.0")
    try:
        server.wait_for_server(url, process)
        web_url = server.send([CONTROL], url)
        port, token = web_url.partition(":")[2].partition(":")[2].split("/static/?token=")
        page = f"http://127.0.0.1:{port}/static/"
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(page)
        with urllib.request.urlopen(f"{page}?token={token}") as answer:
            cookie = answer.headers["Set-Cookie"].partition(";")[0]

        async def look(headers):
            request = HTTPRequest(f"ws://127.0.0.1:{port}/", headers=headers)
            return await (await websocket_connect(request)).read_message()

        assert asyncio.run(look({"Cookie": cookie})) == CONTROL.data
        with pytest.raises(HTTPClientError, match="403"):
            asyncio.run(look({}))
    finally:
        process.kill()
        process.wait(10)


@pytest.mark.parametrize("url", ["tcp://0.0.0.0:6000", "tcp://192.0.2.1:6000"])
def test_commands_come_from_this_computer_alone(url):
    with pytest.raises(InputError, match="for this computer only"):
        server.start_server(url)
