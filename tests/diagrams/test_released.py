"""Diagrams that nobody uses any more are gone, with all their systems and threads."""

import gc
import threading
import time
import weakref
from functools import partial

import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, SystemBase

from pepper_drake.diagrams.factory import make_coupling, make_primitive, prepare_scene
from pepper_drake.diagrams.live_teaching import LiveTeaching
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.reproduction import Reproduction
from pepper_drake.diagrams.reproduction_simulation import start_positions
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.diagrams.teaching import Teaching
from pepper_drake.models.scene import SCENES_DIR, load_scene
from pepper_drake.systems.framework import Diagram, LeafSystem, ValueProducer, build, build_into


def reaching():
    scene = prepare_scene(load_scene("table"))
    station = StationConfig(goal_motion_port=False)
    primitive = make_primitive(None, scene.arm)
    return Reaching(scene, primitive, make_coupling("report"), ReachingConfig(station=station))


def live_teaching():
    scene = load_scene(SCENES_DIR / "teach.yaml")
    return LiveTeaching(
        scene,
        make_primitive(None, scene.arm),
        make_coupling(scene.coupling),
        config=ReachingConfig(station=StationConfig(cameras=False)),
    )


def teaching():
    return Teaching("right", load_scene("table").robot.positions())


def reproduction():
    primitive = make_primitive(None, "right")
    positions = start_positions(primitive, "right")
    return Reproduction(primitive, arm="right", positions=positions)


OTHERS = set()
"""Threads of renderers that other tests of this process still use."""


@pytest.fixture(autouse=True)
def _others():
    gc.collect()
    OTHERS.clear()
    OTHERS.update(renderers())


def renderers():
    alive = (thread for thread in threading.enumerate() if thread.name.startswith("renderer"))
    return [thread for thread in alive if thread not in OTHERS]


def systems():
    """All of our own systems that are there."""
    gc.collect()
    end = time.monotonic() + 20
    while renderers() and time.monotonic() < end:
        time.sleep(0.05)  # A list of all objects would keep from them what they are to free.
    assert not renderers()
    gc.collect()
    gc.collect()
    ours = (o for o in gc.get_objects() if isinstance(o, SystemBase))
    return {id(o): type(o).__name__ for o in ours if type(o).__module__.startswith("pepper_drake")}


@pytest.mark.parametrize("make", [reaching, live_teaching, teaching, reproduction])
def test_a_diagram_goes_with_all_its_systems(make):
    before = systems()
    diagram = make()
    assert type(diagram).__module__.startswith("pepper_drake")
    diagram.CreateDefaultContext()
    del diagram
    gc.collect()
    assert {name for key, name in systems().items() if key not in before} == set()


@pytest.mark.render
def test_a_simulated_reach_takes_its_renderer_with_it():
    def run():
        diagram = reaching()
        simulator = Simulator(diagram)
        simulator.Initialize()
        diagram.station.renderer.wait_until_ready()
        simulator.AdvanceTo(0.1)

    run()  # Starts what is shared by all reaches.
    systems()
    before = threading.active_count()
    run()
    systems()
    assert threading.active_count() == before


def _add(ports, context, out):
    out.SetFromVector(sum(port.Eval(context) for port in ports))


class Everything(LeafSystem):
    """Declares all that Drake calls back."""

    def __init__(self):
        super().__init__()
        self.input = self.DeclareVectorInputPort("u", 1)
        index = self.DeclareDiscreteState(1)
        self.entry = self.DeclareCacheEntry(
            "entry",
            ValueProducer(allocate=lambda: Value({}), calc=self._calc),
            prerequisites_of_calc={self.input.ticket()},
        )
        self.method = self.DeclareVectorOutputPort("y", 1, self._output, {self.input.ticket()})
        self.closure = self.DeclareVectorOutputPort(
            "z", 1, lambda context, out: self._output(context, out), {self.input.ticket()}
        )
        self.partial = self.DeclareVectorOutputPort(
            "twice", 1, partial(Everything._output, self), {self.input.ticket()}
        )
        self.sum = self.DeclareVectorOutputPort(
            "sum", 1, partial(_add, [self.input, self.input]), {self.input.ticket()}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(0.1, 0.0, self._update)
        self.DeclareInitializationDiscreteUpdateEvent(self._update)
        self.state = self.DeclareStateOutputPort("x", index)

    def _calc(self, context, value):
        value.set_value({})

    def _output(self, context, out):
        out.SetFromVector(2.0 * self.input.Eval(context))

    def _update(self, context, values):
        values.set_value(values.value() + 1.0)


def test_a_system_is_freed_whatever_it_declares():
    system = Everything()
    context = system.CreateDefaultContext()
    system.input.FixValue(context, [3.0])
    assert system.method.Eval(context) == [6.0]
    assert system.closure.Eval(context) == [6.0]
    assert system.partial.Eval(context) == [6.0]
    assert system.sum.Eval(context) == [6.0]
    gone = weakref.ref(system)
    del system, context
    gc.collect()
    assert gone() is None


def test_a_system_lives_as_long_as_its_diagram():
    builder = DiagramBuilder()
    system = builder.AddSystem(Everything())
    builder.ExportInput(system.input, "u")
    builder.ExportOutput(system.method, "y")
    diagram = build(builder)
    gone = weakref.ref(system)
    del system, builder
    gc.collect()
    simulator = Simulator(diagram)
    diagram.GetInputPort("u").FixValue(simulator.get_mutable_context(), [4.0])
    simulator.AdvanceTo(0.5)
    assert diagram.GetOutputPort("y").Eval(simulator.get_context()) == [8.0]
    assert gone() is not None
    del diagram, simulator
    gc.collect()
    gc.collect()
    assert gone() is None


class Remembering(LeafSystem):
    """Has something in its state."""

    def __init__(self, memory):
        super().__init__()
        self.DeclareAbstractState(Value(memory))


class Remembered:
    """Something in a state."""


class Outer(Diagram):
    """A diagram of it."""

    def __init__(self, memory):
        super().__init__()
        builder = DiagramBuilder()
        builder.AddSystem(Remembering(memory))
        build_into(builder, self)


@pytest.mark.parametrize("get", ["GetMyContextFromRoot", "GetMyMutableContextFromRoot"])
def test_a_root_context_that_was_asked_for_goes_with_its_simulator(get):
    diagram = Outer(Remembered())
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    assert getattr(diagram, get)(root) is root
    del diagram, simulator, root
    gc.collect()
    gc.collect()
    assert not [o for o in gc.get_objects() if isinstance(o, Remembered)]
