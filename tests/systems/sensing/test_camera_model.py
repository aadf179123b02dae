import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.image_future import ImageFuture
from pepper_drake.perception.cameras.noise import (
    ColorNoise,
    DepthNoise,
    apply_color_noise,
    apply_depth_noise,
    drop_dark_patches,
)
from pepper_drake.systems.sensing.async_rgbd_sensor import AsyncRgbdSensor
from pepper_drake.systems.sensing.camera_model import CameraModel

INTRINSICS = CameraIntrinsics.from_vertical_fov(32, 24, 0.8, near=0.4, far=8.0)


class Renderer(LeafSystem):
    """Counts how often its image is asked for."""

    def __init__(self, make):
        super().__init__()
        self.count = 0
        self.make = make
        self.DeclareAbstractOutputPort("image", lambda: Value(type(make(0.0))()), self.calc)

    def calc(self, context, output):
        self.count += 1
        output.set_value(self.make(context.get_time()))


def color_image(time):
    image = ImageRgba8U(32, 24)
    image.mutable_data[:] = int(10 * time + 0.5) + 50
    return image


def depth_image(time):
    image = ImageDepth32F(32, 24)
    image.mutable_data[:] = 1.0 + time
    return image


def build(make=color_image, **options):
    builder = DiagramBuilder()
    renderer = builder.AddSystem(Renderer(make))
    options = {"kind": "color", "noise": ColorNoise(sigma=0.0)} | options
    camera = builder.AddSystem(CameraModel(INTRINSICS, **options))
    builder.Connect(renderer.get_output_port(), camera.get_image_input_port())
    for name in ("X_WC", "enabled"):
        builder.ExportInput(camera.GetInputPort(name), name)
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    return simulator, renderer, camera, camera.GetMyContextFromRoot(root)


def stamp(camera, context):
    return camera.GetOutputPort("time_stamp").Eval(context)[0]


def test_there_is_no_image_before_the_first():
    simulator, renderer, camera, context = build(offset=0.1)
    simulator.AdvanceTo(0.05)
    assert stamp(camera, context) == -np.inf
    assert camera.get_image_output_port().Eval(context).size() == 0
    assert renderer.count == 0


def test_image_pose_and_stamp_are_of_the_same_moment():
    simulator, renderer, camera, context = build(period=0.2, offset=0.1)
    root = simulator.get_mutable_context()
    pose = simulator.get_system().GetInputPort("X_WC")
    pose.FixValue(root, RigidTransform([1.0, 0, 0]))
    simulator.AdvanceTo(0.35)
    pose.FixValue(root, RigidTransform([2.0, 0, 0]))
    simulator.AdvanceTo(0.4)
    assert stamp(camera, context) == pytest.approx(0.3)
    assert camera.get_image_output_port().Eval(context).data[0, 0, 0] == 53
    X_WC = camera.GetOutputPort("X_WC").Eval(context)
    np.testing.assert_array_equal(X_WC.translation(), [1, 0, 0])
    assert renderer.count == 2


def test_joints_are_captured_with_the_image():
    camera = CameraModel(INTRINSICS, kind="color", num_positions=2)
    simulator = Simulator(camera)
    context = simulator.get_mutable_context()
    camera.get_image_input_port().FixValue(context, color_image(0))
    camera.GetInputPort("position").FixValue(context, [1.0, 2.0])
    simulator.AdvanceTo(0.05)
    camera.GetInputPort("position").FixValue(context, [3.0, 4.0])
    simulator.AdvanceTo(0.15)
    np.testing.assert_array_equal(camera.GetOutputPort("position").Eval(context), [1, 2])


def test_nothing_is_rendered_while_disabled():
    simulator, renderer, camera, context = build(period=0.1)
    enabled = simulator.get_system().GetInputPort("enabled")
    enabled.FixValue(simulator.get_mutable_context(), [0.0])
    simulator.AdvanceTo(1.05)
    assert renderer.count == 0
    enabled.FixValue(simulator.get_mutable_context(), [1.0])
    simulator.AdvanceTo(1.25)
    assert renderer.count == 2
    assert stamp(camera, context) == pytest.approx(1.2)


def test_outputs_between_images_cost_nothing():
    simulator, renderer, camera, context = build(period=0.2)
    simulator.AdvanceTo(0.05)
    first = camera.get_image_output_port().Eval(context)
    assert not camera.HasAnyDirectFeedthrough()
    for time in (0.1, 0.15, 0.19):
        simulator.AdvanceTo(time)
        assert camera.get_image_output_port().Eval(context) is first
    assert renderer.count == 1


def test_a_dropped_frame_leaves_the_last_one():
    def make(time):
        return ImageRgba8U() if 0.15 < time < 0.35 else color_image(time)

    simulator, _, camera, context = build(make, period=0.1)
    simulator.AdvanceTo(0.32)
    assert stamp(camera, context) == pytest.approx(0.1)
    simulator.AdvanceTo(0.42)
    assert stamp(camera, context) == pytest.approx(0.4)
    assert camera.last_frame(context).number == 3


@pytest.mark.parametrize(
    ("kind", "make", "noise"),
    [("color", color_image, ColorNoise()), ("depth", depth_image, DepthNoise())],
)
def test_noise_is_that_of_seed_and_frame_number(kind, make, noise):
    def images(seed, prepare=False):
        simulator, _, camera, context = build(make, kind=kind, noise=noise, seed=seed)
        if prepare:
            camera.prepare()
        found = []
        for time in (0.1, 0.3):
            simulator.AdvanceTo(time)
            found.append(camera.get_image_output_port().Eval(context).data.copy())
        return found

    one, again, other = images(4), images(4, prepare=True), images(5)
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one[1], other[1])
    if kind == "color":
        expected = apply_color_noise(make(0.2).data, INTRINSICS, noise, seed=4, frame=1)
    else:
        clean = make(0.2).data[..., 0]
        lit = drop_dark_patches(clean, INTRINSICS, RigidTransform(), noise, seed=4)
        expected = apply_depth_noise(lit, INTRINSICS, noise, seed=4, frame=1)
    np.testing.assert_array_equal(np.squeeze(one[1]), np.squeeze(expected))


def test_two_contexts_of_one_camera_do_not_meet():
    simulator, _, camera, context = build(period=0.2)
    other = Simulator(simulator.get_system())
    simulator.AdvanceTo(0.5)
    other.AdvanceTo(0.1)
    assert stamp(camera, context) == pytest.approx(0.4)
    assert stamp(camera, camera.GetMyContextFromRoot(other.get_context())) == 0.0


def test_a_frame_is_out_after_its_latency_with_what_was_measured_then():
    simulator, renderer, camera, context = build(period=0.2, latency=0.15)
    pose = simulator.get_system().GetInputPort("X_WC")
    root = simulator.get_mutable_context()
    pose.FixValue(root, RigidTransform([1.0, 0, 0]))
    simulator.AdvanceTo(0.1)
    assert renderer.count == 1
    assert stamp(camera, context) == -np.inf
    assert camera.get_image_output_port().Eval(context).size() == 0
    pose.FixValue(root, RigidTransform([2.0, 0, 0]))
    simulator.AdvanceTo(0.18)
    assert stamp(camera, context) == 0.0
    assert camera.get_image_output_port().Eval(context).data[0, 0, 0] == 50
    X_WC = camera.GetOutputPort("X_WC").Eval(context)
    np.testing.assert_array_equal(X_WC.translation(), [1, 0, 0])
    simulator.AdvanceTo(0.34)
    assert stamp(camera, context) == 0.0
    simulator.AdvanceTo(0.36)
    assert stamp(camera, context) == pytest.approx(0.2)


def test_images_from_the_background_are_waited_for_when_they_are_looked_at():
    executor = ThreadPoolExecutor(1)
    release = threading.Event()

    def render(positions):
        pixels = np.full((24, 32, 4), int(positions[0]), np.uint8)
        return ImageFuture(executor.submit(lambda: release.wait(10) and pixels), executor)

    builder = DiagramBuilder()
    sensor = builder.AddSystem(AsyncRgbdSensor(render, 1))
    noise = ColorNoise(sigma=0.0)
    camera = builder.AddSystem(
        CameraModel(INTRINSICS, kind="color", latency=0.1, background=True, noise=noise)
    )
    builder.Connect(sensor.get_output_port(), camera.get_image_input_port())
    builder.ExportInput(sensor.get_input_port(), "positions")
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    context = camera.GetMyContextFromRoot(root)
    simulator.get_system().GetInputPort("positions").FixValue(root, [70.0])
    simulator.AdvanceTo(0.15)  # Does not wait: nobody looks yet.
    assert stamp(camera, context) == 0.0
    release.set()
    assert camera.get_image_output_port().Eval(context).data[0, 0, 0] == 70
    executor.shutdown()


def test_a_latency_beyond_the_period_is_named():
    with pytest.raises(InputError, match=r"latency 0\.3 s"):
        CameraModel(INTRINSICS, kind="color", period=0.2, latency=0.3)


def test_bad_kind_and_noise_are_named():
    with pytest.raises(InputError, match="infrared"):
        CameraModel(INTRINSICS, kind="infrared")
    with pytest.raises(InputError, match="DepthNoise"):
        CameraModel(INTRINSICS, kind="depth", noise=ColorNoise())
