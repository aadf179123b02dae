"""A movement performed by a robot without cameras (algorithm 2 of the report)."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.calibration_run import CalibrationMotion
from pepper_drake.diagrams.reproduction import Reproduction, ReproductionParams
from pepper_drake.diagrams.reproduction_simulation import (
    LONGEST,
    ReproductionResult,
    begin_movement,
    comes_to_rest,
    measure,
    start_positions,
)
from pepper_drake.errors import PepperDrakeError
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.robot_run import HardwareRun, RobotRun
from pepper_drake.hardware.slow_motion import slow_motion
from pepper_drake.learning import MovementPrimitive
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    CONTROL_PERIOD,
    arm_joints,
    shared_control_model,
)

Vector = npt.NDArray[np.float64]

_SHORTEST = 0.1
"""Shortest time of a movement that has begun [s]."""
_AT_START = 0.05
"""Largest deviation of a joint from the movement's start [rad]."""


def perform_with_robot(
    primitive: MovementPrimitive,
    arm: str,
    run: HardwareRun,
    goal: Vector | None = None,
    params: ReproductionParams | None = None,
) -> tuple[ReproductionResult | None, LinkFault | None, bool]:
    """Moves the arm slowly to the start of a movement, and performs the movement.

    Args:
        primitive: With orientation and posture.
        arm: "left" or "right".
        run: How the robot is driven.
        goal: (3,) of the hand in T [m]; the primitive's own if None.
        params: Of the reproduction; a robot always logs once per control period.

    Returns:
        The result, None if the movement did not begin; the fault of robot or link; whether the user
        stopped it.

    Raises:
        LinkFault: The robot cannot be reached, or is not ready; nothing was moved.
        PepperDrakeError: The arm cannot reach the start without touching the body.
    """
    result: ReproductionResult | None = None
    with RobotRun(run, arm, cameras=()) as robot:
        wanted = start_positions(primitive, arm)
        there = robot.joints | {name: wanted[name] for name in arm_joints(arm)}
        motion = motion_to(robot.joints, there)
        run.say(f"the {arm} arm goes to where the movement starts, in {motion.times[-1]:.1f} s")
        robot.go_along(motion)
        if robot.fault is None and not robot.is_stopped:
            off = max(abs(robot.joints[name] - there[name]) for name in arm_joints(arm))
            if off > _AT_START:
                raise PepperDrakeError(
                    f"the {arm} arm did not get to where the movement starts: a joint is "
                    f"{np.degrees(off):.0f}° off, so something holds it"
                )
            run.say("the movement begins")
            result = _perform(robot, primitive, arm, goal, params or ReproductionParams())
    return result, robot.fault, robot.is_stopped


def _perform(
    robot: RobotRun,
    primitive: MovementPrimitive,
    arm: str,
    goal: Vector | None,
    params: ReproductionParams,
) -> ReproductionResult | None:
    """Performs the movement; None if a fault came before it had begun."""
    params = replace(params, log_period=CONTROL_PERIOD)
    diagram = Reproduction(
        primitive, arm=arm, positions=robot.joints, params=params, robot=robot.station()
    )
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    goal = begin_movement(diagram, root, goal)
    rests = comes_to_rest(diagram, root, period=CONTROL_PERIOD)
    end = LONGEST * primitive.duration
    robot.advance(diagram, lambda: rests() or root.get_time() > end, simulator)
    return measure(diagram, root, goal) if root.get_time() > _SHORTEST else None


def motion_to(here: Mapping[str, float], there: Mapping[str, float]) -> CalibrationMotion:
    """Returns a slow motion of joints from one posture to another.

    Args:
        here: Position of each joint by name [rad].
        there: The same at the end.

    Raises:
        PepperDrakeError: Parts of the robot would touch on the way.
    """
    model = shared_control_model()
    begin = np.array([here[name] for name in BODY_JOINTS])
    end = np.array([there[name] for name in BODY_JOINTS])
    checker = model.make_collision_checker()
    checker.set_edge_step_size(0.05)
    ends = (model.positions(q, np.zeros(3)) for q in (begin, end))
    if not checker.CheckEdgeCollisionFree(*ends):
        raise PepperDrakeError(
            "the arm would touch the body on its way to where the movement starts: lead it nearer "
            "to that by hand, and begin again"
        )
    return slow_motion(np.array([begin, end]))
