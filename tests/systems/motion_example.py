"""Motion that the tests of its systems share."""

import numpy as np
from pydrake.common.value import Value
from pydrake.perception import PointCloud

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning import rotations as so3
from pepper_drake.planning.reach.movement import Movement

STEP = 0.01


def learn(scaling):
    """A curved reach of 1.5 s with a turn, starting and ending while moving."""
    t = np.arange(151) * STEP
    p = np.column_stack((0.2 * t, 0.1 * np.sin(2 * t), 0.05 * np.cos(3 * t)))
    q = so3.exp_map(np.column_stack((np.sin(t), 0.3 * t, 0 * t)))
    demonstration = Demonstration.from_positions(t, p, rotations=q)
    return MovementPrimitive.fit(demonstration, num_basis=15, scaling=scaling)


def moving(primitive, number=1, **parts):
    """A movement's value as ports take it."""
    return Value[object](Movement(primitive, **parts, id=int(number)))


def make_cloud(points):
    cloud = PointCloud(len(points))
    cloud.mutable_xyzs()[:] = np.asarray(points, dtype=np.float32).T
    return cloud
