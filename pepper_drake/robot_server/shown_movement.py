"""A simulated person who demonstrates a movement with the served robot's limp arm."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.guide import GuideScript
from pepper_drake.models.scene import make_pose
from pepper_drake.naoqi.constants import CYCLE, JOINTS
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.robot_server.robot.simulated_robot import SimulatedRobot
from pepper_drake.robot_server.services.motion import Motion
from pepper_drake.systems.guiding.scripted_guide import GuidePath

_PRESSED = 0.2
"""Time for which the chest button is pressed [s]."""


async def show_when_limp(
    script: GuideScript, robot: SimulatedRobot, motion: Motion, say: Callable[[str], None]
) -> None:
    """Guides an arm along a script whenever it has gone limp, until cancelled.

    Args:
        script: The movement, mirrored for the other arm; its initial posture is ignored: the arm is
            guided from its current pose.
        robot: The robot.
        motion: Its ALMotion.
        say: Prints a line for the user.
    """
    scripts = (script, script.mirrored())

    def limp() -> list[GuideScript]:
        return [s for s in scripts if not any(motion.get_stiffnesses(list(arm_joints(s.arm))))]

    while True:
        await _until(lambda: bool(limp()))
        script = limp()[0]
        names = list(arm_joints(script.arm))
        kinematics = arm_kinematics(shared_control_model(), script.arm)
        rows = [JOINTS.index(name) for name in names]
        say(f'the {script.arm} arm is limp: it is shown the movement "{script.name}"')
        begin = robot.state()
        path = GuidePath(
            [script.rest, *(script.rest + via.time for via in script.via_points)],
            [
                kinematics.hand_pose(begin.positions[rows]),
                *(make_pose(via.position, via.rpy) for via in script.via_points),
            ],
        )
        with _held(robot):
            while (time := robot.state().time - begin.time) < path.end_time + script.rest:
                X_TG = path.pose(time)
                rpy = X_TG.rotation().ToRollPitchYaw().vector()
                robot.lead_hand(script.arm, np.r_[X_TG.translation(), rpy])
                await asyncio.sleep(CYCLE / 2)
            robot.touch("ChestBoard/Button")
            await _sleep(robot, _PRESSED)
        say("the movement was shown, and the chest button pressed")
        await _until(lambda: not limp())


@contextmanager
def _held(robot: SimulatedRobot) -> Iterator[None]:
    """Releases the robot in the end, whatever happens."""
    try:
        yield
    finally:
        robot.let_go()
        robot.touch()


async def _until(is_so: Callable[[], bool]) -> None:
    while not is_so():
        await asyncio.sleep(CYCLE / 2)


async def _sleep(robot: SimulatedRobot, seconds: float) -> None:
    """Waits for a duration by the robot's clock [s]."""
    end = robot.state().time + seconds
    await _until(lambda: robot.state().time >= end)
