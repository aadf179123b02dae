import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator

from pepper_drake.systems.robot.reference_filter import ReferenceFilter, step_follower

LAW = {"time_constant": 0.2, "max_speed": 0.3, "time_step": 0.01}


def test_one_step_by_hand():
    # w = 0.02 / 0.2 = 0.1, v' = 4 / 0.2 * 0.1 = 2, so v = 0.02 and x = 0.0002 after 10 ms.
    state = step_follower(np.zeros(2), np.array([0.02]), **LAW)
    np.testing.assert_allclose(state, [0.0002, 0.02])


@given(st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_comes_to_the_target_without_overshoot_or_excess_speed(target):
    target = np.array(target)
    # At most 3.5 m at 0.3 m/s, and 20 time constants to come to rest.
    states = np.zeros((1 + int((np.linalg.norm(target) / 0.3 + 4.0) / 0.01), 6))
    for before, after in itertools.pairwise(states):
        after[:] = step_follower(before, target, **LAW)
    distances = np.linalg.norm(states[1:, :3] - target, axis=1)
    assert distances[-1] < 1e-6
    assert np.linalg.norm(states[:, 3:], axis=1).max() <= 0.3 + 1e-12
    assert np.all(np.diff(distances) <= 1e-9)


def test_system_follows_a_jump_smoothly():
    follower = ReferenceFilter(3)
    simulator = Simulator(follower)
    context = simulator.get_mutable_context()
    follower.target_input.FixValue(context, [0.0, 0.0, 0.0])
    simulator.AdvanceTo(0.1)
    follower.target_input.FixValue(context, [0.1, 0.0, -0.2])
    simulator.AdvanceTo(0.15)
    early = follower.desired_state_output.Eval(context)
    assert 0 < early[0] < 0.02
    simulator.AdvanceTo(3.0)
    state = follower.desired_state_output.Eval(context)
    assert state == pytest.approx([0.1, 0.0, -0.2, 0, 0, 0], abs=1e-4)
    assert not follower.HasAnyDirectFeedthrough()
