import asyncio

import numpy as np
import pytest
from virtual_pepper import CALLER, VirtualPepper, virtual

from pepper_drake.naoqi.constants import CAMERAS, DEPTH, RESOLUTIONS, RGB, TOP, XYZ
from pepper_drake.naoqi.images import decode_reply
from pepper_drake.robot_server.robot.robot_port import CameraImage
from pepper_drake.robot_server.wire.service import Caller, ServiceError


def _show(pepper: VirtualPepper, seed: int = 0) -> None:
    random = np.random.default_rng(seed)
    color = random.integers(0, 256, (480, 640, 3), dtype=np.uint8)
    depth = random.uniform(0.5, 4.0, (240, 320)).astype(np.float32)
    now = pepper.robot.now
    pepper.robot.images = {
        0: CameraImage(now, color),
        1: CameraImage(now, 255 - color),
        2: CameraImage(now, depth),
    }


async def _image(pepper: VirtualPepper, handle: str):
    call = pepper.start("ALVideoDevice.getImageRemote", handle)
    await pepper.finish(call)
    return call.result()


def test_an_image_comes_as_it_was_taken_with_its_time():
    async def scenario(pepper):
        _show(pepper)
        handle = pepper.call("ALVideoDevice.subscribeCamera", "viewer", 0, 2, 11, 30)
        assert handle == "viewer_0"
        await pepper.run(0.2)
        reply = await _image(pepper, handle)
        taken = pepper.robot.images[0]
        image = decode_reply(reply)
        np.testing.assert_array_equal(image.pixels, taken.pixels)
        assert image.time == pytest.approx(taken.time, abs=1e-6)
        assert type(reply[6]) is bytes
        assert [type(value) for value in reply] == [int] * 6 + [bytes, int] + [float] * 4

    virtual(scenario)


def test_every_resolution_and_space_of_every_camera_is_served():
    async def scenario(pepper):
        _show(pepper)
        for camera, known in CAMERAS.items():
            for resolution in known.resolutions:
                for space in known.color_spaces:
                    handle = pepper.call(
                        "ALVideoDevice.subscribeCamera", "all", camera, resolution, space, 5
                    )
                    reply = await _image(pepper, handle)
                    assert (reply[0], reply[1]) == RESOLUTIONS[resolution]
                    assert (reply[3], reply[7]) == (space, camera)
                    assert len(reply[6]) == reply[0] * reply[1] * reply[2]
                    assert pepper.call("ALVideoDevice.unsubscribe", handle)

    virtual(scenario)


def test_a_smaller_image_takes_pixels_and_mixes_none():
    async def scenario(pepper):
        _show(pepper)
        handle = pepper.call("ALVideoDevice.subscribeCamera", "small", 2, 0, XYZ, 5)
        depth = decode_reply(await _image(pepper, handle)).depth()
        assert depth.shape == (120, 160)
        assert np.isin(depth, pepper.robot.images[2].pixels).all()

    virtual(scenario)


def test_depth_of_the_size_that_a_pepper_does_not_serve_comes_smaller():
    async def scenario(pepper):
        _show(pepper)
        handle = pepper.call("ALVideoDevice.subscribeCamera", "vga", DEPTH, 2, 17, 5)
        reply = await _image(pepper, handle)
        assert reply[:2] == [80, 60]

    virtual(scenario)


@pytest.mark.parametrize(
    ("camera", "resolution", "space", "fps"),
    [(3, 1, 11, 5), (9, 1, 11, 5), (0, 77, 11, 5), (0, 1, 17, 5), (2, 1, 13, 5), (0, 1, 11, 0)],
)
def test_what_no_camera_has_gives_an_empty_handle(camera, resolution, space, fps):
    async def scenario(pepper):
        handle = pepper.call("ALVideoDevice.subscribeCamera", "me", camera, resolution, space, fps)
        assert handle == ""
        assert pepper.call("ALVideoDevice.getSubscribers") == []

    virtual(scenario)


def test_a_name_may_subscribe_six_times():
    async def scenario(pepper):
        handles = [
            pepper.call("ALVideoDevice.subscribeCamera", "me", 0, 1, 11, 5) for _ in range(7)
        ]
        assert handles == ["me_0", "me_1", "me_2", "me_3", "me_4", "me_5", ""]
        assert pepper.call("ALVideoDevice.unsubscribe", "me_3")
        assert pepper.call("ALVideoDevice.subscribeCamera", "me", 0, 1, 11, 5) == "me_3"
        pepper.call("ALVideoDevice.unsubscribeAllInstances", "me")
        assert pepper.call("ALVideoDevice.getSubscribers") == []
        assert pepper.call("ALVideoDevice.unsubscribe", "me") is False

    virtual(scenario)


def test_a_camera_works_only_while_someone_watches_and_as_hard_as_the_hardest_watcher():
    async def scenario(pepper):
        assert pepper.robot.wanted == {}
        small = pepper.call("ALVideoDevice.subscribeCamera", "a", TOP, 1, RGB, 10)
        large = pepper.call("ALVideoDevice.subscribeCamera", "b", TOP, 2, RGB, 5)
        assert pepper.robot.wanted == {TOP: (640, 480, 10)}
        pepper.call("ALVideoDevice.unsubscribe", large)
        assert pepper.robot.wanted == {TOP: (320, 240, 10)}
        assert pepper.call("ALVideoDevice.setResolution", small, 0)
        assert pepper.call("ALVideoDevice.setFrameRate", small, 15)
        assert not pepper.call("ALVideoDevice.setFrameRate", small, 99)
        assert pepper.robot.wanted == {TOP: (160, 120, 15)}
        assert pepper.call("ALVideoDevice.setActiveCamera", small, DEPTH) is True
        assert pepper.robot.wanted == {DEPTH: (160, 120, 15)}
        assert not pepper.call("ALVideoDevice.setColorSpace", small, 13)
        assert pepper.call("ALVideoDevice.setColorSpace", small, 17)
        pepper.call("ALVideoDevice.unsubscribe", small)
        assert pepper.robot.wanted == {}

    virtual(scenario)


def test_a_client_that_leaves_takes_its_subscriptions_with_it():
    async def scenario(pepper):
        pepper.call("ALVideoDevice.subscribeCamera", "stays", 0, 1, 11, 5)
        pepper.call("ALVideoDevice.subscribeCamera", "leaves", 2, 1, 17, 5, caller=Caller(9))
        pepper.services["ALVideoDevice"].on_client_left(Caller(9))
        assert pepper.call("ALVideoDevice.getSubscribers") == ["stays_0"]
        assert set(pepper.robot.wanted) == {TOP}
        pepper.services["ALVideoDevice"].on_client_left(CALLER)
        assert pepper.robot.wanted == {}

    virtual(scenario)


def test_the_first_image_is_waited_for_and_none_comes_from_a_blind_camera():
    async def scenario(pepper):
        handle = pepper.call("ALVideoDevice.subscribeCamera", "me", 0, 1, 11, 5)
        call = pepper.start("ALVideoDevice.getImageRemote", handle)
        await pepper.run(0.4)
        assert not call.done()
        _show(pepper)
        assert await pepper.finish(call) < 0.1
        assert call.result()[0] == 320
        pepper.robot.images.clear()
        blind = pepper.start("ALVideoDevice.getImageRemote", handle)
        assert await pepper.finish(blind) == pytest.approx(1.0, abs=0.1)
        assert blind.result() is None
        assert await pepper.call("ALVideoDevice.getImageRemote", "") is None

    virtual(scenario)


def test_several_cameras_in_one_subscription():
    async def scenario(pepper):
        _show(pepper)
        handle = pepper.call("ALVideoDevice.subscribeCameras", "two", [0, 2], [1, 0], [11, 17], 5)
        call = pepper.start("ALVideoDevice.getImagesRemote", handle)
        await pepper.finish(call)
        assert [reply[7] for reply in call.result()] == [0, 2]
        assert pepper.call("ALVideoDevice.getResolutions", handle) == [1, 0]

    virtual(scenario)


def test_programs_of_old_subscribe_to_the_active_camera():
    async def scenario(pepper):
        _show(pepper)
        pepper.call("ALVideoDevice.setParam", 18, 1)
        handle = pepper.call("ALVideoDevice.subscribe", "old", 1, 11, 5)
        assert (await _image(pepper, handle))[7] == 1
        assert pepper.call("ALVideoDevice.getActiveCamera") == 1

    virtual(scenario)


def test_parameters_are_kept_within_their_range():
    async def scenario(pepper):
        assert pepper.call("ALVideoDevice.setParameter", 0, 11, 0)
        assert pepper.call("ALVideoDevice.getParameter", 0, 11) == 0
        assert not pepper.call("ALVideoDevice.setParameter", 0, 11, 7)
        assert not pepper.call("ALVideoDevice.setParameter", 0, 12345, 0)
        assert pepper.call("ALVideoDevice.setAllParametersToDefault", 0)
        assert pepper.call("ALVideoDevice.getParameter", 0, 11) == 1

    virtual(scenario)


def test_places_in_an_image_and_angles():
    async def scenario(pepper):
        known = CAMERAS[TOP]
        angles = pepper.call("ALVideoDevice.getAngularPositionFromImagePosition", 0, [0.0, 1.0])
        assert angles == pytest.approx([known.width_fov / 2, known.height_fov / 2])
        back = pepper.call("ALVideoDevice.getImagePositionFromAngularPosition", 0, angles)
        assert back == pytest.approx([0.0, 1.0])
        assert pepper.call("ALVideoDevice.getHorizontalFOV", 0) == pytest.approx(0.98262, abs=1e-4)
        assert pepper.call("ALVideoDevice.resolutionToSizes", 2) == [640, 480]
        assert pepper.call("ALVideoDevice.sizesToResolution", 320, 240) == 1
        assert pepper.call("ALVideoDevice.sizesToResolution", 1, 1) == -1

    virtual(scenario)


def test_who_waits_for_an_image_may_give_up():
    async def scenario(pepper):
        handle = pepper.call("ALVideoDevice.subscribeCamera", "me", 0, 1, 11, 5)
        call = pepper.start("ALVideoDevice.getImageRemote", handle)
        await pepper.run(0.1)
        call.cancel()
        await pepper.run(0.1)
        with pytest.raises(asyncio.CancelledError):
            call.result()

    virtual(scenario)


def test_a_parameter_is_set_for_each_camera_of_a_subscription():
    async def scenario(pepper):
        two = [[0, 1], [1, 1], [11, 11], 5]
        handle = pepper.call("ALVideoDevice.subscribeCameras", "me", *two)
        assert pepper.call("ALVideoDevice.setCamerasParameter", handle, 22, 2) == [True, True]
        assert pepper.call("ALVideoDevice.setCamerasParameter", handle, 22, [1, 99]) == [
            True,
            False,
        ]
        assert pepper.call("ALVideoDevice.getCamerasParameter", handle, 22) == [1, 2]
        with pytest.raises(ServiceError, match="2 integers"):
            pepper.call("ALVideoDevice.setCamerasParameter", handle, 22, [1])

    virtual(scenario)
