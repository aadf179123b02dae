import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import (
    ConstantVectorSource,
    LogVectorOutput,
    ZeroOrderHold,
)
from pydrake.systems.sensors import ImageDepth16U

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.systems.faults.fault import KINDS, SIGNALS, parse_fault
from pepper_drake.systems.faults.fault_injector import FaultInjector
from pepper_drake.systems.faults.fault_memory import Role
from pepper_drake.systems.faults.fault_set import FaultSet
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor


class Rig:
    """A signal that counts the ticks, and its fault."""

    def __init__(self, text, ports=None, **kwargs):
        self.fault = parse_fault(text)
        self.period = SIGNALS[self.fault.signal].period
        self.system = FaultInjector(
            self.fault, ports or {"value": (Role.VALUE, 3)}, seed=3, **kwargs
        )
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.names = list(ports or {"value": None})
        self.tick = 0

    def step(self, **values):
        """Sets what comes at this tick and returns what leaves after it."""
        for name, value in values.items():
            self.system.GetInputPort(name).FixValue(self.context, value)
        self.simulator.AdvanceTo((self.tick + 0.5) * self.period)
        self.tick += 1
        left = [self.system.GetOutputPort(name).Eval(self.context) for name in self.names]
        return left[0] if len(left) == 1 else left

    def run(self, ticks):
        return np.array([self.step(value=np.full(3, float(self.tick))) for _ in range(ticks)])


def test_nothing_changes_before_and_after_a_fault():
    for kind in ("off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent", "noisy"):
        rig = Rig(f"encoders:{kind}@0.2+0.2")
        values = rig.run(40)
        expected = np.arange(40.0)[:, None] * np.ones(3)
        np.testing.assert_array_equal(values[:10], expected[:10])
        np.testing.assert_array_equal(values[20:], expected[20:])
        assert not np.array_equal(values[10:20], expected[10:20]), kind


def test_a_signal_that_is_off_gives_no_numbers_or_the_neutral_value():
    assert np.isnan(Rig("encoders:off@0").run(3)).all()
    rig = Rig("actuators:off@0")
    rig.system.GetInputPort("neutral").FixValue(rig.context, [7.0, 8.0, 9.0])
    np.testing.assert_array_equal(rig.run(3), [[7.0, 8.0, 9.0]] * 3)


def test_a_stuck_signal_gives_the_value_of_its_start():
    assert set(Rig("encoders:stuck@0.1").run(30)[5:, 0]) == {5.0}


def test_one_element_of_those_named_is_stuck():
    values = Rig("encoders:stuck@0.1", elements=[1, 2]).run(30)
    changing = [len(set(column)) > 10 for column in values.T]
    assert changing[0]
    assert sum(changing) == 2


def test_a_slow_signal_has_a_fifth_of_the_values():
    values = Rig("encoders:slow@0").run(50)[:, 0]
    assert len(set(values)) == 10


def test_a_delayed_signal_is_late_by_its_delay():
    values = Rig("encoders:delayed@0.4").run(60)[:, 0]
    np.testing.assert_array_equal(values[30:], np.arange(25.0, 55.0))


def test_an_intermittent_signal_loses_half_of_its_values_and_the_seed_says_which():
    values = Rig("encoders:intermittent@0").run(400)[:, 0]
    assert 150 < len(set(values)) < 250
    assert (np.diff(values) >= 0).all()
    np.testing.assert_array_equal(values, Rig("encoders:intermittent@0").run(400)[:, 0])


def test_noise_and_offset_have_the_size_that_the_table_says():
    values = Rig("encoders:noisy@0").run(400) - np.arange(400.0)[:, None]
    assert values.std() == pytest.approx(SIGNALS["encoders"].noise, rel=0.1)
    values = Rig("encoders:wrong@0").run(50) - np.arange(50.0)[:, None]
    np.testing.assert_allclose(np.abs(values), SIGNALS["encoders"].offset)
    assert np.ptp(values, axis=0).max() < 1e-9, "an offset stays"


def test_a_fault_may_begin_with_the_arm():
    rig = Rig("encoders:off@reach+0.1")
    rig.system.GetInputPort("trigger").FixValue(rig.context, [0.0])
    assert np.isfinite(rig.run(20)).all()
    rig.system.GetInputPort("trigger").FixValue(rig.context, [1.0])
    values = rig.run(20)
    assert np.isnan(values[:5]).all()
    assert np.isfinite(values[5:]).all()


FRAME = {
    "image": (Role.VALUE, Value(ImageDepth16U(4, 3))),
    "X_WC": (Role.CARRIED, Value(RigidTransform())),
    "time_stamp": (Role.STAMP, 1),
}


def frame(number):
    image = ImageDepth16U(4, 3)
    image.mutable_data[:] = 1000 + number
    return {
        "image": Value(image),
        "X_WC": Value(RigidTransform([number, 0, 0])),
        "time_stamp": [0.2 * number],
    }


def frames(text, ticks=80):
    """Frames of a new image every fourth tick: (pixel, x of the pose, stamp)."""
    rig, seen = Rig(text, FRAME), []
    for tick in range(ticks):
        image, X_WC, stamp = rig.step(**frame(tick // 4))
        pixel = int(image.data[0, 0, 0]) if image.size() else -1
        seen.append((pixel, X_WC.translation()[0], float(stamp[0])))
    return np.array(seen)


def test_a_frozen_image_has_stamps_and_poses_that_go_on():
    seen = frames("depth:stuck@1")
    assert set(seen[20:, 0]) == {1005.0}
    assert len(set(seen[20:, 1])) == len(set(seen[20:, 2])) == 15


@pytest.mark.parametrize("kind", ["off", "slow", "delayed", "intermittent"])
def test_image_pose_and_stamp_stay_together(kind):
    seen = frames(f"depth:{kind}@1")
    np.testing.assert_allclose(seen[:, 0] - 1000, seen[:, 1])
    np.testing.assert_allclose(0.2 * seen[:, 1], seen[:, 2])
    late = np.arange(80) // 4 - seen[:, 1]
    if kind == "off":
        assert set(seen[20:, 1]) == {5.0}
    elif kind == "delayed":
        assert set(late[24:]) == {5.0}
    else:
        assert 1 < late.max() <= 12


def test_garbage_images_are_of_three_sorts():
    sorts = set()
    for seed in range(12):
        system = FaultInjector(parse_fault("depth:garbage@0"), FRAME, seed=seed)
        simulator = Simulator(system)
        for name, value in frame(1).items():
            system.GetInputPort(name).FixValue(simulator.get_mutable_context(), value)
        simulator.AdvanceTo(0.1)
        pixels = system.GetOutputPort("image").Eval(simulator.get_context()).data
        sorts.add(int(pixels.flat[0]) if len(set(pixels.flat)) == 1 else -1)
    assert sorts == {0, 65535, -1}


def test_a_goal_that_is_off_is_not_valid_and_grows_old():
    ports = {
        "object_pose": (Role.VALUE, Value(RigidTransform())),
        "valid": (Role.VALID, 1),
        "age": (Role.AGE, 1),
    }
    rig = Rig("goal:off@0.5", ports)
    for tick in range(30):
        X_WO, valid, age = rig.step(
            object_pose=Value(RigidTransform([tick, 0, 0])), valid=[1.0], age=[0.1]
        )
    assert X_WO.translation()[0] == 10
    assert valid[0] == 0.0
    assert age[0] == pytest.approx(0.1 + 0.95)


@pytest.mark.parametrize("kind", ["garbage", "wrong", "noisy"])
def test_poses_and_clouds_keep_their_type_and_size(kind):
    cloud = PointCloud(5)
    cloud.mutable_xyzs()[:] = 0.5
    for text, value in (("goal", RigidTransform()), ("cloud", cloud)):
        rig = Rig(f"{text}:{kind}@0", {"value": (Role.VALUE, Value(value))})
        result = rig.step(value=Value(value))
        assert isinstance(result, type(value))
        if text == "cloud":
            assert result.size() == 5
            assert not np.allclose(result.xyzs(), 0.5)
            np.testing.assert_array_equal(cloud.xyzs(), np.full((3, 5), 0.5))
        else:
            assert not np.allclose(result.translation(), 0.0)


def test_a_clone_goes_on_like_the_original():
    rig = Rig("encoders:delayed@0")
    rig.run(20)
    clone = rig.context.Clone()
    port = rig.system.GetOutputPort("value")
    np.testing.assert_array_equal(port.Eval(clone), port.Eval(rig.context))


def test_only_the_signal_with_a_fault_is_tapped():
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource([1.0, 2.0]))
    port = source.get_output_port()
    faults = FaultSet((parse_fault("encoders:off@0"),))
    same = faults.tap(builder, "base_pose", {"pose": (Role.VALUE, port)})
    assert same["pose"] is port
    tapped = faults.tap(builder, "encoders", {"position": (Role.VALUE, port)})
    builder.ExportOutput(tapped["position"], "position")
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.1)
    output = simulator.get_system().GetOutputPort("position").Eval(simulator.get_context())
    assert np.isnan(output).all()


def test_outputs_depend_on_what_is_declared(ports):
    system = FaultInjector(parse_fault("encoders:wrong@5"), {"value": (Role.VALUE, 2)})
    changed = ports(system).changes(
        {"value": [1.0, 2.0], "neutral": [0.0, 0.0]}, {"value": [3.0, 2.0], "neutral": [1.0, 1.0]}
    )
    assert changed == {("value", "value")}


class Wishes(LeafSystem):
    """A sequence of commands (N, n), the next one at each tick, as a controller gives them."""

    def __init__(self, commands):
        super().__init__()
        self._commands = commands
        self._tick = self.DeclareDiscreteState(1)
        self.DeclareVectorOutputPort(
            "command",
            commands.shape[1],
            self._calc,
            prerequisites_of_calc={self.discrete_state_ticket(self._tick)},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(0.02, 0.0, self._update)

    def _update(self, context, discrete_state):
        tick = context.get_discrete_state(self._tick).value()[0]
        discrete_state.set_value(self._tick, [tick + 1])

    def _calc(self, context, output):
        tick = int(context.get_discrete_state(self._tick).value()[0])
        output.SetFromVector(self._commands[min(tick, len(self._commands) - 1)])


@pytest.mark.parametrize("kind", sorted(set(KINDS)))
def test_no_fault_of_the_commands_gets_past_the_limiter(kind):
    """Commands of an arm that starts and turns, spoilt on their way to the safety monitor."""
    limits = shared_control_model().command_limits(arm_joints("right"))
    start = np.array([1.0, -0.5, 0.5, 0.8, 0.1])
    times = np.arange(0.0, 3.01, 0.02)
    path = start + 0.4 * np.sin(1.5 * times)[:, None] ** 2 * np.array([1, -0.5, 1, 0.5, 1])
    builder = DiagramBuilder()
    wishes = builder.AddSystem(Wishes(path))
    monitor = builder.AddSystem(SafetyMonitor(limits=limits, start_position=start, time_step=0.02))
    faults = FaultSet((parse_fault(f"commands:{kind}@0.3"),), seed=1)
    tapped = faults.tap(builder, "commands", {"position": (Role.VALUE, wishes.get_output_port())})
    builder.Connect(tapped["position"], monitor.command_input)
    measured = builder.AddSystem(ConstantVectorSource(start))
    builder.Connect(measured.get_output_port(), monitor.measured_input)
    port = monitor.GetOutputPort("safe_joint_position_command")
    command = builder.AddSystem(ZeroOrderHold(0.02, 5, 0.01))
    builder.Connect(port, command.get_input_port())
    # What the joints' own controllers take: the command in the middle of each period.
    log = LogVectorOutput(command.get_output_port(), builder, 0.02)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(2.9)
    commands = log.FindLog(simulator.get_context()).data().T[2:]
    velocity = np.diff(commands, axis=0) / 0.02
    acceleration = np.diff(velocity, axis=0) / 0.02
    assert np.isfinite(commands).all()
    assert np.abs(acceleration).max() <= limits.acceleration[0] + 1e-6
    assert (np.abs(velocity) <= limits.velocity + 1e-9).all()
    assert np.abs(np.diff(commands, axis=0)).max() > 0.0
