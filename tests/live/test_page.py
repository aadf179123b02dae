import time

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.live.page import BUTTONS, LivePage
from tests.live.clients import ProtocolClient


@pytest.fixture
def page(meshcat):
    return LivePage(meshcat, ["ball", "goal_object"])


@pytest.fixture
def client(drake_page, page):
    client = ProtocolClient(drake_page)
    yield client
    client.close()


def wait_for(look):
    end = time.monotonic() + 10
    while time.monotonic() < end:
        if look():
            return
        time.sleep(0.01)
    raise TimeoutError


def test_a_press_is_told_once(page, client):
    assert page.pressed() == []
    client.press("Record (R)")
    seen = []
    wait_for(lambda: seen.extend(page.pressed()) or seen)
    assert seen == ["Record"]
    assert page.pressed() == []


def test_every_button_has_its_key_on_its_label(page):
    names = page.meshcat.GetButtonNames()
    for button, key in BUTTONS.items():
        assert f"{button} ({key.removeprefix('Key')})" in names


def test_the_hands_sliders_move_it_from_where_it_is(page, client):
    X_TH = RigidTransform(RollPitchYaw(1.0, 0.3, -0.2), [0.1234, -0.2345, 0.0567])
    page.set_hand(X_TH)
    assert page.hand().IsExactlyEqualTo(X_TH)
    shown = page.meshcat.GetSliderValue("hand up PgDn PgUp")
    assert shown == pytest.approx(0.0567, abs=0.0026)
    client.slide("hand up PgDn PgUp", shown + 0.01)
    wait_for(lambda: not page.hand().IsExactlyEqualTo(X_TH))
    moved = page.hand()
    np.testing.assert_allclose(moved.translation() - X_TH.translation(), [0, 0, 0.01], atol=1e-12)
    np.testing.assert_allclose(moved.rotation().matrix(), X_TH.rotation().matrix(), atol=1e-12)


def test_objects_have_sliders(page, client):
    assert list(page.offsets()) == ["goal_object", "ball"]
    client.slide("goal to the left", 0.05)
    wait_for(lambda: page.offsets()["goal_object"].any())
    np.testing.assert_allclose(page.offsets()["goal_object"], [0, 0.05, 0])
    page.set_offset("ball", np.array([0.1, 0.0, -0.1]))
    np.testing.assert_allclose(page.offsets()["ball"], [0.1, 0.0, -0.1])


def test_a_game_pad_asks_for_a_velocity(page, client):
    assert not page.pad_velocity().any()
    client.pad([0.0, -1.0, 0.0, 0.0], [0.0] * 16)
    wait_for(lambda: page.pad_velocity().any())
    velocity = page.pad_velocity()
    assert velocity[3] > 0.1
    np.testing.assert_allclose(np.delete(velocity, 3), 0, atol=1e-12)


def test_the_status_is_one_label_that_cannot_be_mistaken_for_html(page):
    before = len(page.meshcat.GetButtonNames())
    page.show_status("guided", "it's <b>\\bold</b>")
    page.show_status("guided", 'a "second" line')
    names = page.meshcat.GetButtonNames()
    assert len(names) == before + 1
    assert "a &quot;second&quot; line" in page.status
    page.show_status("guided", "it's <b>\\bold</b>")
    assert "it&#x27;s &lt;b&gt;&#92;bold&lt;/b&gt;" in page.status
    assert "'" not in page.status
    assert "\\" not in page.status
