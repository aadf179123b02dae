"""The robot of the services: a simulator in its own process, behind shared memory.

It is not a thread: beside a simulation in the same interpreter the server would answer late.
"""

import time
from collections.abc import Sequence

import numpy as np

from pepper_drake.errors import PepperDrakeError
from pepper_drake.models.pepper import ARMS
from pepper_drake.naoqi.constants import DEPTH
from pepper_drake.robot_server.robot.child_process import ChildProcess
from pepper_drake.robot_server.robot.range_sensors import MEASURED
from pepper_drake.robot_server.robot.robot_port import (
    SENSORS,
    CameraImage,
    RobotCommand,
    RobotState,
)
from pepper_drake.robot_server.robot.shared_state import Record, SharedNames, SharedRecord
from pepper_drake.robot_server.robot.simulator import (
    CAMERAS,
    COMMAND,
    IMAGE,
    STATE,
    SimulatorConfig,
    simulate,
)

_START_SECONDS = 120.0
"""Timeout of the simulator's first state [s]."""
_END_SECONDS = 5.0
_FARTHEST_POSE = 10.0
"""Largest coordinate of a pose to which a hand is guided [m, rad]."""


class SimulatedRobot(ChildProcess):
    """A `RobotPort` to a simulator's process; a context manager that ends it."""

    def __init__(self, config: SimulatorConfig) -> None:
        """Starts the process; `wait_until_ready` waits for its first state.

        Args:
            config: Of the simulator.
        """
        self._state = SharedRecord(STATE)
        self._command = SharedRecord(COMMAND)
        self._images = [SharedRecord(IMAGE) for _ in CAMERAS]
        self._enabled = [False] * len(CAMERAS)
        self._seen_writes = [0] * len(CAMERAS)
        self._frozen: dict[int, CameraImage | None] = {}
        self._goal_moves_itself = bool(config.scene.goal.path)
        names = SharedNames(
            self._state.name, self._command.name, tuple(image.name for image in self._images)
        )
        self.start(simulate, (config, names), "simulator")

    def wait_until_ready(self) -> None:
        """Waits for the simulator's first state.

        Raises:
            PepperDrakeError: The simulator did not start.
        """
        end = time.monotonic() + _START_SECONDS
        while self._state.writes == 0:
            if not self._process.is_alive() or time.monotonic() > end:
                raise PepperDrakeError("the simulated robot did not start")
            time.sleep(0.02)

    def check(self) -> None:
        """Raises if the simulation ended.

        Raises:
            PepperDrakeError: It did; the message says why.
        """
        if self._process.is_alive():
            return
        failure = str(self.record()["failed"]) or f"exit code {self._process.exitcode}"
        raise PepperDrakeError(f"the simulation cannot continue: {failure}")

    def record(self) -> Record:
        """Returns the newest state with ground truth, such as the goal's true position."""
        return self._state.read()

    def state(self) -> RobotState:
        """Returns the newest state; see `RobotPort`."""
        now = self._state.read()
        x, y, theta = map(float, now["base_pose"])
        vx, vy, wz = map(float, now["base_velocity"])
        touched = frozenset(s for s, is_on in zip(SENSORS, now["touched"], strict=True) if is_on)
        return RobotState(
            float(now["time"]),
            np.array(now["positions"]),
            np.array(now["velocities"]),
            (x, y, theta),
            (vx, vy, wz),
            np.array(now["currents"]),
            touched,
            dict(zip(MEASURED, map(float, now["ranges"]), strict=True)),
            np.array(now["torques"]),
        )

    def command(self, command: RobotCommand) -> None:
        """Passes a command to the simulator; see `RobotPort`."""
        self._command.write(
            positions=command.positions,
            stiffnesses=command.stiffnesses,
            base_velocity=command.base_velocity,
        )

    def want_image(self, camera: int, width: int, height: int, fps: float) -> None:
        """Switches a camera on or off; see `RobotPort`. Its image size is fixed."""
        if camera not in CAMERAS:
            return
        index = list(CAMERAS).index(camera)
        if fps > 0 and not self._enabled[index]:
            self._seen_writes[index] = self._images[index].writes
        self._enabled[index] = fps > 0
        self._command.write(enabled=self._enabled)

    def image(self, camera: int) -> CameraImage | None:
        """Returns a camera's newest image since the request; see `RobotPort`."""
        if camera in self._frozen or camera not in CAMERAS:
            return self._frozen.get(camera)
        index = list(CAMERAS).index(camera)
        if self._images[index].writes <= self._seen_writes[index]:
            return None
        image = self._images[index].read()
        height, width = int(image["height"]), int(image["width"])
        data = np.array(image["pixels"]).view(np.uint8)
        if camera == DEPTH:
            millimetres = data[: 2 * height * width].view(np.uint16).reshape(height, width)
            return CameraImage(float(image["time"]), np.float32(0.001) * millimetres)
        color = data[: 3 * height * width].reshape(height, width, 3)
        return CameraImage(float(image["time"]), color)

    def move_goal(self, offset: Sequence[float]) -> None:
        """Moves the goal object, as a person would, to an offset (3,) in W from its pose [m].

        Raises:
            ValueError: The goal moves by itself.
        """
        if self._goal_moves_itself:
            raise ValueError("the goal of this scene moves by itself")
        self._command.write(goal_offset=offset)

    def lead_hand(self, arm: str, pose: Sequence[float]) -> None:
        """Guides a hand, as a person does: pulls it, softly and slowly, to a pose.

        Args:
            arm: "left" or "right"; a limp one follows.
            pose: (3,) position of the hand in T [m], its orientation free, or (6,) with roll,
                pitch, yaw [rad].

        Raises:
            ValueError: There is no such arm, or no such pose.
        """
        if arm not in ARMS:
            raise ValueError(f'arm is "{arm}"; it is {" or ".join(ARMS)}')
        values = np.array(pose, dtype=float)
        if values.shape not in ((3,), (6,)) or not np.all(np.abs(values) <= _FARTHEST_POSE):
            raise ValueError("a pose is x, y, z [m], or these and roll, pitch, yaw [rad]")
        led_pose = np.r_[values, np.full(6 - len(values), np.nan)]
        self._command.write(led_arm=arm, led_pose=led_pose)

    def let_go(self) -> None:
        """Releases the guided hand."""
        self._command.write(led_arm="")

    def freeze(self, cameras: Sequence[str]) -> None:
        """Freezes the newest images of cameras, such as "camera_top", and of no others.

        Raises:
            ValueError: There is no such camera.
        """
        numbers = {name: number for number, name in CAMERAS.items()}
        for camera in cameras:
            if camera not in numbers:
                raise ValueError(f'"{camera}" is no camera; they are {", ".join(numbers)}')
        self._frozen = {}
        self._frozen = {numbers[camera]: self.image(numbers[camera]) for camera in cameras}

    def touch(self, *sensors: str) -> None:
        """Touches these of `SENSORS`, and no others, until the next call.

        Raises:
            ValueError: There is no such sensor.
        """
        for sensor in sensors:
            if sensor not in SENSORS:
                raise ValueError(f'"{sensor}" is no sensor; they are {", ".join(SENSORS)}')
        self._command.write(held_sensors=[sensor in sensors for sensor in SENSORS])

    def close(self) -> None:
        """Ends the simulator and releases the shared memory."""
        self._command.write(stop=True)
        self.end(_END_SECONDS)
        for record in (self._state, self._command, *self._images):
            record.close()
