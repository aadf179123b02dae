import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pepper_drake.systems.robot.measurement_guard import MeasurementGuard


class Rig:
    def __init__(self):
        self.guard = MeasurementGuard([5.0, 6.0], time_step=0.02)
        self.simulator = Simulator(self.guard)
        self.context = self.simulator.get_mutable_context()
        self.tick = 0

    def step(self, measured):
        self.guard.measured_input.FixValue(self.context, measured)
        self.simulator.AdvanceTo((self.tick + 0.5) * 0.02)
        self.tick += 1
        return self.read()

    def read(self):
        return [
            self.guard.GetOutputPort(name).Eval(self.context).tolist()
            for name in ("measured", "age", "missing")
        ]


def test_numbers_pass_as_they_are_and_are_new():
    rig = Rig()
    assert rig.step([1.0, 2.0]) == [[1.0, 2.0], [0.0], [-1.0]]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_replaced_by_the_last_and_grows_old(bad):
    rig = Rig()
    rig.step([1.0, 2.0])
    assert rig.step([1.5, bad]) == [[1.5, 2.0], [0.02], [1.0]]
    measured, age, missing = rig.step([1.6, bad])
    assert measured == [1.6, 2.0]
    assert age == [0.04]
    assert missing == [1.0]
    assert rig.step([1.7, 2.5]) == [[1.7, 2.5], [0.0], [-1.0]]


def test_no_number_passes_even_between_the_ticks_or_before_the_first():
    rig = Rig()
    rig.guard.measured_input.FixValue(rig.context, [np.nan, 3.0])
    assert rig.read()[0] == [5.0, 3.0]
    rig.step([1.0, 2.0])
    rig.guard.measured_input.FixValue(rig.context, [np.nan, np.nan])
    assert rig.read()[0] == [1.0, 2.0]


def test_a_number_that_cannot_be_counts_as_none():
    guard = MeasurementGuard([0.0, 0.0], lower=[-1.0, -2.0], upper=[1.0, 2.0])
    simulator = Simulator(guard)
    context = simulator.get_mutable_context()
    guard.measured_input.FixValue(context, [0.5, 1.9])
    simulator.AdvanceTo(0.01)
    guard.measured_input.FixValue(context, [0.6, 2.1])
    simulator.AdvanceTo(0.05)
    assert guard.GetOutputPort("measured").Eval(context).tolist() == [0.6, 1.9]
    assert guard.GetOutputPort("missing").Eval(context)[0] == 1
    assert guard.GetOutputPort("age").Eval(context)[0] > 0


def test_outputs_depend_on_what_is_declared(ports):
    guard = MeasurementGuard([0.0, 0.0])
    assert ports(guard).changes({"measured": [1.0, 2.0]}, {"measured": [3.0, 2.0]}) == {
        ("measured", "measured")
    }
