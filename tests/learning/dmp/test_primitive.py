import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.dmp.scaling import SCALINGS
from tests.learning.conftest import distance, make_demonstration

vectors = st.tuples(*[st.floats(-0.3, 0.3)] * 3).map(np.array)


@pytest.fixture(scope="module")
def primitive(demonstration):
    return MovementPrimitive.fit(demonstration)


def reference_path(primitive, times, start, goal, velocity, tau):
    """Equations 2.4 and 2.5 integrated by another solver."""
    attractor = primitive.translation
    alpha_z, alpha_x = attractor.alpha_z, attractor.alpha_x
    forcing = attractor.forcing(start, goal)

    def rates(t, state):
        y, z = state[:3], state[3:]
        f = forcing(np.exp(-alpha_x * t / tau)[None])[0]
        return np.concatenate((z / tau, (alpha_z * (alpha_z / 4 * (goal - y) - z) + f) / tau))

    first = np.concatenate((start, velocity * tau))
    end = times[-1] + 1e-9
    return solve_ivp(rates, (0, end), first, t_eval=times, rtol=1e-10, atol=1e-12).y[:3].T


@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize(
    ("approximator", "position", "velocity"),
    [
        ("trajectory_slopes", 3e-6, 5e-4),
        ("trajectory", 5e-5, 7e-3),
        ("lwr_slopes", 1.2e-3, 1.5e-2),
        ("rbfn", 4e-4, 2e-2),
        ("lwr", 0.04, 0.3),
    ],
)
def test_gives_back_what_was_shown(approximator, position, velocity, moving):
    # Equation 4.1; bounds are 1.5 times what these motions reach, fast ones of 40 cm.
    for seed in range(3):
        demo = make_demonstration(seed=seed, moving=moving)
        path = MovementPrimitive.fit(demo, approximator=approximator).rollout()
        assert len(path.times) == len(demo.times)
        assert distance(path.positions, demo.positions) < position
        assert distance(path.velocities, demo.velocities) < velocity


def test_starts_and_ends_with_the_velocity_shown(demonstration, primitive):
    path = primitive.rollout()
    assert np.linalg.norm(demonstration.velocities[[0, -1]], axis=1).min() > 0.05
    np.testing.assert_allclose(path.velocities[0], demonstration.velocities[0], atol=1e-9)
    np.testing.assert_allclose(path.velocities[-1], demonstration.velocities[-1], atol=1e-3)


@pytest.mark.parametrize("scaling", SCALINGS)
def test_rollout_solves_the_equations(demonstration, scaling):
    primitive = MovementPrimitive.fit(demonstration, scaling=scaling)
    start, goal, tau = (
        primitive.start + np.array([0.05, -0.02, 0.1]),
        primitive.goal + np.array([-0.1, 0.2, 0.04]),
        3.3,
    )
    velocity = np.array([0.1, 0.0, -0.2])
    path = primitive.rollout(
        start=start, goal=goal, duration=tau, start_velocity=velocity, time_step=0.02
    )
    expected = reference_path(primitive, path.times, start, goal, velocity, tau)
    np.testing.assert_allclose(path.positions, expected, atol=1e-7)


def test_velocities_and_accelerations_are_derivatives_of_positions(primitive):
    path = primitive.rollout(time_step=0.001)
    h = 0.001
    p, v, a = path.positions, path.velocities, path.accelerations
    np.testing.assert_allclose((p[2:] - p[:-2]) / (2 * h), v[1:-1], atol=1e-3)
    np.testing.assert_allclose((v[2:] - v[:-2]) / (2 * h), a[1:-1], atol=2e-2)


@pytest.mark.parametrize("approximator", ["trajectory_slopes", "lwr", "gmr", "lwpr"])
@pytest.mark.parametrize("scaling", SCALINGS)
def test_the_time_step_does_not_change_the_motion(approximator, scaling):
    primitive = MovementPrimitive.fit(make_demonstration(2.0), approximator, 20, scaling)
    goal = primitive.goal + np.array([0.05, 0.1, -0.05])
    fine = primitive.rollout(time_step=0.001, goal=goal)
    for step in (5, 10, 20):
        coarse = primitive.rollout(time_step=0.001 * step, goal=goal)
        np.testing.assert_allclose(coarse.positions, fine.positions[::step], atol=1e-5)
        np.testing.assert_allclose(coarse.velocities, fine.velocities[::step], atol=1e-3)


@settings(max_examples=25)
@given(vectors, vectors, st.floats(0.5, 6.0), st.sampled_from(["gradual", "none", "amplitude"]))
def test_ends_at_any_goal_from_any_start(start, goal, duration, scaling):
    primitive = MovementPrimitive.fit(make_demonstration(seed=3), scaling=scaling)
    path = primitive.rollout(start=start, goal=goal, duration=duration, settle=1.0)
    assert np.linalg.norm(path.positions[-1] - goal) < 1e-3


@settings(max_examples=25)
@given(vectors, st.sampled_from(["goal", "rotation_dilation"]))
def test_ends_at_any_goal_with_scalings_that_grow_with_the_way(offset, scaling):
    demo = make_demonstration(seed=4, moving=False)
    primitive = MovementPrimitive.fit(demo, scaling=scaling)
    path = primitive.rollout(goal=primitive.goal + offset, settle=1.0)
    assert np.linalg.norm(path.positions[-1] - primitive.goal - offset) < 1e-3


@settings(max_examples=25)
@given(vectors)
def test_translating_start_and_goal_translates_the_path(offset):
    primitive = MovementPrimitive.fit(make_demonstration(seed=5))
    path = primitive.rollout()
    moved = primitive.rollout(start=primitive.start + offset, goal=primitive.goal + offset)
    np.testing.assert_allclose(moved.positions, path.positions + offset, atol=1e-10)


@settings(max_examples=25)
@given(vectors, st.floats(0.3, 2.0))
def test_rotation_dilation_turns_and_grows_the_path(axis, size):
    demo = make_demonstration(seed=6)
    primitive = MovementPrimitive.fit(demo, scaling="rotation_dilation")
    way = primitive.goal - primitive.start
    # Only turns at right angles to the way are determined by start and goal.
    axis = np.cross(way, axis + np.array([0.01, 0.02, 0.0]))
    turn = Rotation.from_rotvec(2.5 * axis / np.linalg.norm(axis)).as_matrix()
    goal = primitive.start + size * turn @ way
    path, turned = primitive.rollout(), primitive.rollout(goal=goal)
    expected = primitive.start + size * (path.positions - primitive.start) @ turn.T
    np.testing.assert_allclose(turned.positions, expected, atol=1e-9)


@settings(max_examples=25)
@given(st.floats(0.5, 3.0))
def test_another_duration_keeps_the_shape(factor):
    primitive = MovementPrimitive.fit(make_demonstration(seed=7))
    path = primitive.rollout(time_step=0.01)
    slow = primitive.rollout(time_step=0.01 * factor, duration=factor * primitive.duration)
    np.testing.assert_allclose(slow.positions, path.positions, atol=1e-9)
    np.testing.assert_allclose(slow.velocities * factor, path.velocities, atol=1e-9)


def test_goal_scaling_explodes_near_the_start_and_others_do_not():
    demo = make_demonstration(seed=8, moving=False)
    # The goal is 1 mm from the start in x; move it by 5 cm there.
    p = demo.positions - np.linspace(0, 1, len(demo.times))[:, None] * [
        demo.positions[-1, 0] - demo.positions[0, 0] - 0.001,
        0,
        0,
    ]
    near = Demonstration.from_positions(demo.times, p)
    reach = {}
    for scaling in ("goal", "none", "gradual"):
        primitive = MovementPrimitive.fit(near, scaling=scaling)
        path = primitive.rollout(goal=primitive.goal + np.array([0.05, 0, 0]))
        reach[scaling] = np.abs(path.positions[:, 0] - p[:, 0]).max()
    assert reach["goal"] > 1.0
    assert reach["none"] < 0.051
    assert reach["gradual"] < 0.051


def test_goal_scaling_mirrors_where_the_sign_changes_and_others_do_not():
    demo = make_demonstration(seed=9, moving=False)
    for scaling, mirrored in (("goal", True), ("none", False), ("gradual", False)):
        primitive = MovementPrimitive.fit(demo, scaling=scaling)
        way = primitive.goal - primitive.start
        path = primitive.rollout(goal=primitive.start - way)
        mirror = primitive.start - (primitive.rollout().positions - primitive.start)
        assert (np.abs(path.positions - mirror).max() < 1e-9) == mirrored


@settings(max_examples=25)
@given(vectors, vectors)
def test_the_default_starts_like_the_demonstration_wherever_it_goes(start, goal):
    primitive = MovementPrimitive.fit(make_demonstration(seed=13))
    path, other = primitive.rollout(), primitive.rollout(start=start, goal=goal)
    np.testing.assert_allclose(other.accelerations[0], path.accelerations[0], atol=1e-8)
    np.testing.assert_allclose(other.velocities[0], path.velocities[0], atol=1e-12)


@pytest.mark.parametrize(
    ("approximator", "tolerance"), [("trajectory_slopes", 5e-4), ("lwr", 8e-3)]
)
def test_demonstrations_to_several_goals_differ_by_what_gradual_expects(approximator, tolerance):
    demo = make_demonstration(seed=14)
    first = MovementPrimitive.fit(demo, approximator=approximator)
    paths = [first.rollout(goal=first.goal + np.array(way)) for way in ([0, 0.1, 0], [0, -0.1, 0])]
    shown = [
        Demonstration.from_positions(p.times, p.positions, p.velocities, p.accelerations)
        for p in paths
    ]
    both = MovementPrimitive.fit(shown, approximator=approximator)
    np.testing.assert_allclose(both.rollout().positions, first.rollout().positions, atol=tolerance)
    again = both.rollout(goal=paths[0].positions[-1])
    np.testing.assert_allclose(again.positions, paths[0].positions, atol=tolerance)


def test_uneven_times_are_learned_as_well():
    demo = make_demonstration(seed=10)
    keep = np.sort(np.random.default_rng(0).choice(len(demo.times), 180, replace=False))
    keep[0], keep[-1] = 0, len(demo.times) - 1
    uneven = Demonstration.from_positions(
        demo.times[keep], demo.positions[keep], demo.velocities[keep], demo.accelerations[keep]
    )
    path = MovementPrimitive.fit(uneven).rollout()
    assert distance(path.positions, demo.positions) < 1e-4


@pytest.mark.parametrize("approximator", ["trajectory_slopes", "trajectory", "lwr", "rbfn"])
def test_of_several_demonstrations_the_mean_is_learned(approximator):
    demo = make_demonstration(seed=11)
    up, down = demo.translated([0, 0, 0.05]), demo.translated([0, 0, -0.05])
    one = MovementPrimitive.fit(demo, approximator=approximator).rollout()
    primitive = MovementPrimitive.fit([up, down], approximator=approximator)
    np.testing.assert_allclose(primitive.rollout().positions, one.positions, atol=1e-5)


def test_several_demonstrations_with_the_goal_scaling():
    demo = make_demonstration(seed=12, moving=False)
    way = demo.positions[0] + 1.5 * (demo.positions - demo.positions[0])
    larger = Demonstration.from_positions(demo.times, way)
    primitive = MovementPrimitive.fit([demo, larger], scaling="goal")
    path = primitive.rollout(
        start=demo.positions[0], goal=demo.positions[-1], start_velocity=[0] * 3
    )
    assert distance(path.positions, demo.positions) < 1e-3


def test_batch_is_the_single_rollouts(primitive):
    rng = np.random.default_rng(0)
    weights = primitive.weights + rng.normal(size=(5, *primitive.weights.shape))
    goal = primitive.goal + 0.1
    batch = primitive.rollout_batch(weights, goal=goal, duration=3.0)
    assert batch.positions.shape == (5, 301, 3)
    for k in range(5):
        single = primitive.with_weights(weights[k]).rollout(goal=goal, duration=3.0)
        np.testing.assert_allclose(batch.positions[k], single.positions, atol=1e-12)
        np.testing.assert_allclose(batch.velocities[k], single.velocities, atol=1e-11)
        np.testing.assert_allclose(batch.accelerations[k], single.accelerations, atol=1e-10)


def test_batch_takes_one_weight_a_basis_function(primitive):
    weights = primitive.weights[:40] + np.arange(3.0)[:, None, None]
    batch = primitive.rollout_batch(weights)
    full = np.concatenate((weights[2], primitive.weights[40:]))
    single = primitive.with_weights(full).rollout()
    np.testing.assert_allclose(batch.positions[2], single.positions, atol=1e-12)


def test_a_motion_is_linear_in_its_weights(primitive):
    rng = np.random.default_rng(1)
    step = rng.normal(size=primitive.weights.shape)
    paths = [
        primitive.with_weights(primitive.weights + k * step).rollout().positions for k in range(3)
    ]
    np.testing.assert_allclose(paths[2] - paths[1], paths[1] - paths[0], atol=1e-10)


def test_orientation_and_joints_come_back_in_step(demonstration, primitive):
    path = primitive.rollout()
    turn = so3.multiply(path.rotations, so3.conjugate(demonstration.rotations))
    assert np.abs(so3.log_map(turn)).max() < 1e-4
    np.testing.assert_allclose(path.joints, demonstration.joints, atol=1e-4)


def test_joints_stay_after_the_end(primitive):
    path = primitive.rollout(settle=1.0)
    end = len(primitive.rollout().times) - 1
    np.testing.assert_allclose(path.joints[end:] - path.joints[end], 0.0, atol=1e-9)


def test_a_demonstration_without_orientation_and_joints_has_none():
    demo = make_demonstration(moving=False)
    path = MovementPrimitive.fit(demo).rollout()
    assert path.rotations is None
    assert path.joints is None


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda d: MovementPrimitive.fit([]), "none given"),
        (lambda d: MovementPrimitive.fit(d, num_basis=0), "at least 1"),
        (lambda d: MovementPrimitive.fit(d, num_basis=1001), "at most 1000"),
        (lambda d: MovementPrimitive.fit(d, scaling="big"), "scaling: 'big'"),
        (lambda d: MovementPrimitive.fit(d, approximator="magic"), "approximator: 'magic'"),
        (lambda d: MovementPrimitive.fit(d, orientation="matrix"), "orientation: 'matrix'"),
        (lambda d: MovementPrimitive.fit(d, alpha_z=0.0), "alpha_z"),
        (lambda d: MovementPrimitive.fit(d).rollout(goal=[1, 2]), "goal: .* 3 finite"),
        (lambda d: MovementPrimitive.fit(d).rollout(goal="there"), "goal: 'there' must be 3"),
        (lambda d: MovementPrimitive.fit(d).rollout(goal=lambda t: [t]), "goal: .* 3 finite"),
        (
            lambda d: MovementPrimitive.fit(d).rollout(goal_velocity=lambda t: [t] * 3),
            "needs a goal",
        ),
        (lambda d: MovementPrimitive.fit(d).rollout(start=[np.nan] * 3), "start: .* 3 finite"),
        (lambda d: MovementPrimitive.fit(d).rollout(duration=-1), "duration: -1"),
        (lambda d: MovementPrimitive.fit(d).rollout(time_step=0), "time_step: 0"),
        (lambda d: MovementPrimitive.fit(d).rollout(settle=-0.1), "settle"),
        (lambda d: MovementPrimitive.fit(d).rollout(goal_rotation=[1, 1, 0, 0]), "unit quat"),
        (lambda d: MovementPrimitive.fit(d).rollout_batch(np.zeros((2, 7, 3))), "weights: shape"),
        (lambda d: MovementPrimitive.fit(d).rollout(obstacles=[[0, 0]]), "obstacles: shape"),
        (lambda d: MovementPrimitive.fit(d).rollout(obstacles=[], coupling="x"), "coupling: 'x'"),
    ],
)
def test_bad_input_gets_one_sentence(demonstration, call, words):
    with pytest.raises(InputError, match=words) as caught:
        call(demonstration)
    assert "\n" not in str(caught.value)
