"""A libqi program against the app, as its user starts it."""

import json
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from pepper_drake.learning import Demonstration

APP = Path(__file__).parents[2] / "apps" / "serve_naoqi.py"

CLIENT = textwrap.dedent(
    """
    import json, os, sys, time, qi
    qi.logging.setLevel(qi.logging.FATAL)
    app = qi.Application(["test"], raw=True)
    session, truth = qi.Session(), qi.Session()
    session.connect(sys.argv[1]); truth.connect(sys.argv[2])
    motion, video = session.service("ALMotion"), session.service("ALVideoDevice")
    extras = truth.service("PepperDrake")
    before = extras.groundTruth()
    handle = video.subscribeCamera("test", 0, 2, 11, 10)
    depth = video.subscribeCamera("test", 2, 1, 17, 5)
    motion.angleInterpolation(["HeadYaw", "RShoulderPitch"], [0.3, 1.0], [1.0, 1.0], True)
    time.sleep(0.5)
    motion.moveTo(0.1, 0.0, 0.0)
    time.sleep(1.0)
    image, ranges = video.getImageRemote(handle), video.getImageRemote(depth)
    after = extras.groundTruth()
    motion.setStiffnesses("LArm", 0.0)
    result = {
        "angles": motion.getAngles(["HeadYaw", "RShoulderPitch"], True),
        "image": [image[0], image[1], len(image[6])],
        "depth": [ranges[0], ranges[1], len(ranges[6])],
        "way": after["base_pose"][0] - before["base_pose"][0],
    }
    print(json.dumps(result)); sys.stdout.flush(); os._exit(0)
    """
)


SHOWN = textwrap.dedent(
    """
    name: short
    arm: right
    posture: stand
    rest: 0.3
    via_points:
    - {time: 0.5, position: [0.081, -0.170, -0.263], rpy: [1.08, 0.88, 0.09]}
    - {time: 1.0, position: [0.115, -0.237, -0.236], rpy: [0.53, 0.81, -0.01]}
    """
)


# What needs no served robot comes first: one that nobody asks takes processor time.


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--host", "0.0.0.0"], "--password-file"),
        (["--password-file", "/nowhere/at/all"], "no such file"),
        (["--rate", "7"], "is not a rate"),
        (["--port", "x"], "is not a port"),
        (["--set", "station.cameras=false"], "a served robot has its cameras"),
    ],
)
def test_what_cannot_be_served_is_refused_in_one_line(run_app, options, sentence):
    ran = run_app("serve_naoqi", *options)
    assert ran.returncode == 2
    assert sentence in ran.stderr
    assert ran.stderr.count("\n") == 1


@pytest.mark.render
def test_the_simulator_does_not_outlive_a_server_that_is_killed():
    app = subprocess.Popen(
        [sys.executable, str(APP), "--port", "0"], stdout=subprocess.PIPE, text=True
    )
    app.stdout.readline()
    started = Path(f"/proc/{app.pid}/task/{app.pid}/children").read_text().split()
    app.kill()
    app.wait()
    assert started
    end = time.monotonic() + 10.0
    while any(is_running(process) for process in started):
        assert time.monotonic() < end
        time.sleep(0.05)


def is_running(process):
    """True unless a process has ended, waited for or not."""
    state = Path(f"/proc/{process}/stat")
    try:
        return state.read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """The app at work, and the addresses that it tells."""
    folder = tmp_path_factory.mktemp("served")
    (folder / "short.yaml").write_text(SHOWN)
    options = ["--port", "0", "--show", str(folder / "short.yaml"), "--output", str(folder)]
    app = subprocess.Popen([sys.executable, str(APP), *options], stdout=subprocess.PIPE, text=True)
    yield re.findall(r"tcp://[\d.:]+", app.stdout.readline())
    app.send_signal(signal.SIGINT)
    assert app.wait(30) == 0


@pytest.mark.render
def test_a_limp_arm_is_shown_a_movement_which_is_recorded(served, run_app, tmp_path):
    to = ("--station", "naoqi", "--robot", served[0], "--disable-life")
    ran = run_app("record", *to, "--output", tmp_path / "shown")
    assert ran.returncode == 0, ran.stderr
    assert "the right arm is limp: lead it; the chest button ends it" in ran.stdout
    report = json.loads((tmp_path / "shown" / "report.json").read_text())
    assert report["ended_by"] == "ChestButtonPressed"
    demonstration = Demonstration.load(tmp_path / "shown")
    # A person's hold is soft, and the joints have friction.
    np.testing.assert_allclose(demonstration.positions[-1], [0.115, -0.237, -0.236], atol=0.02)
    assert 0.5 < demonstration.duration < 2.0


@pytest.mark.render
def test_a_program_for_a_robot_finds_one(served):
    pytest.importorskip("qi", reason="libqi is in the naoqi extra")
    ran = subprocess.run(
        [sys.executable, "-c", CLIENT, *served], capture_output=True, text=True, timeout=120
    )
    assert ran.returncode == 0, ran.stderr[-2000:]
    result = json.loads(ran.stdout.splitlines()[-1])
    assert result["angles"] == pytest.approx([0.3, 1.0], abs=0.03)
    assert result["image"] == [640, 480, 640 * 480 * 3]
    assert result["depth"] == [320, 240, 320 * 240 * 2]
    assert result["way"] == pytest.approx(0.1, abs=0.02)
