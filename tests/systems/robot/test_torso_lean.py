import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pepper_drake.models.pepper import JOINT_GROUPS, posture_positions
from pepper_drake.systems.robot.torso_lean import LeanMotion, TorsoLean

START = posture_positions("stand", {})
HIP = JOINT_GROUPS["body"].index("HipPitch")
PERIOD = 0.02


class Rig:
    """A torso whose goal, base and stop are set by hand."""

    def __init__(self, goal=np.nan, arrived=1.0):
        self.system = TorsoLean(START, time_step=PERIOD)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.give(hip_pitch_goal=goal, base_arrived=arrived, stop=0.0)
        self.simulator.AdvanceTo(0.5 * PERIOD)  # Later, each period holds one update.

    def give(self, **values):
        for name, value in values.items():
            self.system.GetInputPort(name).FixValue(self.context, [value])

    def hip(self, duration):
        """Returns the hip's command at each tick of a duration [s]."""
        angles = []
        for _ in range(round(duration / PERIOD)):
            self.simulator.AdvanceTo(self.context.get_time() + PERIOD)
            command = self.system.GetOutputPort("body_command").Eval(self.context)
            angles.append(command[HIP])
        return np.array(angles)

    @property
    def arrived(self):
        return self.system.GetOutputPort("arrived").Eval(self.context)[0] == 1.0


def test_without_a_goal_the_body_stays_as_it_was():
    rig = Rig()
    assert set(rig.hip(0.5)) == {START["HipPitch"]}
    command = rig.system.GetOutputPort("body_command").Eval(rig.context)
    assert list(command) == [START[name] for name in JOINT_GROUPS["body"]]
    assert rig.arrived


def test_the_torso_leans_within_its_limits_and_arrives():
    rig, motion = Rig(goal=-0.3), LeanMotion()
    assert not rig.arrived
    angles = rig.hip(3.0)
    speed = np.diff(angles) / PERIOD
    change = np.diff(speed) / PERIOD
    assert np.abs(speed).max() == pytest.approx(motion.speed)
    assert np.abs(change).max() <= motion.acceleration * 1.001
    assert (speed <= 1e-12).all()
    assert angles[-1] == pytest.approx(-0.3, abs=1e-3)
    assert rig.arrived


def test_it_waits_for_the_base():
    rig = Rig(goal=-0.3, arrived=0.0)
    assert set(rig.hip(0.5)) == {START["HipPitch"]}
    assert not rig.arrived


def test_a_stop_brakes_within_the_limit_and_holds_until_it_is_over():
    rig, motion = Rig(goal=-0.3), LeanMotion()
    before = rig.hip(0.6)
    rig.give(stop=1.0)
    after = rig.hip(1.5)
    speed = np.diff(np.concatenate((before[-2:], after))) / PERIOD
    assert np.abs(np.diff(speed) / PERIOD).max() <= motion.acceleration * 1.001
    assert speed[-1] == 0.0
    assert after[-1] > -0.25
    assert not rig.arrived
    rig.give(stop=0.0)
    assert rig.hip(3.0)[-1] == pytest.approx(-0.3, abs=1e-3)
