"""One control step: from phase and goal to the next joint command.

Canonical system, both transformation systems, obstacle coupling with 2,000 points, differential
inverse kinematics and joint command, as they run in the reaching diagram.
"""

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource, MatrixGain

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.models.control_model import CONTROL_PERIOD, arm_joints, shared_control_model
from pepper_drake.models.pepper import POSTURES
from pepper_drake.perception.mapping.cloud import SurfacePoints, to_point_cloud
from pepper_drake.planning.collision.arm_geometry import ArmGeometry
from pepper_drake.planning.ik.differential_ik import (
    DifferentialIkParams,
    hand_key,
    make_differential_ik,
)
from pepper_drake.systems.primitive.canonical_system import CanonicalSystem
from pepper_drake.systems.primitive.feedforward_pose import FeedforwardPose
from pepper_drake.systems.primitive.obstacle_coupling import ObstacleCoupling
from pepper_drake.systems.primitive.orientation_transformation_system import (
    OrientationTransformationSystem,
)
from pepper_drake.systems.primitive.transformation_system import TransformationSystem
from pepper_drake.systems.robot.arm_command import ArmCommand

NUM_POINTS = 2000
TIME_STEP = CONTROL_PERIOD


def make_table(count):
    """Points on a table's top whose edge is 0.18 m ahead of the torso and 8 cm below it."""
    rng = np.random.default_rng(0)
    xy = rng.uniform([0.18, -0.6], [0.6, 0.4], (count, 2))
    positions = np.column_stack((xy, np.full(count, -0.08))).astype(np.float32)
    return SurfacePoints(positions, np.full_like(positions, np.nan))


def make_controller():
    arm, params = "right", DifferentialIkParams(time_step=TIME_STEP)
    model, primitive = shared_control_model(), make_primitive(None, arm)
    start = [POSTURES["stand"][name] for name in arm_joints(arm)]
    X_TH = ArmGeometry(model, arm).hand_pose(np.array(start))
    builder = DiagramBuilder()

    def constant(values):
        return builder.AddSystem(ConstantVectorSource(values)).get_output_port()

    def connect(source, system, *names):
        for name in names:
            builder.Connect(source, system.GetInputPort(name))

    active, goal = constant([1.0]), constant(primitive.goal + np.array([0.0, 0.0, 0.03]))
    canonical = builder.AddSystem(CanonicalSystem(primitive, time_step=TIME_STEP))
    translation = builder.AddSystem(TransformationSystem(primitive, time_step=TIME_STEP))
    rotation = builder.AddSystem(OrientationTransformationSystem(primitive, time_step=TIME_STEP))
    coupling = builder.AddSystem(ObstacleCoupling(make_coupling("barrier")))
    bus = builder.AddSystem(FeedforwardPose(hand_key(arm), params.tracking_gain))
    ik = builder.AddSystem(make_differential_ik(model, arm, params))
    command = builder.AddSystem(
        ArmCommand(
            limits=model.command_limits(arm_joints(arm)),
            start_position=start,
            time_step=TIME_STEP,
        )
    )
    for system in (canonical, translation, rotation, coupling, command):
        connect(active, system, "active")
    for system in (translation, rotation):
        for name in ("phase", "phase_velocity", "tau"):
            connect(canonical.GetOutputPort(name), system, name)
    for system in (canonical, translation, coupling):
        connect(goal, system, "goal_position")
    connect(constant(X_TH.translation()), translation, "start_position")
    connect(constant(X_TH.rotation().ToQuaternion().wxyz()), rotation, "start_orientation")
    connect(constant(primitive.orientation.goal), rotation, "goal_orientation")
    cloud = builder.AddSystem(ConstantValueSource(Value(to_point_cloud(make_table(NUM_POINTS)))))
    connect(cloud.get_output_port(), coupling, "cloud")
    for name in ("position", "velocity", "nominal_acceleration"):
        connect(translation.GetOutputPort(name), coupling, name)
    connect(canonical.GetOutputPort("tau"), coupling, "tau")
    connect(coupling.GetOutputPort("coupling"), translation, "coupling")
    connect(coupling.GetOutputPort("slowdown"), canonical, "slowdown")
    for system, what in ((translation, "position"), (rotation, "orientation")):
        for name in (what, f"next_{what}"):
            connect(system.GetOutputPort(name), bus, name)
    connect(bus.get_output_port(), ik, "desired_cartesian_poses")
    widen = np.zeros((model.plant.num_positions(), 5))
    widen[model.position_indices(arm_joints(arm)), range(5)] = 1
    for source, port in (
        (command.GetOutputPort("position_command"), "position"),
        (constant(start), "nominal_posture"),
    ):
        wide = builder.AddSystem(MatrixGain(widen))
        builder.Connect(source, wide.get_input_port())
        connect(wide.get_output_port(), ik, port)
    connect(ik.get_output_port(), command, "desired_velocity")
    connect(constant(start), command, "measured_position")
    return Simulator(builder.Build())


@pytest.mark.benchmark(group="control step among 2,000 points")
def test_control_step(benchmark):
    simulator = make_controller()
    simulator.AdvanceTo(0.05)
    context = simulator.get_context()

    def step():
        simulator.AdvanceTo(context.get_time() + TIME_STEP)

    benchmark.pedantic(step, rounds=280, iterations=1, warmup_rounds=5)
