import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.systems.guiding.external_force import ForcePulse, HandForce, ScriptedForce


def test_a_script_pushes_from_its_start_for_its_duration():
    script = ForcePulse((0.0, 0.0, -5.0), start=1.0, duration=0.5)
    for time, expected in ((0.99, 0.0), (1.0, -5.0), (1.49, -5.0), (1.5, 0.0)):
        np.testing.assert_array_equal(script.at(time), [0, 0, 0, 0, 0, expected])


def test_the_push_begins_with_the_movement_and_again_with_the_next():
    push = ScriptedForce(ForcePulse((5.0, 0, 0), 0.1, 0.2), ForcePulse((0, 1.0, 0), 0.25, 0.1))
    simulator = Simulator(push)
    context = simulator.get_mutable_context()
    push.active_input.FixValue(context, [0.0])
    simulator.AdvanceTo(0.495)
    np.testing.assert_array_equal(push.push_output.Eval(context), np.zeros(6))
    for start in (0.5, 1.5):
        push.active_input.FixValue(context, [1.0])
        impulse = np.zeros(3)
        for tick in range(60):
            simulator.AdvanceTo(start + 0.01 * tick + 0.005)
            impulse += 0.01 * push.push_output.Eval(context)[3:]
        np.testing.assert_allclose(impulse, [1.0, 0.1, 0.0], atol=1e-12)
        push.active_input.FixValue(context, [0.0])
        simulator.AdvanceTo(start + 0.995)


@pytest.fixture
def body():
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    inertia = SpatialInertia(2.0, np.zeros(3), UnitInertia.SolidSphere(0.1))
    body = plant.AddRigidBody("body", inertia)
    X_BH = RigidTransform([0.0, 0.1, 0.0])
    frame = plant.AddFrame(FixedOffsetFrame("H", body.body_frame(), X_BH))
    plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
    plant.Finalize()
    force = builder.AddSystem(HandForce(frame))
    builder.Connect(force.spatial_forces_output, plant.get_applied_spatial_force_input_port())
    builder.ExportInput(force.force_input, "force")
    return plant, builder.Build()


def test_a_force_accelerates_and_turns_as_newton_says(body):
    plant, diagram = body
    context = diagram.CreateDefaultContext()
    diagram.GetInputPort("force").FixValue(context, [0, 0, 0.5, 4.0, 0, 0])
    rates = plant.EvalTimeDerivatives(plant.GetMyContextFromRoot(context)).CopyToVector()
    # m a = F; I = 2/5 m r² = 0.008; the force is 0.1 m off the middle: -0.4 N m about z.
    np.testing.assert_allclose(rates[10:], [2.0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(rates[7:10], [0, 0, (0.5 - 0.4) / 0.008], atol=1e-6)


def test_unconnected_nothing_pushes(body):
    plant, diagram = body
    context = diagram.CreateDefaultContext()
    rates = plant.EvalTimeDerivatives(plant.GetMyContextFromRoot(context)).CopyToVector()
    np.testing.assert_allclose(rates[7:], 0, atol=1e-12)
