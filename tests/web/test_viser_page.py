import contextlib
import random
import re
import time
import urllib.error
import urllib.request

import msgpack
import numpy as np
import psutil
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from pepper_drake.web.messages import BadMessageError
from pepper_drake.web.viser_messages import checked
from pepper_drake.web.viser_page import ViserPage
from pepper_drake.web.viser_process import _NO_CONTROLS

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.0, 0.0, 1.0],
    "fov": 1.0,
    "near": 0.1,
    "far": 100.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}
DRAG = {
    "type": "TransformControlsUpdateMessage",
    "name": "/hand",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.1, 0.2, 0.3],
    "owner": "",
}


@pytest.fixture(scope="module")
def page():
    with ViserPage(keys=["KeyR"]) as page:
        page.hand = page.server.scene.add_transform_controls("/hand")
        yield page


def open_socket(url, **headers):
    return connect(
        url.replace("http:", "ws:"),
        subprotocols=[f"viser-v{viser.__version__}"],
        additional_headers=headers,
        max_size=None,
        compression=None,
    )


def wait_for(look):
    end = time.monotonic() + 20
    while not look():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_nothing_listens_but_the_page_on_this_computer(page):
    this = psutil.Process()
    listening = [
        connection.laddr.ip
        for process in (this, *this.children(recursive=True))
        for connection in process.net_connections()
        if connection.status == psutil.CONN_LISTEN
    ]
    assert listening == ["127.0.0.1"]


def test_a_page_leads_and_the_class_looks_on(page):
    with open_socket(page.class_url) as looks:
        looks.recv()  # It is shown what there is.
        looks.send(msgpack.packb(CAMERA))
        looks.send(msgpack.packb(DRAG | {"position": [9.0, 9.0, 9.0]}))
        with open_socket(page.url) as leads:
            leads.send(msgpack.packb(CAMERA))
            leads.send(msgpack.packb(DRAG))
            wait_for(lambda: np.allclose(page.hand.position, DRAG["position"]))
            leads.send(msgpack.packb(DRAG | {"position": [1e9, 0.0, 0.0]}))
            wait_for(lambda: np.allclose(page.hand.position, [10.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": "http://localhost:1"}],
)
@pytest.mark.parametrize("path", ["", "class", "input"])
def test_other_websites_are_refused(page, path, headers):
    with pytest.raises(InvalidStatus, match="403"):
        open_socket(page.url + path, **headers)
    request = urllib.request.Request(page.url + path, headers=headers)
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(request, timeout=10)


def test_beyond_this_computer_each_address_holds_its_own_token():
    with ViserPage("0.0.0.0") as page:
        before, _, lead = page.url.partition("/?token=")
        look = page.class_url.partition("/class/")[2]
        assert len(lead) >= 32
        # It is typed from a blackboard: short, and no letter looks like another.
        assert re.fullmatch("[a-hjkmnp-z2-9]{5}-[a-hjkmnp-z2-9]{5}", look)
        address = f"http://127.0.0.1:{before.rpartition(':')[2]}"
        wrong = look[:-1] + ("a" if look[-1] != "a" else "b")
        refused = ("/", f"/?token={look}", f"/?token={wrong}")
        refused += ("/class", f"/class/{lead}", f"/class/{wrong}")
        for path, code in (*((path, "403") for path in refused), (f"/class/{look}/a", "404")):
            for method in ("GET", "HEAD"):
                request = urllib.request.Request(address + path, method=method)
                with pytest.raises(urllib.error.HTTPError, match=code):
                    urllib.request.urlopen(request, timeout=10)
        with pytest.raises(InvalidStatus, match="403"):
            open_socket(f"{address}/class/{wrong}")
        for path in (f"/?token={lead}", f"/class/{look}", f"/class?token={look}"):
            # An open page asks in this way whether it is still served.
            request = urllib.request.Request(address + path, method="HEAD")
            assert urllib.request.urlopen(request, timeout=10).read() == b""
            assert b"viser" in urllib.request.urlopen(address + path, timeout=10).read().lower()
        with open_socket(f"{address}/class/{look}") as looks:
            looks.recv()


HOSTILE = [
    b"",
    b"\xc1",
    "a text",
    b"x" * 5000,
    msgpack.packb([]),
    msgpack.packb({"type": ["GuiUpdateMessage"]}),
    msgpack.packb({"type": "ShareUrlRequest"}),
    msgpack.packb({"type": "RunJavascriptMessage", "source": "alert(1)"}),
    msgpack.packb({"type": "RemoveSceneNodeMessage", "name": "/hand"}),
    msgpack.packb({"type": "GuiUpdateMessage", "uuid": "1", "updates": {"disabled": True}}),
    msgpack.packb({"type": "GuiUpdateMessage", "uuid": "1", "updates": {"value": float("nan")}}),
    msgpack.packb(DRAG | {"position": [float("nan"), 0.0, 0.0]}),
    msgpack.packb(DRAG | {"position": "abc"}),
    msgpack.packb(DRAG | {"wxyz": [0.0, 0.0, 0.0, 0.0]}),
    msgpack.packb(DRAG | {"more": 1}),
]


@pytest.mark.parametrize("message", HOSTILE)
def test_a_bad_message_closes_its_own_connection_alone(page, message):
    with open_socket(page.url) as good, open_socket(page.url) as bad:
        bad.send(message)
        with contextlib.suppress(ConnectionClosed):
            for _ in bad:  # Ends when it is closed.
                pass
        assert bad.close_code in (1008, 1009)
        place = [0.5, 0.25, float(HOSTILE.index(message)) / 8]
        good.send(msgpack.packb(DRAG | {"position": place}))
        wait_for(lambda: np.allclose(page.hand.position, place))


def test_mutated_messages_are_refused_or_make_sense():
    dice = random.Random(18)
    passed = 0
    for _ in range(20_000):
        data = bytearray(msgpack.packb(dice.choice([DRAG, CAMERA])))
        for _ in range(dice.randrange(4)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        try:
            message = msgpack.unpackb(checked(bytes(data), leads=True))
        except BadMessageError:
            continue
        passed += 1
        for field in ("wxyz", "position"):
            assert np.isfinite(message[field]).all()
        assert np.linalg.norm(message["wxyz"]) == pytest.approx(1.0)
    assert passed > 2000


def test_keys_and_pads_are_told_and_a_pad_lets_go_when_its_page_goes(page):
    page.events()
    seen = []
    with open_socket(page.url + "input") as keys:
        keys.send('{"key": "KeyR"}')
        keys.send('{"gamepad": {"index": 0, "axes": [0.5, -40], "button_values": [2]}}')
        wait_for(lambda: seen.extend(page.events()) or {"key": "KeyR"} in seen)
        wait_for(
            lambda: {"axes": [0.5, -1.0], "buttons": [1.0]} in (seen.extend(page.events()) or seen)
        )
    wait_for(lambda: seen.extend(page.events()) or seen[-1] == {"axes": [], "buttons": []})
    with open_socket(page.url + "input") as keys:
        keys.send('{"key": "F12"}')
        with pytest.raises(ConnectionClosed):
            keys.recv(timeout=20)


def test_it_waits_for_a_browser(page):
    page.events()
    with open_socket(page.url):
        page.wait_for_browser()


def test_the_class_is_told_that_it_watches_and_has_no_controls(page):
    lead, look = (urllib.request.urlopen(url).read() for url in (page.url, page.class_url))
    for said in (b"You are watching", _NO_CONTROLS):
        assert said in look
        assert said not in lead
    assert b"The program has ended" in lead
