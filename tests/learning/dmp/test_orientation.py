import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.dmp.orientation import OrientationState
from tests.learning.conftest import make_demonstration

TAU, STEP = 2.5, 0.01
vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)


def angle_between(p, q):
    return float(np.linalg.norm(so3.log_map(so3.multiply(p, so3.conjugate(q)))))


@pytest.fixture(scope="module", params=["log_map", "angles"])
def primitive(request, demonstration):
    return MovementPrimitive.fit(demonstration, orientation=request.param)


def step_through(orientation, goal_at, steps=250, start=None, start_moving=True):
    state = orientation.start_state(
        orientation.start if start is None else start, goal_at(0), TAU if start_moving else None
    )
    alpha_x = orientation.attractor.alpha_x
    poses = [orientation.pose(state)]
    for k in range(steps):
        phase = np.exp(-alpha_x * k * STEP / TAU)
        state = orientation.advance(state, goal_at(k), phase, alpha_x / TAU, TAU, STEP)
        poses.append(orientation.pose(state))
    return np.array([q for q, _ in poses]), np.array([w for _, w in poses])


def test_gives_back_the_orientation_shown(primitive, demonstration):
    path = primitive.rollout()
    gaps = [
        angle_between(p, q) for p, q in zip(path.rotations, demonstration.rotations, strict=True)
    ]
    assert max(gaps) < 1e-4


def test_angular_velocity_is_the_derivative(primitive):
    path = primitive.rollout(time_step=0.001)
    q = path.rotations
    turn = so3.log_map(so3.multiply(q[2:], so3.conjugate(q[:-2]))) / 0.002
    np.testing.assert_allclose(path.angular_velocities[1:-1], turn, atol=1e-3)


@settings(max_examples=20)
@given(vectors, vectors)
def test_ends_at_any_goal_from_any_start(start, goal):
    primitive = MovementPrimitive.fit(make_demonstration(seed=3))
    path = primitive.rollout(
        start_rotation=so3.exp_map(1.5 * start), goal_rotation=so3.exp_map(1.5 * goal), settle=1.0
    )
    assert angle_between(path.rotations[-1], so3.exp_map(1.5 * goal)) < 1e-3
    np.testing.assert_allclose(np.linalg.norm(path.rotations, axis=1), 1.0)


@settings(max_examples=20)
@given(vectors)
def test_turning_the_frame_of_the_hand_turns_nothing_else(turn):
    # q -> q h for a fixed h renames the hand's axes: with log_map the motion is the same.
    demo = make_demonstration(seed=4)
    h = so3.exp_map(2 * turn)
    renamed = Demonstration.from_positions(
        demo.times, demo.positions, rotations=so3.multiply(demo.rotations, h)
    )
    one, other = (MovementPrimitive.fit(d).rollout() for d in (demo, renamed))
    np.testing.assert_allclose(one.angular_velocities, other.angular_velocities, atol=1e-6)


def turned_by(angle):
    """A demonstration that turns the hand by an angle [rad], from rest to rest."""
    t = np.arange(251) * 0.01
    s = t / t[-1]
    q = so3.exp_map(np.outer(angle * s**3 * (10 - 15 * s + 6 * s**2), [0.6, 0.0, 0.8]))
    return Demonstration.from_positions(t, np.outer(s, [1, 0, 0]), rotations=q)


def test_more_than_half_a_turn_is_given_back():
    demo = turned_by(4.5)
    path = MovementPrimitive.fit(demo).rollout()
    assert (
        max(angle_between(*pair) for pair in zip(path.rotations, demo.rotations, strict=True))
        < 1e-4
    )


def test_after_another_motion_it_turns_the_way_of_its_own_demonstration():
    """By more than half a turn: the other motion's coordinates are those of the shorter way."""
    demo = turned_by(3.6)
    orientation = MovementPrimitive.fit(demo).orientation
    at_rest = OrientationState(np.zeros((2, 3)), np.zeros(3), orientation.start)
    begun = orientation.started_anew(at_rest, orientation.goal)
    planned = orientation.start_state(orientation.start, orientation.goal, None)
    np.testing.assert_allclose(begun.coordinates, planned.coordinates, atol=1e-9)
    assert np.linalg.norm(begun.start) == pytest.approx(3.6)


@settings(max_examples=40)
@given(vectors, vectors, vectors, vectors, st.floats(0.2, 1.0))
def test_after_another_motion_hand_and_speed_go_on(primitive, e, rates, before, goal, slowed):
    orientation = primitive.orientation
    state = OrientationState(np.array((e, rates)), e, so3.exp_map(before))
    q, velocity = orientation.pose(state)
    begun = orientation.started_anew(state, so3.exp_map(goal), slowed)
    q_begun, velocity_begun = orientation.pose(begun)
    assert angle_between(q, q_begun) < 1e-9
    np.testing.assert_allclose(slowed * velocity_begun, velocity, atol=1e-9)


def test_steps_are_the_rollout(primitive):
    orientation = primitive.orientation
    rotations, rates = step_through(orientation, lambda k: orientation.goal)
    path = primitive.rollout()
    for p, q in zip(rotations, path.rotations, strict=True):
        assert angle_between(p, q) < 1e-9
    np.testing.assert_allclose(rates, path.angular_velocities, atol=1e-9)


def test_a_goal_that_turns_is_followed_without_a_jump(primitive):
    orientation = primitive.orientation
    turned = so3.multiply(so3.exp_map([0.0, 0.2, 0.3]), orientation.goal)
    rotations, rates = step_through(
        orientation, lambda k: orientation.goal if k < 100 else turned, steps=600
    )
    assert angle_between(rotations[-1], turned) < 1e-3
    assert np.abs(np.diff(rates, axis=0)).max() < 0.1
    # The angular velocity stays that of the orientation, also while the goal turns.
    turn = so3.log_map(so3.multiply(rotations[2:], so3.conjugate(rotations[:-2]))) / (2 * STEP)
    np.testing.assert_allclose(rates[1:-1], turn, atol=0.02)


def test_starts_from_rest_when_asked_to(primitive):
    orientation = primitive.orientation
    _, rates = step_through(orientation, lambda k: orientation.goal, steps=1, start_moving=False)
    np.testing.assert_allclose(rates[0], 0.0)


def test_angles_take_the_short_way_around():
    # From yaw 3.0 to -3.0 demonstrated through pi; the goal is given as a quaternion.
    t = np.arange(101) * 0.02
    yaw = np.linspace(3.0, 2 * np.pi - 3.0, 101)
    q = so3.from_angles(np.column_stack((0 * yaw, 0 * yaw, yaw)))
    demo = Demonstration.from_positions(t, np.outer(t, [1, 0, 0]), rotations=q)
    path = MovementPrimitive.fit(demo, orientation="angles").rollout(0.02, goal_rotation=q[-1])
    assert max(angle_between(*pair) for pair in zip(path.rotations, q, strict=True)) < 1e-3


def test_the_mean_of_two_goals_is_between_them(demonstration):
    from dataclasses import replace

    half = so3.exp_map([0.0, 0.0, 0.2])
    left, right = (
        replace(demonstration, rotations=so3.multiply(turn, demonstration.rotations))
        for turn in (half, so3.conjugate(half))
    )
    primitive = MovementPrimitive.fit([left, right])
    assert angle_between(primitive.orientation.goal, demonstration.rotations[-1]) < 1e-9
