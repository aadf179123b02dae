import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import (
    BODY_JOINTS,
    coupled_limits,
    elbow_roll_limits,
    head_pitch_limits,
    posture_positions,
)
from pepper_drake.planning.safety.command_check import StopReason, check_command
from pepper_drake.planning.safety.command_limits import (
    limit_joint_command,
    track_joint_command,
)
from pepper_drake.planning.safety.compiled_limits import stopping_distance

TIME_STEP = 0.01


@pytest.fixture(scope="module")
def right_limits():
    return shared_control_model().command_limits(arm_joints("right"), speed_fraction=0.5)


def test_a_reachable_velocity_is_integrated_as_it_is(right_limits):
    position = np.array([1.0, -0.5, 0.5, 0.8, 0.1])
    wish = np.array([0.05, -0.04, 0.03, 0.02, -0.01])
    following, velocity = limit_joint_command(
        position, np.zeros(5), wish, limits=right_limits, time_step=TIME_STEP
    )
    np.testing.assert_allclose(following, position + TIME_STEP * wish, atol=1e-15)
    np.testing.assert_allclose(velocity, wish, atol=1e-12)


def test_acceleration_is_limited(right_limits):
    _, velocity = limit_joint_command(
        np.array([1.0, -0.5, 0.5, 0.8, 0.1]),
        np.zeros(5),
        np.full(5, 5.0),
        limits=right_limits,
        time_step=TIME_STEP,
    )
    np.testing.assert_allclose(velocity, right_limits.acceleration * TIME_STEP, rtol=1e-9)


class LimitWatch:
    """Largest excess of a sequence of commands over each of its limits, from positions alone."""

    def __init__(self, names, limits, position, time_step):
        self.names, self.limits, self.time_step = names, limits, time_step
        self.position, self.velocity = position, np.zeros(len(position))
        self.beyond = dict.fromkeys(("position", "velocity", "acceleration", "coupled"), -np.inf)

    def add(self, position):
        limits, velocity = self.limits, (position - self.position) / self.time_step
        change = np.abs(velocity - self.velocity) / self.time_step
        self._note("position", limits.position_lower - position)
        self._note("position", position - limits.position_upper)
        self._note("velocity", np.abs(velocity) - limits.velocity)
        self._note("acceleration", change - limits.acceleration)
        joints = dict(zip(self.names, position, strict=True))
        for side, arm in (("L", "left"), ("R", "right")):
            if f"{side}ElbowYaw" in joints:
                lower, upper = elbow_roll_limits(joints[f"{side}ElbowYaw"], arm)
                roll = joints[f"{side}ElbowRoll"]
                self._note("coupled", [lower - roll, roll - upper])
        if "HeadYaw" in joints:
            lower, upper = head_pitch_limits(joints["HeadYaw"])
            self._note("coupled", [lower - joints["HeadPitch"], joints["HeadPitch"] - upper])
        self.position, self.velocity = position, velocity

    def _note(self, limit, excess):
        assert np.isfinite(excess).all()
        self.beyond[limit] = max(self.beyond[limit], np.max(excess))

    def assert_kept(self):
        assert max(self.beyond.values()) < 1e-9, self.beyond


def random_wishes(names, number, seed):
    """Velocities of all sizes that last for a while, whole stops and missing numbers among them."""
    rng = np.random.default_rng(seed)
    wish = np.zeros(len(names))
    for _ in range(number):
        if rng.random() < 0.15:
            wish = rng.normal(size=len(names)) * rng.choice([0.0, 0.5, 3.0, 30.0, np.inf])
            wish[rng.random(len(names)) < 0.1] = np.nan
        yield wish


@pytest.mark.parametrize("joints", ["left", "right", "body"])
def test_no_wish_ever_passes_a_limit(joints):
    names = BODY_JOINTS if joints == "body" else arm_joints(joints)
    limits = shared_control_model().command_limits(names)
    position = np.array([posture_positions("upright")[name] for name in names])
    velocity = np.zeros(len(names))
    watch = LimitWatch(names, limits, position, 0.02)
    for wish in random_wishes(names, 35_000 // len(names), seed=1):
        position, velocity = limit_joint_command(
            position, velocity, wish, limits=limits, time_step=0.02
        )
        watch.add(position)
    watch.assert_kept()


@settings(max_examples=40, deadline=None)
@given(
    wishes=st.lists(
        st.lists(st.floats(allow_nan=True), min_size=5, max_size=5), min_size=1, max_size=6
    ),
    arm=st.sampled_from(["left", "right"]),
    steps=st.integers(1, 40),
)
def test_a_stop_after_any_wishes_keeps_every_limit_and_ends(wishes, arm, steps):
    limits = shared_control_model().command_limits(arm_joints(arm))
    position = np.array([posture_positions("upright")[name] for name in arm_joints(arm)])
    velocity = np.zeros(5)
    watch = LimitWatch(arm_joints(arm), limits, position, TIME_STEP)
    stop = [np.zeros(5)] * int(np.ceil((limits.velocity / limits.acceleration).max() / TIME_STEP))
    for wish in [np.array(w) for w in wishes for _ in range(steps)] + stop:
        position, velocity = limit_joint_command(
            position, velocity, wish, limits=limits, time_step=TIME_STEP
        )
        watch.add(position)
    watch.assert_kept()
    assert not velocity.any()


def test_full_speed_towards_a_limit_uses_all_of_the_range_and_brakes_at_the_full_rate(right_limits):
    position, velocity = np.array([1.0, -0.5, 0.5, 0.8, 0.1]), np.zeros(5)
    previous, hardest = velocity, 0.0
    for _ in range(400):
        position, velocity = limit_joint_command(
            position, velocity, np.full(5, 50.0), limits=right_limits, time_step=TIME_STEP
        )
        hardest = max(hardest, np.max(previous - velocity) / TIME_STEP)
        previous = velocity
    ends = [0, 1, 2, 4]
    np.testing.assert_allclose(position[ends], right_limits.position_upper[ends], atol=1e-9)
    np.testing.assert_allclose(hardest, right_limits.acceleration[0], rtol=1e-9)


@given(speed=st.floats(0, 20), acceleration=st.floats(0.5, 50))
def test_the_stopping_distance_is_that_of_braking_step_by_step(speed, acceleration):
    change = acceleration * TIME_STEP
    travelled, remaining = 0.0, speed
    while remaining > 0:
        remaining = max(remaining - change, 0.0)
        travelled += TIME_STEP * remaining
    assert stopping_distance(speed, change, TIME_STEP) == pytest.approx(travelled, abs=1e-9)


def test_an_elbow_that_turns_into_its_coupled_limit_gives_way_in_its_roll():
    names = arm_joints("left")
    limits = shared_control_model().command_limits(names)
    # Roll is bent as far as yaw allows near 0; towards -60 degrees it has to open.
    position = np.array([1.0, 0.5, -0.05, np.radians(-88.0), 0.0])
    velocity = np.zeros(5)
    watch = LimitWatch(names, limits, position, TIME_STEP)
    for _ in range(150):
        position, velocity = limit_joint_command(
            position, velocity, np.array([0, 0, -2.0, 0, 0]), limits=limits, time_step=TIME_STEP
        )
        watch.add(position)
    watch.assert_kept()
    assert position[2] < np.radians(-110)
    assert position[3] == pytest.approx(elbow_roll_limits(np.radians(-60.0), "left")[0], abs=0.02)


def test_a_command_outside_a_limit_comes_back_in_without_a_jump(right_limits):
    position = right_limits.position_upper + 0.2
    position[3] = 1.0
    velocity = np.zeros(5)
    for _ in range(150):
        before = velocity
        position, velocity = limit_joint_command(
            position, velocity, np.zeros(5), limits=right_limits, time_step=TIME_STEP
        )
        assert np.abs(velocity - before).max() <= right_limits.acceleration[0] * TIME_STEP + 1e-9
    assert (position <= right_limits.position_upper + 1e-9).all()
    assert (position > right_limits.position_upper - 0.05)[[0, 1, 2, 4]].all()


def test_position_wishes_within_the_limits_come_out_as_they_are(right_limits):
    time = np.arange(200) * TIME_STEP
    path = np.array([1.0, -0.5, 0.5, 0.8, 0.1]) + 0.3 * np.sin(2 * time)[:, None] ** 2
    position, velocity = path[0], np.zeros(5)
    for before, wish in itertools.pairwise(path):
        position, velocity = track_joint_command(
            position, velocity, wish, before, limits=right_limits, time_step=TIME_STEP
        )
        np.testing.assert_allclose(position, wish, atol=1e-12)


def test_a_jump_of_position_wishes_is_caught_up_with_and_no_limit_is_passed():
    names = BODY_JOINTS
    limits = shared_control_model().command_limits(names)
    rng = np.random.default_rng(0)
    position = np.array([posture_positions("upright")[name] for name in names])
    velocity, wish = np.zeros(len(names)), position
    watch = LimitWatch(names, limits, position, 0.02)
    for k in range(1200):
        before = wish
        if k % 150 == 0:
            wish = rng.uniform(limits.position_lower - 0.3, limits.position_upper + 0.3)
            if k % 300 == 0:
                wish[rng.integers(len(names))] = np.nan
        elif k % 150 < 50:
            wish = wish + rng.normal(size=len(names)) * 0.05
        position, velocity = track_joint_command(
            position, velocity, wish, before, limits=limits, time_step=0.02
        )
        watch.add(position)
    watch.assert_kept()
    followers = {limit.follower for limit in limits.coupled}
    free = [k for k in range(len(names)) if k not in followers]
    reachable = np.clip(wish, limits.position_lower, limits.position_upper)
    np.testing.assert_allclose(position[free], reachable[free], atol=1e-9)


def test_the_tables_of_coupled_limits_say_what_the_functions_say():
    (head, left, right) = coupled_limits(BODY_JOINTS)
    for yaw in np.linspace(-2.2, 2.2, 91):
        for table, expected in (
            (head, head_pitch_limits(yaw)),
            (left, elbow_roll_limits(yaw, "left")),
            (right, elbow_roll_limits(yaw, "right")),
        ):
            found = [np.interp(yaw, table.positions, side) for side in (table.lower, table.upper)]
            np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (np.array([np.nan, 0, 0, 0, 0]), StopReason.COMMAND_NOT_FINITE),
        (np.array([9.0, 0, 0, 0, 0]), StopReason.COMMAND_OUTSIDE_LIMITS),
        (np.array([0.1, 0, 0, 0, 0]), StopReason.COMMAND_TOO_FAST),
        (np.array([0.01, 0, 0, 0, 0]), StopReason.NONE),
    ],
)
def test_each_unsafe_command_has_its_name(right_limits, change, reason):
    previous = np.array([1.0, -0.5, 0.5, 0.8, 0.1])
    status = check_command(previous + change, previous, right_limits, time_step=TIME_STEP)
    assert status == reason
