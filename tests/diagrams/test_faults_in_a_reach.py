"""Whole reaches in which a signal fails, or something is touched: what the robot does and says."""

import numpy as np
import pytest

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.robot_calibration import (
    CameraCalibration,
    JointCalibration,
    RobotCalibration,
)
from pepper_drake.models.robot_wear import RobotWear
from pepper_drake.models.scene import load_scene
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.systems.faults.fault import parse_fault
from pepper_drake.systems.faults.fault_set import FaultSet

pytestmark = pytest.mark.render


def reach(scene="table", fault=None, wear=None, coupled=True, calibration=None, seed=0):
    """The result of a reach, with a fault or a worn robot."""
    faults = FaultSet(() if fault is None else (parse_fault(fault),), seed=seed)
    config = ReachingConfig(
        station=StationConfig(seed=seed, faults=faults, wear=wear, calibration=calibration)
    )
    scene = load_scene(scene)
    coupling = make_coupling(scene.coupling) if coupled else None
    config.planner.collision_checked = coupled
    reaching = Reaching(scene, make_primitive(None, scene.arm), coupling, config)
    result = ReachSimulation(reaching, RunOptions(progress=False)).run()
    assert result.report.command_acceleration <= 10.0 + 1e-6
    return result


def perfect_calibration(wear):
    """A calibration that has found all of a robot's offsets and colour cameras."""
    joints = {
        name: JointCalibration(offset=float(offset))
        for name, offset in zip(BODY_JOINTS, wear.encoder_offset, strict=True)
    }
    cameras = {
        name: CameraCalibration(
            position=list(camera.position), rotation=list(camera.rotation), focal=camera.focal
        )
        for name, camera in wear.cameras.items()
        if name != "camera_depth"
    }
    return RobotCalibration(joints=joints, cameras=cameras)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("encoders:garbage@reach", "joints_not_measured"),
        ("actuators:stuck@reach", "joint_held"),
        ("commands:stuck@0", "joint_held"),
        ("depth:stuck@reach", "cloud_missing"),
    ],
)
def test_a_fault_ends_in_a_named_stop_without_a_touch(fault, reason):
    report = reach(fault=fault).report
    assert (report.outcome, report.reason) == ("failed", reason)
    assert report.message
    assert report.contacts == 0
    assert report.stopping_seconds < 0.6
    assert report.faults == [fault]


@pytest.mark.parametrize(
    ("fault", "scene", "seed", "reason"),
    [
        ("actuators:wrong@reach", "clutter", 2, "joint_held"),
        ("base_command:garbage@reach", "clutter", 2, ""),
        ("base_command:noisy@0", "shelf", 1, "base_held"),
    ],
)
def test_what_drove_arm_or_base_against_things_does_not(fault, scene, seed, reason):
    """The arm's command followed an offset; the base did whatever it was told."""
    report = reach(scene, fault, seed=seed).report
    assert report.reason == reason
    assert report.contacts == 0
    assert "pushed" not in report.message


def test_an_arm_that_runs_into_the_table_notices_it_and_backs_off():
    """The movement as it was taught, nothing checked: what is left is the joints' own sense."""
    result = reach(coupled=False)
    report, log = result.report, result.log
    assert report.reason == "joint_held"
    assert report.message.startswith("R")
    assert report.own_touch_speed < 0.05
    assert 0.0 < report.contact_force < 50.0
    first = log.time_s[np.flatnonzero(log.clearance_m <= 0.0)[0]]
    noticed = log.time_s[np.flatnonzero(log.mode == ReachMode.FAILED)[0]]
    assert noticed - first <= 0.1 + 1e-6
    assert log.clearance_m[-1] > 0.005, "it goes back"


def test_a_worn_robot_reaches_and_a_calibrated_one_more_closely():
    wear, errors = RobotWear.draw(2), []
    for calibration in (None, perfect_calibration(wear)):
        report = reach(wear=wear, calibration=calibration).report
        assert report.outcome == "reached"
        assert report.contacts == 0
        errors.append(report.final_position_error)
    # What is left is the slack of the gears.
    assert errors[1] < 0.75 * errors[0]
    assert errors[1] < 0.004


def test_the_robot_may_come_from_outside():
    """Whole reaches of another station: tests/hardware."""
    scene, config = load_scene("free"), ReachingConfig()
    station = PepperStation(scene, config.station, shared_control_model())
    reaching = Reaching(scene, make_primitive(None, scene.arm), None, config, station)
    assert reaching.station is station
    assert [system for system in reaching.GetSystems() if isinstance(system, PepperStation)] == [
        station
    ]
    ReachSimulation(reaching, RunOptions(progress=False)).simulator.AdvanceTo(0.1)
