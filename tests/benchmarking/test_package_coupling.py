import numpy as np
import pytest

from pepper_drake.learning.dmp.obstacle_coupling import ReportCoupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance

package = pytest.importorskip(
    "movement_primitives", reason="movement_primitives is in the bench extra"
)
from pepper_drake.benchmarking.package_coupling import PackageCoupling  # noqa: E402


def test_one_point_pushes_as_equation_2_7_says():
    field = PointCloudDistance([[0.3, 0.02, 0.1], [5.0, 5.0, 5.0]])
    near = PointCloudDistance([[0.3, 0.02, 0.1]])
    state = np.array([[0.0, 0.0, 0.1], [0.3, 0.0, 0.05]])
    push = PackageCoupling().push(field, state, np.zeros(3), np.ones(3), 0.0, 3.0)
    own = ReportCoupling(gamma=1000.0).push(near, state, np.zeros(3), np.ones(3), 0.0, 3.0)
    np.testing.assert_allclose(push.coupling, own.coupling, rtol=1e-6)
    assert np.linalg.norm(push.coupling) > 1.0
    assert push.slowdown == 0.0


def test_many_hands_at_once_and_none_of_them_pushed_by_nothing():
    states = np.zeros((4, 2, 3))
    states[:, 1, 0] = 0.2
    nothing = PointCloudDistance(np.zeros((0, 3)))
    push = PackageCoupling().push(nothing, states, np.zeros((4, 3)), np.ones(3), 0.0, 3.0)
    np.testing.assert_array_equal(push.coupling, np.zeros((4, 3)))
    field = PointCloudDistance([[0.3, 0.02, 0.1]])
    several = PackageCoupling().push(field, states, np.zeros((4, 3)), np.ones(3), 0.0, 3.0)
    one = PackageCoupling().push(field, states[0], np.zeros(3), np.ones(3), 0.0, 3.0)
    np.testing.assert_allclose(several.coupling, np.repeat(one.coupling[None], 4, axis=0))


def test_heading_exactly_for_the_point_is_no_push_and_no_fault():
    field = PointCloudDistance([[1.0, 0.0, 0.0]])
    state = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    push = PackageCoupling().push(field, state, np.zeros(3), np.ones(3), 0.0, 3.0)
    assert np.linalg.norm(push.coupling) < 0.01
