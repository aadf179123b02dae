"""Services that keep programs' data, and those of lights, gestures and conditions."""

import cv2
import numpy as np
import pytest
from virtual_pepper import virtual

from pepper_drake.naoqi.constants import TOP
from pepper_drake.robot_server.robot.robot_port import CameraImage
from pepper_drake.robot_server.services.expression_watcher import Expression
from pepper_drake.robot_server.wire.service import ServiceError


def test_knowledge_as_the_makers_tutorial_says():
    async def scenario(pepper):
        def call(method, *arguments):
            return pepper.call(f"ALKnowledge.{method}", "tutorial", *arguments)

        call("add", "sky", "hasColor", "blue")
        call("add", "smurf", "hasColor", "blue")
        call("add", "smurf", "hasColor", "white")
        assert call("getSubject", "hasColor", "blue") == ["sky", "smurf"]
        assert call("getPredicate", "sky", "blue") == ["hasColor"]
        assert call("getObject", "smurf", "hasColor") == ["blue", "white"]
        call("update", "smurf", "hasColor", "red")
        assert call("getObject", "smurf", "hasColor") == ["red"]
        assert call("contains", "smurf", "hasColor", "red")
        call("remove", "smurf", "hasColor", "red")
        assert not call("contains", "smurf", "hasColor", "red")
        assert call("query", "sky", "hasColor", "?") == ["blue"]
        call("resetKnowledge")
        assert call("query", "?", "hasColor", "blue") == []

    virtual(scenario)


def test_nobody_is_there_whose_information_could_be_kept():
    async def scenario(pepper):
        assert pepper.call("ALUserSession.getFocusedUser") == -1
        assert pepper.call("ALUserInfo.set", "me", "nickname", "Ada") is False
        assert pepper.call("ALUserInfo.set", "me", 3, "nickname", "Ada") is True
        assert pepper.call("ALUserInfo.get", "me", 3, "nickname") == "Ada"
        assert pepper.call("ALUserInfo.has", "me", "nickname") is False
        assert pepper.call("ALMood.currentPersonState")[0] == (0.0, 0.0)

    virtual(scenario)


def test_a_resource_within_another_is_taken_with_it():
    async def scenario(pepper):
        def call(method, *arguments):
            return pepper.call(f"ALResourceManager.{method}", *arguments)

        call("createResource", "hat", "Head")
        call("acquireResource", "Head", "one", "", 1)
        assert not call("isResourceFree", "hat")
        with pytest.raises(ServiceError, match="belong to another module"):
            call("acquireResource", "hat", "two", "", 1)
        call("releaseResource", "Head", "one")
        assert call("areResourcesFree", ["hat", "Head", "LArm"])

    virtual(scenario)


def test_lights_fade_by_the_robots_clock():
    key = "Device/SubDeviceList/Face/Led/{}/Left/45Deg/Actuator/Value"

    async def scenario(pepper):
        call = pepper.start("ALLeds.fadeRGB", "FaceLeds", 0xFF0080, 1.0)
        await pepper.run(0.5)
        assert pepper.call("ALMemory.getData", key.format("Green")) == pytest.approx(0.5, abs=0.05)
        await pepper.finish(call)
        found = [pepper.call("ALMemory.getData", key.format(c)) for c in ("Red", "Green", "Blue")]
        assert found == [1.0, 0.0, pytest.approx(128 / 255)]
        pepper.call("ALLeds.createGroup", "mine", ["LeftEarLeds", "FaceLedLeft0"])
        assert len(pepper.call("ALLeds.listGroup", "mine")) == 10 + 3
        with pytest.raises(ServiceError, match="no group or light 'Nose'"):
            pepper.call("ALLeds.on", "Nose")

    virtual(scenario)


def test_touches_of_the_head_make_gestures():
    told = []

    async def touch(pepper, *patterns):
        for pattern in patterns:
            sensors = [
                f"Head/Touch/{name}"
                for name, on in zip(("Front", "Middle", "Rear"), pattern, strict=True)
                if on == "1"
            ]
            pepper.robot.touch(*sensors)
            await pepper.run(0.2)
        await pepper.run(0.5)

    async def scenario(pepper):
        triple = ["000", "111", "000", "111", "000", "111", "000"]
        name = pepper.call("ALTactileGesture.createGesture", triple)
        service = pepper.services["ALTactileGesture"]
        service.emitters.append(lambda _, uid, __, values: told.append((uid, *values)))
        await touch(pepper, "100", "000")
        await touch(pepper, "100", "010", "001", "000")
        await touch(pepper, "111", "000", "111", "000", "111", "000")
        names = [values[1] for values in told if len(values) == 2]
        assert names == ["SingleFront", "CaressFtoR", name]
        told.clear()
        pepper.robot.touch("Head/Touch/Rear")
        await pepper.run(2.0)
        held = [values[1] for values in told if len(values) == 2]
        assert len(held) > 1
        assert set(held) == {"SingleRearHold"}

    virtual(scenario)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("'a' + 2 * 3", 7),
        ("!'zero' && ('a' == 1 || 'b' == 5)", True),
        ("[1, 2] subsets [1, 2, 3]", True),
        ("[4, 5] intersects 6", False),
        ('concat("a", "b") == "ab"', True),
        ("'none' > 1", None),
        ("1 / 'zero'", None),
        ('"a" * 1000000000000', None),
        ("1000000000000 * [1]", None),
        (f"int({'9' * 309}.0 * 10)", None),
        ("('a' == 1) ~ 1.5", True),
        ("('b' == 2) @ 2.0", True),
        ("('b' == 2) # 2.5", True),
        ("('b' == 3) ~ 0.5 && ('b' == 2) @ 1.5", True),
        ("'b' == 3 ~ 2", False),
    ],
)
def test_conditions(text, value):
    now = 0.0
    keys = {"a": lambda: 1, "zero": lambda: 0, "b": lambda: 2 if now < 8.0 else 3}
    expression = Expression(text, lambda key: keys.get(key, lambda: None)())
    while now < 9.2:
        expression.step(now)
        now += 0.02
    assert expression.value(now) == value


@pytest.mark.parametrize("text", ["", "1 +", "(1", "'a' ~", "rm(1)", "1 2", "$", "(" * 60 + "1"])
def test_what_is_no_condition_is_refused(text):
    with pytest.raises(ValueError, match=r"expression|function"):
        Expression(text, lambda _: None)


def test_a_condition_tells_when_it_becomes_true():
    async def scenario(pepper):
        watch = pepper.call("ALExpressionWatcher.add", "'mine' > 2", 2)
        told = []
        watch.emitters.append(lambda _, __, ___, values: told.append(values))
        for value in (1, 3, 4, 0, 5):
            pepper.call("ALMemory.insertData", "mine", value)
            await pepper.run(0.1)
        assert told == [(True,), (True,)]
        watch.on_terminated()
        pepper.call("ALMemory.insertData", "mine", 0)
        await pepper.run(0.1)

    virtual(scenario)


def test_pictures_and_films_are_files_in_the_robots_folder_and_nowhere_else(tmp_path):
    async def scenario(pepper):
        pixels = np.zeros((480, 640, 3), np.uint8)
        pixels[..., 0] = 200
        pepper.robot.images[TOP] = CameraImage(pepper.robot.now, pixels)
        pepper.call("ALPhotoCapture.setResolution", 2)
        call = pepper.start("ALPhotoCapture.takePictures", 2, "/home/nao/pictures", "image")
        await pepper.finish(call)
        told = [f"/home/nao/pictures/image_{number}.jpg" for number in (0, 1)]
        assert call.result() == [told]
        picture = cv2.imread(str(tmp_path / told[1].lstrip("/")))
        np.testing.assert_allclose(picture[200, 300], [0, 0, 200], atol=3)
        again = pepper.start("ALPhotoCapture.takePicture", "/home/nao/pictures", "image_0", False)
        with pytest.raises(ServiceError, match="already exists"):
            await pepper.finish(again)
        away = pepper.start("ALPhotoCapture.takePicture", "/home/../../..", "image")
        with pytest.raises(ServiceError, match="is not a path"):
            await pepper.finish(away)
        pepper.call("ALVideoRecorder.startRecording", "/home/nao", "film")
        assert pepper.call("ALVideoRecorder.isRecording")
        await pepper.run(1.0)
        stop = pepper.start("ALVideoRecorder.stopRecording")
        await pepper.finish(stop)
        frames, name = stop.result()
        assert name == "/home/nao/film.avi"
        film = cv2.VideoCapture(str(tmp_path / "home/nao/film.avi"))
        assert film.get(cv2.CAP_PROP_FRAME_COUNT) == frames > 0
        assert pepper.call("ALVideoDevice.getSubscribers") == []

    virtual(scenario, files=tmp_path)
