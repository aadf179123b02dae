import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.check import examine, refuse_out_of_reach

from .importers.recordings import NAMES, make_motion

MOTION = make_motion()
T, P, Q, J = MOTION.times, MOTION.positions, MOTION.rotations, MOTION.joints


def test_a_good_motion_has_nothing_to_warn_of():
    report = examine(MOTION)
    assert report.warnings == ()
    assert report.samples == len(T)
    assert report.rate == pytest.approx(50.0)
    assert report.within_reach == 1.0
    assert report.noise == 0.0
    assert report.path_length == pytest.approx(MOTION.path_length)
    assert report.top_speed == pytest.approx(
        np.linalg.norm(MOTION.velocities, axis=1).max(), rel=0.01
    )


def warned(demo):
    return " | ".join(examine(demo).warnings)


def test_doubtful_things_are_told_with_the_sample():
    kept = (T < 0.5) | (T > 1.2)
    assert "sample 26: a gap of 0.74 s" in warned(Demonstration.from_positions(T[kept], P[kept]))
    floor = MOTION.translated([0.0, 0.0, 0.82])
    assert "sample 1: " in warned(floor)
    assert "base_footprint" in warned(floor)
    slow = Demonstration.from_positions(T[::10], P[::10])
    assert "5 samples a second" in warned(slow)
    held = P.copy()
    held[41:60:2] = held[40:59:2]
    assert "the same position as before" in warned(Demonstration.from_positions(T, held))
    fast = Demonstration.from_positions(0.12 * T, P, joints=J, joint_names=NAMES)
    assert "its limit is 7.3 rad/s" in warned(fast)
    jitter = T + np.where(np.arange(len(T)) % 2, 0.009, 0.0)
    assert "varies by" in warned(Demonstration.from_positions(jitter, P))


def test_an_arm_is_not_given_what_it_cannot_reach():
    refuse_out_of_reach(MOTION, "motion")
    with pytest.raises(InputError, match=r"motion: no position is within.*base_footprint"):
        refuse_out_of_reach(MOTION.translated([0.0, 0.0, 0.82]), "motion")


def test_demonstrations_of_one_movement_are_alike():
    others = [
        Demonstration.from_positions(T, P + [0.03, 0.02, -0.05]),
        Demonstration.from_positions(3.0 * T, P),
        Demonstration.from_positions(T, P[0] + 0.7 * (P - P[0])),
    ]
    MovementPrimitive.fit([MOTION, *others])


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (Demonstration.from_positions(T, 0.001 * P, name="mm"), "not alike; are their units"),
        (Demonstration.from_positions(1000 * T, P, name="ms"), "not alike; are their units"),
        (Demonstration.from_positions(T, P[::-1], name="back"), "differently from the other"),
        (MOTION.mirrored(), "a motion of the left arm, .* the right"),
        (Demonstration.from_positions(T, P * [1, -1, 1]), "a motion of the left arm, .* the right"),
    ],
    ids=["millimetres", "milliseconds", "backwards", "the other arm", "the other side"],
)
def test_demonstrations_that_are_not_alike_are_refused(other, words):
    with pytest.raises(InputError, match=words):
        MovementPrimitive.fit([MOTION, MOTION, other])


@pytest.mark.parametrize(
    "arrays",
    [
        {"rotations": Q[:, :3]},
        {"rotations": Q[:-1]},
        {"rotations": np.where(np.arange(len(T))[:, None] == 9, np.nan, Q)},
        {"rotations": np.where(np.arange(len(T))[:, None] == 9, 0.0, Q)},
        {"velocities": P * np.nan, "accelerations": P},
        {"velocities": P[:, :2]},
        {"velocities": "fast"},
        {"velocities": P, "accelerations": P[:-1]},
        {"joints": np.full((len(T), 5), np.nan), "joint_names": NAMES},
        {"joints": J, "joint_names": NAMES[:4]},
        {"joints": J[:-1], "joint_names": NAMES},
        {"joints": [[0.0], [1.0, 2.0]], "joint_names": NAMES},
    ],
)
def test_arrays_that_are_no_motion_are_refused(arrays):
    with pytest.raises(InputError) as caught:
        Demonstration.from_positions(T, P, **arrays)
    assert next(iter(arrays)) in str(caught.value) or "accelerations" in str(caught.value)
