import pytest
from hypothesis import given
from hypothesis import strategies as st
from virtual_pepper import VirtualPepper, virtual

from pepper_drake.naoqi.clock import join_time
from pepper_drake.naoqi.constants import CYCLE
from pepper_drake.robot_server.wire.service import ServiceError

_YAW = "Device/SubDeviceList/HeadYaw/Position/{}/Value"


def _listen(pepper: VirtualPepper, *events: str) -> list[tuple[str, object]]:
    """Returns a list that fills with what happens."""
    heard: list[tuple[str, object]] = []
    for event in events:
        subscriber = pepper.call("ALMemory.subscriber", event)
        subscriber.emitters.append(
            lambda _s, _u, _p, arguments, event=event: heard.append((event, arguments[0]))
        )
    return heard


_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5) | st.floats(-1, 1) | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=6,
)


def test_what_is_put_in_comes_out():
    async def scenario(pepper):
        @given(st.dictionaries(st.text(min_size=1, max_size=5), _VALUES, max_size=5))
        def check(data):
            pepper.call("ALMemory.insertListData", [[key, value] for key, value in data.items()])
            for key, value in data.items():
                assert pepper.call("ALMemory.getData", key) == value
            found = pepper.call("ALMemory.getListData", [*data, "nowhere"])
            assert found == [*data.values(), None]
            for key in data:
                pepper.call("ALMemory.removeData", key)

        check()

    virtual(scenario)


def test_a_key_that_is_not_there_is_an_error():
    async def scenario(pepper):
        with pytest.raises(ServiceError, match=r"^ALMemory::getData: data not found: nowhere$"):
            pepper.call("ALMemory.getData", "nowhere")
        pepper.call("ALMemory.insertData", "mine", 1)
        pepper.call("ALMemory.removeData", "mine")
        with pytest.raises(ServiceError, match="data not found"):
            pepper.call("ALMemory.getData", "mine")

    virtual(scenario)


def test_sensor_and_actuator_of_a_joint():
    async def scenario(pepper):
        pepper.call("ALMotion.setAngles", "HeadYaw", 1.0, 0.1)
        await pepper.run(0.6)
        sensor = pepper.call("ALMemory.getData", _YAW.format("Sensor"))
        actuator = pepper.call("ALMemory.getData", _YAW.format("Actuator"))
        # The joint goes half of the way to its command in a cycle.
        assert 0.0 < sensor < actuator
        keys = [_YAW.format("Sensor"), "Device/SubDeviceList/HeadYaw/Hardness/Actuator/Value"]
        assert pepper.call("ALMemory.getListData", keys) == [sensor, 1.0]
        value, seconds, microseconds = pepper.call("ALMemory.getTimestamp", keys[0])
        assert value == sensor
        # The state is that of the last cycle's begin.
        assert join_time(seconds, microseconds) == pytest.approx(pepper.robot.now, abs=1e-6)
        # Programs that simulate a sensor write; the next measurement overwrites that.
        pepper.call("ALMemory.insertData", keys[0], 0.0)
        pepper.call("ALMemory.raiseEvent", keys[0], 0.0)
        await pepper.cycle()
        value, seconds, microseconds = pepper.call("ALMemory.getTimestamp", keys[0])
        assert value > sensor
        assert join_time(seconds, microseconds) == pytest.approx(pepper.robot.now, abs=1e-6)
        speed = pepper.call("ALMemory.getData", "Motion/Velocity/Sensor/HeadYaw")
        assert speed == pytest.approx((value - sensor) / CYCLE)
        with pytest.raises(ServiceError, match="the torque of HeadYaw is not simulated"):
            pepper.call("ALMemory.getData", "Motion/Torque/Sensor/HeadYaw")

    virtual(scenario, follow=0.5)


def test_wheels_turn_as_the_base_does():
    async def scenario(pepper):
        speeds = "Device/SubDeviceList/{}/Speed/Sensor/Value"
        keys = [speeds.format(wheel) for wheel in ("WheelFL", "WheelFR", "WheelB")]
        pepper.call("ALMotion.move", 0.0, 0.0, 0.5)
        await pepper.run(3.0)
        turning = pepper.call("ALMemory.getListData", keys)
        # Turning on the spot, all roll the same way round; the back one by 0.17 m of arm.
        assert abs(turning[2]) == pytest.approx(0.5 * 0.17 / 0.07, rel=1e-6)
        assert turning[0] * turning[1] > 0
        pepper.call("ALMotion.move", 0.2, 0.0, 0.0)
        await pepper.run(3.0)
        ahead = pepper.call("ALMemory.getListData", keys)
        assert ahead[0] == pytest.approx(-ahead[1])
        assert ahead[2] == pytest.approx(0.0, abs=1e-9)

    virtual(scenario)


def test_touch_is_told_when_it_begins_and_when_it_ends():
    async def scenario(pepper):
        heard = _listen(pepper, "FrontTactilTouched", "HandRightBackTouched", "TouchChanged")
        pepper.robot.touch("Head/Touch/Front")
        await pepper.run(0.2)
        key = "Device/SubDeviceList/Head/Touch/Front/Sensor/Value"
        assert pepper.call("ALMemory.getData", key) == 1.0
        assert pepper.call("ALMemory.getData", "FrontTactilTouched") == 1.0
        pepper.robot.touch("RHand/Touch/Back")
        await pepper.run(0.2)
        assert [pair for pair in heard if pair[0] != "TouchChanged"] == [
            ("FrontTactilTouched", 1.0),
            ("FrontTactilTouched", 0.0),
            ("HandRightBackTouched", 1.0),
        ]
        parts = [part[:2] for name, value in heard if name == "TouchChanged" for part in value]
        assert ["Head", True] in parts
        assert ["RArm", True] in parts
        assert pepper.call("ALMemory.getData", "FrontTactilTouched") == 0.0

    virtual(scenario)


@pytest.mark.parametrize(
    ("sensor", "event"),
    [
        ("Platform/FrontLeft/Bumper", "LeftBumperPressed"),
        ("Platform/FrontRight/Bumper", "RightBumperPressed"),
        ("Platform/Back/Bumper", "BackBumperPressed"),
        ("ChestBoard/Button", "ChestButtonPressed"),
    ],
)
def test_bumpers_and_button(sensor, event):
    async def scenario(pepper):
        heard = _listen(pepper, event)
        pepper.robot.touch(sensor)
        await pepper.run(0.1)
        pepper.robot.touch()
        await pepper.run(0.1)
        assert heard == [(event, 1.0), (event, 0.0)]

    virtual(scenario)


@pytest.mark.parametrize(("presses", "name"), [(1, "Simple"), (2, "Double"), (3, "Triple")])
def test_clicks_of_the_chest_button_are_counted(presses, name):
    async def scenario(pepper):
        events = [f"ALChestButton/{n}ClickOccurred" for n in ("Simple", "Double", "Triple")]
        heard = _listen(pepper, *events)
        for _ in range(presses):
            pepper.robot.touch("ChestBoard/Button")
            await pepper.run(0.1)
            pepper.robot.touch()
            await pepper.run(0.1)
        await pepper.run(1.0)
        assert heard == [(f"ALChestButton/{name}ClickOccurred", presses)]

    virtual(scenario)


def test_events_of_programs_reach_subscribers_until_they_end():
    async def scenario(pepper):
        heard = _listen(pepper, "mine")
        pepper.call("ALMemory.raiseEvent", "mine", [1, "a"])
        pepper.call("ALMemory.insertData", "mine", 2)
        pepper.call("ALMemory.raiseMicroEvent", "mine", 3)
        assert heard == [("mine", [1, "a"]), ("mine", 3)]
        subscriber = pepper.call("ALMemory.subscriber", "other")
        subscriber.on_terminated()
        pepper.call("ALMemory.raiseEvent", "other", 1)
        assert {"other", "HandLeftBackTouched"} < set(pepper.call("ALMemory.getEventList"))
        history = pepper.call("ALMemory.getEventHistory", "mine")
        assert [entry[0] for entry in history] == [[1, "a"]]

    virtual(scenario)


class Module:
    def __init__(self):
        self.calls = []

    async def call(self, method, *arguments):
        self.calls.append((method, *arguments))
        raise ServiceError("its own affair")


class Directory:
    def __init__(self, **modules):
        self.modules = modules

    def find(self, name):
        return self.modules.get(name)


def test_events_call_the_modules_of_clients_and_forget_those_that_are_gone():
    async def scenario(pepper):
        module = Module()
        pepper.pepper.finder = Directory(Mine=module)
        pepper.call("ALMemory.subscribeToEvent", "MiddleTactilTouched", "Mine", "onTouch")
        pepper.call("ALMemory.subscribeToEvent", "other", "Mine", "hello", "onOther")
        pepper.call("ALMemory.subscribeToEvent", "other", "Gone", "onOther")
        assert pepper.call("ALMemory.getSubscribers", "other") == ["Gone", "Mine"]
        pepper.robot.touch("Head/Touch/Middle")
        await pepper.run(0.1)
        pepper.call("ALMemory.raiseEvent", "other", 5)
        await pepper.run(0.1)
        assert module.calls == [
            ("onTouch", "MiddleTactilTouched", 1.0, ""),
            ("onOther", "other", 5, "hello"),
        ]
        assert pepper.call("ALMemory.getSubscribers", "other") == ["Mine"]
        pepper.call("ALMemory.unsubscribeToEvent", "other", "Mine")
        with pytest.raises(ServiceError, match="has not subscribed"):
            pepper.call("ALMemory.unsubscribeToEvent", "other", "Mine")

    virtual(scenario)


def test_a_distance_that_was_not_measured_is_told_apart_from_a_free_way():
    async def scenario(pepper):
        sonar = "Device/SubDeviceList/Platform/{}/Sonar/Sensor/Value"
        pepper.robot.measure({"Platform/Front/Sonar": 1.25})
        await pepper.cycle()
        assert pepper.call("ALMemory.getData", sonar.format("Front")) == 1.25
        with pytest.raises(ServiceError, match="Back/Sonar/Sensor/Value: not simulated"):
            pepper.call("ALMemory.getData", sonar.format("Back"))
        keys = pepper.call("ALSonar.getMemoryKeyList")
        assert pepper.call("ALMemory.getListData", keys) == [1.25, None]
        # Programs read every key that is listed.
        assert pepper.call("ALMemory.getDataList", "/Sonar/") == [sonar.format("Front")]

    virtual(scenario)
