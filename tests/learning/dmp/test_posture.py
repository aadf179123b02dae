from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.posture import PostureProfile


def test_several_demonstrations_give_the_mean_posture(demonstration):
    higher = replace(demonstration, joints=demonstration.joints + 0.2)
    primitive = MovementPrimitive.fit([demonstration, higher])
    path = primitive.rollout()
    np.testing.assert_allclose(path.joints, demonstration.joints + 0.1, atol=1e-4)


def test_different_joints_are_refused(demonstration):
    other = replace(demonstration, joint_names=("A", "B", "C"))
    with pytest.raises(InputError, match="joints differ"):
        MovementPrimitive.fit([demonstration, other])


def test_without_joints_in_one_there_is_no_posture(demonstration):
    other = replace(demonstration, joints=None, joint_names=())
    assert MovementPrimitive.fit([demonstration, other]).posture is None


def test_plain_data_gives_the_profile_back(demonstration):
    posture = MovementPrimitive.fit(demonstration).posture
    back = PostureProfile.from_data(posture.to_data())
    np.testing.assert_array_equal(back.at([0.0, 0.3, 2.0]), posture.at([0.0, 0.3, 2.0]))
    assert back.names == posture.names
