import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.systems.sensing.estimate_guard import CloudGuard, PoseGuard, makes_sense


def cloud_of(points):
    cloud = PointCloud(len(points))
    cloud.mutable_xyzs()[:] = np.asarray(points, dtype=np.float32).T
    return cloud


class PoseRig:
    def __init__(self):
        self.guard = PoseGuard()
        self.simulator = Simulator(self.guard)
        self.context = self.simulator.get_mutable_context()
        self.ticks = 0

    def step(self, position):
        self.guard.pose_input.FixValue(self.context, Value(RigidTransform(position)))
        self.simulator.AdvanceTo((self.ticks + 0.5) * 0.05)
        self.ticks += 1
        pose = self.guard.GetOutputPort("pose").Eval(self.context)
        return pose.translation().tolist(), self.guard.GetOutputPort("age").Eval(self.context)[0]


def test_a_finite_pose_passes():
    rig = PoseRig()
    assert rig.step([1.0, 2.0, 3.0]) == ([1.0, 2.0, 3.0], 0.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e4])
def test_a_pose_that_cannot_be_is_replaced_by_the_last_and_grows_old(bad):
    rig = PoseRig()
    rig.step([1.0, 2.0, 3.0])
    for k in range(1, 4):
        position, age = rig.step([bad, 2.0, 3.0])
        assert position == [1.0, 2.0, 3.0]
        assert age == pytest.approx(0.05 * k)
    assert rig.step([4.0, 5.0, 6.0]) == ([4.0, 5.0, 6.0], 0.0)


class CloudRig:
    def __init__(self):
        self.guard = CloudGuard()
        self.simulator = Simulator(self.guard)
        self.context = self.simulator.get_mutable_context()
        self.ticks = 0

    def step(self, points, stamp, torso=None):
        for name, value in (("cloud", points), ("cloud_torso", points if torso is None else torso)):
            self.guard.GetInputPort(name).FixValue(self.context, Value(cloud_of(value)))
        self.guard.GetInputPort("time_stamp").FixValue(self.context, [stamp])
        self.simulator.AdvanceTo((self.ticks + 0.5) * 0.05)
        self.ticks += 1
        clouds = [
            self.guard.GetOutputPort(name).Eval(self.context).xyzs()
            for name in ("cloud", "cloud_torso")
        ]
        return *clouds, self.guard.GetOutputPort("time_stamp").Eval(self.context)[0]


GOOD = np.full((50, 3), 0.5)


def test_clouds_that_make_sense_pass_with_their_stamp():
    rig = CloudRig()
    cloud, torso, stamp = rig.step(GOOD, 0.1, torso=GOOD + 1)
    np.testing.assert_array_equal(cloud, GOOD.T)
    np.testing.assert_array_equal(torso, GOOD.T + 1)
    assert stamp == 0.1


@pytest.mark.parametrize("bad", [np.full((50, 3), np.nan), np.full((50, 3), 1e3)])
def test_of_clouds_that_make_no_sense_the_last_good_one_stays_and_its_stamp_stands(bad):
    rig = CloudRig()
    rig.step(GOOD, 0.1)
    for k in range(3):
        cloud, torso, stamp = rig.step(bad, 0.2 + 0.1 * k)
        np.testing.assert_array_equal(cloud, GOOD.T)
        np.testing.assert_array_equal(torso, GOOD.T)
        assert stamp == 0.1
    assert rig.step(GOOD + 0.1, 0.6)[2] == 0.6


def test_before_the_first_good_cloud_there_is_none():
    cloud, _, stamp = CloudRig().step(np.full((9, 3), np.nan), 0.1)
    assert cloud.shape[1] == 0
    assert stamp == -np.inf


def test_an_empty_cloud_and_a_few_bad_points_make_sense():
    assert makes_sense(PointCloud())
    points = np.full((100, 3), 0.5)
    points[0] = np.nan
    assert makes_sense(cloud_of(points))
    points[:5] = np.nan
    assert not makes_sense(cloud_of(points))
