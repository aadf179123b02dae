import base64
import contextlib
import gc
import random
import re
import struct
import subprocess
import sys
import urllib.error
import urllib.request

import msgpack
import numpy as np
import psutil
import pytest
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform
from tornado.httpclient import HTTPClientError

from pepper_drake.errors import InputError
from pepper_drake.web.drake_page import DrakePage, offline_meshcat


@pytest.fixture
def page():
    with DrakePage() as page:
        page.meshcat.AddSlider("ahead", -0.2, 0.2, 0.01, 0.0)
        page.meshcat.AddButton("Record (R)", "KeyR")
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
    waiting(lambda: any(m["type"] == "set_control" for m in later.told))
    assert not any(m.get("path", "").endswith("ball") for m in later.told)


def test_what_one_browser_moves_all_show_and_meshcat_knows(page, open_browser, waiting):
    one, other = open_browser(page.ws_url), open_browser(page.ws_url)
    waiting(lambda: len(other.told) >= 2)
    one.send({"type": "slider", "name": "ahead", "value": 0.12})
    one.send({"type": "button", "name": "Record (R)"})
    waiting(lambda: page.meshcat.GetButtonClicks("Record (R)") == 1)
    assert page.meshcat.GetSliderValue("ahead") == 0.12
    waiting(lambda: other.told[-1]["type"] == "set_control_value")
    assert other.told[-1]["value"] == 0.12
    third = open_browser(page.ws_url)
    waiting(lambda: any(m.get("name") == "ahead" for m in third.told))
    assert next(m for m in third.told if m.get("name") == "ahead")["value"] == 0.12


@pytest.mark.parametrize(("sent", "value"), [(9e9, 0.2), (-1e300, -0.2), (3, 0.2), (0.07, 0.07)])
def test_a_slider_stays_within_what_it_shows(page, open_browser, waiting, sent, value):
    browser = open_browser(page.ws_url)
    browser.send({"type": "slider", "name": "ahead", "value": sent})
    waiting(lambda: page.meshcat.GetSliderValue("ahead") == value)


def test_a_game_pad_is_passed_on_within_its_range(page, open_browser, waiting):
    browser = open_browser(page.ws_url)
    pad = {"index": 0, "axes": [0.5, -40.0], "button_values": [2, 0.25, -1]}
    browser.send({"type": "gamepad", "name": "", "gamepad": pad})
    waiting(lambda: page.meshcat.GetGamepad().index == 0)
    np.testing.assert_allclose(page.meshcat.GetGamepad().axes, [0.5, -1.0])
    np.testing.assert_allclose(page.meshcat.GetGamepad().button_values, [1.0, 0.25, 0.0])
    browser.send({"type": "gamepad", "name": "", "gamepad": {}})
    waiting(lambda: not page.meshcat.GetGamepad().axes)


def test_a_pad_lets_go_when_its_browser_goes(page, open_browser, waiting):
    browser = open_browser(page.ws_url)
    pad = {"index": 0, "axes": [0.5, -1.0], "button_values": []}
    browser.send({"type": "gamepad", "name": "", "gamepad": pad})
    waiting(lambda: list(page.meshcat.GetGamepad().axes) == [0.5, -1.0])
    browser.close()
    waiting(lambda: not page.meshcat.GetGamepad().axes)


HOSTILE = [
    b"",
    b"\xc1",
    b"\x00",
    b"\xff" * 100,
    "a text",
    "",
    b"\x91" * 4000,
    b"\xdf\xff\xff\xff\xff",
    b"x" * 5000,
    msgpack.packb({"type": "slider", "name": "ahead", "value": float("nan")}),
    msgpack.packb({"type": "slider", "name": "ahead", "value": float("inf")}),
    msgpack.packb({"type": "slider", "name": "ahead", "value": "0.1"}),
    msgpack.packb({"type": "slider", "name": "ahead", "value": None}),
    msgpack.packb({"type": "slider", "name": "ahead", "value": True}),
    msgpack.packb({"type": "slider", "name": ["ahead"], "value": 0.1}),
    msgpack.packb({"type": "slider", "name": "Record (R)", "value": 0.1}),
    msgpack.packb({"type": "button", "name": "ahead"}),
    msgpack.packb({"type": "set_object", "path": "/x"}),
    msgpack.packb({"type": ["button"], "name": "Record (R)"}),
    msgpack.packb({"type": "gamepad", "name": "", "gamepad": {"index": 0, "axes": [1]}}),
    msgpack.packb({"type": "gamepad", "gamepad": {"index": 0, "axes": "no", "button_values": []}}),
    msgpack.packb({"type": "gamepad", "gamepad": {"index": 10**12}}),
    msgpack.packb({"type": "gamepad", "gamepad": 5}),
    msgpack.packb({"type": "button", "name": "Record (R)"}) + b"\x00",
    msgpack.packb({1: 2}),
    msgpack.packb([]),
    msgpack.packb(2**63),
]


@pytest.mark.parametrize("message", HOSTILE)
def test_a_bad_message_closes_its_own_connection_alone(page, open_browser, waiting, message):
    good, bad = open_browser(page.ws_url), open_browser(page.ws_url)
    bad.send(message)
    waiting(lambda: bad.is_closed)
    good.send({"type": "button", "name": "Record (R)"})
    waiting(lambda: page.meshcat.GetButtonClicks("Record (R)") == 1)
    assert page.meshcat.GetSliderValue("ahead") == 0.0
    assert not good.is_closed


@pytest.mark.parametrize(
    "message",
    [
        {"type": "button", "name": "gone"},
        {"type": "slider", "name": "gone", "value": 1.0},
        {"type": "camera_pose", "camera_pose": [0.0] * 16, "is_perspective": True},
    ],
)
def test_what_is_said_too_late_is_forgotten(page, open_browser, waiting, message):
    browser = open_browser(page.ws_url)
    browser.send(message)
    browser.send({"type": "button", "name": "Record (R)"})
    waiting(lambda: page.meshcat.GetButtonClicks("Record (R)") == 1)


def test_mutated_messages_in_great_number_leave_the_page_as_it_is(page, open_browser, waiting):
    """A sample of what `scripts/fuzz.py` does 100,000 times."""
    dice = random.Random(15)
    good = open_browser(page.ws_url)
    bad = open_browser(page.ws_url)
    for _ in range(1500):
        value = struct.unpack("d", dice.randbytes(8))[0]
        data = bytearray(msgpack.packb({"type": "slider", "name": "ahead", "value": value}))
        for _ in range(dice.randrange(3)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        if bad.is_closed:
            bad.close()
            bad = open_browser(page.ws_url)
        try:
            bad.send(bytes(data))
        except Exception:  # Closed in between.
            bad.is_closed = True
    good.send({"type": "button", "name": "Record (R)"})
    waiting(lambda: page.meshcat.GetButtonClicks("Record (R)") >= 1)
    assert -0.2 <= page.meshcat.GetSliderValue("ahead") <= 0.2


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
