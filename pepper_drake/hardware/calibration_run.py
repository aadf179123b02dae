"""Calibration of a robot over a link, paced by the clock."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.calibration_run import (
    CalibrationDrive,
    CalibrationParams,
    CalibrationResult,
    MarkerCollector,
    plan_motion,
)
from pepper_drake.hardware.robot_run import HardwareRun, RobotRun
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.perception.calibration.marker_calibration import estimate_calibration
from pepper_drake.perception.calibration.marker_kinematics import (
    COLOR_CAMERAS,
    MarkerModel,
    PriorSigmas,
)
from pepper_drake.planning.calibration.calibration_postures import choose_postures

_HEAD_START = 0.5
"""Time before the robot moves [s]."""


def calibrate_robot(
    params: CalibrationParams,
    seed: int,
    run: HardwareRun,
    on_look: Callable[[int], object] = lambda _: None,
) -> CalibrationResult | None:
    """Calibrates a robot from any initial posture.

    Args:
        params: Of the calibration.
        seed: Of the choice of postures.
        run: How the robot is driven.
        on_look: Called after each posture with the number of images that showed the marker.

    Returns:
        The result; None if stopped.

    Raises:
        LinkFault: The robot cannot be reached, is not ready, or a fault stopped the motion.
        PepperDrakeError: The marker was seen in too few postures.
    """
    model, arm = shared_control_model(), params.arm
    chain = MarkerModel(arm, params.marker, COLOR_CAMERAS, PriorSigmas.of_wear())
    with RobotRun(run, arm, cameras=COLOR_CAMERAS) as robot:
        start = np.array(list(robot.joints.values()))
        postures = choose_postures(model, chain, arm, start, params.postures, seed)
        motion = plan_motion(postures, arm, start, _HEAD_START)
        drive = CalibrationDrive(robot.station(), motion)
        collector = MarkerCollector(
            drive.station, motion, postures, arm, params.marker, on_look=on_look
        )
        simulator = Simulator(drive)
        robot.advance(drive, lambda: collector.watch(simulator.get_context()), simulator)
    if robot.fault is not None:
        raise robot.fault
    if robot.is_stopped:
        return None
    estimate = estimate_calibration(chain, collector.sightings)
    return CalibrationResult(estimate, collector.sightings, float(motion.times[-1]))
