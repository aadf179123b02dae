"""One control step: from phase and goal to the next joint command.

Canonical system, both transformation systems, obstacle coupling with 2,000 points, differential
inverse kinematics and joint command: the controller of the reaching diagram.
"""

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.arm_controller import ArmController
from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.models.control_model import CONTROL_PERIOD, arm_joints, shared_control_model
from pepper_drake.models.pepper import POSTURES
from pepper_drake.perception.mapping.cloud import SurfacePoints, to_point_cloud
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.movement import Movement

NUM_POINTS = 2000
TIME_STEP = CONTROL_PERIOD


def make_table(count):
    """Points on a table's top whose edge is 0.18 m ahead of the torso and 8 cm below it."""
    rng = np.random.default_rng(0)
    xy = rng.uniform([0.18, -0.6], [0.6, 0.4], (count, 2))
    positions = np.column_stack((xy, np.full(count, -0.08))).astype(np.float32)
    return SurfacePoints(positions, np.full_like(positions, np.nan))


def make_controller():
    arm, model = "right", shared_control_model()
    primitive = make_primitive(None, arm)
    start = [POSTURES["stand"][name] for name in arm_joints(arm)]
    ik = DifferentialIkParams(time_step=TIME_STEP)
    controller = ArmController(model, arm, primitive, start, ik=ik)
    simulator = Simulator(controller)
    goal = primitive.goal + np.array([0.0, 0.0, 0.03])
    X_TG = RigidTransform(Quaternion(primitive.orientation.goal), goal)
    for name, value in (
        ("movement", Value[object](Movement(primitive, make_coupling("barrier"), id=1))),
        ("object_pose", X_TG),
        ("torso_pose", RigidTransform()),
        ("hand_pose", arm_kinematics(model, arm).hand_pose(np.array(start))),
        ("arm_position", start),
        ("cloud", Value(to_point_cloud(make_table(NUM_POINTS)))),
    ):
        controller.GetInputPort(name).FixValue(simulator.get_mutable_context(), value)
    return simulator


@pytest.mark.benchmark(group="control step among 2,000 points")
def test_control_step(benchmark):
    simulator = make_controller()
    simulator.AdvanceTo(0.05)
    context = simulator.get_context()

    def step():
        simulator.AdvanceTo(context.get_time() + TIME_STEP)

    benchmark.pedantic(step, rounds=280, iterations=1, warmup_rounds=5)
