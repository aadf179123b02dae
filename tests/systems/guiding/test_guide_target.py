import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.systems.guiding.guide_target import GuideTarget, velocity_to

LIMITS = {"time_constant": 0.1, "max_speed": 0.5, "max_turn_rate": 2.0}


def test_velocity_is_the_error_over_the_time_constant():
    X_TG = RigidTransform([0.1, 0.0, 0.0])
    X_TGd = RigidTransform(RotationMatrix.MakeZRotation(0.1), [0.1, 0.02, 0.0])
    velocity = velocity_to(X_TG, X_TGd, **LIMITS)
    assert velocity == pytest.approx([0, 0, 1.0, 0, 0.2, 0])


def test_velocity_is_limited_and_keeps_its_direction():
    X_TGd = RigidTransform(RotationMatrix.MakeXRotation(-3.0), [3.0, 4.0, 0.0])
    velocity = velocity_to(RigidTransform(), X_TGd, **LIMITS)
    assert velocity == pytest.approx([-2.0, 0, 0, 0.3, 0.4, 0])


def test_targets_are_in_the_torso_frame_and_a_pad_comes_first():
    system = GuideTarget(**LIMITS)
    context = system.CreateDefaultContext()
    X_WT = RigidTransform(RotationMatrix.MakeZRotation(np.pi / 2), [1.0, 2.0, 0.8])
    X_TG = RigidTransform([0.3, 0.0, 0.0])
    system.torso_pose_input.FixValue(context, X_WT)
    system.guide_pose_input.FixValue(context, X_WT @ X_TG)
    system.target_pose_input.FixValue(context, RigidTransform([0.32, 0.0, 0.0]))
    assert system.velocity_output.Eval(context) == pytest.approx([0, 0, 0, 0.2, 0, 0])
    system.velocity_input.FixValue(context, [0, 0, 0, 0, -0.1, 0])
    assert system.velocity_output.Eval(context) == pytest.approx([0, 0, 0, 0, -0.1, 0])
    system.velocity_input.FixValue(context, np.zeros(6))
    assert system.velocity_output.Eval(context) == pytest.approx([0, 0, 0, 0.2, 0, 0])
