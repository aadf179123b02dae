"""The scripts of examples/ do what they say."""

import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def cartesian_robot():
    return runpy.run_path(str(EXAMPLES / "cartesian_robot.py"))


def test_another_robot_reaches_past_the_ball(cartesian_robot):
    outcome = cartesian_robot["perform"](avoid=True)
    assert outcome.goal_error < 0.002
    assert 0.005 < outcome.gap < 0.05


def test_without_the_coupling_it_goes_through_the_ball(cartesian_robot):
    outcome = cartesian_robot["perform"](avoid=False)
    assert outcome.goal_error < 0.002
    assert outcome.gap < -0.01
