"""Actions on the page happen to the robot: by messages, and in a real browser."""

import os
import time
from pathlib import Path

import msgpack
import numpy as np
import pytest
import viser
from headless import launch
from playwright.sync_api import expect, sync_playwright
from websockets.sync.client import connect

from pepper_drake.live.controls import BUTTONS, KEYS
from pepper_drake.live.page import LivePage
from pepper_drake.live.session import Mode
from pepper_drake.live.show import LiveApp
from pepper_drake.web.viser_page import ViserPage

WINDOW = {"width": 1366, "height": 768}
COARSE = "?fixedDpr=0.25"
"""Viser's option for few pixels: without a graphics card the processor draws them all."""


@pytest.fixture
def page():
    with ViserPage(keys=KEYS) as page:
        yield page


@pytest.fixture
def app(page, make_session, tmp_path):
    session = make_session(tmp_path, spares=True)
    return LiveApp(session, LivePage(page, cameras=False, spares=True))


@pytest.fixture
def say(page):
    """Returns a function that sends what a browser would."""
    socket = connect(
        page.url.replace("http:", "ws:"),
        subprotocols=[f"viser-v{viser.__version__}"],
        max_size=None,
        close_timeout=0.2,  # What it was shown is not read.
    )

    def send(kind, **fields):
        socket.send(msgpack.packb({"type": kind, "owner": "", **fields}))

    camera = {"wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, 0.0, 1.0], "fov": 1.0}
    camera |= {"near": 0.1, "far": 100.0, "image_height": 600, "image_width": 800}
    camera |= {"look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0]}
    # A browser counts from when it has told where it looks from.
    socket.send(msgpack.packb({"type": "ViewerCameraMessage", **camera}))
    end = time.monotonic() + 20
    while not page.server.get_clients():
        assert time.monotonic() < end
        time.sleep(0.02)
    yield send
    socket.close()


def step_until(app, done, longest=60.0):
    end = time.monotonic() + longest
    while not done():
        assert app.session.mode != Mode.STOPPED, app.session.status
        assert time.monotonic() < end, app.session.status
        app.step()


def drag_hand(app, say, offset):
    simulation = app.session.simulation
    X_WG = simulation.torso_pose() @ app.target
    for share in np.linspace(0.1, 1.0, 10):
        say(
            "TransformControlsUpdateMessage",
            name="/hand",
            wxyz=X_WG.rotation().ToQuaternion().wxyz().tolist(),
            position=(X_WG.translation() + share * np.asarray(offset)).tolist(),
        )
        for _ in range(4):
            app.step()

    def moved():
        X_WH = simulation.torso_pose() @ simulation.hand_pose()
        return float(np.linalg.norm(X_WH.translation() - X_WG.translation()))

    # Messages of the page take their time.
    step_until(app, lambda: moved() > 0.9 * float(np.linalg.norm(offset)))


def test_the_hand_follows_the_mouse_and_is_recorded_learned_and_undone(app, say, tmp_path):
    session, simulation = app.session, app.session.simulation
    app.step()
    before = simulation.torso_pose() @ simulation.hand_pose().translation()
    app.press("Record")
    drag_hand(app, say, [0.08, -0.06, 0.08])
    step_until(app, lambda: simulation.time > 2.5)
    moved = simulation.torso_pose() @ simulation.hand_pose().translation() - before
    np.testing.assert_allclose(moved, [0.08, -0.06, 0.08], atol=0.015)
    assert "Recording" in app.page.status
    app.press("Stop")
    assert len(session.shown) == 1
    assert (tmp_path / "demonstrations" / "01" / "translation.txt").exists()
    app.press("Learn")
    assert (tmp_path / "primitive.yaml").exists()
    path = session.predicted()
    np.testing.assert_allclose(path[-1], simulation.goal_position(), atol=0.01)
    app.press("Undo")
    assert session.primitive is None
    app.press("Undo")
    assert session.shown == ()
    app.press("Undo")
    assert "nothing to undo" in session.status


def test_a_demonstration_is_trimmed_discarded_and_brought_back(app, say):
    session = app.session
    app.press("Record")
    session.trim(0.0, 1.0)
    assert session.status == "Pepper is recording; press Stop before Trim"
    drag_hand(app, say, [0.08, -0.06, 0.08])
    app.press("Stop")
    whole = session.demonstration
    session.trim(0.0, whole.duration)
    assert "keeps all of it" in session.status
    session.trim(0.25 * whole.duration, whole.duration)
    trimmed = session.demonstration
    assert trimmed.duration == pytest.approx(0.75 * whole.duration, abs=0.05)
    np.testing.assert_allclose(trimmed.positions[-1], whole.positions[-1])
    assert trimmed.times[0] == 0.0
    session.trim(0.0, 0.01)
    assert "no movement" in session.status
    session.discard()
    assert session.shown == ()
    session.undo()
    session.undo()
    assert session.demonstration is whole


def test_keys_lead_the_hand_and_objects_are_dragged_within_their_range(app, page, say):
    simulation = app.session.simulation
    app.step()
    with connect(page.url.replace("http:", "ws:") + "input") as keys:
        before = app.target.translation()
        for _ in range(6):
            keys.send('{"key": "PageUp"}')
        step_until(app, lambda: app.target.translation()[2] > before[2] + 0.0299)
        keys.send('{"key": "KeyR"}')
        step_until(app, lambda: app.session.mode == Mode.RECORDED)
    start = simulation.position("goal_object")
    grab = start + [0.0, 0.0, 0.1]
    drag = {"name": goal_node(app), "instance_index": None, "button": "left", "modifier": None}
    drag |= {"start_screen_pos": [0.5, 0.5], "end_screen_pos": [0.5, 0.5]}
    for phase, end in (("start", grab), ("update", grab + [0, 0, 0.05]), ("end", grab + [0, 0, 9])):
        say(
            "SceneNodeDragMessage",
            phase=phase,
            start_position=grab.tolist(),
            end_position=end.tolist(),
            **drag,
        )
    step_until(app, lambda: simulation.offset("goal_object")[2] == 0.2)
    app.press("Undo")  # While it is recorded, too: nothing was taught since.
    assert not simulation.offset("goal_object").any()
    assert app.session.mode == Mode.RECORDED


def goal_node(app):
    name = app._robot.bodies["goal_object"].name
    return f"{name}/0"


def test_obstacles_are_added_where_the_arm_is_not_and_removed(app):
    simulation = app.session.simulation
    app.add("spare_ball")
    for _ in range(8):
        app.step()
    place = simulation.position("spare_ball")
    frame = simulation.diagram.station.plant.GetBodyByName("spare_ball")
    context = simulation.diagram.station.plant.GetMyContextFromRoot(
        simulation.simulator.get_context()
    )
    at = frame.EvalPoseInWorld(context).translation()
    np.testing.assert_allclose(at, place, atol=1e-3)
    assert place[2] > 0.8

    def height():
        app.step()
        return frame.EvalPoseInWorld(context).translation()[2]

    app.remove_added()
    assert height() < -0.5
    app.press("Undo")
    assert height() > 0.8
    app.press("Undo")
    assert height() < -0.5
    app.press("Undo")
    assert "nothing to undo" in app.session.status


def test_a_session_left_alone_lives(app):
    step_until(app, lambda: app.session.simulation.time > 3.0)
    assert app.session.mode == Mode.GUIDED


def pixel(pg, camera, point):
    """Returns where a browser shows a point (3,) in W."""
    R = viser.transforms.SO3(np.array(camera.wxyz)).as_matrix()
    x, y, z = R.T @ (point - np.array(camera.position))
    size = pg.viewport_size
    scale = 0.5 * size["height"] / np.tan(0.5 * camera.fov)
    return 0.5 * size["width"] + scale * x / z, 0.5 * size["height"] + scale * y / z


def test_in_a_browser_a_hand_is_dragged_recorded_learned_and_reaches(app, page, tmp_path):
    kept = Path(os.environ.get("PEPPER_SCREENSHOTS", tmp_path))
    kept.mkdir(parents=True, exist_ok=True)
    simulation, session = app.session.simulation, app.session
    with sync_playwright() as playwright:
        browser = launch(playwright)
        pg = browser.new_page(viewport=WINDOW)
        pg.set_default_timeout(90_000)
        pg.goto(page.url + COARSE)
        step_until(app, lambda: page.server.get_clients(), 90.0)
        pg.get_by_text("Lead the hand").wait_for()

        def press(name):
            pg.get_by_role("button", name=name, exact=True).click()
            app.step()
            app.step()

        press("Next: Record (R)")
        step_until(app, lambda: session.mode == Mode.RECORDED)
        (client,) = page.server.get_clients().values()
        X_WG = simulation.torso_pose() @ app.target
        tip = X_WG @ np.array([0.0, 0.0, 0.11])
        x, y = pixel(pg, client.camera, tip)
        before = simulation.hand_pose().translation()
        pg.mouse.move(x, y)
        pg.mouse.down()
        for step in range(1, 9):
            pg.mouse.move(x - 4 * step, y - 12 * step)
            for _ in range(6):
                app.step()
        pg.mouse.up()
        for _ in range(20):
            app.step()
        pg.screenshot(path=kept / "recording.png")
        assert np.linalg.norm(simulation.hand_pose().translation() - before) > 0.03
        press("Stop")
        step_until(app, lambda: session.shown)
        press("Learn")
        step_until(app, lambda: session.primitive is not None)
        pg.get_by_text("Learned a movement").wait_for()
        for _ in range(20):
            app.step()
        pg.screenshot(path=kept / "learned.png")
        # All of this is seen without scrolling.
        for seen in ("Learned a movement", "Phase: 1", "Clearance of the arm", "Coupling: push"):
            expect(pg.get_by_text(seen)).to_be_in_viewport(ratio=1)
        for button in ("Next: Reach (G)", *BUTTONS):
            expect(pg.get_by_role("button", name=button, exact=True)).to_be_in_viewport(ratio=1)
        press("Reach")
        step_until(app, lambda: session.mode == Mode.REACHING)
        pg.screenshot(path=kept / "reaching.png")
        # Nobody looks on meanwhile: without a graphics card drawing takes most of the time.
        pg.goto("about:blank")
        step_until(app, lambda: session.status.startswith("At the goal"), 300.0)
        pg.goto(page.url)
        pg.get_by_text("At the goal").wait_for()
        pg.get_by_role("alert").get_by_role("button").click()  # That there is no graphics card.
        expect(pg.get_by_role("alert")).to_have_count(0)
        pg.screenshot(path=kept / "reached.png")
        (kept / "reached.txt").write_text(app.page.status)
        step_until(app, lambda: page.server.get_clients())
        pg.get_by_role("tab", name="Scene").click()
        press("Add ball")
        step_until(app, lambda: simulation.offset("spare_ball").any())
        (client,) = page.server.get_clients().values()
        x, y = pixel(pg, client.camera, simulation.position("goal_object") + [0, 0, 0.2])
        pg.mouse.move(x, y)
        pg.mouse.down()
        for step in range(1, 6):
            pg.mouse.move(x, y - 5 * step)
            app.step()
        pg.mouse.up()
        step_until(app, lambda: simulation.offset("goal_object").any())
        press("Stop")
        press("Save")
        step_until(app, lambda: (tmp_path / "demonstration" / "translation.txt").exists())
        pg.reload()
        pg.get_by_text("ready").first.wait_for()
        pg.get_by_role("tab", name="Demos").click()
        pg.get_by_role("cell", name="1", exact=True).wait_for()
        pg.screenshot(path=kept / "reloaded.png")
        # On a telephone the controls stand below the view, not over it.
        pg.set_viewport_size({"width": 420, "height": 800})
        title = pg.get_by_text("Teach Pepper")
        pg.wait_for_function("document.querySelector('canvas').clientHeight < 600")
        view = pg.locator("canvas").first.bounding_box()
        assert 300 < view["y"] + view["height"] <= title.bounding_box()["y"]
        expect(pg.get_by_role("button", name="Save", exact=True)).to_be_in_viewport(ratio=1)
        pg.screenshot(path=kept / "narrow.png")
        browser.close()
