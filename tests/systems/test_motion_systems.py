"""The canonical, transformation, orientation and coupling systems, alone and as one loop."""

from functools import partial

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource, LogVectorOutput

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.dmp.obstacle_coupling import get_coupling
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems.primitive.canonical_system import CanonicalSystem
from pepper_drake.systems.primitive.obstacle_coupling import ObstacleCoupling
from pepper_drake.systems.primitive.orientation_transformation_system import (
    OrientationTransformationSystem,
)
from pepper_drake.systems.primitive.transformation_system import TransformationSystem
from tests.systems.motion_example import STEP, learn, make_cloud, moving


@pytest.fixture(scope="module")
def primitive():
    return learn("rotation_dilation")


@pytest.fixture(scope="module")
def unscaled():
    return learn("none")


class Function(LeafSystem):
    """A vector that is a function of the time."""

    def __init__(self, function):
        super().__init__()
        self.DeclareVectorOutputPort(
            "y",
            len(function(0.0)),
            lambda context, out: out.SetFromVector(function(context.get_time())),
            prerequisites_of_calc={self.time_ticket()},
        )


class Movements(LeafSystem):
    """A movement whose number is a function of the time."""

    def __init__(self, primitive, number, **parts):
        super().__init__()
        self.DeclareAbstractOutputPort(
            "movement",
            lambda: Value[object](None),
            lambda context, out: out.set_value(
                Movement(primitive, **parts, id=number(context.get_time()))
            ),
            prerequisites_of_calc={self.time_ticket()},
        )


class Loop:
    """All four systems wired as in the reaching diagram, with what they are given."""

    def __init__(
        self,
        primitive,
        *,
        goal=None,
        number=lambda t: 1,
        points=None,
        goal_velocity=None,
        start_moving=True,
        time_step=STEP,
        performed=None,
    ):
        goal = goal or (lambda t: primitive.goal)
        builder = DiagramBuilder()
        add, connect = builder.AddSystem, builder.Connect
        self.canonical = add(CanonicalSystem(primitive, time_step=time_step))
        self.translation = add(
            TransformationSystem(primitive, time_step=time_step, start_moving=start_moving)
        )
        goal_port = add(Function(goal)).get_output_port()
        movement = add(
            Movements(performed or primitive, number, coupling=get_coupling("barrier"))
        ).get_output_port()
        start_port = add(ConstantVectorSource(primitive.start)).get_output_port()
        systems = [self.translation]
        if time_step > 0:
            self.rotation = add(
                OrientationTransformationSystem(
                    primitive, time_step=time_step, start_moving=start_moving
                )
            )
            systems.append(self.rotation)
            q0, qg = (
                add(ConstantVectorSource(q)).get_output_port()
                for q in (primitive.orientation.start, primitive.orientation.goal)
            )
            connect(q0, self.rotation.start_orientation_port)
            connect(qg, self.rotation.goal_orientation_port)
        connect(movement, self.canonical.movement_port)
        connect(goal_port, self.canonical.goal_position_port)
        connect(goal_port, self.translation.goal_position_port)
        connect(start_port, self.translation.start_position_port)
        for system in systems:
            connect(movement, system.movement_port)
            for name in ("phase_port", "phase_velocity_port", "tau_port"):
                connect(getattr(self.canonical, name), getattr(system, name))
        if goal_velocity is not None:
            velocity = add(ConstantVectorSource(goal_velocity)).get_output_port()
            connect(velocity, self.translation.goal_velocity_port)
        if points is not None:
            coupling = add(ObstacleCoupling())
            connect(movement, coupling.movement_port)
            source = add(ConstantValueSource(Value(make_cloud(points))))
            connect(source.get_output_port(), coupling.cloud_port)
            for name in ("position_port", "velocity_port", "nominal_acceleration_port"):
                connect(getattr(self.translation, name), getattr(coupling, name))
            connect(goal_port, coupling.goal_position_port)
            connect(self.canonical.tau_port, coupling.tau_port)
            connect(coupling.coupling_port, self.translation.coupling_port)
            connect(coupling.slowdown_port, self.canonical.slowdown_port)
        log = partial(LogVectorOutput, builder=builder, publish_period=STEP)
        self.logs = {
            port.get_name(): log(port)
            for system in [self.canonical, *systems]
            for port in map(system.get_output_port, range(system.num_output_ports()))
        }
        self.simulator = Simulator(builder.Build())

    def run(self, time):
        self.simulator.Initialize()
        self.simulator.AdvanceTo(time)
        context = self.simulator.get_context()
        return {name: log.FindLog(context).data().T for name, log in self.logs.items()}


def near_path(primitive):
    return primitive.rollout().positions[75] + np.array([[0.0, 0.01, -0.02], [0.0, 0.03, -0.01]])


CASES = {
    "undisturbed": {},
    "among obstacles": {"points": True},
    "moving goal": {"goal": lambda g, t: g + np.array([0.0, 0.0, 0.08]) * min(1.0, t)},
    "jumping goal": {"goal": lambda g, t: g + (np.array([0.1, 0.0, 0.05]) if t > 0.5 else 0)},
    "known goal velocity": {
        "goal": lambda g, t: g + np.array([0.0, 0.05, 0.0]) * t,
        "goal_velocity": np.array([0.0, 0.05, 0.0]),
    },
    "all at once": {
        "points": True,
        "goal": lambda g, t: g + np.array([0.0, 0.05, 0.0]) * t,
        "goal_velocity": np.array([0.0, 0.05, 0.0]),
    },
}


@pytest.mark.parametrize("case", CASES)
def test_the_diagram_gives_the_path_of_the_offline_rollout(primitive, case):
    options = CASES[case]
    move = options.get("goal", lambda g, t: g)
    # Single precision is what a point cloud has.
    points = near_path(primitive).astype(np.float32) if "points" in options else None
    path = primitive.rollout(
        goal=partial(move, primitive.goal),
        goal_velocity=options.get("goal_velocity"),
        obstacles=points,
    )
    found = Loop(
        primitive,
        goal=partial(move, primitive.goal),
        goal_velocity=options.get("goal_velocity"),
        points=points,
    ).run(path.times[-1])
    if points is not None:
        assert np.any(path.coupling)
    close = partial(np.testing.assert_allclose, rtol=0, atol=1e-9)
    close(found["position"], path.positions)
    close(found["velocity"], path.velocities)
    close(found["phase"][:, 0], path.phases)
    close(found["tau"][:, 0], path.taus)
    close(found["angular_velocity"], path.angular_velocities)
    close(np.abs(np.sum(found["orientation"] * path.rotations, axis=1)), 1.0)
    # What follows the motion knows the next state one period ahead.
    for name in ("position", "velocity", "angular_velocity", "orientation"):
        np.testing.assert_array_equal(found[f"next_{name}"][:-1], found[name][1:])


def test_continuous_time_gives_the_same_path(primitive):
    path = primitive.rollout()
    loop = Loop(primitive, time_step=0.0)
    loop.simulator.get_mutable_integrator().set_target_accuracy(1e-7)
    found = loop.run(primitive.duration)
    np.testing.assert_allclose(found["position"], path.positions, atol=1e-6)
    np.testing.assert_allclose(found["velocity"], path.velocities, atol=1e-5)


def test_continuous_time_follows_a_jumping_goal(primitive):
    def goal(t):
        return primitive.goal + (np.array([0.0, 0.06, 0.0]) if t > 0.4 else 0)

    path = primitive.rollout(goal=goal)
    loop = Loop(primitive, goal=goal, time_step=0.0)
    loop.simulator.get_mutable_integrator().set_maximum_step_size(0.005)
    found = loop.run(1.4)
    # The jump is seen after a step of the integrator, here up to a period later.
    position = found["position"][:140]
    np.testing.assert_allclose(position, path.positions[:140], atol=2e-3)
    assert found["tau"][-1, 0] == pytest.approx(path.taus[140])


@pytest.mark.parametrize("time_step", [STEP, 0.0])
def test_waits_where_the_hand_is_and_starts_when_it_is_told_to(primitive, time_step):
    loop = Loop(primitive, number=lambda t: int(0.3 < t < 1.0), time_step=time_step)
    if time_step == 0.0:
        loop.simulator.get_mutable_integrator().set_maximum_step_size(0.01)
    found = loop.run(1.3)
    waiting = slice(0, 30)
    np.testing.assert_array_equal(found["phase"][waiting], 1.0)
    np.testing.assert_array_equal(found["position"][waiting] - primitive.start, 0.0)
    np.testing.assert_array_equal(found["tau"][waiting], primitive.duration)
    assert np.all(np.diff(found["phase"][32:95, 0]) < 0)
    # Told to stop, it is at the start again.
    np.testing.assert_allclose(found["phase"][-10:], 1.0)
    np.testing.assert_allclose(found["position"][-10:] - primitive.start, 0.0, atol=1e-12)


def test_starts_from_rest_or_moving(primitive):
    resting = Loop(primitive, start_moving=False).run(0.5)
    moving = Loop(primitive, start_moving=True).run(0.5)
    np.testing.assert_array_equal(resting["velocity"][0], 0.0)
    np.testing.assert_allclose(moving["velocity"][0], primitive.rollout().velocities[0], atol=1e-12)
    path = primitive.rollout(start_velocity=[0, 0, 0])
    np.testing.assert_allclose(resting["position"], path.positions[:51], atol=1e-12)


def test_coupling_and_next_state_have_no_loop_and_no_delay(primitive):
    system = TransformationSystem(primitive)
    fed = {
        (system.get_input_port(i).get_name(), system.get_output_port(o).get_name())
        for i in range(system.num_input_ports())
        for o in range(system.num_output_ports())
        if system.HasDirectFeedthrough(i, o)
    }
    assert ("coupling", "next_position") in fed
    assert ("phase_velocity", "next_velocity") in fed
    for port in ("position", "velocity", "delayed_goal_position"):
        assert not any(output == port for _, output in fed)
    for port in ("coupling", "phase_velocity"):
        assert (port, "nominal_acceleration") not in fed
    canonical = CanonicalSystem(primitive)
    for port in (canonical.phase_port, canonical.tau_port):
        for source in (canonical.goal_position_port, canonical.slowdown_port):
            assert not canonical.HasDirectFeedthrough(source.get_index(), port.get_index())


def test_another_motion_starts_with_the_position_and_velocity_of_the_last(primitive):
    middle, end = primitive.duration / 2, primitive.goal + [0.05, -0.04, 0.06]
    middle = STEP * round(middle / STEP)
    loop = Loop(
        primitive,
        goal=lambda t: primitive.goal if t < middle - STEP / 2 else end,
        number=lambda t: 1 if t < middle - STEP / 2 else 2,
    )
    taken = loop.run(middle + 1.5 * primitive.duration)
    first = primitive.rollout(STEP)
    turn = round(middle / STEP)
    np.testing.assert_allclose(
        taken["position"][: turn + 1], first.positions[: turn + 1], atol=1e-12
    )
    second = primitive.rollout(
        STEP,
        start=first.positions[turn],
        start_velocity=first.velocities[turn],
        goal=end,
        settle=0.5,
    )
    count = min(len(second.times), len(taken["position"]) - turn)
    np.testing.assert_allclose(
        taken["position"][turn : turn + count], second.positions[:count], atol=1e-9
    )
    turns = taken["orientation"]
    steps = np.linalg.norm(np.diff(turns, axis=0), axis=1)
    assert steps[turn - 1 : turn + 2].max() < 1.5 * steps[turn - 3 : turn - 1].max() + 1e-6


def test_a_primitive_at_the_port_takes_the_place_of_the_systems_own(primitive, unscaled):
    wanted = Loop(unscaled).run(1.0)
    given = Loop(primitive, performed=unscaled, goal=lambda t: unscaled.goal).run(1.0)
    for name in ("position", "orientation"):
        np.testing.assert_allclose(given[name], wanted[name], atol=1e-12)


def test_next_state_follows_every_input_that_it_is_declared_to_follow(unscaled, ports):

    def make(system, first, second, read=None):
        changed = ports(system, read or {}).changes(first, second)
        assert changed <= ports(system).feedthrough()
        return changed

    one, three = [0.9], np.ones(3)
    first = {
        "movement": moving(unscaled),
        "phase": one,
        "phase_velocity": [-2.0],
        "tau": [1.5],
        "goal_position": 0.3 * three,
        "start_position": 0 * three,
        "goal_velocity": 0 * three,
        "coupling": 0 * three,
    }
    second = {
        "movement": moving(unscaled, 0),
        "phase": [0.5],
        "phase_velocity": [-3.0],
        "tau": [2.0],
        "goal_position": 0.5 * three,
        "start_position": three,
        "goal_velocity": 0.1 * three,
        "coupling": three,
    }
    changed = make(TransformationSystem(unscaled), first, second)
    for name in set(first) - {"start_position"}:
        assert (name, "next_position") in changed
    q = so3.exp_map([0.1, 0.2, 0.3])
    rotation = {name: first[name] for name in ("movement", "phase", "phase_velocity", "tau")}
    turned = {name: second[name] for name in rotation}
    changed = make(
        OrientationTransformationSystem(unscaled),
        rotation | {"goal_orientation": [1.0, 0, 0, 0], "start_orientation": [1.0, 0, 0, 0]},
        turned | {"goal_orientation": q, "start_orientation": q},
    )
    assert ("phase", "next_orientation") in changed
    canonical = {"movement": moving(unscaled), "goal_position": three, "slowdown": [0.0]}
    changed = make(
        CanonicalSystem(unscaled),
        canonical,
        {"movement": moving(unscaled, 0), "goal_position": 0 * three, "slowdown": [1.0]},
    )
    assert changed == {("movement", "phase_velocity"), ("slowdown", "phase_velocity")}


def test_slowdown_divides_the_phases_velocity(primitive):
    system = CanonicalSystem(primitive)
    context = system.CreateDefaultContext()
    system.movement_port.FixValue(context, moving(primitive))
    free = system.phase_velocity_port.Eval(context)[0]
    system.slowdown_port.FixValue(context, [3.0])
    assert free == pytest.approx(-primitive.translation.alpha_x / primitive.duration)
    assert system.phase_velocity_port.Eval(context)[0] == pytest.approx(free / 4)


def test_long_after_the_motion_nothing_is_undefined(primitive):
    loop = Loop(primitive)
    context = loop.canonical.GetMyMutableContextFromRoot(loop.simulator.get_mutable_context())
    loop.simulator.Initialize()
    values = context.get_discrete_state_vector().CopyToVector()
    for phase in (1e-320, 0.0):
        values[0] = phase
        context.SetDiscreteState(values)
        loop.simulator.AdvanceTo(loop.simulator.get_context().get_time() + 0.05)
        found = loop.translation.GetMyContextFromRoot(loop.simulator.get_context())
        assert np.isfinite(loop.translation.next_position_port.Eval(found)).all()


def test_an_orientation_is_needed_for_the_orientation_system():
    t = np.arange(20) * 0.1
    line = np.outer(0.1 * t, [1, 1, 1])
    bare = MovementPrimitive.fit(Demonstration.from_positions(t, line))
    with pytest.raises(InputError, match="no orientation"):
        OrientationTransformationSystem(bare)
