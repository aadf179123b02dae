import math
import time
from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.scene import Obstacle, load_scene
from pepper_drake.naoqi.constants import CHAINS, CYCLE, JOINTS, TOP
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.robot_server.faults_on_demand import FaultsOnDemand
from pepper_drake.robot_server.ground_truth_service import make_extras
from pepper_drake.robot_server.robot.robot_port import RobotCommand
from pepper_drake.robot_server.robot.simulated_robot import SimulatedRobot
from pepper_drake.robot_server.robot.simulator import SimulatorConfig
from pepper_drake.robot_server.wire.service import ServiceError

_ARM = [JOINTS.index(name) for name in CHAINS["RArm"][:5]]
_ELBOW, _WRIST = JOINTS.index("RElbowRoll"), JOINTS.index("RWristYaw")


# These first: the other robot goes on in real time, asked or not.


def test_a_bumper_is_pressed_by_what_the_base_drives_into():
    free = load_scene("free")
    box = Obstacle("box", "box", size=[0.1, 0.2, 0.4], position=[0.4, 0.15, 0.2])
    scene = replace(free, robot=replace(free.robot, x=0.0, y=0.0, yaw=0.0), obstacles=[box])
    with SimulatedRobot(SimulatorConfig(scene, StationConfig(), rate=0.0)) as robot:
        robot.wait_until_ready()
        start = robot.state()
        assert start.touched == frozenset()
        stiff = np.ones(len(JOINTS))
        while not (now := robot.state()).touched and now.time < start.time + 3.0:
            robot.check()
            robot.command(RobotCommand(start.positions, stiff, (0.2, 0.0, 0.0)))
            time.sleep(0.002)
    assert now.touched == {"Platform/FrontLeft/Bumper"}
    assert 0.0 < now.base_pose[0] < 0.3


def test_a_goal_that_moves_by_itself_is_moved_by_nobody(monkeypatch):
    monkeypatch.setattr(SimulatedRobot, "start", lambda *_: None)  # No simulator is needed.
    monkeypatch.setattr(SimulatedRobot, "end", lambda *_: None)
    scene = load_scene("free")
    moving = replace(scene, goal=replace(scene.goal, path=[[0.0, 0.0, 0.0, 0.0], [1.0, 0.1, 0, 0]]))
    with SimulatedRobot(SimulatorConfig(moving, StationConfig())) as still:
        (move_goal,) = make_extras(still, FaultsOnDemand([], still.close)).overloads("moveGoal")
        with pytest.raises(ServiceError, match="moveGoal: the goal of this scene moves by itself"):
            move_goal.handler(0.0, 0.05, 0.02)
        assert still._command.writes == 0


@pytest.fixture(scope="module")
def robot():
    with SimulatedRobot(SimulatorConfig(load_scene("free"), StationConfig())) as started:
        started.wait_until_ready()
        yield started


def _command(
    robot: SimulatedRobot, seconds: float, positions, stiffness
) -> tuple[np.ndarray, np.ndarray]:
    """Commands as ALMotion does, limp joints to where they are.

    Returns the times and positions that were measured: not each cycle's on a busy machine.
    """
    times, path, last = [], [], -1.0
    state = robot.state()
    end, give_up = state.time + seconds, time.monotonic() + 60 * seconds
    while state.time < end:
        assert time.monotonic() < give_up, "the robot's clock stands still"
        if state.time > last:
            last = state.time
            times.append(last)
            path.append(state.positions)
            wanted = np.where(stiffness > 0.0, positions, state.positions)
            robot.command(RobotCommand(wanted, stiffness))
        time.sleep(0.002)
        state = robot.state()
    return np.array(times), np.array(path)


def test_a_limp_arm_stays_where_it_was_left_and_a_stiff_one_goes_on_from_there(robot):
    stiff = np.ones(len(JOINTS))
    start = robot.state().positions
    moved = start.copy()
    moved[_ELBOW] += 0.3
    # Still on its way when it goes limp: friction brakes it.
    _command(robot, 0.3, moved, stiff)
    limp = stiff.copy()
    limp[_ARM] = 0.0
    times, path = _command(robot, 4.0, moved, limp)
    rest = path[np.searchsorted(times, times[0] + 1.0)]
    np.testing.assert_allclose(path[-1][_ARM], rest[_ARM], atol=0.01)
    _, stiffened = _command(robot, 1.0, path[-1], stiff)
    assert np.abs(stiffened[:, _ARM] - path[-1][_ARM]).max() < 0.01


def test_one_joint_goes_limp_alone(robot):
    one = np.ones(len(JOINTS))
    one[_WRIST] = 0.0
    start = robot.state().positions
    target = start.copy()
    target[[_WRIST, _ELBOW]] += 0.3
    _, path = _command(robot, 2.0, target, one)
    assert path[-1][_ELBOW] == pytest.approx(target[_ELBOW], abs=0.02)
    assert abs(path[-1][_WRIST] - start[_WRIST]) < 0.1
    state = robot.state()
    assert 0.1 < abs(state.torques[_ELBOW]) < 3.0  # It holds the forearm.
    assert state.currents[_ELBOW] > 0.0
    assert abs(state.torques[_WRIST]) < 0.05


def test_somebody_moves_the_goal_smoothly(robot):
    before, since = robot.record(), robot.state()
    robot.command(RobotCommand(since.positions, np.ones(len(JOINTS))))
    robot.move_goal((0.0, 0.05, 0.02))
    seen = [before]
    while seen[-1]["time"] < before["time"] + 1.2:
        seen.append(robot.record())
        time.sleep(0.002)
    goals = np.array([state["goal"] for state in seen])
    times = np.array([state["time"] for state in seen])
    np.testing.assert_allclose(goals[-1], goals[0] + [0.0, 0.05, 0.02], atol=2e-3)
    moved = np.linalg.norm(np.diff(goals, axis=0), axis=1)
    assert np.all(moved <= 0.2 * np.diff(times) * 1.05 + 1e-6)


def test_a_person_leads_the_limp_arm_to_a_place_and_lets_go(robot):
    extras = make_extras(robot, FaultsOnDemand([], robot.close))
    call = {method.name: method.handler for method in extras.methods.values()}
    stiff, start = np.ones(len(JOINTS)), robot.state().positions
    limp = stiff.copy()
    limp[_ARM] = 0.0
    _command(robot, 0.1, start, limp)
    kinematics = arm_kinematics(shared_control_model(), "right")
    X_TH = kinematics.hand_pose(robot.state().positions[_ARM])
    place = X_TH.translation() + [0.05, -0.05, 0.08]
    call["leadHand"]("right", place.tolist())
    times, path = _command(robot, 1.5, start, limp)
    hands = np.array([kinematics.hand_pose(row[_ARM]).translation() for row in path])
    assert np.linalg.norm(hands[-1] - place) < 0.01
    # As a person: no faster than by hand, and nothing else is moved.
    cycles = np.diff(times) / CYCLE
    assert np.all(np.linalg.norm(np.diff(hands, axis=0), axis=1) < 3 * 0.35 * CYCLE * cycles)
    call["letGo"]()
    call["touch"](["ChestBoard/Button"])
    times, rest = _command(robot, 0.6, start, limp)
    settled = rest[np.searchsorted(times, times[0] + 0.3)]
    assert robot.state().touched == {"ChestBoard/Button"}
    call["touch"]([])
    assert np.abs(rest[-1][_ARM] - settled[_ARM]).max() < 0.01
    for wrong in (("both", [0.0, 0.0, 0.0]), ("left", [0.0, 0.0]), ("left", [math.nan] * 3)):
        with pytest.raises(ServiceError, match="PepperDrake::leadHand"):
            call["leadHand"](*wrong)
    with pytest.raises(ServiceError, match='"nose" is no sensor; they are Head/Touch/Front'):
        call["touch"](["nose"])
    _command(robot, 0.1, robot.state().positions, stiff)


@pytest.mark.render
def test_a_camera_is_frozen_on_demand(robot):
    call = {
        m.name: m.handler
        for m in make_extras(robot, FaultsOnDemand([], robot.close)).methods.values()
    }

    def image_after(stamp):
        end = time.monotonic() + 30.0
        while (image := robot.image(TOP)) is None or image.time <= stamp:
            assert time.monotonic() < end, "no new image"
            time.sleep(0.01)
        return image

    robot.want_image(TOP, 640, 480, 5.0)
    try:
        first = image_after(-1.0)
        call["freeze"](["camera_top"])
        frozen = robot.image(TOP)
        assert frozen.time >= first.time
        time.sleep(0.6)
        assert robot.image(TOP) is frozen
        call["freeze"]([])
        image_after(frozen.time)
        with pytest.raises(ServiceError, match='"nose" is no camera; they are camera_top'):
            call["freeze"](["nose"])
    finally:
        robot.want_image(TOP, 0, 0, 0.0)
