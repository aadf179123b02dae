import base64
import socket
import subprocess
import sys
import urllib.request

import pytest
import umsgpack
import zmq

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
    """Whether who opens the window now is sent a command."""
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
