"""The visual way to teach: a marker that a person moves is seen, and the arm does the same."""

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
"""Farther from where it is led [m] than this, the hand is at the end of its reach."""


@dataclass(frozen=True)
class MarkerRecording:
    """Result of teaching with a marker.

    Attributes:
        recording: The arm's motion.
        sightings: What the camera saw.
        shown: The marker's motion as it was understood, in T.
        tracking_error_rms: Of the sightings from the marker's true way [m].
    """

    recording: Recording
    sightings: Sightings
    shown: Demonstration
    tracking_error_rms: float


def record_marker(
    script: MarkerScript, options: RecordOptions | None = None, *, seed: int = 0
) -> MarkerRecording:
    """Watches a marker that is moved as a script says, and has the arm do the same.

    The camera's images, with its noise, give the marker's pose one by one; the motion through them
    is mapped into the arm's workspace; the inverse kinematics tells whether the arm can follow;
    then the arm's joints are moved along, and recorded as in every other way to teach.

    Args:
        script: One that passes its check.
        options: How the recording is made.
        seed: Of the camera's noise.

    Raises:
        InputError: The marker was not seen for too long, or leads the hand out of its reach.
    """
    options = options or RecordOptions()
    path = GuidePath(*script.poses())
    sightings = watch(script, path, seed=seed, should_stop=options.should_stop)
    shown = sighted_motion(sightings, name=script.name or "marker")
    true = np.array([path.pose(time).translation() for time in sightings.times])
    errors = np.linalg.norm(sightings.positions - true, axis=1)

    start = np.array([script.positions()[name] for name in arm_joints(script.arm)])
    wanted, joints = follow(shown, WorkspaceMap(script.scale, script.yaw), script.arm, start)
    times = script.rest + shown.times
    angles = PiecewisePolynomial.CubicShapePreserving(
        times, joints.T, zero_end_point_derivatives=True
    )
    builder, teaching = make_teaching(script, "joints", options)
    drag_joints(builder, teaching, angles)
    session = Session(build(builder), teaching, options)
    recorded, motion, stopped = session.run(float(times[-1]) + script.rest, script.name)
    led = np.column_stack(
        [np.interp(recorded.times, times, column) for column in wanted.positions.T]
    )
    return MarkerRecording(
        recording=measured_recording(recorded, motion, stopped, led),
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
    """Looks at a marker that moves along a path, with a camera of the resting head.

    Args:
        script: Camera, marker and posture.
        path: Poses X_TM; T does not move, so it is the scene graph's world.
        seed: Of the camera's noise.
        should_stop: Asked every tenth of a second; when it says so there are no more images.
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
    """Finds the arm's joints for a motion that was shown.

    Args:
        shown: In T, at even steps.
        workspace: How it is mapped.
        arm: "left" or "right".
        start: (5,) the arm's joints where it starts [rad].

    Returns:
        Where the hand is wanted, and the arm's joints (N, 5) [rad].

    Raises:
        InputError: The hand cannot go there; the sentence says what scale it could follow.
    """
    wanted, joints, error = _followed(shown, workspace, arm, start)
    if error <= OUT_OF_REACH:
        return wanted, joints
    for scale in workspace.scale * np.arange(0.95, 0.15, -0.05):
        smaller = WorkspaceMap(float(scale), workspace.yaw)
        if _followed(shown, smaller, arm, start)[2] <= OUT_OF_REACH:
            mend = f"scale {scale:.2f} would do"
            break
    else:
        mend = "show it elsewhere, or start from another posture"
    raise InputError(
        f"{shown.name}: at scale {workspace.scale:g} the marker leads the hand"
        f" {1000 * error:.0f} mm beyond its reach; {mend}"
    )


def _followed(
    shown: Demonstration, workspace: WorkspaceMap, arm: str, start: Vector
) -> tuple[Demonstration, Vector, float]:
    """The wanted motion, joints that follow it, and how far the hand is from it at most [m]."""
    model = shared_control_model()
    kinematics = arm_kinematics(model, arm)
    X_TH = kinematics.hand_pose(start)
    wanted = workspace.apply(shown, X_TH.translation(), X_TH.rotation().ToQuaternion().wxyz())
    assert wanted.rotations is not None
    count = len(wanted.times)
    nominal = np.tile(start, (count, 1))
    ik = DifferentialIkParams(time_step=float(wanted.times[1] - wanted.times[0]))
    simulator = KinematicSimulator(
        model, kinematics, ik, settle=0.0, still_speed=ReachPlannerParams.still_speed
    )
    joints = simulator.track(
        ArmState(start, np.zeros(5)),
        HandPath(wanted.positions, wanted.rotations, nominal, count - 1),
        OUT_OF_REACH,
    )
    hands = kinematics.poses(joints).hand_position
    return wanted, joints, float(np.linalg.norm(hands - wanted.positions, axis=1).max())
