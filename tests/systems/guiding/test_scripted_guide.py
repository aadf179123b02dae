import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.systems.guiding.scripted_guide import GuidePath, ScriptedGuide


def random_path(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 7))
    times = np.cumsum(rng.uniform(0.3, 0.8, count))
    rpy = np.cumsum(rng.uniform(-0.5, 0.5, (count, 3)), axis=0)
    poses = [RigidTransform(RollPitchYaw(a), rng.uniform(-0.3, 0.3, 3)) for a in rpy]
    return GuidePath(times, poses), times, poses


@given(st.integers(0, 2**32 - 1))
def test_path_passes_its_via_poses_and_rests_at_both_ends(seed):
    path, times, poses = random_path(seed)
    for time, X_WG in zip(times, poses, strict=True):
        assert path.pose(time).IsNearlyEqualTo(X_WG, 1e-9)
    assert path.pose(0.0).IsNearlyEqualTo(poses[0], 1e-9)
    assert path.pose(times[-1] + 9.0).IsNearlyEqualTo(poses[-1], 1e-9)
    for time in (0.0, times[0], times[-1], times[-1] + 1.0):
        np.testing.assert_allclose(path.velocity(time).get_coeffs(), 0.0, atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.99))
def test_velocity_is_the_derivative_of_the_pose(seed, part):
    path, times, _ = random_path(seed)
    time = times[0] + part * (times[-1] - times[0])
    step = 1e-6
    before, after = path.pose(time - step), path.pose(time + step)
    turn = (after.rotation() @ before.rotation().inverse()).ToAngleAxis()
    V = path.velocity(time)
    difference = (after.translation() - before.translation()) / (2 * step)
    np.testing.assert_allclose(V.translational(), difference, atol=1e-4)
    np.testing.assert_allclose(V.rotational(), turn.angle() * turn.axis() / (2 * step), atol=1e-4)


def test_system_plays_the_path():
    path, times, _ = random_path(1)
    guide = ScriptedGuide(path)
    context = guide.CreateDefaultContext()
    for time in (0.0, times[1] + 0.1):
        context.SetTime(time)
        assert guide.guide_pose_output.Eval(context).IsExactlyEqualTo(path.pose(time))
        V = guide.guide_velocity_output.Eval(context)
        np.testing.assert_array_equal(V.get_coeffs(), path.velocity(time).get_coeffs())
