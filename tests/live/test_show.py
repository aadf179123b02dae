"""A control is pressed where a person presses it, and the robot moves."""

import time

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.live.session import Mode
from tests.live.clients import BrowserClient, ProtocolClient, find_browser

UP = "hand up PgDn PgUp"


class ByProtocol(ProtocolClient):
    """Without a browser: the messages that the page sends for a key and for a click."""

    def __init__(self, drake_page):
        super().__init__(drake_page)
        self._meshcat = drake_page.meshcat

    def go_ahead(self):
        label = "hand ahead ↓↑"
        self.slide(label, self._meshcat.GetSliderValue(label) + 0.005)
        time.sleep(0.02)

    def record(self):
        self.press("Record (R)")

    def status(self):
        (label,) = (n for n in self._meshcat.GetButtonNames() if 'id="status"' in n)
        return label


class InBrowser(BrowserClient):
    """With a browser: real keys and clicks."""

    def __init__(self, drake_page):
        super().__init__(drake_page.url)

    def go_ahead(self):
        self.key("ArrowUp")

    def record(self):
        self.click("Record")

    def status(self):
        return self.evaluate("document.querySelector('#status')?.innerText ?? ''")


@pytest.fixture(params=[ByProtocol] + [InBrowser] * (find_browser() is not None))
def person(request, drake_page, show):
    show.step()
    person = request.param(drake_page)
    yield person
    person.close()


def step_until(show, done, longest=60.0):
    end = time.monotonic() + longest
    while not done():
        assert time.monotonic() < end
        show.step()


def test_a_person_leads_the_hand_and_records(show, person):
    simulation = show.session.simulation
    step_until(show, lambda: "Lead the hand" in person.status())
    before = simulation.hand_pose().translation()
    for _ in range(12):
        person.go_ahead()
    step_until(show, lambda: simulation.hand_pose().translation()[0] > before[0] + 0.04)
    for _ in range(40):
        show.step()
    moved = simulation.hand_pose().translation() - before
    np.testing.assert_allclose(moved, [0.06, 0, 0], atol=0.015)
    person.record()
    step_until(show, lambda: show.session.mode == Mode.RECORDED)
    step_until(show, lambda: "Recording" in person.status())


def test_a_game_pad_leads_the_hand_and_the_sliders_follow(show, drake_page):
    simulation, pad = show.session.simulation, ProtocolClient(drake_page)
    show.step()
    before = simulation.hand_pose().translation()
    pad.pad([0.0, 0.0, 0.0, -1.0], [0.0] * 16)
    step_until(show, lambda: simulation.hand_pose().translation()[2] > before[2] + 0.05)
    assert drake_page.meshcat.GetSliderValue(UP) > before[2] + 0.04
    pad.pad([0.0, 0.0, 0.0, 0.0], [0.0] * 16)
    step_until(show, lambda: not show.page.pad_velocity().any())
    for _ in range(20):
        show.step()
    rest = simulation.hand_pose().translation()
    for _ in range(20):
        show.step()
    np.testing.assert_allclose(simulation.hand_pose().translation(), rest, atol=0.004)
    pad.close()


def test_objects_move_with_their_sliders(show, meshcat):
    meshcat.SetSliderValue("goal up", 0.05)
    before = show.session.simulation.goal_position()
    for _ in range(64):
        show.step()
    moved = show.session.simulation.goal_position() - before
    R_WT = show.session.simulation.torso_pose().rotation()
    np.testing.assert_allclose(R_WT @ moved, [0, 0, 0.05], atol=0.002)


def test_paths_are_drawn_in_their_colours(show, meshcat):
    show.step()
    show.press("Record")
    start = show.session.simulation.hand_pose()
    for share in np.linspace(0.0, 1.0, 96):
        show.lead(
            RigidTransform(
                start.rotation(), start.translation() + share * np.array([0.08, -0.06, 0.08])
            )
        )
        show.step()
    assert meshcat.HasPath("live/paths/demonstration")
    show.press("Stop")
    show.press("Learn")
    show.press("Reach")
    step_until(show, lambda: show.session.mode == Mode.REACHING)
    for _ in range(16):
        show.step()
    assert meshcat.HasPath("live/paths/reproduction/0")
    assert not meshcat.HasPath("live/paths/reproduction/1")
    show.move("goal_object", np.array([0.0, 0.0, 0.05]))
    for _ in range(24):
        show.step()
    assert meshcat.HasPath("live/paths/reproduction/1")
    assert meshcat.HasPath("live/paths/demonstration")
