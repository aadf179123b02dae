import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.symbolic import Expression, Variable

from pepper_drake.systems.primitive.canonical_system import CanonicalSystem
from pepper_drake.systems.primitive.transformation_system import TransformationSystem
from tests.systems.motion_example import STEP, learn, moving


@pytest.fixture(scope="module")
def primitive():
    return learn("rotation_dilation")


@pytest.fixture(scope="module")
def unscaled():
    return learn("none")


def discrete_path_end(system, primitive, inputs, steps, make):
    """Steps a TransformationSystem of any scalar; returns its position."""
    alpha_x, tau = primitive.translation.alpha_x, primitive.duration
    context = system.CreateDefaultContext()

    def fix(name, values):
        system.GetInputPort(name).FixValue(context, make(values))

    for name in ("goal_position", "start_position"):
        system.GetInputPort(name).FixValue(context, inputs[name])
    if "weights" in inputs:
        context.get_mutable_numeric_parameter(0).SetFromVector(inputs["weights"])
    fix("tau", [tau])
    for k in range(-1, steps):
        phase = np.exp(-alpha_x * max(k, 0) * STEP / tau)
        system.GetInputPort("movement").FixValue(context, moving(primitive, k >= 0))
        fix("phase", [phase])
        fix("phase_velocity", [-alpha_x * phase / tau])
        context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    return system.GetOutputPort("position").Eval(context)


def test_gradient_of_the_path_by_weights_and_goal(primitive):
    steps = 40
    weights = primitive.weights.ravel()
    values = np.concatenate((weights, primitive.goal))
    variables = InitializeAutoDiff(values).ravel()

    def constants(numbers):
        return [AutoDiffXd(float(x), np.zeros(len(values))) for x in numbers]

    system = TransformationSystem(primitive, start_moving=True).ToAutoDiffXd()
    position = discrete_path_end(
        system,
        primitive,
        {
            "weights": variables[:-3],
            "goal_position": variables[-3:],
            "start_position": constants(primitive.start),
        },
        steps,
        constants,
    )

    def rollout(x):
        return primitive.with_weights(x[:-3].reshape(-1, 3)).rollout(goal=x[-3:]).positions[steps]

    numeric = np.empty((3, len(values)))
    for k in range(len(values)):
        h = 1e-5 * max(1.0, abs(values[k]))
        step = np.zeros(len(values))
        step[k] = h
        numeric[:, k] = (rollout(values + step) - rollout(values - step)) / (2 * h)
    np.testing.assert_allclose(ExtractValue(position).ravel(), rollout(values), atol=1e-12)
    np.testing.assert_allclose(ExtractGradient(position), numeric, atol=1e-8)
    assert np.abs(numeric).max() > 0.1


def test_continuous_systems_have_a_symbolic_form(unscaled):
    system = CanonicalSystem(unscaled, time_step=0.0).ToSymbolic()
    context = system.CreateDefaultContext()
    system.GetInputPort("movement").FixValue(context, moving(unscaled))
    context.SetContinuousState([Expression(x := Variable("x"))])
    value = system.EvalTimeDerivatives(context).CopyToVector()[0].Evaluate({x: 0.5})
    assert value == pytest.approx(-0.5 * unscaled.translation.alpha_x / unscaled.duration)

    plain = TransformationSystem(unscaled, time_step=0.0)
    symbolic = plain.ToSymbolic()
    numbers = {
        "phase": [0.3],
        "phase_velocity": [-1.0],
        "tau": [1.4],
        "goal_position": [0.3, 0.2, 0.1],
        "start_position": [0.0, 0.1, 0.0],
    }
    state = np.arange(9.0) / 10
    memory = np.arange(6.0) / 7
    contexts = [system.CreateDefaultContext() for system in (plain, symbolic)]
    for context, one in zip(contexts, (plain, symbolic), strict=True):
        convert = (lambda v: v) if one is plain else (lambda v: [Expression(x) for x in v])
        one.GetInputPort("movement").FixValue(context, moving(unscaled))
        for name, values in numbers.items():
            one.GetInputPort(name).FixValue(context, convert(values))
        context.SetContinuousState(convert(state))
        context.SetDiscreteState(convert(memory))
    found = [
        one.EvalTimeDerivatives(c).CopyToVector()
        for one, c in zip((plain, symbolic), contexts, strict=True)
    ]
    np.testing.assert_allclose([e.Evaluate() for e in found[1]], found[0], rtol=1e-12)


def test_clones_behave_alike(primitive):
    for system in (CanonicalSystem(primitive), TransformationSystem(primitive)):
        clone = system.ToAutoDiffXd().ToScalarType[float]()
        assert clone.num_output_ports() == system.num_output_ports()
