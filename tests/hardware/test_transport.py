"""Both ways to a robot do the same."""

import subprocess
import sys

import pytest
from served import served

from pepper_drake.errors import InputError
from pepper_drake.hardware.transport import LINKS, RobotAccess, make_transport
from pepper_drake.robot_server.wire.connection import Credentials

# In a process of its own, since libqi may have one application in each.
PROGRAM = """
import asyncio, json, sys
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.transport import RobotAccess, make_transport

async def main():
    address, link, user, password = sys.argv[1:5]
    transport = make_transport(RobotAccess(address, user, password, link))
    try:
        await transport.connect()
    except LinkFault as fault:
        return [fault.word]
    heard, result = [], []
    await transport.on_event("Greeting", heard.append)
    await transport.call("ALMemory", "raiseEvent", "Greeting", 5)
    result.append(len(await transport.call("ALMotion", "getAngles", "Body", True)))
    result.append(await transport.call("ALMemory", "getData", "RobotConfig/Body/Type"))
    for call in [("ALMotion", "getAngles", "None", True), ("ALNone", "ping")]:
        try:
            await transport.call(*call)
        except LinkFault as fault:
            result.append(fault.word)
    await asyncio.sleep(0.3)
    result += [heard, transport.is_lost]
    await transport.close()
    return result

print(json.dumps(asyncio.run(main())), flush=True)
import os; os._exit(0)
"""


def run(address, link, user="", password=""):
    if link == "libqi":
        pytest.importorskip("qi", reason="libqi is in the naoqi extra")
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM, address, link, user, password],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.strip().splitlines()[-1]


@pytest.mark.parametrize("link", LINKS)
def test_calls_events_and_errors(link):
    with served() as robot:
        result = run(robot.address, link)
    assert result == '[20, "Juliette", "call_failed", "service_missing", [5], false]'


@pytest.mark.parametrize("link", LINKS)
def test_refused_and_unreachable(link):
    with served(credentials=Credentials("nao", "secret")) as robot:
        assert run(robot.address, link, "nao", "secret").startswith("[20")
        assert run(robot.address, link, "nao", "wrong") == '["robot_refused"]'
    assert run("tcp://127.0.0.1:9", link) == '["robot_unreachable"]'


def test_a_link_that_there_is_not():
    with pytest.raises(InputError, match="wire, libqi"):
        make_transport(RobotAccess("tcp://127.0.0.1", link="radio"))
