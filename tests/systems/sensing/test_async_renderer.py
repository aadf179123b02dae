import gc
import threading
import time

import numpy as np
import pytest

from pepper_drake.evaluation.camera_rig import CameraRig
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_DEPTH
from pepper_drake.systems.sensing.async_renderer import AsyncRenderer

pytestmark = pytest.mark.render

CAMERAS = {"bottom": (CAMERA_BOTTOM, "color"), "depth": (CAMERA_DEPTH, "depth")}


def test_it_renders_what_the_rig_renders_for_the_same_joints():
    scene = load_scene("table")
    rig, renderer = CameraRig(scene), AsyncRenderer(scene, CAMERAS)
    names = [rig.plant.get_joint(i).name() for i in rig.plant.GetJointIndices(rig.pepper)]
    assert "HeadPitch" in names
    images = []
    for pitch in (0.0, 0.3):
        rig.set_positions({"HeadPitch": pitch})
        q = np.zeros(rig.plant.num_positions())
        q[: len(rig.pepper_positions())] = rig.pepper_positions()
        pending = [renderer.render(name, q) for name in ("bottom", "depth")]
        color, depth = (image.pixels() for image in pending)
        np.testing.assert_array_equal(color, rig.color("CameraBottom"))
        np.testing.assert_array_equal(depth[..., 0], rig.depth("CameraDepth"))
        images.append(color)
    assert np.mean(images[0] != images[1]) > 0.05


def test_its_thread_ends_with_it():
    others = set(threading.enumerate())
    renderer = AsyncRenderer(load_scene("free"), CAMERAS)
    threads = [t for t in set(threading.enumerate()) - others if t.name.startswith("renderer")]
    assert threads
    del renderer
    gc.collect()
    for thread in threads:
        thread.join(timeout=30)
    assert not any(thread.is_alive() for thread in threads)


def test_the_simulation_goes_on_while_it_renders():
    renderer = AsyncRenderer(load_scene("table"), CAMERAS)
    plant_positions = np.zeros(CameraRig(load_scene("table")).plant.num_positions())
    renderer.render("bottom", plant_positions).pixels()
    image = renderer.render("bottom", plant_positions)
    turns = 0
    while not image.future.done() and turns < 10**7:
        turns += 1
        time.sleep(0)
    assert turns > 10  # Python ran on while the image was made.


def test_it_is_ready_when_all_that_was_to_be_prepared_is():
    renderer = AsyncRenderer(load_scene("free"), CAMERAS)
    threads = []
    renderer.prepare(lambda: (time.sleep(0.05), threads.append(threading.current_thread().name)))
    renderer.wait_until_ready()
    assert len(threads) == 1
    assert threads[0].startswith("renderer")


def test_what_prevents_rendering_is_told_to_who_waits():
    renderer = AsyncRenderer(load_scene("free"), {"odd": (CAMERA_DEPTH, "depth")})
    with pytest.raises(KeyError, match="top"):
        renderer.render("top", np.zeros(18)).pixels()
