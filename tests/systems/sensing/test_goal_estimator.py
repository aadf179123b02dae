import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import ImageRgba8U

from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP
from pepper_drake.perception.cameras.noise import ColorNoise, apply_color_noise
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.systems.sensing.goal_estimator import GoalEstimator

CAMERA = CAMERA_TOP.intrinsics
X_OM = RigidTransform(RollPitchYaw(np.pi / 2, 0, 0), [0.0, -0.04, 0.1])
X_WC = RigidTransform(RollPitchYaw(-np.pi / 2 - 0.3, 0, -np.pi / 2), [0.0, 0.0, 1.0])
MARKED = MarkedObject(7, 0.06, X_OM)


class Bench:
    """A goal estimator whose inputs are set by hand."""

    def __init__(self, draw_marker, **options):
        self.draw_marker = draw_marker
        self.estimator = GoalEstimator(MARKED, **options)
        self.simulator = Simulator(self.estimator)
        self.context = self.simulator.get_mutable_context()
        self.frame = 0

    def picture(self, X_CM, camera=CAMERA):
        self.frame += 1
        gray = self.draw_marker(X_CM, camera.ideal())
        rgba = cv2.cvtColor(gray, cv2.COLOR_GRAY2RGBA)
        return apply_color_noise(rgba, camera, ColorNoise(), seed=0, frame=self.frame)

    def show(self, pixels, time, X_WC=X_WC, camera="top"):
        image = ImageRgba8U(pixels.shape[1], pixels.shape[0]) if pixels.size else ImageRgba8U()
        if pixels.size:
            image.mutable_data[:] = pixels
        self.estimator.GetInputPort(f"color_image_{camera}").FixValue(self.context, image)
        self.estimator.GetInputPort(f"time_stamp_{camera}").FixValue(self.context, [time])
        self.estimator.GetInputPort(f"X_WC_{camera}").FixValue(self.context, X_WC)

    def see(self, X_CM, frames, start=0.0):
        for k in range(frames):
            time = start + 0.2 * k
            self.simulator.AdvanceTo(time)
            self.show(self.picture(X_CM), time)
            self.simulator.AdvanceTo(time + 0.05)

    def output(self, name):
        value = self.estimator.GetOutputPort(name).Eval(self.context)
        return value if name == "object_pose" else np.array(value)


@pytest.fixture
def bench(draw_marker):
    return Bench(draw_marker)


@pytest.fixture
def X_CM(facing):
    return facing([0.05, 0.05, 0.6], 0.4, 1.0)


def position_error(bench, X_CM, X_WC=X_WC):
    X_WO = X_WC @ X_CM @ X_OM.inverse()
    return np.linalg.norm(bench.output("object_pose").translation() - X_WO.translation())


def test_without_images_there_is_no_goal(bench):
    bench.simulator.AdvanceTo(0.5)
    assert bench.output("valid") == [0]
    assert np.isinf(bench.output("age")).all()
    assert np.isinf(np.diag(bench.output("position_covariance").reshape(3, 3))).all()
    assert bench.output("object_pose").IsExactlyIdentity()


def test_goal_is_found_in_the_third_image(bench, X_CM):
    bench.see(X_CM, 2)
    assert bench.output("valid") == [0]
    bench.see(X_CM, 1, start=0.4)
    assert bench.output("valid") == [1]
    assert position_error(bench, X_CM) < 0.003
    assert bench.output("age")[0] == pytest.approx(0.05)
    sigma = np.sqrt(np.trace(bench.output("position_covariance").reshape(3, 3)))
    assert 0.0002 < sigma < 0.01
    assert np.linalg.norm(bench.output("velocity")) < 0.05


def test_each_image_is_worked_on_once(bench, X_CM, monkeypatch):
    calls = []
    original = bench.estimator._use_camera

    def count(context, name, memory):
        after = original(context, name, memory)
        calls.append(after is not memory)
        return after

    monkeypatch.setattr(bench.estimator, "_use_camera", count)
    bench.see(X_CM, 4)
    assert sum(calls) == 4
    assert not bench.estimator.HasAnyDirectFeedthrough()


def test_both_cameras_feed_one_goal(bench, X_CM):
    X_WM = X_WC @ X_CM
    camera = CAMERA_BOTTOM.intrinsics
    X_WB = X_WC @ RigidTransform([0.05, 0.02, 0.1])
    for k in range(3):
        name = ("top", "bottom")[k % 2]
        X_WCk, intrinsics = ((X_WC, CAMERA), (X_WB, camera))[k % 2]
        bench.simulator.AdvanceTo(0.2 * k)
        bench.show(bench.picture(X_WCk.inverse() @ X_WM, intrinsics), 0.2 * k, X_WCk, name)
        bench.simulator.AdvanceTo(0.2 * k + 0.05)
    assert bench.output("valid") == [1]
    assert position_error(bench, X_CM) < 0.003


def test_late_image_is_used_with_the_pose_of_its_own_time(bench, X_CM):
    X_WM = X_WC @ X_CM
    for k in range(4):
        # The head turns; each image arrives 0.1 s late, with the pose that it was taken at.
        X_WCk = X_WC @ RigidTransform(RollPitchYaw(0, 0.05 * k, 0), [0, 0, 0])
        bench.simulator.AdvanceTo(0.2 * k + 0.1)
        bench.show(bench.picture(X_WCk.inverse() @ X_WM), 0.2 * k, X_WCk)
        bench.simulator.AdvanceTo(0.2 * k + 0.15)
    assert position_error(bench, X_CM) < 0.003
    assert bench.output("age")[0] == pytest.approx(0.15)


def test_lost_marker_is_held_then_invalid(bench, X_CM):
    bench.see(X_CM, 4)
    held = bench.output("object_pose")
    blank = np.full((480, 640, 4), 90, np.uint8)
    for k in range(8):
        time = round(0.8 + 0.2 * k, 1)
        bench.simulator.AdvanceTo(time)
        bench.show(blank + np.uint8(k), time)
        if time == 1.4:
            assert bench.output("valid") == [1]
    bench.simulator.AdvanceTo(2.3)
    assert bench.output("valid") == [0]
    assert bench.output("age")[0] > 1.0
    assert bench.output("object_pose").IsExactlyEqualTo(held)


@pytest.mark.parametrize("fault", ["empty", "future", "old", "hangs"])
def test_faulty_images_change_nothing(bench, X_CM, facing, fault):
    bench.see(X_CM, 4)
    track = bench.estimator.goal_state(bench.context).track
    elsewhere = bench.picture(facing([-0.1, 0, 0.6], 0.2))
    pixels, time = {
        "empty": (np.zeros((0, 0, 4), np.uint8), 0.8),
        "future": (elsewhere, 5.0),
        "old": (elsewhere, 0.1),
        "hangs": (None, 0.8),
    }[fault]
    bench.simulator.AdvanceTo(0.8)
    if pixels is None:
        bench.estimator.GetInputPort("time_stamp_top").FixValue(bench.context, [time])
        bench.estimator.GetInputPort("X_WC_top").FixValue(
            bench.context, X_WC @ RigidTransform([0.1, 0, 0])
        )
    else:
        bench.show(pixels, time)
    bench.simulator.AdvanceTo(0.85)
    assert bench.estimator.goal_state(bench.context).track is track


def test_the_age_of_images_counts_those_alone_that_can_be_looked_at(bench, X_CM):
    bench.simulator.AdvanceTo(0.1)
    assert np.isinf(bench.output("image_ages")).all()
    bench.see(X_CM, 2, start=0.2)
    assert bench.output("image_ages")[0] == pytest.approx(0.05)
    frozen = bench.picture(X_CM)
    for pixels, time in ((frozen, 0.6), (frozen, 0.8), (frozen[::2, ::2], 1.0)):
        bench.show(pixels, time)
        bench.simulator.AdvanceTo(time + 0.05)
    top, bottom = bench.output("image_ages")
    assert top == pytest.approx(0.45)
    assert np.isinf(bottom)


def test_noiseless_images_are_used_when_told_so(draw_marker, X_CM):
    bench = Bench(draw_marker, expects_noise=False)
    pixels = bench.picture(X_CM)
    for k in range(3):
        bench.simulator.AdvanceTo(0.2 * k)
        bench.show(pixels, 0.2 * k)
        bench.simulator.AdvanceTo(0.2 * k + 0.05)
    assert bench.output("valid") == [1]


def test_a_measurement_counts_after_its_latency(draw_marker, X_CM):
    prompt, slow = Bench(draw_marker), Bench(draw_marker, latency=0.06)
    for bench in (prompt, slow):
        bench.see(X_CM, 4)
    time = 0.8
    for bench in (prompt, slow):
        bench.simulator.AdvanceTo(time)
        bench.show(bench.picture(X_CM), time)
        bench.simulator.AdvanceTo(time + 0.04)
    seen = [bench.estimator.goal_state(bench.context).track.time for bench in (prompt, slow)]
    assert seen == pytest.approx([0.8, 0.6])
    slow.simulator.AdvanceTo(time + 0.08)
    one, other = (bench.estimator.goal_state(bench.context).track for bench in (prompt, slow))
    np.testing.assert_array_equal(one.p_WM, other.p_WM)
    assert other.time == pytest.approx(0.8)
