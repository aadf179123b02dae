import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays
from pepper_drake.perception.cameras.noise import ColorNoise, apply_color_noise
from pepper_drake.perception.cameras.texture import paint_texture, project_pattern
from pepper_drake.perception.stereo.matching import make_stereo_cameras
from pepper_drake.systems.sensing.projected_pattern import ProjectedPattern
from pepper_drake.systems.sensing.stereo_depth import StereoDepth

LEFT, RIGHT = make_stereo_cameras()
X_WHead = RigidTransform([0.0, 0.0, 1.0])
WALL = 0.9


def wall_image(camera, number):
    """A painted wall x = 0.9 in front of the head."""
    X_WC = X_WHead @ camera.X_HeadC
    rays = pixel_rays(camera.intrinsics.ideal()).astype(float)
    z = (WALL - X_WC.translation()[0]) / (rays @ X_WC.rotation().matrix()[0])
    bare = np.full((720, 1280, 4), 190, np.uint8)
    painted = paint_texture(bare, z, camera.intrinsics, X_WC)
    pixels = apply_color_noise(painted, camera.intrinsics, ColorNoise(2.0), seed=0, frame=number)
    image = ImageRgba8U(1280, 720)
    image.mutable_data[:] = pixels
    return image


@pytest.fixture(scope="module")
def pair():
    return [wall_image(camera, k) for k, camera in enumerate((LEFT, RIGHT))]


class Bench:
    def __init__(self):
        self.system = StereoDepth(LEFT, RIGHT, num_positions=2)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.fix("X_WC", X_WHead @ LEFT.X_HeadC)
        self.fix("position", [1.0, 2.0])

    def fix(self, name, value):
        self.system.GetInputPort(name).FixValue(self.context, value)

    def show(self, left, right, stamp, until):
        self.fix("color_image_left", left)
        self.fix("color_image_right", right)
        self.fix("time_stamp", [stamp])
        self.simulator.AdvanceTo(until)
        return self

    def output(self, name):
        return self.system.GetOutputPort(name).Eval(self.context)


def test_wall_is_seen_where_it_is(pair):
    bench = Bench().show(*pair, 0.0, 0.05)
    depth = bench.output("depth_image").data[..., 0].astype(float) / 1000
    X_WC = bench.output("X_WC")
    shown = depth > 0
    assert shown.mean() > 0.7
    points = X_WC @ (pixel_rays(bench.system.intrinsics)[shown] * depth[shown][:, None]).T
    assert np.median(points[0]) == pytest.approx(WALL, abs=0.003)
    assert bench.output("time_stamp") == [0.0]
    np.testing.assert_array_equal(bench.output("position"), [1, 2])
    assert not bench.system.HasAnyDirectFeedthrough()


def test_left_camera_may_sit_off_the_frame_that_is_tracked(pair):
    X_CL = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [0.1, 0, 0])
    moved = StereoDepth(LEFT, RIGHT, X_CL=X_CL, num_positions=2)
    bench = Bench()
    bench.system, bench.simulator = moved, Simulator(moved)
    bench.context = bench.simulator.get_mutable_context()
    bench.fix("X_WC", X_WHead @ LEFT.X_HeadC @ X_CL.inverse())
    bench.show(*pair, 0.0, 0.01)
    expected = Bench().show(*pair, 0.0, 0.01).output("X_WC")
    assert bench.output("X_WC").IsNearlyEqualTo(expected, 1e-9)


@pytest.mark.parametrize("fault", ["empty", "sizes", "future"])
def test_faulty_pairs_are_passed_over(pair, fault):
    left, right, stamp = {
        "empty": (ImageRgba8U(), ImageRgba8U(), 0.0),
        "sizes": (pair[0], ImageRgba8U(64, 48), 0.0),
        "future": (*pair, 9.0),
    }[fault]
    bench = Bench().show(left, right, stamp, 0.05)
    assert bench.output("time_stamp") == [-np.inf]
    assert bench.output("depth_image").size() == 0


def test_pattern_is_thrown_when_asked_for():
    camera = CameraIntrinsics.from_vertical_fov(64, 48, 0.8)
    X_CP = RigidTransform([0.05, 0, 0])
    system = ProjectedPattern(camera, X_CP, seed=4)
    context = system.CreateDefaultContext()
    color, depth = ImageRgba8U(64, 48), ImageDepth32F(64, 48)
    color.mutable_data[:] = 200
    depth.mutable_data[:] = 1.2
    system.GetInputPort("color_image").FixValue(context, color)
    system.GetInputPort("depth_image").FixValue(context, depth)
    lit = system.get_output_port().Eval(context).data
    expected = project_pattern(
        color.data, depth.data[..., 0], camera, RigidTransform(), X_CP, seed=4
    )
    np.testing.assert_array_equal(lit, expected)
    assert lit[..., 0].std() > 10
