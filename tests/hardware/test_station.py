"""The station of a served robot, advanced with the clock."""

import json
import time
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from served import served

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.diagrams.head_perception import HeadPerception
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.hardware.link_config import LinkConfig
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.link_process import LinkProcess
from pepper_drake.hardware.paced_run import DiagramClock, run_paced
from pepper_drake.hardware.preflight import PreflightOptions
from pepper_drake.hardware.reach_run import HardwareReport
from pepper_drake.hardware.robot_run import HardwareRun, RobotRun
from pepper_drake.hardware.station import HardwareStation
from pepper_drake.hardware.transport import RobotAccess
from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.robot_calibration import JointCalibration, RobotCalibration
from pepper_drake.models.robot_wear import WearSizes
from pepper_drake.models.scene import load_scene
from pepper_drake.naoqi.constants import JOINTS
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.robot_server.robot.robot_port import CameraImage

PREPARED = PreflightOptions(disable_life=True)


def linked(robot, **options):
    return LinkProcess(RobotAccess(robot.address), LinkConfig("right", **options), PREPARED)


def test_a_robot_over_a_link_is_not_asked_to_lean():
    scene = load_scene("table")
    with served() as robot, linked(robot) as link:
        link.wait_until_ready()
        station = HardwareStation(link, shared_control_model())
        primitive = make_primitive(None, scene.arm)
        reaching = Reaching(scene, primitive, None, ReachingConfig(), station)
        assert reaching.planner.params.lean.hip_pitch == []


def test_it_has_the_ports_of_the_simulated_station():
    simulated = PepperStation(load_scene("table"), StationConfig(), shared_control_model())
    with served() as robot, linked(robot) as link:
        link.wait_until_ready()
        station = HardwareStation(link, shared_control_model())
        for direction in ("Input", "Output"):
            names = [
                {
                    getattr(s, f"get_{direction.lower()}_port")(k).get_name()
                    for k in range(getattr(s, f"num_{direction.lower()}_ports")())
                }
                for s in (simulated, station)
            ]
            missing = {
                name
                for name in names[0] - names[1]
                if not name.startswith("ground_truth") and name != "applied_forces"
            }
            assert missing == set()
        for name in names[0] & names[1]:
            ours, its = station.GetOutputPort(name), simulated.GetOutputPort(name)
            assert ours.get_data_type() == its.get_data_type()
            assert ours.size() == its.size()


def test_the_perception_takes_its_place():
    with served() as robot, linked(robot) as link:
        link.wait_until_ready()
        station = HardwareStation(link, shared_control_model())
        perception = HeadPerception(load_scene("table"), station)
        assert perception.HasOutputPort("cloud")
        # A real robot is worn.
        adapted = station.obstacle_parameters(ObstacleParameters())
        assert adapted.approach.pointing_error == WearSizes().pointing_error


def test_a_calibrated_robot_says_and_is_told_true_angles():
    offset = 0.02
    calibration = RobotCalibration(joints={"RElbowRoll": JointCalibration(offset=offset)})
    column = BODY_JOINTS.index("RElbowRoll")
    with served() as robot, linked(robot) as link:
        link.wait_until_ready()
        station = HardwareStation(link, shared_control_model(), calibration=calibration)
        context = station.CreateDefaultContext()
        said = np.array(link.state()["positions"])
        measured = station.GetOutputPort("joint_position").Eval(context)
        expected = said.copy()
        expected[column] -= offset
        np.testing.assert_allclose(measured, expected, atol=1e-3)
        station.GetInputPort("joint_position_command").FixValue(context, measured)
        inside = station.GetSubsystemByName("robot")
        command = inside.GetInputPort("joint_position_command").Eval(
            inside.GetMyContextFromRoot(context)
        )
        np.testing.assert_allclose(command, said, atol=1e-3)


def test_a_path_is_performed_and_seen():
    row = shared_control_model().position_indices(["RElbowRoll"])[0]
    column = BODY_JOINTS.index("RElbowRoll")
    with served() as robot, linked(robot) as link:
        link.wait_until_ready()
        start = np.array(link.state()["positions"])
        goal = start.copy()
        goal[column] += 0.4
        clock = DiagramClock()
        builder = DiagramBuilder()
        station = builder.AddSystem(HardwareStation(link, shared_control_model(), clock))
        path = PiecewisePolynomial.CubicHermite(
            np.array([0.0, 0.3, 1.8]), np.array([start, start, goal]).T, np.zeros((15, 3))
        )
        source = builder.AddSystem(TrajectorySource(path, zero_derivatives_beyond_limits=True))
        still = builder.AddSystem(ConstantVectorSource(np.zeros(3)))
        off = builder.AddSystem(ConstantVectorSource([0.0]))
        builder.Connect(source.get_output_port(), station.GetInputPort("joint_position_command"))
        builder.Connect(still.get_output_port(), station.GetInputPort("base_velocity_command"))
        for name in ("top", "bottom"):
            builder.Connect(off.get_output_port(), station.GetInputPort(f"camera_{name}.enabled"))
        diagram = builder.Build()
        simulator = Simulator(diagram)
        context = station.GetMyContextFromRoot(simulator.get_context())
        speeds, seen = [], []

        def is_over():
            link.check()
            image = CameraImage(robot.robot.now, np.full((240, 320), 2.0, np.float32))
            robot.do(lambda: robot.robot.images.update({2: image}))
            now = simulator.get_context().get_time()
            speeds.append((now, station.GetOutputPort("joint_velocity").Eval(context)[column]))
            stamp = station.GetOutputPort("camera_depth.time_stamp").Eval(context)[0]
            position = station.GetOutputPort("camera_depth.position").Eval(context)
            if np.isfinite(stamp) and (not seen or stamp != seen[-1][0]):
                seen.append((stamp, position[row]))
            return simulator.get_context().get_time() > 2.5

        pacing = run_paced(simulator, clock, is_over)
        angle = robot.do(lambda: robot.robot.state().positions[JOINTS.index("RElbowRoll")])
        assert angle == pytest.approx(goal[column], abs=1e-3)
        measured = station.GetOutputPort("joint_position").Eval(context)
        np.testing.assert_allclose(measured, goal, atol=2e-3)
        # The whole way, integrated: single speeds jitter with when the robot is asked.
        times, rates = np.array(speeds).T
        assert np.trapezoid(rates, times) == pytest.approx(0.4, rel=0.15)
        assert pacing.steps > 60
        status = station.GetOutputPort("link_status").Eval(context)
        assert status.is_fresh
        assert not status.fault
        image = station.GetOutputPort("camera_depth.image").Eval(context)
        assert (image.width(), image.height()) == (320, 240)
        assert set(np.unique(image.data)) == {2000}
        stamp = station.GetOutputPort("camera_depth.time_stamp").Eval(context)[0]
        assert 1.5 < stamp < 2.6
        # The joints are those of the capture, not those of when the image came.
        moving = [(stamp, angle) for stamp, angle in seen if 0.6 < stamp < 1.6]
        assert len(moving) >= 3
        for stamp, angle in moving:
            # The arm runs one lookahead less one cycle ahead of its plan.
            ahead = path.value(stamp + 0.03)[column, 0]
            assert angle == pytest.approx(ahead, abs=0.02)
        assert station.GetOutputPort("camera_top.time_stamp").Eval(context)[0] == -np.inf


def test_a_robot_that_is_not_ready_is_told_by_the_process():
    with served() as robot:
        robot.do(lambda: robot.pepper.motion.set_stiffnesses("RArm", 0.0))
        with linked(robot) as link, pytest.raises(LinkFault) as fault:
            link.wait_until_ready()
        assert fault.value.word == "robot_not_ready"
        assert "stiffness" in str(fault.value)


def test_nobody_at_the_address():
    access = RobotAccess("tcp://127.0.0.1:9")
    with LinkProcess(access, LinkConfig("right"), PREPARED) as link, pytest.raises(LinkFault) as e:
        link.wait_until_ready()
    assert e.value.word == "robot_unreachable"
    assert str(e.value).count("no robot answers") == 1


def test_a_report_of_a_robot_tells_what_it_knows_and_what_slowed_it(tmp_path):
    report = HardwareReport(
        outcome="reached",
        believed_position_error=0.0012,
        wall_seconds=20.0,
        skipped_steps=50,
        warnings=["arm_slowed"],
    )
    lines = report.summary().splitlines()
    assert lines[0] == "reached"
    assert "  hand to goal         1.2 mm   (as the robot sees both)" in lines
    assert any("took 20.0 s; for 1.0 s" in line for line in lines)
    assert lines[-1] == "  arm_slowed: the robot slows its arm near what it sees"
    assert "0 mm/s" not in report.summary()  # Nobody measured the arm's speed.
    report.save(tmp_path / "report.json")
    saved = json.loads((tmp_path / "report.json").read_text())
    assert saved["arm_speed"] is None
    assert saved["contacts"] is None
    assert HardwareReport.load(tmp_path / "report.json") == report
    assert saved["warnings"] == ["arm_slowed"]


def test_an_arm_that_the_robot_slows_is_told_once():
    source, said = DiagramBuilder(), []
    source.AddSystem(ConstantVectorSource([0.0]))
    diagram, states = source.Build(), iter([False, True, True, False, True])
    run = RobotRun(HardwareRun(RobotAccess("tcp://127.0.0.1:1"), say=said.append), "right")
    here = np.zeros(len(BODY_JOINTS))
    run.link = SimpleNamespace(
        check=lambda: None, state=lambda: {"slowed": next(states, True), "positions": here}
    )
    run.clock = DiagramClock(time.monotonic, time.sleep)
    run.advance(diagram, lambda: run.was_slowed and len(said) > 0)
    assert run.was_slowed
    assert said == ["arm_slowed: the robot slows its arm near what it sees"]
    steps = iter(range(5))
    run.advance(diagram, lambda: next(steps) == 4)
    assert len(said) == 1
