"""Simulates a primitive without cameras, with pushes at the hand, and measures the result."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.geometry import Meshcat, MeshcatVisualizer, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from pepper_drake.diagrams.reproduction import Reproduction, ReproductionParams
from pepper_drake.diagrams.simulate import simulate
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.correction import ReproducedMotion
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import posture_positions
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems.framework import build
from pepper_drake.systems.guiding.external_force import ForcePulse, ScriptedForce

Vector = npt.NDArray[np.float64]

_SLICE = 0.1
_REST_SPEED = 0.01
"""Speed below which the hand is at rest [m/s]."""
LONGEST = 3.0
"""Timeout of a reproduction after the last push, in durations of its primitive."""
_LIMIT_TOLERANCE = 1e-3
"""Violation of a joint limit that the plant's solver allows [rad]."""


@dataclass(frozen=True)
class ReproductionOptions:
    """Options of a reproduction.

    Attributes:
        goal: Goal position of the hand (3,) in T [m]; the primitive's own if None.
        pushes: Pushes at the hand; time counts from the start of the movement.
        params: Tracking and compliance of the arm.
        meshcat: Meshcat for the visualization; None for none.
        realtime: Whether it runs no faster than real time.
        progress: Whether a progress bar is shown.
        should_stop: Polled every tenth of a second of simulated time.
        keep: Receives the result so far about once a second, in case the program is killed.
    """

    goal: Vector | None = None
    pushes: tuple[ForcePulse, ...] = ()
    params: ReproductionParams | None = None
    meshcat: Meshcat | None = None
    realtime: bool = False
    progress: bool = False
    should_stop: Callable[[], bool] = lambda: False
    keep: "Callable[[ReproductionResult], None] | None" = None


@dataclass(frozen=True)
class ReproductionResult:
    """Result of a reproduction.

    Attributes:
        motion: The arm's motion.
        desired_positions: The primitive's desired hand positions in T (N, 3) [m].
        slowdowns: Slowdown of the phase (N,).
        final_position_error: Final distance of the hand from its goal [m].
        worst_joint_speed: Largest speed of an arm joint as a fraction of its rated speed.
        limit_overrun: Largest violation of a joint's position limits [rad]; negative inside.
        desired_velocity_step: Largest change of the desired velocity in one tick [m/s].
        hand_velocity_step: Largest change of the hand's velocity in one tick [m/s].
    """

    motion: ReproducedMotion
    desired_positions: Vector
    slowdowns: Vector
    final_position_error: float
    worst_joint_speed: float
    limit_overrun: float
    desired_velocity_step: float
    hand_velocity_step: float

    @property
    def keeps_limits(self) -> bool:
        """Tells whether all joints stayed within their position and velocity limits."""
        return self.limit_overrun <= _LIMIT_TOLERANCE and self.worst_joint_speed <= 1.0


def start_positions(primitive: MovementPrimitive, arm: str) -> dict[str, float]:
    """Returns all joint positions [rad, m] at the start of a primitive with a posture, by name."""
    assert primitive.posture is not None
    joints = primitive.posture.at([0.0])[0]
    return posture_positions("stand", dict(zip(arm_joints(arm), joints, strict=True)))


def reproduce(
    primitive: MovementPrimitive, arm: str, options: ReproductionOptions | None = None
) -> ReproductionResult | None:
    """Performs a primitive until the hand is at rest, or for three times its duration.

    Args:
        primitive: The primitive, with orientation and posture.
        arm: "left" or "right".
        options: Options of the run.

    Returns:
        The result; None if it was stopped before the movement began.

    Raises:
        InputError: The primitive has no orientation or no posture.
    """
    options = options or ReproductionOptions()
    builder = DiagramBuilder()
    positions = start_positions(primitive, arm) if primitive.posture is not None else {}
    diagram = builder.AddNamedSystem(
        "reproduction",
        Reproduction(primitive, arm=arm, positions=positions, params=options.params),
    )
    push = builder.AddNamedSystem("scripted_push", ScriptedForce(*options.pushes))
    builder.Connect(push.push_output, diagram.GetInputPort("push"))
    builder.Connect(diagram.GetOutputPort("active"), push.active_input)
    if options.meshcat is not None:
        visualizer = builder.AddNamedSystem("visualizer", MeshcatVisualizer(options.meshcat))
        builder.Connect(diagram.GetOutputPort("query"), visualizer.query_object_input_port())
        options.meshcat.StartRecording(set_visualizations_while_recording=options.realtime)
    system = build(builder)
    simulator = Simulator(system)
    simulator.set_target_realtime_rate(1.0 if options.realtime else 0.0)
    root = simulator.get_mutable_context()
    context = diagram.GetMyMutableContextFromRoot(root)
    goal = begin_movement(diagram, context, options.goal)
    _advance(simulator, diagram, goal, options)
    if not diagram.logs["phase"].FindLog(root).num_samples():
        return None
    result = measure(diagram, root, goal)
    if options.meshcat is not None:
        _draw(options.meshcat, diagram, context, result)
        options.meshcat.PublishRecording()
    return result


def begin_movement(diagram: Reproduction, context: Context, goal: Vector | None) -> Vector:
    """Starts the movement from the hand's present position.

    Args:
        diagram: The diagram, with its primitive.
        context: The diagram's context.
        goal: Goal position of the hand (3,) in T [m]; the primitive's own if None.

    Returns:
        The goal (3,) [m].
    """
    primitive = diagram.primitive
    goal = primitive.goal if goal is None else goal
    assert primitive.orientation is not None
    goal_pose = RigidTransform(Quaternion(primitive.orientation.goal), goal)
    diagram.GetInputPort("goal_pose").FixValue(context, goal_pose)
    movement = Movement(primitive, id=1)
    diagram.GetInputPort("movement").FixValue(context, Value[object](movement))
    return goal


def comes_to_rest(
    diagram: Reproduction, root: Context, last_push: float = 0.0, period: float = _SLICE
) -> Callable[[], bool]:
    """Returns a function, to be called once per period, that tells if the movement has ended.

    Args:
        diagram: The diagram.
        root: The simulator's context.
        last_push: End of the last push [s].
        period: Time between two calls [s].
    """
    end = diagram.primitive.phase_at([diagram.primitive.duration])[0]
    context = diagram.GetMyContextFromRoot(root)
    before = diagram.GetOutputPort("hand_position").Eval(context)

    def rests() -> bool:
        nonlocal before
        hand = np.array(diagram.GetOutputPort("hand_position").Eval(context))
        still = np.linalg.norm(hand - before) < _REST_SPEED * period
        before = hand
        over = diagram.GetOutputPort("phase").Eval(context)[0] < end
        return bool(over and still and root.get_time() > last_push + 0.5)

    return rests


def _advance(
    simulator: Simulator, diagram: Reproduction, goal: Vector, options: ReproductionOptions
) -> None:
    """Simulates until the movement is over and the hand is at rest."""
    last_push = max((push.start + push.duration for push in options.pushes), default=0.0)
    root = simulator.get_context()

    def keep() -> None:
        if options.keep is not None:
            options.keep(measure(diagram, root, goal))

    simulate(
        simulator,
        LONGEST * diagram.primitive.duration + last_push,
        watch=comes_to_rest(diagram, root, last_push),
        should_stop=options.should_stop,
        keep=keep,
        period=_SLICE,
        progress=options.progress,
        title="reproducing",
    ).check()


def measure(diagram: Reproduction, root: Context, goal: Vector) -> ReproductionResult:
    """Computes the result of a run from its logs.

    Joint speeds are the true ones of a simulated robot, the commanded ones of a real one.

    Args:
        diagram: The diagram.
        root: The simulator's context.
        goal: Goal position of the hand (3,) in T [m].
    """

    def rows(name: str) -> Vector:
        return np.array(diagram.logs[name].FindLog(root).data().T)

    plant, names, joints = diagram.plant, arm_joints(diagram.arm), rows("arm_position")
    limits = shared_control_model().command_limits(names)
    if plant is None:
        speeds = rows("joint_velocity_command")
    else:
        first = plant.num_positions()
        columns = [first + plant.GetJointByName(name).velocity_start() for name in names]
        speeds = rows("state")[:, columns]
    motion = ReproducedMotion(
        times=np.array(diagram.logs["phase"].FindLog(root).sample_times()),
        phases=rows("phase")[:, 0],
        positions=rows("hand_position"),
        rotations=rows("hand_orientation"),
        joints=joints,
        goal=np.array(goal),
    )
    desired = rows("desired_position")
    return ReproductionResult(
        motion=motion,
        desired_positions=desired,
        slowdowns=rows("slowdown")[:, 0],
        final_position_error=float(np.linalg.norm(motion.positions[-1] - goal)),
        worst_joint_speed=float((np.abs(speeds) / limits.velocity).max()),
        limit_overrun=float(
            np.maximum(limits.position_lower - joints, joints - limits.position_upper).max()
        ),
        desired_velocity_step=_velocity_step(desired, diagram.params.log_period),
        hand_velocity_step=_velocity_step(motion.positions, diagram.params.log_period),
    )


def _velocity_step(positions: Vector, step: float) -> float:
    return float(np.linalg.norm(np.diff(positions, n=2, axis=0), axis=1).max() / step)


def _draw(
    meshcat: Meshcat, diagram: Reproduction, context: Context, result: ReproductionResult
) -> None:
    """Draws the primitive's own path in black and the hand's in white."""
    X_WT = diagram.GetOutputPort("torso_pose").Eval(context)
    own = diagram.primitive.rollout(0.02).positions
    for name, path, width, shade in (
        ("demonstration", own, 3.0, 0.0),
        ("reproduction", result.motion.positions, 4.0, 1.0),
    ):
        meshcat.SetLine(name, X_WT @ path.T, width, Rgba(shade, shade, shade))
