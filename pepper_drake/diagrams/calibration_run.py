"""Calibration run: the robot visits postures while its cameras see a marker on its hand."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np
import numpy.typing as npt
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.diagrams.simulate import simulate
from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.calibration_scene import calibration_scene
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    CONTROL_PERIOD,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.robot_wear import HEAD_CAMERAS
from pepper_drake.models.scene import HandMarker
from pepper_drake.perception.calibration.calibrated_cameras import HEAD_CAMERA_MODELS
from pepper_drake.perception.calibration.marker_calibration import (
    CalibrationEstimate,
    estimate_calibration,
)
from pepper_drake.perception.calibration.marker_kinematics import (
    COLOR_CAMERAS,
    MarkerModel,
    MarkerSighting,
    PriorSigmas,
)
from pepper_drake.perception.goal.marker import (
    MARKER_DICTIONARY,
    detect_markers,
    detection_poses,
    marker_corners,
    refine_poses,
)
from pepper_drake.planning.calibration.calibration_postures import (
    CalibrationPosture,
    choose_postures,
)
from pepper_drake.planning.trajectories.joint_trajectories import minimum_jerk
from pepper_drake.systems.framework import Diagram, build_into

Vector = npt.NDArray[np.float64]

SPEED, ACCELERATION = 1.0, 3.0
"""Largest speed [rad/s] and acceleration [rad/s²] between postures."""
_APPROACH_TIME = 0.5
"""Duration of the final approach to a posture, always from the same side [s]."""
SETTLING = 0.5
"""Settling time of robot and cameras [s]."""
_LOOKING = 0.5
"""Time for which the cameras are on [s]: images come every 0.2 s, with a latency of 0.15 s."""
_EDGE_SIGMA = 0.1
"""Standard deviation of corners fitted to all pattern edges [pixel]; the fit re-estimates it."""
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.774
"""Peak speed and acceleration of a minimum-jerk motion of unit length and duration."""


@dataclass(frozen=True, eq=False)
class CalibrationMotion:
    """Commands of all joints, and the times at which images are taken.

    Attributes:
        times: (N,) [s].
        positions: (N, 15) [rad].
        looks: Start and end of taking images [s], one pair for each posture.
    """

    times: Vector
    positions: Vector
    looks: tuple[tuple[float, float], ...]


def plan_motion(
    postures: Sequence[CalibrationPosture], arm: str, start: Vector, begin: float = 0.0
) -> CalibrationMotion:
    """Plans the motion through postures and back to the start, at rest in each.

    Args:
        postures: The postures in order.
        arm: "left" or "right".
        start: All joints (15,) at the start [rad].
        begin: Start time [s].
    """
    moving = body_indices((*JOINT_GROUPS["head"], *arm_joints(arm)))
    times, rows = [np.array([begin])], [start[None]]
    looks: list[tuple[float, float]] = []
    now, here = begin, np.asarray(start, dtype=float)

    def move(joints: Vector, min_duration: float) -> None:
        nonlocal now, here
        there = here.copy()
        there[moving] = joints
        turn = float(np.abs(there - here).max())
        needed = max(turn * _PEAK_SPEED / SPEED, np.sqrt(turn * _PEAK_ACCELERATION / ACCELERATION))
        steps = max(int(np.ceil(max(needed, min_duration) / CONTROL_PERIOD)), 1)
        progress = minimum_jerk(np.arange(1, steps + 1) / steps)[:, None]
        times.append(now + CONTROL_PERIOD * np.arange(1, steps + 1))
        rows.append(here + progress * (there - here))
        now, here = now + CONTROL_PERIOD * steps, there

    for posture in postures:
        move(posture.before, 0.0)
        move(posture.joints, _APPROACH_TIME)
        looks.append((now + SETTLING, now + SETTLING + _LOOKING))
        now = looks[-1][1]
        times.append(np.array([now]))
        rows.append(here[None])
    move(np.asarray(start)[moving], 0.0)
    return CalibrationMotion(np.concatenate(times), np.concatenate(rows), tuple(looks))


class CalibrationDrive(Diagram):
    """Moves a station's joints along a calibration motion, with the base at rest.

    .. pydrake_system::

        name: CalibrationDrive

    Attributes:
        station: The station, simulated or real.
    """

    def __init__(self, station: Diagram, motion: CalibrationMotion) -> None:
        """Makes the diagram.

        Args:
            station: A `PepperStation` with cameras, or another with its ports.
            motion: The motion.
        """
        super().__init__()
        builder = DiagramBuilder()
        # A real robot's station has the same ports except for `ground_truth.*`.
        self.station: PepperStation = builder.AddNamedSystem(
            "station", cast(PepperStation, station)
        )
        commands = builder.AddNamedSystem(
            "commands",
            TrajectorySource(PiecewisePolynomial.FirstOrderHold(motion.times, motion.positions.T)),
        )
        builder.Connect(commands.get_output_port(), station.GetInputPort("joint_position_command"))
        rest = builder.AddNamedSystem("rest", ConstantVectorSource([0.0, 0.0, 0.0]))
        builder.Connect(rest.get_output_port(), station.GetInputPort("base_velocity_command"))
        looking = builder.AddNamedSystem("looking", TrajectorySource(_when(motion)))
        never = builder.AddNamedSystem("never", ConstantVectorSource([0.0]))
        for name in HEAD_CAMERAS:
            source = looking if name in COLOR_CAMERAS else never
            builder.Connect(source.get_output_port(), station.GetInputPort(f"{name}.enabled"))
        build_into(builder, self)


def _when(motion: CalibrationMotion) -> PiecewisePolynomial:
    """Returns a trajectory that is 1 while images are taken, else 0."""
    edges = [0.0, *(time for look in motion.looks for time in look)]
    values = [0.0, *(value for _ in motion.looks for value in (1.0, 0.0))]
    last = max(float(motion.times[-1]), edges[-1]) + 1.0
    return PiecewisePolynomial.ZeroOrderHold([*edges, last], [[*values, 0.0]])


@dataclass
class MarkerCollector:
    """Collects the images of each posture and finds the marker in them.

    Attributes:
        station: The station.
        motion: Its motion.
        postures: The postures, in the same order.
        arm: "left" or "right".
        marker: The marker on its hand.
        sightings: The sightings so far.
        on_look: Called after each posture with the number of images in which the marker was seen.
    """

    station: PepperStation
    motion: CalibrationMotion
    postures: Sequence[CalibrationPosture]
    arm: str
    marker: HandMarker
    sightings: list[MarkerSighting] = field(default_factory=list)
    on_look: Callable[[int], object] = lambda _: None
    _taken: int = 0

    def watch(self, root: Context) -> bool:
        """Collects a posture's images once they have arrived; tells if the motion is over."""
        time = root.get_time()
        looks = self.motion.looks
        while self._taken < len(looks) and time >= looks[self._taken][1]:
            self._take(root, self._taken)
            self._taken += 1
        return time >= float(self.motion.times[-1])

    def _take(self, root: Context, number: int) -> None:
        context = self.station.GetMyContextFromRoot(root)
        found = 0
        columns = self.station.control_model.position_indices(
            (*JOINT_GROUPS["head"], *arm_joints(self.arm))
        )
        for camera in COLOR_CAMERAS:
            stamp = self.station.GetOutputPort(f"{camera}.time_stamp").Eval(context)[0]
            if stamp < self.motion.looks[number][0] - 1e-9:
                continue  # No image arrived.
            image = self.station.GetOutputPort(f"{camera}.image").Eval(context).data
            corners = find_marker(image, camera, self.marker)
            if corners is None:
                continue
            position = self.station.GetOutputPort(f"{camera}.position").Eval(context)
            self.sightings.append(
                MarkerSighting(
                    camera,
                    np.asarray(position[columns]),
                    self.postures[number].approach,
                    *corners,
                    number,
                )
            )
            found += 1
        self.on_look(found)


def find_marker(
    image: npt.NDArray[np.uint8], camera: str, marker: HandMarker
) -> tuple[Vector, float] | None:
    """Finds a marker's corners in an image of a head camera with subpixel accuracy.

    The corners are the projections of the pose that fits all edges of the pattern, so they do not
    depend on an error of the focal length.

    Args:
        image: Colour image.
        camera: The station's name of the camera.
        marker: The marker.

    Returns:
        The corners (4, 2) and their standard deviation [pixel]; None if the marker is not seen.
    """
    intrinsics = HEAD_CAMERA_MODELS[camera].intrinsics
    found = [d for d in detect_markers(image, wanted=marker.id) if d.id == marker.id]
    if len(found) != 1:
        return None
    (detection,) = found
    poses = detection_poses(detection, marker.size, intrinsics)
    poses = refine_poses(
        image, poses, marker.id, marker.size, intrinsics, dictionary=MARKER_DICTIONARY
    )
    if not poses:
        return None
    if not poses[0].on_edges:
        return detection.corners, detection.corner_sigma
    return intrinsics.project((poses[0].X_CM @ marker_corners(marker.size).T).T), _EDGE_SIGMA


@dataclass
class CalibrationParams:
    """Parameters of a robot's calibration."""

    arm: str = "right"
    """The arm that holds the marker."""
    postures: int = 20
    """Number of postures."""
    marker: HandMarker = field(default_factory=HandMarker)
    """The marker, with its nominal pose on the hand."""


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """Result of a calibration.

    Attributes:
        estimate: The estimated calibration.
        sightings: The marker in all images.
        robot_seconds: Duration of the robot's motion [s].
    """

    estimate: CalibrationEstimate
    sightings: list[MarkerSighting]
    robot_seconds: float


def calibrate_simulated(
    params: CalibrationParams,
    config: StationConfig,
    *,
    on_look: Callable[[int], object] = lambda _: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> CalibrationResult | None:
    """Calibrates the simulated robot of a station from its images and encoders alone.

    Args:
        params: Parameters of the calibration.
        config: The station; its wear is to be estimated.
        on_look: Called after each posture with the number of images that showed the marker.
        should_stop: Polled every 0.1 s of simulated time.

    Returns:
        The result; None if it was stopped.

    Raises:
        PepperDrakeError: The marker was not seen, or the simulation failed.
    """
    model, arm = shared_control_model(), params.arm
    scene = calibration_scene(arm, params.marker, config.seed)
    positions = scene.robot.positions()
    start = np.array([positions[name] for name in BODY_JOINTS])
    chain = MarkerModel(arm, params.marker, COLOR_CAMERAS, PriorSigmas.of_wear())
    postures = choose_postures(model, chain, arm, start, params.postures, config.seed)
    motion = plan_motion(postures, arm, start)
    drive = CalibrationDrive(PepperStation(scene, config, model), motion)
    simulator = Simulator(drive)
    simulator.Initialize()
    if drive.station.renderer is not None:
        drive.station.renderer.wait_until_ready()
    collector = MarkerCollector(
        drive.station, motion, postures, arm, params.marker, on_look=on_look
    )
    end = simulate(
        simulator,
        float(motion.times[-1]) + 1.0,
        watch=lambda: collector.watch(simulator.get_context()),
        should_stop=should_stop,
    )
    end.check()
    if end.stopped:
        return None
    estimate = estimate_calibration(chain, collector.sightings)
    return CalibrationResult(estimate, collector.sightings, float(motion.times[-1]))
