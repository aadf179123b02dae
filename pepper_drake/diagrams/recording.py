"""Simulates and records a scripted demonstration, writing it to disk as it goes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.diagrams.simulate import simulate
from pepper_drake.diagrams.teaching import Teaching
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.recording import RecordingWriter, without_rest
from pepper_drake.models.control_model import CONTROL_PERIOD, shared_control_model
from pepper_drake.models.guide import GuideScript
from pepper_drake.models.joint_script import JointScript
from pepper_drake.models.pad_script import PadScript
from pepper_drake.models.pepper import JOINT_GROUPS, arm_group, hand_frame
from pepper_drake.models.scene import make_pose
from pepper_drake.models.teaching_script import TeachingScript
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.systems.framework import Diagram, build
from pepper_drake.systems.guiding.gamepad_velocity import GamepadState, GamepadVelocity
from pepper_drake.systems.guiding.scripted_gamepad import ScriptedGamepad
from pepper_drake.systems.guiding.scripted_guide import GuidePath, ScriptedGuide
from pepper_drake.systems.guiding.velocity_guide import VelocityGuide

Vector = npt.NDArray[np.float64]

_SLICE = 0.1
"""Period in simulated time at which new samples are written to the file [s]."""
_EPSILON = 1e-9
"""Time simulated beyond the end, to include the sample at the end [s]."""


@dataclass(frozen=True)
class RecordOptions:
    """Options of a recording.

    Attributes:
        folder: Folder to which it is written during the recording; None for none.
        should_stop: Polled once per slice; ends the recording in an orderly way.
        meshcat: Meshcat for the visualization; None for none.
        realtime: Whether it runs no faster than real time.
        progress: Whether a progress bar is shown.
    """

    folder: Path | None = None
    should_stop: Callable[[], bool] = lambda: False
    meshcat: Meshcat | None = None
    realtime: bool = False
    progress: bool = False


@dataclass(frozen=True)
class Recording:
    """Result of recording a script.

    Attributes:
        demonstration: The motion without the rest before and after it, from time 0.
        stopped: Whether it was stopped before the end of the script.
        final_distance: Distance of the hand from the script's last position [m].
        distance_rms: RMS distance of the hand from the script's positions [m].
    """

    demonstration: Demonstration
    stopped: bool
    final_distance: float
    distance_rms: float


class Session:
    """One recording: a diagram that contains a `Teaching`, simulated in slices."""

    def __init__(self, diagram: Diagram, teaching: Teaching, options: RecordOptions) -> None:
        self._teaching, self._options = teaching, options
        self.simulator = Simulator(diagram)
        self.simulator.set_target_realtime_rate(1.0 if options.realtime else 0.0)

    def run(self, end_time: float, name: str) -> tuple[Demonstration, Demonstration, bool]:
        """Simulates up to a time, or until it is stopped.

        Returns:
            The whole recording; the motion without the rest at both ends, as written to the folder;
            and whether it was stopped.

        Raises:
            StoppedError: It was stopped before there was any motion.
            InputError: The folder cannot be written to.
        """
        meshcat, recorder = self._options.meshcat, self._teaching.recorder
        if meshcat is not None:
            meshcat.StartRecording(set_visualizations_while_recording=self._options.realtime)
        if self._options.folder is None:
            stopped = self._advance(end_time, None)
            recorded = recorder.demonstration(self.simulator.get_context(), name=name)
            motion = without_rest(recorded)
        else:
            with RecordingWriter(self._options.folder, recorder.joint_names) as writer:
                stopped = self._advance(end_time, writer)
                context = self.simulator.get_context()
                recorded, motion = writer.finish_motion(
                    lambda: recorder.demonstration(context, name=name)
                )
        if meshcat is not None:
            meshcat.PublishRecording()
        return recorded, motion, stopped

    def _advance(self, end_time: float, writer: RecordingWriter | None) -> bool:
        """Simulates and writes new samples periodically; returns whether it was stopped."""
        context = self.simulator.get_context()

        def write() -> bool:
            if writer is not None:
                writer.write(*self._teaching.recorder.samples(context))
            return False

        end = simulate(
            self.simulator,
            end_time + _EPSILON,
            watch=write,
            should_stop=self._options.should_stop,
            period=_SLICE,
            progress=self._options.progress,
            title="recording",
        )
        end.check()
        write()
        return end.stopped


def record_guided(script: GuideScript, options: RecordOptions | None = None) -> Recording:
    """Guides the hand of the limp arm through a script's via points and records it.

    Args:
        script: A checked script.
        options: Options of the recording.
    """
    options = options or RecordOptions()
    builder, teaching = make_teaching(script, "hand", options)
    plant_context = teaching.plant.CreateDefaultContext()
    X_WT = teaching.plant.GetFrameByName("torso").CalcPoseInWorld(plant_context)
    X_WH = teaching.plant.GetFrameByName(hand_frame(script.arm)).CalcPoseInWorld(plant_context)
    path = GuidePath(
        [script.rest, *(script.rest + via.time for via in script.via_points)],
        [X_WH, *(X_WT @ make_pose(via.position, via.rpy) for via in script.via_points)],
    )
    guide = builder.AddNamedSystem("scripted_guide", ScriptedGuide(path))
    builder.Connect(guide.guide_pose_output, teaching.GetInputPort("guide_pose"))
    builder.Connect(guide.guide_velocity_output, teaching.GetInputPort("guide_velocity"))
    session = Session(build(builder), teaching, options)
    recorded, motion, stopped = session.run(path.end_time + script.rest, script.name)
    guided = [(X_WT.inverse() @ path.pose(time)).translation() for time in recorded.times]
    return measured_recording(recorded, motion, stopped, np.array(guided))


def record_joints(script: JointScript, options: RecordOptions | None = None) -> Recording:
    """Drags the arm's joints one by one along a script and records it.

    Args:
        script: A checked script.
        options: Options of the recording.
    """
    options = options or RecordOptions()
    builder, teaching = make_teaching(script, "joints", options)
    path = joint_path(script)
    drag_joints(builder, teaching, path)
    session = Session(build(builder), teaching, options)
    recorded, motion, stopped = session.run(path.end_time() + script.rest, script.name)
    kinematics = arm_kinematics(shared_control_model(), script.arm)
    dragged = [
        kinematics.hand_pose(path.value(time)[:, 0]).translation() for time in recorded.times
    ]
    return measured_recording(recorded, motion, stopped, np.array(dragged))


def record_pad(script: PadScript, options: RecordOptions | None = None) -> Recording:
    """Steers the hand of the limp arm with a scripted game pad and records it.

    Args:
        script: A checked script.
        options: Options of the recording.
    """
    options = options or RecordOptions()
    builder, teaching = make_teaching(script, "hand", options)

    def pad_at(time: float) -> GamepadState:
        step = script.step_at(time)
        return GamepadState.of(step.axes, step.buttons())

    pad = builder.AddNamedSystem("scripted_gamepad", ScriptedGamepad(pad_at))
    steering = builder.AddNamedSystem("gamepad_velocity", GamepadVelocity())
    guide = builder.AddNamedSystem("velocity_guide", VelocityGuide())
    builder.Connect(pad.gamepad_output, steering.gamepad_input)
    builder.Connect(steering.velocity_output, guide.velocity_input)
    builder.Connect(teaching.GetOutputPort("hand_pose"), guide.hand_pose_input)
    builder.Connect(teaching.GetOutputPort("torso_pose"), guide.torso_pose_input)
    builder.Connect(guide.guide_pose_output, teaching.GetInputPort("guide_pose"))
    builder.Connect(guide.guide_velocity_output, teaching.GetInputPort("guide_velocity"))
    steered = LogVectorOutput(guide.guide_position_output, builder, publish_period=0.01)
    session = Session(build(builder), teaching, options)
    recorded, motion, stopped = session.run(script.end_time + script.rest, script.name)
    log = steered.FindLog(session.simulator.get_context())
    return measured_recording(recorded, motion, stopped, log.data().T)


def drag_joints(builder: DiagramBuilder, teaching: Teaching, path: PiecewisePolynomial) -> None:
    """Adds a source that drags the taught arm's joints along a trajectory (5,) [rad]."""
    ahead = path.Clone()
    ahead.shiftRight(-CONTROL_PERIOD)
    source = builder.AddNamedSystem("joint_path", TrajectorySource(ahead))
    builder.Connect(source.get_output_port(), teaching.GetInputPort("joint_target"))


def joint_path(script: JointScript) -> PiecewisePolynomial:
    """Returns the joint trajectory (5,) [rad], shoulder to wrist, at rest between moves."""
    joints = JOINT_GROUPS[arm_group(script.arm)]
    angles = [script.positions()[name] for name in joints]
    times, rows = [0.0, script.rest], [list(angles)] * 2
    for number, move in enumerate(script.moves):
        if number and script.pause > 0.0:
            times.append(times[-1] + script.pause)
            rows.append(list(angles))
        angles[joints.index(move.joint)] = move.angle
        times.append(times[-1] + move.duration)
        rows.append(list(angles))
    if script.rest == 0.0:
        times, rows = times[1:], rows[1:]
    knots = np.array(rows).T
    return PiecewisePolynomial.CubicHermite(times, knots, np.zeros_like(knots))


def make_teaching(
    script: TeachingScript, guided_by: str, options: RecordOptions
) -> tuple[DiagramBuilder, Teaching]:
    """Returns a builder with the `Teaching` for a script, and a visualizer if wanted."""
    builder = DiagramBuilder()
    teaching = Teaching(script.arm, script.positions(), guided_by=guided_by)
    builder.AddNamedSystem("teaching", teaching)
    if options.meshcat is not None:
        visualizer = builder.AddNamedSystem("visualizer", MeshcatVisualizer(options.meshcat))
        builder.Connect(teaching.GetOutputPort("query"), visualizer.query_object_input_port())
    return builder, teaching


def measured_recording(
    recorded: Demonstration, motion: Demonstration, stopped: bool, scripted: Vector
) -> Recording:
    """Compares a recording with the script's hand positions in T (N, 3) [m]."""
    distances = np.linalg.norm(recorded.positions - scripted[: len(recorded.times)], axis=1)
    return Recording(
        demonstration=motion,
        stopped=stopped,
        final_distance=float(distances[-1]),
        distance_rms=float(np.sqrt(np.mean(distances**2))),
    )
