import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BusValue

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import POSTURES, hand_frame
from pepper_drake.planning.ik.differential_ik import (
    DifferentialIkParams,
    hand_key,
)
from pepper_drake.planning.ik.feedforward import feedforward_pose
from pepper_drake.systems.robot.arm_differential_ik import ArmDifferentialIk

PARAMS = DifferentialIkParams()


class Tracker:
    """Follows hand poses with the bare inverse kinematics, one tick at a time."""

    def __init__(self, arm):
        self.arm, self.model = arm, shared_control_model()
        self.system = ArmDifferentialIk(self.model, arm, PARAMS)
        self.context = self.system.CreateDefaultContext()
        self.plant_context = self.model.create_context()
        self.index = self.model.position_indices(arm_joints(arm))
        self.q = np.zeros(18)
        for name, angle in POSTURES["stand"].items():
            self.q[self.model.position_indices([name])] = angle
        self.nominal = self.q.copy()

    def hand(self):
        self.model.plant.SetPositions(self.plant_context, self.q)
        return self.model.pose(self.plant_context, hand_frame(self.arm), "torso")

    def step(self, X_TH):
        bus = BusValue()
        bus.Set(hand_key(self.arm), Value(X_TH))
        for port, value in (
            ("position", self.q[self.index]),
            ("nominal_posture", self.nominal[self.index]),
            ("desired_cartesian_poses", Value(bus)),
        ):
            self.system.GetInputPort(port).FixValue(self.context, value)
        velocity = self.system.get_output_port().Eval(self.context)
        self.q[self.index] += PARAMS.time_step * velocity
        return velocity


def minimum_jerk(s):
    s = np.clip(s, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


@pytest.mark.parametrize("arm", ["left", "right"])
def test_a_reachable_path_is_followed_without_lag(arm):
    tracker = Tracker(arm)
    start = tracker.hand()
    side = 1 if arm == "left" else -1
    goal = np.array([0.24, 0.2 * side, 0.0])
    rotation = start.rotation().ToQuaternion().wxyz()
    errors, before = [], start.translation()
    for time in np.arange(0, 3.5, PARAMS.time_step):
        p = start.translation() + minimum_jerk(time / 3) * (goal - start.translation())
        tracker.step(feedforward_pose(before, p, rotation, rotation, PARAMS.tracking_gain))
        before = p
        errors.append(np.linalg.norm(tracker.hand().translation() - p))
    # The nominal posture, kept at the start, bends the path by a fraction of a millimetre.
    assert max(errors) < 1e-3
    assert errors[-1] < 3e-4


@pytest.mark.parametrize("goal", [(0.6, -0.15, 0.1), (-0.05, -0.75, 0.1)], ids=["ahead", "aside"])
def test_beyond_reach_through_a_singular_pose_and_back_stays_inside_half_speed(goal):
    tracker = Tracker("right")
    start = tracker.hand()
    limits = tracker.model.command_limits(arm_joints("right"), speed_fraction=0.5)
    for time in np.arange(0, 8, PARAMS.time_step):
        s = minimum_jerk(time / 3) if time < 4 else 1 - minimum_jerk((time - 4) / 3)
        p = start.translation() + s * (np.array(goal) - start.translation())
        velocity = tracker.step(RigidTransform(start.rotation(), p))
        assert np.all(np.isfinite(velocity))
        assert np.all(np.abs(velocity) <= limits.velocity * (1 + 1e-3))
        q = tracker.q[tracker.index]
        assert np.all(q >= limits.position_lower - 1e-6)
        assert np.all(q <= limits.position_upper + 1e-6)
    np.testing.assert_allclose(tracker.hand().translation(), start.translation(), atol=1e-3)
