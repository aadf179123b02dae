"""Faults of a served robot on demand, which are mended again."""

import asyncio
import time

import pytest

from pepper_drake.robot_server.faults_on_demand import FaultsOnDemand
from pepper_drake.robot_server.wire.service import Service, ServiceError

DELAY = 0.05


def test_calls_are_late_or_fail_until_they_are_mended():
    async def later():
        return "later"

    async def duration(call):
        begin = time.monotonic()
        result = call()
        answer = await result if asyncio.iscoroutine(result) else result
        return answer, time.monotonic() - begin

    async def scenario():
        faults.delay(DELAY)
        for method, answer in ((at_once, "at once"), (in_time, "later")):
            told, seconds = await duration(service.methods[method.uid].handler)
            assert (told, seconds >= DELAY) == (answer, True)
        faults.fail(["Mine.atOnce"])
        with pytest.raises(ServiceError, match=r"^Mine::atOnce: fails on demand$"):
            service.methods[at_once.uid].handler()
        faults.fail([])
        faults.delay(0.0)
        assert service.methods == {at_once.uid: at_once, in_time.uid: in_time}

    service = Service("Mine")
    at_once = service.add_method("atOnce", "()", "s", lambda: "at once")
    in_time = service.add_method("later", "()", "s", later)
    faults = FaultsOnDemand([service], lambda: None)
    asyncio.run(scenario())
    with pytest.raises(ValueError, match=r"there is no method 'Mine\.nothing'"):
        faults.fail(["Mine.nothing"])
    for wrong in (-1.0, float("nan"), 1e9):
        with pytest.raises(ValueError, match="the delay must be between 0 and 60 s"):
            faults.delay(wrong)
