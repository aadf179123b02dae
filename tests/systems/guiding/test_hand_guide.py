import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource

from pepper_drake.systems.guiding.hand_guide import HandGuide, HandGuideParams, guide_force

PARAMS = HandGuideParams(
    stiffness=100.0,
    damping=10.0,
    rotational_stiffness=2.0,
    rotational_damping=0.5,
    max_force=50.0,
    max_torque=4.0,
)


def test_spring_and_damper_by_hand():
    X_WH = RigidTransform([0.1, 0.0, 0.0])
    V_WH = SpatialVelocity(w=[0, 0, 0.2], v=[0.1, 0, 0])
    X_WG = RigidTransform(RotationMatrix.MakeZRotation(0.3), [0.1, 0.2, 0.0])
    V_WG = SpatialVelocity(w=[0, 0, 0], v=[0, 0, 0.5])
    force = guide_force(X_WH, V_WH, X_WG, V_WG, PARAMS)
    np.testing.assert_allclose(force.translational(), [-1.0, 20.0, 5.0], atol=1e-12)
    np.testing.assert_allclose(force.rotational(), [0, 0, 2 * 0.3 - 0.5 * 0.2], atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_force_is_limited_and_zero_at_the_guide(seed):
    rng = np.random.default_rng(seed)
    X = RigidTransform(RollPitchYaw(rng.uniform(-1, 1, 3)), rng.uniform(-1, 1, 3))
    V = SpatialVelocity(w=rng.normal(size=3), v=rng.normal(size=3))
    np.testing.assert_allclose(guide_force(X, V, X, V, PARAMS).get_coeffs(), 0, atol=1e-7)
    far = RigidTransform(RollPitchYaw(rng.uniform(-3, 3, 3)), rng.uniform(-5, 5, 3))
    force = guide_force(X, V, far, V, PARAMS)
    assert np.linalg.norm(force.translational()) <= 50.0 + 1e-9
    assert np.linalg.norm(force.rotational()) <= 4.0 + 1e-9


def test_a_free_body_comes_to_the_guide_pose_and_ports_feed_nothing_through():
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.002))
    inertia = SpatialInertia(0.5, [0.02, 0, 0], UnitInertia.SolidSphere(0.2))
    body = plant.AddRigidBody("body", inertia)
    X_BH = RigidTransform([0.05, 0.0, 0.02])
    frame = plant.AddFrame(FixedOffsetFrame("H", body.body_frame(), X_BH))
    plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
    plant.Finalize()
    guide = builder.AddSystem(HandGuide(frame, PARAMS))
    X_WG = RigidTransform(RollPitchYaw(0.4, -0.2, 0.7), [0.1, -0.2, 0.3])
    source = builder.AddSystem(ConstantValueSource(Value(X_WG)))
    builder.Connect(source.get_output_port(), guide.guide_pose_input)
    builder.Connect(plant.get_body_poses_output_port(), guide.body_poses_input)
    builder.Connect(
        plant.get_body_spatial_velocities_output_port(), guide.body_spatial_velocities_input
    )
    builder.Connect(guide.spatial_forces_output, plant.get_applied_spatial_force_input_port())
    diagram = builder.Build()
    assert not guide.HasAnyDirectFeedthrough()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(3.0)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    X_WH = frame.CalcPoseInWorld(context)
    assert X_WH.IsNearlyEqualTo(X_WG, 2e-3)


def test_force_is_held_between_samples():
    plant = MultibodyPlant(0.0)
    body = plant.AddRigidBody("body", SpatialInertia(1.0, np.zeros(3), UnitInertia(1, 1, 1)))
    plant.Finalize()
    guide = HandGuide(body.body_frame(), PARAMS, time_step=0.01)
    context = guide.CreateDefaultContext()
    guide.body_poses_input.FixValue(context, [RigidTransform(), RigidTransform()])
    guide.body_spatial_velocities_input.FixValue(context, [SpatialVelocity.Zero()] * 2)
    guide.guide_pose_input.FixValue(context, RigidTransform([0.1, 0, 0]))
    assert guide.force_output.Eval(context) == pytest.approx(np.zeros(6))
    simulator = Simulator(guide, context)
    simulator.AdvanceTo(0.005)
    assert guide.force_output.Eval(context) == pytest.approx([0, 0, 0, 10, 0, 0])
    guide.guide_pose_input.FixValue(context, RigidTransform([0.2, 0, 0]))
    simulator.AdvanceTo(0.009)
    assert guide.force_output.Eval(context)[3] == pytest.approx(10)
    simulator.AdvanceTo(0.011)
    assert guide.force_output.Eval(context)[3] == pytest.approx(20)
    (applied,) = guide.spatial_forces_output.Eval(context)
    assert applied.body_index == body.index()


def test_a_guide_that_has_let_go_pulls_nothing():
    plant = MultibodyPlant(0.0)
    body = plant.AddRigidBody("body", SpatialInertia(1.0, np.zeros(3), UnitInertia(1, 1, 1)))
    plant.Finalize()
    guide = HandGuide(body.body_frame(), PARAMS, time_step=0.01)
    simulator = Simulator(guide)
    context = simulator.get_mutable_context()
    still = [SpatialVelocity.Zero()] * 2
    guide.body_poses_input.FixValue(context, [RigidTransform()] * 2)
    guide.body_spatial_velocities_input.FixValue(context, still)
    guide.guide_pose_input.FixValue(context, RigidTransform([0.1, 0.0, 0.0]))
    guide.holding_input.FixValue(context, [1.0])
    simulator.AdvanceTo(0.015)
    np.testing.assert_allclose(guide.force_output.Eval(context), [0, 0, 0, 10.0, 0, 0])
    guide.holding_input.FixValue(context, [0.0])
    simulator.AdvanceTo(0.025)
    np.testing.assert_array_equal(guide.force_output.Eval(context), np.zeros(6))
