"""A demonstration given by a script, simulated and recorded so that nothing is lost."""

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
"""Period [s] of simulated time at which new samples are written to the file."""
_HAIR = 1e-9
"""Time [s] simulated beyond the end, for the sample that is due at the end."""


@dataclass(frozen=True)
class RecordOptions:
    """Options of a recording.

    Attributes:
        folder: Where it is written while it is made, if anywhere.
        should_stop: Asked between two slices; when it says so the recording ends in order.
        meshcat: Where the robot is shown, if anywhere.
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
    """Result of a script.

    Attributes:
        demonstration: The motion without the rest before and after it, from time 0.
        stopped: Whether it was asked to end before the script was over.
        final_distance: Of the hand from where the script has it at last [m].
        distance_rms: Of the hand from where the script has it, over the whole time [m].
    """

    demonstration: Demonstration
    stopped: bool
    final_distance: float
    distance_rms: float


class Session:
    """One recording: a diagram with a `Teaching` in it, simulated slice by slice."""

    def __init__(self, diagram: Diagram, teaching: Teaching, options: RecordOptions) -> None:
        self._teaching, self._options = teaching, options
        self.simulator = Simulator(diagram)
        self.simulator.set_target_realtime_rate(1.0 if options.realtime else 0.0)

    def run(self, end_time: float, name: str) -> tuple[Demonstration, Demonstration, bool]:
        """Simulates up to a time, or until it is asked to stop.

        Returns:
            All that was recorded, as it was; the motion without the rest at both ends, which is
            what the folder has; and whether it was asked to stop.

        Raises:
            StoppedError: It was stopped before it held a motion.
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
        """Simulates, and writes what is new once in a while; returns whether it was stopped."""
        context = self.simulator.get_context()

        def write() -> bool:
            if writer is not None:
                writer.write(*self._teaching.recorder.samples(context))
            return False

        end = simulate(
            self.simulator,
            end_time + _HAIR,
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
        script: One that passes its check.
        options: How the recording is made.
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
    """Drags the arm's joints one by one as a script says and records it.

    Args:
        script: One that passes its check.
        options: How the recording is made.
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
    """Steers the hand of the limp arm with a game pad as a script says and records it.

    Args:
        script: One that passes its check.
        options: How the recording is made.
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
    """Adds what drags the taught arm's joints along angles (5,) [rad] over time."""
    ahead = path.Clone()
    ahead.shiftRight(-CONTROL_PERIOD)
    source = builder.AddNamedSystem("joint_path", TrajectorySource(ahead))
    builder.Connect(source.get_output_port(), teaching.GetInputPort("joint_target"))


def joint_path(script: JointScript) -> PiecewisePolynomial:
    """Returns the angles (5,) [rad], shoulder to wrist, over time: at rest between two moves."""
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
    """Starts a diagram with the Teaching that a script is for."""
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
    """Compares what was recorded with where the script has the hand in T, (N, 3)."""
    distances = np.linalg.norm(recorded.positions - scripted[: len(recorded.times)], axis=1)
    return Recording(
        demonstration=motion,
        stopped=stopped,
        final_distance=float(distances[-1]),
        distance_rms=float(np.sqrt(np.mean(distances**2))),
    )
