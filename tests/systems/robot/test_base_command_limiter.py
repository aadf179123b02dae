"""Whatever asks for it, the base is no faster than it needs to be, and brakes when it has to."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator

from pepper_drake.systems.robot.base_command_limiter import (
    BaseCommandLimiter,
    largest_base_velocity,
    limit_base_command,
)
from pepper_drake.systems.robot.base_position_controller import BaseMotion

MOTION = BaseMotion()
PERIOD = 0.02
GOAL, NO_GOAL = [1.0, 0.0, 0.0], [np.nan] * 3

anything = st.floats(allow_nan=True, allow_infinity=True)


class Rig:
    """A limiter whose inputs a test sets before each tick."""

    def __init__(self):
        self.system = BaseCommandLimiter(MOTION, time_step=PERIOD)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.set(base_goal=GOAL, started=[0.0], stop=[0.0], base_velocity_command=np.zeros(3))
        self.simulator.Initialize()
        self.ticks = 0

    def set(self, **values):
        for name, value in values.items():
            self.system.GetInputPort(name).FixValue(self.context, value)
        return self

    def send(self, command):
        """The command that passes in place of one, and one period goes by."""
        self.set(base_velocity_command=command)
        passed = self.system.GetOutputPort("safe_base_velocity_command").Eval(self.context).copy()
        self.ticks += 1
        self.simulator.AdvanceTo((self.ticks + 0.5) * PERIOD)
        return passed


FASTEST = np.array(
    [
        MOTION.speed + MOTION.correction * MOTION.held_distance,
        MOTION.turning_speed + MOTION.correction * MOTION.held_angle,
    ]
)
RISE = 2.0 * PERIOD * np.array([MOTION.acceleration, MOTION.turning_acceleration])


@given(
    st.lists(anything, min_size=3, max_size=3),
    st.lists(st.floats(0.0, 2.0), min_size=2, max_size=2).map(np.array),
    st.booleans(),
    st.booleans(),
)
def test_no_command_exceeds_its_limits(command, before, stands, brakes):
    largest = largest_base_velocity(MOTION, before, PERIOD, stands=stands, brakes=brakes)
    passed = limit_base_command(np.array(command), largest)
    assert np.isfinite(passed).all()
    speeds = np.array([np.hypot(*passed[:2]), abs(passed[2])])
    assert (speeds <= largest * (1 + 1e-12)).all()
    assert (largest <= np.minimum(FASTEST, before + RISE)).all()
    if brakes:
        assert (largest <= np.maximum(before - 0.49 * RISE, 0.0)).all()


def at_speed(rig, command, ticks=60):
    """Asks for a command until it passes."""
    for _ in range(ticks):
        passed = rig.send(command)
    return passed


def test_what_a_drive_asks_for_passes_unchanged_in_the_same_tick():
    """The reference's velocity as it rises and turns, and the feedback of a base not held."""
    rig = Rig()
    for k in range(120):
        angle = 0.3 * k
        speed = min(1.9 * MOTION.acceleration * PERIOD * (k + 1), FASTEST[0])
        command = np.array([speed * np.cos(angle), speed * np.sin(angle), -0.02 * min(k, 50)])
        np.testing.assert_allclose(rig.send(command), command, atol=1e-12)


def test_a_command_that_jumps_is_reached_as_fast_as_a_drive_may_rise():
    np.testing.assert_allclose(Rig().send([0.35, 0.0, 1.0]), [RISE[0], 0.0, RISE[1]])


def test_too_fast_a_command_keeps_its_direction():
    passed = at_speed(Rig(), [30.0, 40.0, 5.0])
    np.testing.assert_allclose(passed[:2], FASTEST[0] * np.array([0.6, 0.8]))
    assert passed[2] == FASTEST[1]


def test_once_the_arm_has_started_the_base_moves_the_hand_by_50_mm_a_second_at_most():
    passed = at_speed(Rig().set(started=[1.0]), [1e3, -1e3, 1e3])
    assert 0.04 < np.hypot(*passed[:2]) + 0.6 * passed[2] <= 0.05


@pytest.mark.parametrize("cause", [{"stop": [3.0]}, {"base_goal": NO_GOAL}])
def test_a_base_without_goal_or_stopped_brakes_and_stays(cause):
    rig = Rig()
    fastest = at_speed(rig, [1e3, 0.0, 1e3])
    rig.set(**cause)
    sent = np.array([fastest, *(rig.send([1e3, 0.0, 1e3]) for _ in range(200))])
    # As the driver's own reference brakes.
    rates = np.diff(sent, axis=0)[:20] / PERIOD
    np.testing.assert_allclose(rates[:, 0], -MOTION.acceleration)
    np.testing.assert_allclose(rates[:, 2], -MOTION.turning_acceleration)
    np.testing.assert_array_equal(sent[-1], 0.0)
    # A base at rest is not set in motion.
    still = Rig().set(**cause)
    np.testing.assert_array_equal([still.send([1.0, 1.0, 1.0]) for _ in range(3)], 0.0)


def test_after_a_stop_it_may_drive_again():
    rig = Rig().set(stop=[1.0])
    np.testing.assert_array_equal(rig.send([0.2, 0.0, 0.0]), 0.0)
    rig.set(stop=[0.0])
    np.testing.assert_array_equal(at_speed(rig, [0.2, 0.0, 0.0]), [0.2, 0.0, 0.0])
