import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from virtual_pepper import CALLER, virtual

from pepper_drake.robot_server.services.speech import spoken
from pepper_drake.robot_server.wire.service import ServiceError


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Hello", "Hello"),
        ("\\rspd=80\\ Hello \\pau=500\\ you", "Hello you"),
        ("^start(animations/Stand/Gestures/Hey_1) Hello ^wait(animations/x) you", "Hello you"),
        ("^mode(disabled)", ""),
    ],
)
def test_marks_are_not_spoken(text, words):
    assert spoken(text) == words


def test_sentences_take_their_time_one_after_the_other():
    async def scenario(pepper):
        first = pepper.start("ALTextToSpeech.say", "x" * 28)
        second = pepper.start("ALAnimatedSpeech.say", "^start(a) " + "y" * 14)
        await pepper.run(0.5)
        assert pepper.lines == [f'says "{"x" * 28}"']
        assert pepper.call("ALMemory.getData", "ALTextToSpeech/CurrentSentence") == "x" * 28
        assert await pepper.finish(first) == pytest.approx(1.5, abs=0.2)
        assert await pepper.finish(second) == pytest.approx(1.0, abs=0.2)
        assert pepper.lines[1] == f'says "{"y" * 14}"'
        assert pepper.call("ALMemory.getData", "ALTextToSpeech/TextDone") == 1

    virtual(scenario)


def test_stop_ends_what_is_said_and_what_was_to_follow():
    async def scenario(pepper):
        first = pepper.start("ALTextToSpeech.say", "x" * 280)
        second = pepper.start("ALTextToSpeech.say", "never said")
        await pepper.run(0.5)
        pepper.call("ALTextToSpeech.stopAll")
        assert await pepper.finish(first) < 0.3
        await pepper.finish(second)
        assert len(pepper.lines) == 1
        after = pepper.start("ALTextToSpeech.say", "again")
        await pepper.finish(after)
        assert pepper.lines[1] == 'says "again"'

    virtual(scenario)


def test_life_tells_its_state():
    async def scenario(pepper):
        pepper.call("ALAutonomousLife.setState", "disabled")
        assert pepper.call("ALAutonomousLife.getState") == "disabled"
        assert pepper.call("ALMemory.getData", "AutonomousLife/State") == "disabled"
        with pytest.raises(ServiceError, match="must be one of solitary"):
            pepper.call("ALAutonomousLife.setState", "zombie")

    virtual(scenario)


def test_an_ability_is_one_switch_wherever_it_is_switched():
    async def scenario(pepper):
        pepper.call("ALBasicAwareness.setEnabled", False)
        life = "ALAutonomousLife.getAutonomousAbilityEnabled"
        assert pepper.call(life, "BasicAwareness") is False
        pepper.call("ALAutonomousLife.setAutonomousAbilityEnabled", "BackgroundMovement", False)
        assert pepper.call("ALBackgroundMovement.isEnabled") is False
        assert pepper.call("ALSpeakingMovement.isEnabled") is True

    virtual(scenario)


@given(st.floats(0.3, 3.0), st.floats(-1.5, 1.5), st.floats(-0.3, 0.3))
@settings(max_examples=20, deadline=None)
def test_the_top_camera_looks_at_the_place(distance, bearing, height):
    async def scenario(pepper):
        place = [distance * math.cos(bearing), distance * math.sin(bearing), 0.25 + height]
        await pepper.finish(pepper.start("ALTracker.lookAt", place, 0, 0.5, False))
        camera = np.reshape(pepper.call("ALMotion.getTransform", "CameraTop", 0, True), (4, 4))
        seen = np.linalg.inv(camera) @ [*place, 1.0]
        pitch = pepper.call("ALMotion.getAngles", "HeadPitch", True)[0]
        assert math.atan2(seen[1], seen[0]) == pytest.approx(0.0, abs=1e-3)
        if -0.6 < pitch < 0.23:  # Not at a limit.
            assert math.atan2(seen[2], seen[0]) == pytest.approx(0.0, abs=1e-3)

    virtual(scenario)


def test_looking_in_the_world_knows_where_the_robot_stands():
    async def scenario(pepper):
        await pepper.finish(pepper.start("ALMotion.moveTo", 0.5, 0.0, 0.4))
        await pepper.finish(pepper.start("ALTracker.lookAt", [2.0, 0.0, 1.1], 1, 0.5, False))
        camera = np.reshape(pepper.call("ALMotion.getTransform", "CameraTop", 1, True), (4, 4))
        seen = np.linalg.inv(camera) @ [2.0, 0.0, 1.1, 1.0]
        assert abs(seen[1] / seen[0]) < 1e-2
        assert abs(seen[2] / seen[0]) < 1e-2

    virtual(scenario)


@pytest.mark.parametrize(
    ("effector", "place"), [("RArm", [1.0, -0.5, 0.2]), ("Arms", [0.8, 0.6, -0.2])]
)
def test_the_hand_lies_on_the_line_from_shoulder_to_place(effector, place):
    async def scenario(pepper):
        arm = "LArm" if effector == "Arms" else effector
        await pepper.finish(pepper.start("ALTracker.pointAt", effector, place, 0, 0.5))
        shoulder = np.array(
            pepper.call("ALMotion.getPosition", f"{arm[0]}ShoulderPitch", 0, True)[:3]
        )
        hand = np.array(pepper.call("ALMotion.getPosition", arm, 0, True)[:3])
        way, line = hand - shoulder, np.array(place) - shoulder
        cosine = way @ line / np.linalg.norm(way) / np.linalg.norm(line)
        assert math.degrees(math.acos(min(cosine, 1.0))) < 1.0

    virtual(scenario)


def test_words_bookmarks_and_pauses_come_in_their_order_and_time():
    heard = []

    async def scenario(pepper):
        for name in ("CurrentWord", "PositionOfCurrentWord", "CurrentBookMark"):
            event = f"ALTextToSpeech/{name}"
            pepper.pepper.memory.listen(
                event, lambda value: heard.append((pepper.robot.now, value))
            )
        start = pepper.robot.now
        text = "\\rspd=80\\Look ^start(animations/Stand/Gestures/Hey_1)\\mrk=7\\\\pau=2000\\ there!"
        await pepper.finish(pepper.start("ALAnimatedSpeech.say", text))
        assert [value for _, value in heard] == ["Look", 0, 7, "there!", 1]
        times = [time - start for time, _ in heard]
        assert times == pytest.approx([0.0, 0.0, 0.36, 2.36, 2.36], abs=0.1)

    virtual(scenario)


def test_a_place_that_an_event_tells_is_followed_by_head_and_arm():
    async def scenario(pepper):
        world, place = [1.5, 0.8, 1.3, 0.0, 0.0, 0.0], [1.0, -0.6, 0.0]
        pepper.call("ALTracker.trackEvent", "seen")
        pepper.call("ALMemory.raiseEvent", "seen", [world, [1, 0], 1, 0.0])
        assert pepper.call("ALTracker.getTargetPosition", 1) == pytest.approx(world[:3])
        await pepper.run(2.0)
        followed = pepper.call("ALMotion.getAngles", "Head", True)
        assert pepper.call("ALTracker.isTargetLost") is True  # For want of news.
        await pepper.finish(pepper.start("ALTracker.lookAt", world[:3], 1, 0.5, False))
        assert followed == pytest.approx(pepper.call("ALMotion.getAngles", "Head", True), abs=0.01)
        pepper.call("ALTracker.setEffector", "Arms")
        pepper.call("ALMemory.raiseEvent", "seen", [place, place, [1, 0], 3])
        await pepper.run(2.0)
        assert pepper.call("ALMotion.getAngles", "Head", True) == pytest.approx(followed, abs=0.01)
        followed = pepper.call("ALMotion.getAngles", "RArm", True)
        await pepper.finish(pepper.start("ALTracker.pointAt", "RArm", place, 0, 0.5))
        assert followed == pytest.approx(pepper.call("ALMotion.getAngles", "RArm", True), abs=0.01)
        logged = len(pepper.lines)
        for nonsense in ("nonsense", [world, [1, 0], [1]], [[1.0], [1, 0], 1]):
            pepper.call("ALMemory.raiseEvent", "seen", nonsense)
        assert [line for line in pepper.lines[logged:] if "no position in the value" in line] == [
            pepper.lines[logged]
        ]
        pepper.call("ALTracker.stopTracker")
        assert pepper.call("ALMemory.getData", "ALTracker/ActiveTargetChanged") == ""
        pepper.call("ALMemory.raiseEvent", "seen", [[2.0, 0.0, 1.0], [2, 0], 1])
        assert pepper.call("ALTracker.getTargetPosition", 1) == []

    virtual(scenario)


def test_in_the_mode_move_the_base_follows_what_an_event_tells_and_stops_for_want_of_news():
    async def scenario(pepper):
        async def seen(x, y, seconds):
            for _ in range(round(5 * seconds)):
                pepper.call("ALMemory.raiseEvent", "seen", [[x, y, 1.0], [1, 0], 3])
                await pepper.run(0.2)
            return pepper.call("ALMotion.getRobotPosition", True)

        pepper.call("ALTracker.setMode", "Move")
        pepper.call("ALTracker.trackEvent", "seen")
        assert await seen(2.0, 0.0, 1.0) == [0.0, 0.0, 0.0]  # Nobody has said how near.
        pepper.call("ALTracker.setRelativePosition", [-0.5, 0.0, 0.0, 0.02, 0.02, 0.05])
        assert await seen(2.0, 0.0, 8.0) == pytest.approx([1.5, 0.0, 0.0], abs=0.03)
        assert not pepper.call("ALMotion.moveIsActive")
        x, y, theta = await seen(1.5, 2.0, 8.0)
        assert math.hypot(1.5 - x, 2.0 - y) == pytest.approx(0.5, abs=0.04)
        assert theta == pytest.approx(math.atan2(2.0 - y, 1.5 - x), abs=0.06)
        assert await seen(1e308, -1e308, 1.0) == pepper.call("ALMotion.getRobotPosition", True)
        await seen(9.0, 2.0, 1.0)
        assert pepper.call("ALMotion.moveIsActive")
        await pepper.run(3.0)
        assert not pepper.call("ALMotion.moveIsActive")
        pepper.services["ALTracker"].on_client_left(CALLER)
        assert await seen(9.0, 2.0, 1.0) == pepper.call("ALMotion.getRobotPosition", True)
        assert not pepper.call("ALMotion.moveIsActive")

    virtual(scenario)


def test_nothing_is_tracked_and_nobody_is_told_otherwise():
    async def scenario(pepper):
        pepper.call("ALTracker.registerTarget", "RedBall", 0.06)
        assert pepper.call("ALTracker.getRegisteredTargets") == ["RedBall"]
        pepper.call("ALTracker.track", "RedBall")
        assert any("it stays lost" in line for line in pepper.lines)
        assert pepper.call("ALTracker.isTargetLost") is True
        assert pepper.call("ALTracker.isActive") is True
        assert pepper.call("ALTracker.getActiveTarget") == "RedBall"
        pepper.call("ALTracker.unregisterTarget", "RedBall")
        assert pepper.call("ALTracker.isActive") is False
        with pytest.raises(ServiceError, match=r"^ALTracker::track: .* was not registered$"):
            pepper.call("ALTracker.track", "Face")

    virtual(scenario)


def test_lights_take_the_time_of_their_change():
    async def scenario(pepper):
        call = pepper.start("ALLeds.fadeRGB", "FaceLeds", 0x0000FF, 0.5)
        assert await pepper.finish(call) == pytest.approx(0.5, abs=0.05)
        assert pepper.lines == ["lights of FaceLeds: #0000ff"]
        pepper.call("ALLeds.off", "FaceLeds")
        assert pepper.call("ALLeds.getIntensity", "FaceLeds") == 0.0

    virtual(scenario)


def test_devices_are_led_by_their_keys():
    """As programs light the chest, switch lasers on and move joints below ALMotion."""
    light, joint = "ChestBoard/Led/Red/Actuator/Value", "HeadYaw/Position/Actuator/Value"
    laser = "Device/SubDeviceList/Platform/LaserSensor/Front/Reg/OperationMode/Actuator/Value"

    async def scenario(pepper):
        def time(seconds):
            return pepper.call("DCM.getTime", round(1000 * seconds))

        def brightness():
            return pepper.call("ALMemory.getData", "Device/SubDeviceList/" + light)

        assert pepper.call("ALMemory.getData", "DCM/Time") == time(0)
        pepper.call("DCM.createAlias", ["Red", [light]])
        pepper.call("DCM.set", ["Red", "ClearAll", [[0.0, time(1)], [1.0, time(2)]]])
        pepper.call("DCM.set", [laser, "Merge", [[1.0, time(0)]]])
        pepper.call("DCM.createAlias", ["Head", [joint, "HeadYaw/Hardness/Actuator/Value"]])
        values = [[[0.5, time(1)]], [[1.0, time(0)]]]
        pepper.call("DCM.setAlias", ["Head", "ClearAll", "time-mixed", values])
        await pepper.run(0.5)
        assert brightness() == pytest.approx(0.5, abs=0.05)
        assert pepper.angle("HeadYaw") == pytest.approx(0.25, abs=0.03)
        await pepper.run(0.5)
        assert brightness() == pytest.approx(0.0, abs=0.05)
        await pepper.run(1.0)
        assert brightness() == pytest.approx(1.0, abs=0.05)
        assert pepper.angle("HeadYaw") == pytest.approx(0.5)
        for wrong in (["Red", "Now", [[1.0, 0]]], ["Nose/Actuator", "Merge", [[1.0, 0]]], ["Red"]):
            with pytest.raises(ServiceError, match=r"^DCM::set: "):
                pepper.call("DCM.set", wrong)

    virtual(scenario)
