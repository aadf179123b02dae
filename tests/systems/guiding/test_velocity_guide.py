import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator

from pepper_drake.systems.guiding.velocity_guide import GuideLimits, VelocityGuide, step_guide

X_TH = RigidTransform(RollPitchYaw(0.1, 0.2, -0.3), [0.2, -0.2, 0.0])
X_WT = RigidTransform(RotationMatrix.MakeZRotation(np.pi / 2), [1.0, 0.0, 0.8])
LEASH = GuideLimits(distance=0.05, angle=0.5)


def test_a_step_by_hand():
    X_TG = step_guide(X_TH, np.array([0, 0, 1.0, 0.1, 0, 0]), X_TH, 0.1, LEASH)
    np.testing.assert_allclose(X_TG.translation(), [0.21, -0.2, 0.0], atol=1e-12)
    expected = RotationMatrix.MakeZRotation(0.1) @ X_TH.rotation()
    np.testing.assert_allclose(X_TG.rotation().matrix(), expected.matrix(), atol=1e-12)


def test_the_leash_holds():
    X_TG = step_guide(X_TH, np.array([0, 5.0, 0, 0, 0, 3.0]), X_TH, 1.0, LEASH)
    np.testing.assert_allclose(X_TG.translation(), [0.2, -0.2, 0.05], atol=1e-12)
    turn = (X_TG.rotation() @ X_TH.rotation().inverse()).ToAngleAxis()
    # 5 rad about y is 2 pi - 5 the other way.
    assert turn.angle() == pytest.approx(0.5)
    np.testing.assert_allclose(turn.axis(), [0, -1, 0], atol=1e-9)


def advanced(command, time):
    guide = VelocityGuide(LEASH)
    simulator = Simulator(guide)
    context = simulator.get_mutable_context()
    guide.velocity_input.FixValue(context, command)
    guide.hand_pose_input.FixValue(context, X_TH)
    guide.torso_pose_input.FixValue(context, X_WT)
    before = RigidTransform(guide.guide_pose_output.Eval(context))  # Not a reference.
    simulator.AdvanceTo(time)
    return before, guide.guide_pose_output.Eval(context), guide.guide_velocity_output.Eval(context)


def test_the_guide_starts_at_the_hand_and_moves_in_the_axes_of_the_torso():
    before, after, velocity = advanced(np.array([0, 0, 0, 0.1, 0, 0]), 0.195)
    assert before.IsNearlyEqualTo(X_WT @ X_TH, 1e-12)
    # 20 steps of 1 mm along T's x axis, which is W's y axis.
    shift = after.translation() - before.translation()
    np.testing.assert_allclose(shift, [0, 0.02, 0], atol=1e-12)
    np.testing.assert_allclose(velocity.translational(), [0, 0.1, 0], atol=1e-12)
    np.testing.assert_allclose(velocity.rotational(), 0, atol=1e-9)


def test_at_the_end_of_its_leash_the_guide_rests():
    before, after, velocity = advanced(np.array([0, 0, 0, 0.1, 0, 0]), 1.0)
    np.testing.assert_allclose(after.translation() - before.translation(), [0, 0.05, 0], atol=1e-12)
    np.testing.assert_allclose(velocity.get_coeffs(), 0, atol=1e-9)
