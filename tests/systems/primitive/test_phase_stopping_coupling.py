import numpy as np
from pydrake.systems.analysis import Simulator

from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.systems.primitive.phase_stopping_coupling import PhaseStoppingCoupling
from tests.systems.motion_example import moving

LAW = PhaseStopping(rate=10.0, slowdown_gain=1000.0, coupling_gain=200.0, dead_zone=0.0)


def test_follows_its_law_while_active_and_is_silent_else():
    system = PhaseStoppingCoupling(LAW)
    assert not system.HasAnyDirectFeedthrough()
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    np.testing.assert_array_equal(system.coupling_output.Eval(context), np.zeros(3))
    system.movement_input.FixValue(context, moving(None))
    system.desired_position_input.FixValue(context, [0.1, 0.0, 0.2])
    system.measured_position_input.FixValue(context, [0.1, 0.05, 0.2])
    simulator.AdvanceTo(0.195)  # 20 updates, the first at time zero.
    error = (1 - np.exp(-2.0)) * 0.05
    np.testing.assert_allclose(system.coupling_output.Eval(context), [0, 200 * error, 0])
    np.testing.assert_allclose(system.slowdown_output.Eval(context), [1000 * error**2])
    system.movement_input.FixValue(context, moving(None, 0))
    simulator.AdvanceTo(0.205)
    np.testing.assert_array_equal(system.coupling_output.Eval(context), np.zeros(3))
    np.testing.assert_array_equal(system.slowdown_output.Eval(context), [0.0])
