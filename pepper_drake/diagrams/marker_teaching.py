"""Visual teaching: the arm imitates the motion of a marker seen by a camera."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.diagrams.recording import (
    Recording,
    RecordOptions,
    Session,
    drag_joints,
    make_teaching,
    measured_recording,
)
from pepper_drake.diagrams.simulate import simulate
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.workspace_map import (
    Sightings,
    WorkspaceMap,
    sighted_motion,
)
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    shared_control_model,
)
from pepper_drake.models.marker_script import FACING, MarkerScript
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP
from pepper_drake.perception.cameras.noise import ColorNoise
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.kinematic_simulation import ArmState, HandPath, KinematicSimulator
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.systems.framework import build
from pepper_drake.systems.guiding.scripted_guide import GuidePath
from pepper_drake.systems.sensing.camera_model import CameraModel
from pepper_drake.systems.sensing.marker_tracker import MarkerTracker
from pepper_drake.systems.sensing.moving_marker import MovingMarker
from pepper_drake.systems.sensing.rendered_scene import add_renderer, make_rgbd_sensor

Vector = npt.NDArray[np.float64]

_CAMERAS = {"top": CAMERA_TOP, "bottom": CAMERA_BOTTOM}

OUT_OF_REACH = 0.02
"""Distance of the hand from its target beyond which the target is out of reach [m]."""


@dataclass(frozen=True)
class MarkerRecording:
    """Result of teaching with a marker.

    Attributes:
        recording: The arm's motion.
        sightings: The marker's poses measured by the camera.
        shown: The marker's motion fitted to them, in T.
        tracking_error_rms: RMS distance of the sightings from the marker's true path [m].
    """

    recording: Recording
    sightings: Sightings
    shown: Demonstration
    tracking_error_rms: float


def record_marker(
    script: MarkerScript, options: RecordOptions | None = None, *, seed: int = 0
) -> MarkerRecording:
    """Tracks a marker that moves along a script, and has the arm imitate it.

    The marker's pose is measured in each of the camera's noisy images; the motion fitted to the
    poses is mapped into the arm's workspace; the inverse kinematics checks whether the arm can
    follow; then the arm's joints are moved along and recorded as in all other ways of teaching.

    Args:
        script: A checked script.
        options: Options of the recording.
        seed: Seed of the camera's noise.

    Raises:
        InputError: The marker was not seen for too long, or its motion is out of the hand's reach.
    """
    options = options or RecordOptions()
    path = GuidePath(*script.poses())
    sightings = watch(script, path, seed=seed, should_stop=options.should_stop)
    shown = sighted_motion(sightings, name=script.name or "marker")
    true = np.array([path.pose(time).translation() for time in sightings.times])
    errors = np.linalg.norm(sightings.positions - true, axis=1)

    start = np.array([script.positions()[name] for name in arm_joints(script.arm)])
    target, joints = follow(shown, WorkspaceMap(script.scale, script.yaw), script.arm, start)
    times = script.rest + shown.times
    angles = PiecewisePolynomial.CubicShapePreserving(
        times, joints.T, zero_end_point_derivatives=True
    )
    builder, teaching = make_teaching(script, "joints", options)
    drag_joints(builder, teaching, angles)
    session = Session(build(builder), teaching, options)
    recorded, motion, stopped = session.run(float(times[-1]) + script.rest, script.name)
    desired = np.column_stack(
        [np.interp(recorded.times, times, column) for column in target.positions.T]
    )
    return MarkerRecording(
        recording=measured_recording(recorded, motion, stopped, desired),
        sightings=sightings,
        shown=shown,
        tracking_error_rms=float(np.sqrt(np.mean(errors**2))),
    )


def watch(
    script: MarkerScript,
    path: GuidePath,
    *,
    seed: int = 0,
    should_stop: Callable[[], bool] = lambda: False,
) -> Sightings:
    """Tracks a marker that moves along a path, with a camera of the stationary head.

    Args:
        script: Camera, marker and posture.
        path: Poses X_TM; T does not move, so it is the scene graph's world.
        seed: Seed of the camera's noise.
        should_stop: Polled every tenth of a second; ends the tracking.
    """
    camera = _CAMERAS[script.camera]
    model = shared_control_model()
    context = model.create_context()
    positions = script.positions()
    body = np.array([positions[name] for name in BODY_JOINTS])
    model.plant.SetPositions(context, model.positions(body, np.zeros(3)))
    X_TC = model.pose(context, camera.frame_name, "torso")

    builder = DiagramBuilder()
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    add_renderer(scene_graph)
    MovingMarker.add_to_builder(builder, scene_graph, path, script.marker_id, script.marker_size)
    sensor = builder.AddNamedSystem(
        "sensor", make_rgbd_sensor(camera.intrinsics, scene_graph.world_frame_id(), X_TC)
    )
    builder.Connect(scene_graph.get_query_output_port(), sensor.query_object_input_port())
    images = builder.AddNamedSystem(
        "camera",
        CameraModel(
            camera.intrinsics, kind="color", period=script.period, noise=ColorNoise(), seed=seed
        ),
    )
    builder.Connect(sensor.color_image_output_port(), images.get_image_input_port())
    marked = MarkedObject(script.marker_id, script.marker_size, RigidTransform(FACING, [0, 0, 0]))
    tracker = builder.AddNamedSystem(
        "tracker", MarkerTracker(marked, camera.intrinsics, X_TC, script.period)
    )
    builder.Connect(images.GetOutputPort("color_image"), tracker.image_input)
    builder.Connect(images.GetOutputPort("time_stamp"), tracker.time_stamp_input)
    log = LogVectorOutput(tracker.sighting_output, builder, publish_period=script.period)
    simulator = Simulator(build(builder))
    simulate(simulator, path.end_time + script.rest, should_stop=should_stop).check()
    rows = log.FindLog(simulator.get_context()).data().T
    rows = rows[np.isfinite(rows[:, 0])]
    rows = rows[np.unique(rows[:, 0], return_index=True)[1]]
    return Sightings(rows[:, 0], rows[:, 1:4], rows[:, 4:])


def follow(
    shown: Demonstration, workspace: WorkspaceMap, arm: str, start: Vector
) -> tuple[Demonstration, Vector]:
    """Finds the arm's joints for a demonstrated motion.

    Args:
        shown: The motion in T, at constant time steps.
        workspace: Map into the arm's workspace.
        arm: "left" or "right".
        start: The arm's joints (5,) at the start [rad].

    Returns:
        The hand's desired motion, and the arm's joints (N, 5) [rad].

    Raises:
        InputError: The motion is out of reach; the message names a scale that would do.
    """
    target, joints, error = _track(shown, workspace, arm, start)
    if error <= OUT_OF_REACH:
        return target, joints
    for scale in workspace.scale * np.arange(0.95, 0.15, -0.05):
        smaller = WorkspaceMap(float(scale), workspace.yaw)
        if _track(shown, smaller, arm, start)[2] <= OUT_OF_REACH:
            mend = f"scale {scale:.2f} would do"
            break
    else:
        mend = "show it elsewhere, or start from another posture"
    raise InputError(
        f"{shown.name}: at scale {workspace.scale:g} the marker leads the hand"
        f" {1000 * error:.0f} mm beyond its reach; {mend}"
    )


def _track(
    shown: Demonstration, workspace: WorkspaceMap, arm: str, start: Vector
) -> tuple[Demonstration, Vector, float]:
    """Returns the desired motion, joints that follow it, and the hand's largest error [m]."""
    model = shared_control_model()
    kinematics = arm_kinematics(model, arm)
    X_TH = kinematics.hand_pose(start)
    target = workspace.apply(shown, X_TH.translation(), X_TH.rotation().ToQuaternion().wxyz())
    assert target.rotations is not None
    count = len(target.times)
    nominal = np.tile(start, (count, 1))
    ik = DifferentialIkParams(time_step=float(target.times[1] - target.times[0]))
    simulator = KinematicSimulator(
        model, kinematics, ik, settle=0.0, still_speed=ReachPlannerParams.still_speed
    )
    joints = simulator.track(
        ArmState(start, np.zeros(5)),
        HandPath(target.positions, target.rotations, nominal, count - 1),
        OUT_OF_REACH,
    )
    hands = kinematics.poses(joints).hand_position
    return target, joints, float(np.linalg.norm(hands - target.positions, axis=1).max())
