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
from pepper_drake.hardware.link import LinkConfig
from pepper_drake.hardware.link_process import LinkProcess
from pepper_drake.hardware.paced_run import run_paced
from pepper_drake.hardware.reach_run import HardwareRun
from pepper_drake.hardware.station import HardwareStation
from pepper_drake.models.control_model import CONTROL_PERIOD, shared_control_model
from pepper_drake.perception.calibration.marker_calibration import estimate_calibration
from pepper_drake.perception.calibration.marker_kinematics import (
    COLOR_CAMERAS,
    MarkerModel,
    PriorSigmas,
)
from pepper_drake.planning.calibration.calibration_postures import choose_postures

_HEAD_START = 1.0
"""Time before the robot moves, in which the diagram is built [s]."""


def calibrate_robot(
    params: CalibrationParams,
    seed: int,
    run: HardwareRun,
    on_look: Callable[[int], object] = lambda _: None,
) -> CalibrationResult | None:
    """Calibrates a robot, whatever its posture is at the start.

    Args:
        params: What is done.
        seed: Of the choice of postures.
        run: How the robot is led.
        on_look: Called after each posture with the number of images that showed the marker.

    Returns:
        The result; None if it was stopped.

    Raises:
        LinkFault: The robot cannot be reached, is not ready, or something went wrong on the way.
        PepperDrakeError: The marker was seen in too few postures.
    """
    model, arm = shared_control_model(), params.arm
    chain = MarkerModel(arm, params.marker, COLOR_CAMERAS, PriorSigmas.of_wear())
    config = LinkConfig(arm, cameras=COLOR_CAMERAS, clock_rate=run.clock_rate)
    with LinkProcess(run.access, config, run.preflight) as link:
        link.wait_until_ready()
        start = np.array(link.state()["positions"])
        postures = choose_postures(model, chain, arm, start, params.postures, seed)
        begin = link.clock.now()
        motion = plan_motion(postures, arm, start, _HEAD_START)
        drive = CalibrationDrive(HardwareStation(link, model, begin), motion)
        collector = MarkerCollector(
            drive.station, motion, postures, arm, params.marker, on_look=on_look
        )
        simulator = Simulator(drive)
        simulator.get_mutable_context().SetTime(
            CONTROL_PERIOD * int((link.clock.now() - begin) / CONTROL_PERIOD)
        )
        simulator.Initialize()
        stopped = False

        def is_over() -> bool:
            nonlocal stopped
            link.check()
            stopped = run.should_stop()
            return stopped or collector.watch(simulator.get_context())

        run_paced(simulator, begin, is_over, wall=link.clock.now, sleep=link.clock.sleep)
        run.say("the arm is held, lowered and relaxed")
        link.hand_over()
    if stopped:
        return None
    estimate = estimate_calibration(chain, collector.sightings)
    return CalibrationResult(estimate, collector.sightings, float(motion.times[-1]))
