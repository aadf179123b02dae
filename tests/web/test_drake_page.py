import base64
import contextlib
import gc
import random
import re
import subprocess
import sys
import urllib.error
import urllib.request

import msgpack
import numpy as np
import psutil
import pytest
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform
from tornado.httpclient import HTTPClientError

from pepper_drake.errors import InputError
from pepper_drake.web.drake_page import DrakePage, offline_meshcat


@pytest.fixture
def page():
    with DrakePage() as page:
        page.meshcat.SetObject("cube", Box(0.1, 0.1, 0.1))
        page.meshcat.Flush()
        yield page


def listening():
    this = psutil.Process()
    return [
        connection.laddr
        for process in (this, *this.children(recursive=True))
        for connection in process.net_connections()
        if connection.status == psutil.CONN_LISTEN
    ]


def ask(url, **headers):
    request = urllib.request.Request(url, headers=headers)
    with urllib.request.urlopen(request, timeout=10) as answer:
        return answer.read()


def test_nobody_can_connect_to_what_is_only_recorded():
    before = listening()
    with offline_meshcat() as meshcat:
        assert listening() == before
        meshcat.SetObject("ball", Sphere(0.1))
        assert "set_object" in drawn(meshcat)


def test_a_page_listens_at_this_computer_alone(page):
    assert [address.ip for address in listening()] == ["127.0.0.1"]
    assert page.url.startswith("http://127.0.0.1:")
    assert b"MeshCat" in ask(page.url)


def test_pages_leave_nothing_behind():
    def count():
        gc.collect()
        this = psutil.Process()
        return this.num_fds(), this.num_threads(), len(this.children())

    def use():
        with DrakePage() as page:
            page.meshcat.AddButton("Go")

    use()
    before = count()
    with offline_meshcat():
        # What other tests left may go meanwhile.
        assert np.all(np.array(count()) <= before), "the page's own is used again"
    for _ in range(3):
        with offline_meshcat():
            pass
    assert np.all(np.array(count()) <= before)


def drawn(meshcat):
    """The types of messages in a recording, the camera's aside."""
    kinds = []
    for encoded in re.findall(r"base64,([A-Za-z0-9+/=]{8,9999})", meshcat.StaticHtml()):
        with contextlib.suppress(ValueError):
            message = msgpack.unpackb(base64.b64decode(encoded))
            if "path" not in message or message["path"].startswith("/drake"):
                kinds.append(message["type"])
    return sorted(kinds)


def test_what_was_used_is_as_good_as_new():
    with offline_meshcat():
        pass
    with offline_meshcat() as meshcat:
        new = drawn(meshcat)
        meshcat.SetProperty("/Grid", "visible", False)
        meshcat.SetObject("a/b", Sphere(0.1))
        meshcat.AddSlider("ahead", 0.0, 1.0, 0.1, 0.5)
        meshcat.SetCameraPose([1, 1, 1], [0, 0, 0])
        meshcat.StartRecording()
        meshcat.SetTransform("a/b", RigidTransform(), 0.5)
        meshcat.PublishRecording()
        assert drawn(meshcat) != new
    with offline_meshcat() as again:
        assert again is meshcat
        assert drawn(again) == new
        assert not again.GetSliderNames()


def test_the_page_goes_with_the_program(tmp_path):
    program = (
        "import os, signal\n"
        "from pepper_drake.web.drake_page import DrakePage\n"
        "page = DrakePage()\n"
        "print(page._process.pid, page.url, flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert result.returncode == -9
    server, _ = result.stdout.split()
    # Its port may be another test's page by now: the process is what has to be gone.
    waiting = [psutil.Process(int(server))] if psutil.pid_exists(int(server)) else []
    _, alive = psutil.wait_procs(waiting, 60)
    assert not alive


def test_every_browser_sees_what_was_drawn(page, open_browser, waiting):
    page.meshcat.SetObject("ball", Sphere(0.1))
    page.meshcat.SetTransform("ball", RigidTransform([1.0, 2.0, 3.0]))
    page.meshcat.Flush()
    late = open_browser(page.ws_url)
    waiting(lambda: any(m["type"] == "set_transform" for m in late.told))
    kinds = [m["type"] for m in late.told if m.get("path", "").endswith("ball")]
    assert kinds == ["set_object", "set_transform"]
    page.meshcat.SetTransform("ball", RigidTransform())
    waiting(lambda: [m["type"] for m in late.told].count("set_transform") == 2)
    page.meshcat.Delete("ball")
    page.meshcat.Flush()
    later = open_browser(page.ws_url)
    waiting(lambda: any(m.get("path", "").endswith("cube") for m in later.told))
    assert not any(m.get("path", "").endswith("ball") for m in later.told)


HOSTILE = [
    b"",
    b"\xc1",
    "a text",
    b"\xdf\xff\xff\xff\xff",
    msgpack.packb({"type": "slider", "name": "ahead", "value": float("nan")}),
    msgpack.packb({"type": "set_object", "path": "/x"}),
    msgpack.packb({"type": "gamepad", "name": "", "gamepad": {"index": 10**12}}),
    msgpack.packb([]),
]


def test_meshcat_hears_nothing_of_what_browsers_say(page, open_browser, waiting):
    """One byte that it does not expect would end the program."""
    bad, good = open_browser(page.ws_url), open_browser(page.ws_url)
    dice = random.Random(15)
    for message in HOSTILE:
        bad.send(message)
    for _ in range(500):
        bad.send(dice.randbytes(dice.randrange(1, 100)))
    page.meshcat.SetObject("ball", Sphere(0.1))
    page.meshcat.Flush()
    for browser in (bad, good):
        waiting(lambda told=browser.told: any(m.get("path", "").endswith("ball") for m in told))
    assert not page.meshcat.GetGamepad().axes


def test_a_message_that_is_too_long_closes_its_own_connection_alone(page, open_browser, waiting):
    good, bad = open_browser(page.ws_url), open_browser(page.ws_url)
    bad.send(b"x" * 5000)
    waiting(lambda: bad.is_closed)
    assert not good.is_closed


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://[bad"},
        {"Origin": "http://localhost:1"},
        {"Host": "evil.example"},
        {"Host": "evil.example:7000", "Origin": "http://evil.example:7000"},
    ],
)
def test_other_websites_are_refused(page, open_browser, headers):
    with pytest.raises(HTTPClientError, match="403"):
        open_browser(page.ws_url, **headers)
    with pytest.raises(urllib.error.HTTPError, match="403"):
        ask(page.url, **headers)


def test_the_page_itself_is_admitted(page, open_browser):
    address = page.url.removeprefix("http://").rstrip("/")
    open_browser(page.ws_url, Origin=f"http://{address}")
    named = address.replace("127.0.0.1", "localhost")
    open_browser(page.ws_url, Host=named, Origin=f"http://{named}")


def test_beyond_this_computer_the_address_holds_a_token(open_browser):
    with DrakePage(host="0.0.0.0") as page:
        bare, _, token = page.ws_url.partition("?token=")
        bare = f"ws://127.0.0.1:{bare.rstrip('/').rpartition(':')[2]}/"
        assert len(token) >= 32
        for wrong in (bare, f"{bare}?token=", f"{bare}?token={token[:-1]}", f"{bare}?token=ä"):
            with pytest.raises((HTTPClientError, UnicodeError)):
                open_browser(wrong)
        with pytest.raises(urllib.error.HTTPError, match="403"):
            ask(bare.replace("ws:", "http:"))
        assert b"MeshCat" in ask(f"{bare}?token={token}".replace("ws:", "http:"))
        open_browser(f"{bare}?token={token}")
        with pytest.raises(HTTPClientError):
            open_browser(f"{bare}?token={token}", Origin="http://evil.example")


def test_a_host_that_is_not_here_is_refused():
    for host in ("192.0.2.1", "no such host", "x" * 300, ""):
        with pytest.raises(InputError, match="is not an address of this computer"):
            DrakePage(host=host)
