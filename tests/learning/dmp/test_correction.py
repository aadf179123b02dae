from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.diagrams.factory import SHIPPED_DEMONSTRATION
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.dmp.correction import ReproducedMotion, learn_correction


@pytest.fixture(scope="module")
def primitive():
    return MovementPrimitive.fit(Demonstration.load(SHIPPED_DEMONSTRATION))


@pytest.fixture(scope="module")
def undisturbed(primitive):
    """Performed as it is: at rest for 0.2 s, then along the primitive's own path."""
    path = primitive.rollout(0.01, start_velocity=np.zeros(3), settle=0.2)
    rest = 20

    def held(values):
        return np.concatenate((np.repeat(values[:1], rest, axis=0), values))

    phases = np.minimum(path.phases, 1.0 - 1e-12)
    phases[0] = 1.0
    return ReproducedMotion(
        times=0.01 * np.arange(rest + len(path.times)),
        phases=np.concatenate((np.ones(rest), phases)),
        positions=held(path.positions),
        rotations=held(path.rotations),
        joints=held(path.joints),
        goal=primitive.goal,
    )


def pushed(motion, height=0.05, middle=1.8, width=0.3, turn=0.0):
    """The same with the hand lifted, and turned about z, for a while."""
    bump = np.exp(-(((motion.times - middle) / width) ** 2))
    return replace(
        motion,
        positions=motion.positions + np.outer(bump, [0, 0, height]),
        rotations=so3.multiply(so3.exp_map(np.outer(bump, [0, 0, turn])), motion.rotations),
        joints=motion.joints + np.outer(bump, [0, 0, 0, 0, 2 * height]),
    )


def distances(positions, path):
    return np.array([np.linalg.norm(path - p, axis=1).min() for p in positions])


def test_the_new_primitive_goes_where_the_hand_was_pushed(primitive, undisturbed):
    motion = pushed(undisturbed, turn=0.4)
    correction = learn_correction(primitive, motion)
    assert correction.deviation == pytest.approx(0.05, abs=1e-3)
    new = correction.primitive.rollout(0.01)
    old = primitive.rollout(0.01)
    assert distances(motion.positions, old.positions).max() > 0.03
    assert distances(motion.positions, new.positions).max() < 6e-3
    # Where the push is strongest the hand is turned, and the last joint moved, as well.
    at = np.argmax(
        np.abs(new.positions[:, 2] - np.interp(new.times, old.times, old.positions[:, 2]))
    )
    share = new.times[at] / new.times[-1]
    own = np.array([np.interp(share * old.times[-1], old.times, q) for q in old.rotations.T])
    turn = so3.log_map(so3.multiply(new.rotations[at], so3.conjugate(so3.normalize(own))))
    assert turn[2] == pytest.approx(0.4, abs=0.15)
    last = np.interp(share * old.times[-1], old.times, old.joints[:, 4])
    assert new.joints[at, 4] - last == pytest.approx(0.1, abs=0.05)


def test_start_and_goal_stay_and_so_does_what_was_not_corrected(primitive, undisturbed):
    new = learn_correction(primitive, pushed(undisturbed)).primitive
    np.testing.assert_allclose(new.start, primitive.start, atol=1e-3)
    np.testing.assert_allclose(new.goal, primitive.goal, atol=1e-3)
    own, path = primitive.rollout(0.01), new.rollout(0.01)
    early = own.positions[own.times < 0.9]
    assert distances(early, path.positions).max() < 3e-3
    assert primitive.duration < new.duration < 1.2 * primitive.duration


def test_a_second_correction_adds_to_the_first(primitive, undisturbed):
    first = learn_correction(primitive, pushed(undisturbed, height=0.03)).primitive
    path = first.rollout(0.01, start_velocity=np.zeros(3))
    phases = np.minimum(path.phases, 1.0 - 1e-12)
    again = pushed(
        ReproducedMotion(
            path.times, phases, path.positions, path.rotations, path.joints, first.goal
        ),
        height=0.03,
    )
    second = learn_correction(first, again).primitive
    top = distances(second.rollout(0.01).positions, primitive.rollout(0.01).positions).max()
    assert top > 0.035


def test_a_reproduction_to_another_goal_corrects_the_movement_itself(primitive, undisturbed):
    goal = primitive.goal + [0.0, 0.05, 0.03]
    path = primitive.rollout(0.01, goal=goal, start_velocity=np.zeros(3), settle=0.2)
    phases = np.minimum(path.phases, 1.0 - 1e-12)
    motion = pushed(
        ReproducedMotion(path.times, phases, path.positions, path.rotations, path.joints, goal),
        middle=1.6,
    )
    new = learn_correction(primitive, motion).primitive
    np.testing.assert_allclose(new.goal, primitive.goal, atol=1e-3)
    same = learn_correction(primitive, pushed(undisturbed)).primitive
    ours, theirs = new.rollout(0.01).positions, same.rollout(0.01).positions
    assert distances(ours, theirs).max() < 5e-3


def test_what_is_no_correction_is_refused(primitive, undisturbed):
    with pytest.raises(InputError, match="never more than"):
        learn_correction(primitive, undisturbed)
    with pytest.raises(InputError, match="never more than"):
        # At the very end: the goal is not the tutor's to move.
        learn_correction(primitive, pushed(undisturbed, height=0.03, middle=3.3, width=0.05))
    short = replace(undisturbed, phases=np.ones_like(undisturbed.phases))
    with pytest.raises(InputError, match="ended before it had begun"):
        learn_correction(primitive, short)
    with pytest.raises(InputError, match="without orientation and joints"):
        learn_correction(replace(primitive, posture=None), undisturbed)
