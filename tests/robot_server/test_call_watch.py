"""Statistics and traces of calls, and the log that clients listen to."""

import asyncio

import pytest
from virtual_pepper import virtual

from pepper_drake.naoqi.wire import decode, encode
from pepper_drake.robot_server.wire.call_watch import TRACE, CallWatch
from pepper_drake.robot_server.wire.objects import STATISTICS


def test_calls_are_counted_and_told_with_their_results_and_errors():
    watch, told = CallWatch(counts=True, traces=True), []

    async def later():
        await asyncio.sleep(0.01)
        return [1.5, b"raw"]

    def fails():
        raise ValueError("no")

    assert watch.run(lambda: 3, 100, 7, ("a",), told.append) == 3
    assert asyncio.run(watch.run(later, 101, 8, (), told.append)) == [1.5, b"raw"]
    with pytest.raises(ValueError, match="no"):
        watch.run(fails, 100, 9, (), told.append)
    kinds = [(event[0], event[1], event[2], event[3]) for event in told]
    assert kinds == [
        (7, 1, 100, ["a"]),
        (7, 2, 100, 3),
        (8, 1, 101, []),
        (8, 2, 101, [1.5, "bytes"]),
        (9, 1, 100, []),
        (9, 3, 100, "no"),
    ]
    for event in told:
        assert decode(TRACE, encode(TRACE, event)) == event
    kept = decode(STATISTICS, encode(STATISTICS, watch.statistics()))
    assert {uid: value[0] for uid, value in kept.items()} == {100: 2, 101: 1}
    assert kept[101][1][0] >= 0.01
    watch.clear()
    assert watch.statistics() == {}


def test_a_listener_hears_what_the_robot_logs_until_it_is_let_go():
    async def scenario(pepper):
        listener = pepper.call("LogManager.createListener")
        heard = []
        listener.emitters.append(lambda _, __, ___, values: heard.append(values[0]))
        pepper.call("ALLeds.off", "FaceLeds")
        assert [message[4] for message in heard if isinstance(message, tuple)] == [
            "lights of FaceLeds: 0"
        ]
        listener.on_terminated()
        heard.clear()
        pepper.call("ALLeds.on", "FaceLeds")
        assert heard == []
        message = ("", (4,), "mine", "here", "a line", 1, (0,), (0,))
        pepper.call("LogManager.log", [message])
        assert pepper.lines[-1] == "mine: a line"

    virtual(scenario)
