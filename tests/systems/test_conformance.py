"""Rules for every LeafSystem of the package, tried on those of the diagrams as they are wired.

In a context of its own, set as in the diagram, each input in turn gets another value. An output
may change only where the system declares that the input feeds through, and what is cached must be
what a context gives that never knew the first value. A cloned context goes on like the original.
"""

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BusValue, PortDataType
from pydrake.systems.framework import Diagram as DrakeDiagram

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.diagrams.live_teaching import LiveTeaching
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.reproduction import Reproduction
from pepper_drake.diagrams.reproduction_simulation import start_positions
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.diagrams.teaching import Teaching
from pepper_drake.models.scene import SCENES_DIR, load_scene
from pepper_drake.perception.mapping.cloud_points import make_cloud
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_mode import ReachCommand
from pepper_drake.planning.reach.task_sequence import SequenceTask
from pepper_drake.systems.robot.arm_command import ArmMode

X = RigidTransform(RollPitchYaw(0.1, -0.2, 0.3), [0.05, -0.04, 0.03])
MIRRORED = make_primitive(None, "left")


def reaching():
    scene = load_scene("free")
    primitive = make_primitive(None, scene.arm)
    config = ReachingConfig(tasks=(SequenceTask("return", primitive, returns=True),))
    return Reaching(scene, primitive, make_coupling("barrier"), config), {}


def live_teaching():
    scene = load_scene(SCENES_DIR / "teach.yaml")
    diagram = LiveTeaching(
        scene,
        make_primitive(None, scene.arm),
        make_coupling("barrier"),
        config=ReachingConfig(station=StationConfig(cameras=False)),
    )
    inputs = {
        "arm_mode": [float(ArmMode.LIMP)],
        "command": [float(ReachCommand.IDLE)],
        "guide_target": X,
        "guide_velocity": np.zeros(6),
        "joint_target": np.zeros(5),
        "reset": [0.0],
    }
    return diagram, inputs | {f"{name}.target": np.full(3, 0.01) for name in diagram.movables}


def reproduction():
    primitive = make_primitive(None, "right")
    diagram = Reproduction(primitive, arm="right", positions=start_positions(primitive, "right"))
    movement = Value[object](Movement(primitive, make_coupling("barrier"), id=1))
    return diagram, {"movement": movement, "goal_pose": X, "push": np.zeros(6)}


def teaching():
    diagram = Teaching("right", load_scene("table").robot.positions())
    return diagram, {"guide_pose": X, "guide_velocity": SpatialVelocity.Zero()}


DIAGRAMS = {make.__name__: make for make in (reaching, live_teaching, reproduction, teaching)}


def leaves(diagram, path=""):
    """The package's own leaf systems in a diagram, by path."""
    for system in diagram.GetSystems():
        name = f"{path}/{system.get_name()}"
        if isinstance(system, DrakeDiagram):
            yield from leaves(system, name)
        elif type(system).__module__.startswith("pepper_drake"):
            yield name, system


def plain(value):
    """A port's value as something that compares with ==; None where that cannot be told."""
    if isinstance(value, RigidTransform):
        return value.GetAsMatrix34().tolist()
    if isinstance(value, np.ndarray):
        return np.nan_to_num(value, nan=-1e9, posinf=1e12, neginf=-1e12).tolist()
    if isinstance(value, PointCloud):
        return np.array(value.xyzs()).tolist()
    if isinstance(value, SpatialVelocity):
        return value.get_coeffs().tolist()
    if isinstance(value, list) and value and isinstance(value[0], ExternallyAppliedSpatialForce):
        return [one.F_Bq_W.get_coeffs().tolist() for one in value]
    if isinstance(value, BusValue):
        return plain(value.Find("pepper::r_hand_effector"))
    if isinstance(value, Movement):
        return (value.id, id(value.primitive), value.X_OG.GetAsMatrix34().tolist())
    return None


def other(value):
    """Another value of the same type, or None where there is none to try."""
    if isinstance(value, np.ndarray):
        if np.array_equal(value, np.round(value)) and value.size == 1:
            return 1.0 - np.clip(value, 0.0, 1.0)  # A flag, or a number of something.
        return value + np.linspace(0.01, 0.02, value.size)
    if isinstance(value, RigidTransform):
        return value @ X
    if isinstance(value, PointCloud):
        return make_cloud(np.array([[0.3, -0.2, 0.1], [0.31, -0.2, 0.1]]))
    if isinstance(value, SpatialVelocity):
        return SpatialVelocity(w=[0.1, 0, 0], v=[0, 0.1, 0])
    if isinstance(value, Movement):
        return Movement(MIRRORED, None, value.X_OG @ X, id=value.id + 1)
    if isinstance(value, list) and value and isinstance(value[0], RigidTransform):
        return [one @ X for one in value]
    return None


def fix(port, context, value):
    abstract = port.get_data_type() == PortDataType.kAbstractValued
    if abstract and not isinstance(value, AbstractValue):
        value = Value[object](value) if isinstance(value, Movement) else Value(value)
    port.FixValue(context, value)


class Alone:
    """A leaf system with the inputs and the state that it has in its diagram."""

    def __init__(self, system, root):
        self.system = system
        self._theirs = system.GetMyContextFromRoot(root)
        self.inputs = {}
        for k in range(system.num_input_ports()):
            port = system.get_input_port(k)
            if port.HasValue(self._theirs):
                value = port.Eval(self._theirs)
                self.inputs[port.get_name()] = np.array(value) if self._is_vector(port) else value

    @staticmethod
    def _is_vector(port):
        return port.get_data_type() == PortDataType.kVectorValued

    def context(self, **changed):
        context = self.system.CreateDefaultContext()
        context.SetTimeStateAndParametersFrom(self._theirs)
        for name, value in (self.inputs | changed).items():
            fix(self.system.GetInputPort(name), context, value)
        return context

    def outputs(self, context):
        ports = [self.system.get_output_port(k) for k in range(self.system.num_output_ports())]
        return {port.get_name(): plain(port.Eval(context)) for port in ports}

    def feeds_through(self, name):
        source = self.system.GetInputPort(name).get_index()
        ports = [self.system.get_output_port(k) for k in range(self.system.num_output_ports())]
        return {
            port.get_name()
            for port in ports
            if self.system.HasDirectFeedthrough(source, port.get_index())
        }


def check_declared(name, alone):
    before = alone.outputs(alone.context())
    tried = 0
    for port, value in alone.inputs.items():
        changed = other(value)
        if changed is None:
            continue
        tried += 1
        used = alone.context()
        alone.outputs(used)
        fix(alone.system.GetInputPort(port), used, changed)
        after = alone.outputs(alone.context(**{port: changed}))
        assert alone.outputs(used) == after, f"{name}: stale after {port} changed"
        follows = {output for output in after if after[output] != before[output]}
        assert follows <= alone.feeds_through(port), f"{name}: undeclared, from {port}"
    return tried


def check_clone(name, alone):
    context = alone.context()
    alone.outputs(context)  # What is cached is cloned, too.
    clone = context.Clone()
    found = []
    for one in (context, clone):
        simulator = Simulator(alone.system, one)
        simulator.AdvanceTo(one.get_time() + 0.11)
        found.append(alone.outputs(one))
    assert found[0] == found[1], f"{name}: a clone goes another way"


@pytest.mark.parametrize("make", DIAGRAMS.values(), ids=DIAGRAMS)
@pytest.mark.parametrize("is_initialised", [False, True])
def test_every_leaf_system_declares_what_it_reads_and_nothing_is_stale(make, is_initialised):
    diagram, inputs = make()
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    for port, value in inputs.items():
        fix(diagram.GetInputPort(port), root, value)
    if is_initialised:
        simulator.Initialize()
        if make is not reaching:  # Its cameras render as soon as time passes.
            simulator.AdvanceTo(0.3)
    tried = {}
    for name, system in leaves(diagram):
        alone = Alone(system, root)
        tried[name] = check_declared(name, alone)
        if "camera" not in name and "perception" not in name:
            check_clone(name, alone)
    assert sum(count > 0 for count in tried.values()) >= 6, tried
