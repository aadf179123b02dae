"""Comparison with movement_primitives' own code, where it is installed (`.[test]`)."""

import numpy as np
import pytest

from pepper_drake.learning import MovementPrimitive, ReportCoupling
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance

dmp = pytest.importorskip(
    "movement_primitives.dmp", reason="movement_primitives is not installed: .[test] has it"
)


def test_the_unforced_spring_is_theirs():
    start, goal, duration = np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.0, 0.1]), 1.7
    theirs = dmp.DMP(3, execution_time=duration, dt=0.01)
    theirs.configure(start_y=start, goal_y=goal)
    times, path = theirs.open_loop()
    # Without the scaling that makes a motion's offsets fade in, which is a forcing term too.
    primitive = MovementPrimitive.fit(example_demonstrations(1), scaling="none")
    unforced = primitive.with_weights(0 * primitive.weights)
    ours = unforced.rollout(
        0.01, start=start, goal=goal, duration=duration, start_velocity=np.zeros(3)
    )
    np.testing.assert_allclose(times, ours.times[: len(times)])
    np.testing.assert_allclose(path, ours.positions[: len(path)], atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_equation_2_7_is_theirs(seed):
    rng = np.random.default_rng(seed)
    obstacle, position, velocity = rng.standard_normal((3, 3))
    theirs = dmp.CouplingTermObstacleAvoidance3D(obstacle, gamma=20.0, beta=3.0)
    push = ReportCoupling(gamma=20.0, beta=3.0).push(
        PointCloudDistance(obstacle[None]),
        np.stack((position, velocity)),
        np.zeros(3),
        np.ones(3),
        0.0,
        1.0,
    )
    np.testing.assert_allclose(push.coupling, theirs.coupling(position, velocity)[1], rtol=1e-9)
