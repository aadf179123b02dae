"""Options of the command line for a robot."""

import subprocess
import sys
from argparse import ArgumentParser

import pytest
from served import served

from pepper_drake.cli_robot import add_robot_options
from pepper_drake.errors import InputError
from pepper_drake.hardware.options import add_link_options, check_station, robot_access


def parsed(*words):
    parser = ArgumentParser()
    add_robot_options(parser, addresses=True)
    add_link_options(parser)
    parser.add_argument("--live", action="store_true")
    return parser.parse_args(words)


def test_the_simulation_is_the_default():
    assert not check_station(parsed(), {"live": False})
    assert not check_station(parsed("--live"), {"live": False})


def test_a_robot_is_named_with_its_password(tmp_path):
    file = tmp_path / "nao"
    file.write_text("nao:se:cret\n")
    options = parsed(
        "--station", "naoqi", "--robot", "10.0.0.2", "--password-file", str(file), "--link", "libqi"
    )
    assert check_station(options, {"live": False})
    access = robot_access(options)
    assert (access.address, access.user, access.password, access.link) == (
        "tcp://10.0.0.2:9559",
        "nao",
        "se:cret",
        "libqi",
    )


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--robot", "a"], "--station naoqi"),
        (["--station", "naoqi"], "--robot ADDRESS"),
        (["--station", "naoqi", "--robot", "http://a"], "not a robot's address"),
        (["--station", "naoqi", "--robot", "a", "--live"], "--live is for the simulation"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_sentence(words, text):
    options = parsed(*words)

    def read():
        return check_station(options, {"live": False}) and robot_access(options)

    with pytest.raises(InputError, match=text):
        read()


def test_a_password_file_without_a_password(tmp_path):
    file = tmp_path / "nao"
    file.write_text("nao\n")
    with pytest.raises(InputError, match="line 1: must be USER:PASSWORD"):
        robot_access(parsed("--robot", "a", "--password-file", str(file)))


def test_the_preflight_app():
    def run(*words):
        return subprocess.run(
            [sys.executable, "apps/preflight.py", *words], capture_output=True, text=True
        )

    with served() as robot:
        ready = run("--robot", robot.address, "--disable-life")
        robot.do(lambda: robot.pepper.motion.set_stiffnesses("LArm", 0.0))
        limp = run("--robot", robot.address, "--arm", "left")
    gone = run("--robot", "tcp://127.0.0.1:9")
    assert (ready.returncode, limp.returncode, gone.returncode) == (0, 1, 1)
    assert ready.stdout.startswith("ok    model: Pepper")
    assert "FAIL  stiffness: 0.00" in limp.stdout
    assert gone.stderr.startswith("error: no robot answers")
    assert len(gone.stderr.splitlines()) == 1
