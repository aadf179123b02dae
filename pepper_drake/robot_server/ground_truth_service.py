"""A service on a separate port for what no robot has: truth, a person's hand, and faults."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pepper_drake.robot_server.faults_on_demand import FaultsOnDemand
from pepper_drake.robot_server.robot.simulated_robot import SimulatedRobot
from pepper_drake.robot_server.wire.service import Service, ServiceError

_FARTHEST = 2.0
"""Largest offset of the goal along each axis [m]."""


def make_extras(robot: SimulatedRobot, faults: FaultsOnDemand) -> Service:
    """Makes the service `PepperDrake`.

    Args:
        robot: The simulated robot.
        faults: Of its services.
    """

    def truth() -> dict[str, Any]:
        now = robot.record()
        return {
            "time": [int(now["time"]), int(1e6 * (now["time"] % 1.0))],
            "rate": float(now["rate"]),
            "contacts": int(now["contacts"]),
            "base_pose": [float(v) for v in now["base_pose"]],
            "left_hand": [float(v) for v in now["left_hand"]],
            "right_hand": [float(v) for v in now["right_hand"]],
            "goal": [float(v) for v in now["goal"]],
        }

    service = Service("PepperDrake", "What no robot knows.")
    service.add_method(
        "groundTruth",
        "()",
        "m",
        truth,
        description="Hands and goal in the world [m], base x, y, theta, number of contacts.",
    )

    def move_goal(*offset: float) -> None:
        if not all(abs(value) <= _FARTHEST for value in offset):  # False for NaN.
            raise ServiceError(f"PepperDrake::moveGoal: within {_FARTHEST:g} m along each axis")
        with _refusing("moveGoal"):
            robot.move_goal(offset)

    def lead_hand(arm: str, pose: list[float]) -> None:
        with _refusing("leadHand"):
            robot.lead_hand(arm, pose)

    def touch(sensors: list[str]) -> None:
        with _refusing("touch"):
            robot.touch(*sensors)

    service.add_method(
        "moveGoal",
        "(fff)",
        "v",
        move_goal,
        description="Moves the goal to this offset from its place in the scene, in the world [m].",
    )
    service.add_method(
        "leadHand",
        "(s[f])",
        "v",
        lead_hand,
        description="Pulls the left or right hand to x, y, z [m] in the torso's frame, or to x, y, "
        "z, roll, pitch, yaw [m, rad], as a person does, until letGo; a limp arm follows.",
    )
    service.add_method("letGo", "()", "v", robot.let_go, description="Lets go of the led hand.")
    service.add_method(
        "touch",
        "([s])",
        "v",
        touch,
        description="Touches these sensors, such as ChestBoard/Button, and no others.",
    )

    def delay(seconds: float) -> None:
        with _refusing("delay"):
            faults.delay(seconds)

    def fail(methods: list[str]) -> None:
        with _refusing("fail"):
            faults.fail(methods)

    def freeze(cameras: list[str]) -> None:
        with _refusing("freeze"):
            robot.freeze(cameras)

    for name, parameters, handler, description in (
        (
            "delay",
            "(f)",
            delay,
            "Performs each call of the robot's this much later [s]; 0 ends it.",
        ),
        ("fail", "([s])", fail, "Lets these fail, such as ALMotion.setAngles, and no others."),
        ("freeze", "([s])", freeze, "Freezes the images of camera_top, ..., and of no others."),
        ("reboot", "()", faults.restart, "Ends the robot's connections and begins a new session."),
    ):
        service.add_method(name, parameters, "v", handler, description=description)
    return service


@contextmanager
def _refusing(method: str) -> Iterator[None]:
    """Turns a ValueError into an error reply."""
    try:
        yield
    except ValueError as error:
        raise ServiceError(f"PepperDrake::{method}: {error}") from None
