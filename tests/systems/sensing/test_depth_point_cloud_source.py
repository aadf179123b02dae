import itertools

import numpy as np
import pytest
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import ImageDepth16U

from pepper_drake.models.control_model import ControlModel
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, pixel_rays
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.perception.mapping.depth_scale import ray_depths
from pepper_drake.perception.mapping.depth_validity import DepthFault, ValidityParameters
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.seen_space import SpaceState
from pepper_drake.perception.mapping.solids import RobotSolids, Solid, SolidSet
from pepper_drake.systems.sensing.depth_point_cloud_source import DepthPointCloudSource

CAMERA = CAMERA_DEPTH.intrinsics
# Looks along +x, 1 m above the floor, at a wall 1 m away.
X_WC = RigidTransform(RollPitchYaw(-np.pi / 2, 0, -np.pi / 2), [0.0, 0.0, 1.0])
X_WT = RigidTransform(RollPitchYaw(0, 0, 0.5), [0.1, 0.2, 0.8])
BALL = MarkedObject(7, 0.06, RigidTransform(), (Solid(Sphere(0.1), RigidTransform()),))


NUMBERS = itertools.count()


def wall(millimetres=1000):
    """A wall; two images of it differ in one pixel that measured nothing, as a real camera's do."""
    image = ImageDepth16U(CAMERA.width, CAMERA.height)
    image.mutable_data[:] = millimetres
    image.mutable_data[0, next(NUMBERS) % CAMERA.width] = 0
    return image


class Bench:
    def __init__(self, *arguments, torso_range=5.0, **options):
        self.system = DepthPointCloudSource(*arguments, torso_range=torso_range, **options)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.fix("X_WC", X_WC)
        self.fix("X_WT", X_WT)

    def fix(self, name, value):
        self.system.GetInputPort(name).FixValue(self.context, value)

    def show(self, image, time):
        self.simulator.AdvanceTo(time)
        self.fix("depth_image", image)
        self.fix("time_stamp", [time])
        self.simulator.AdvanceTo(time + 0.05)
        return self

    def output(self, name):
        return self.system.GetOutputPort(name).Eval(self.context)

    def points(self, name="cloud"):
        return self.output(name).xyzs().T


def test_without_images_the_cloud_is_empty():
    bench = Bench()
    bench.simulator.AdvanceTo(0.3)
    assert bench.output("cloud").size() == 0
    assert bench.output("time_stamp") == [-np.inf]
    assert np.isinf(bench.output("age")).all()


def test_wall_is_where_it_is_in_both_frames():
    bench = Bench().show(wall(), 0.0)
    points = bench.points()
    assert len(points) > 1000
    np.testing.assert_allclose(points[:, 0], 1.0, atol=1e-5)
    np.testing.assert_allclose(
        bench.points("cloud_torso"), (X_WT.inverse() @ points.T.astype(float)).T, atol=1e-5
    )
    normals = bench.output("cloud").normals()
    known = np.isfinite(normals).all(axis=0)
    assert known.mean() > 0.8
    np.testing.assert_allclose(normals[0, known], -1, atol=1e-3)
    assert bench.output("time_stamp") == [0.0]
    assert bench.output("age")[0] == pytest.approx(0.05)


def test_cloud_stays_the_same_object_until_the_next_image():
    bench = Bench().show(wall(), 0.0)
    cloud = bench.output("cloud_torso")
    assert not bench.system.HasAnyDirectFeedthrough()
    bench.simulator.AdvanceTo(0.19)
    assert bench.output("cloud_torso") is cloud


def test_torso_cloud_follows_the_torso_between_images():
    bench = Bench().show(wall(), 0.0)
    moved = X_WT @ RigidTransform([0.01, 0, 0])
    bench.fix("X_WT", moved)
    bench.simulator.AdvanceTo(0.1)
    np.testing.assert_allclose(
        bench.points("cloud_torso"),
        (moved.inverse() @ bench.points().T.astype(float)).T,
        atol=1e-5,
    )


def test_torso_cloud_is_what_is_near():
    bench = Bench(torso_range=0.95).show(wall(), 0.0)
    distances = np.linalg.norm(bench.points() - X_WT.translation(), axis=1)
    near = np.linalg.norm(bench.points("cloud_torso"), axis=1)
    assert 0 < len(near) < len(distances)
    np.testing.assert_allclose(near, distances[distances <= 0.95], atol=1e-5)


def test_goal_object_is_cut_out_by_its_shape():
    bench = Bench(None, BALL)
    bench.fix("object_pose", RigidTransform([1.0, 0, 1.0]))
    bench.show(wall(), 0.0)
    distance = np.linalg.norm(bench.points() - [1, 0, 1], axis=1)
    assert 0.1 < distance.min() < 0.14
    bench.fix("object_velocity", [0.1, 0, 0])
    bench.show(wall(), 0.2)
    assert np.linalg.norm(bench.points() - [1, 0, 1], axis=1).min() > 0.14


def test_goal_that_is_lost_is_still_cut_out_where_it_was():
    bench = Bench(None, BALL)
    bench.fix("object_pose", RigidTransform())
    bench.fix("object_valid", [0.0])
    bench.show(wall(), 0.0)
    assert np.linalg.norm(bench.points() - [1, 0, 1], axis=1).min() < 0.02  # Not known yet.
    bench.fix("object_pose", RigidTransform([1.0, 0, 1.0]))
    bench.fix("object_valid", [1.0])
    bench.show(wall(), 0.2)
    bench.fix("object_pose", RigidTransform([5.0, 0, 1.0]))
    bench.fix("object_valid", [0.0])
    bench.show(wall(), 0.4)
    assert np.linalg.norm(bench.points() - [1, 0, 1], axis=1).min() > 0.1


def test_robot_is_cut_out_where_its_joints_put_it():
    model = ControlModel()
    bench = Bench(RobotSolids(model.plant, model.diagram.scene_graph()))
    q = np.zeros(model.plant.num_positions())
    context = model.create_context()
    model.plant.SetPositions(context, q)
    hand = model.pose(context, "r_hand_effector").translation()
    # A camera 0.6 m in front of the hand sees a wall right through it.
    look = RigidTransform(X_WC.rotation(), hand - [0.6, 0, 0])
    bench.fix("X_WC", look)
    bench.fix("position", q)
    bench.show(wall(600), 0.0)
    distances = np.linalg.norm(bench.points() - hand, axis=1)
    assert len(distances) > 500
    assert distances.min() > 0.04


@pytest.mark.parametrize("fault", ["empty", "future", "old", "small", "blind"])
def test_faulty_images_change_nothing(fault):
    bench = Bench().show(wall(), 0.4)
    before = bench.points().copy()
    image, time = {
        "empty": (ImageDepth16U(), 0.6),
        "future": (wall(700), 5.0),
        "old": (wall(700), 0.1),
        "small": (ImageDepth16U(16, 12), 0.6),
        "blind": (wall(0), 0.6),
    }[fault]
    bench.simulator.AdvanceTo(0.6)
    bench.fix("depth_image", image)
    bench.fix("time_stamp", [time])
    bench.simulator.AdvanceTo(0.65)
    np.testing.assert_array_equal(bench.points(), before)


def test_camera_that_hangs_while_the_head_turns_adds_nothing():
    first = wall()
    bench = Bench().show(first, 0.0)
    before = bench.points().copy()
    turned = X_WC @ RigidTransform(RollPitchYaw(0, 0.3, 0), [0, 0, 0])
    bench.fix("X_WC", turned)
    bench.show(first, 0.2)
    np.testing.assert_array_equal(bench.points(), before)
    assert bench.output("time_stamp") == [0.0]
    bench.show(wall(1001), 0.4)
    assert len(bench.points()) > len(before)


def board(millimetres):
    """A wall with a board before its left third."""
    image = wall(1200)
    image.mutable_data[1:, : CAMERA.width // 3] = millimetres
    return image


def test_board_that_moved_leaves_no_ghost():
    bench = Bench()
    for k in range(5):
        bench.show(board(900), 0.2 * k)
    for k in range(5, 7):
        bench.show(board(1100), 0.2 * k)
    distances = bench.points()[:, 0]
    assert distances.min() > 1.05
    assert np.any(np.abs(distances - 1.1) < 1e-3)


def spoilt(fault):
    """A faulty image after a wall 1 m away, and its time stamp."""
    image, stamp = wall(), 0.6
    if fault == DepthFault.MISSING:
        image = ImageDepth16U()
    elif fault == DepthFault.WRONG_SIZE:
        image = ImageDepth16U(16, 12)
    elif fault == DepthFault.BLANK:
        image.mutable_data[:] = 65535
    elif fault == DepthFault.CONSTANT:
        image.mutable_data[:] = 1000
    elif fault == DepthFault.LATE:
        stamp = 0.1
    elif fault == DepthFault.BELOW_FLOOR:
        image.mutable_data[:] *= 5
    elif fault == DepthFault.CONTRADICTS_MAP:
        image.mutable_data[1:] = 1300
    elif fault == DepthFault.WRONG_UNIT:
        image.mutable_data[:] = np.maximum(image.data // 1000, 1)
        image.mutable_data[::2] = 3
    elif fault == DepthFault.NOISE:
        image.mutable_data[:] = np.random.default_rng(0).integers(400, 2000, image.data.shape)
    return image, stamp


SEEN_ALONE = set(DepthFault) - {DepthFault.NONE, DepthFault.FROZEN, DepthFault.WRONG_SCALE}


@pytest.mark.parametrize("fault", sorted(SEEN_ALONE))
def test_what_is_no_image_lets_the_age_grow_and_is_named(fault):
    # Looks down by 45 degrees, so that there is a floor.
    down = X_WC @ RigidTransform(RollPitchYaw(-np.pi / 4, 0, 0), [0, 0, 0])
    bench = Bench()
    bench.fix("X_WC", down)
    for k in range(3):
        bench.show(wall(), 0.2 * k)
    assert bench.output("fault") == [DepthFault.NONE]
    before = bench.points().copy()
    image, stamp = spoilt(fault)
    bench.simulator.AdvanceTo(0.6)
    bench.fix("depth_image", image)
    bench.fix("time_stamp", [stamp])
    bench.simulator.AdvanceTo(0.9)
    assert bench.output("fault") == [fault]
    assert bench.output("time_stamp") == [0.4]
    assert bench.output("age")[0] == pytest.approx(0.5)
    np.testing.assert_array_equal(bench.points(), before)
    bench.show(wall(), 1.0)
    assert bench.output("fault") == [DepthFault.NONE]
    assert bench.output("age")[0] == pytest.approx(0.05)


@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_an_image_of_another_scale_than_the_goal_objects_marker_is_none(scale):
    down = X_WC @ RigidTransform(RollPitchYaw(-np.pi / 4, 0, 0), [0, 0, 0])
    place = RigidTransform([0.6, 0.0, 0.4])
    cube = Solid(Box(0.1, 0.1, 0.1), RigidTransform([0.0, 0.0, 0.05]))
    rays = pixel_rays(CAMERA).reshape(-1, 3).astype(float)
    table = (0.4 - down.translation()[2]) / (rays @ down.rotation().matrix()[2])
    cube_in_C = SolidSet.posed([cube], [down.InvertAndCompose(place)])
    depth = np.minimum(np.where(table > 0, table, 2.0), ray_depths(cube_in_C, rays, 0.3, 2.0))
    depth = np.minimum(depth, 2.0).reshape(CAMERA.height, CAMERA.width, 1)

    def image(scale):
        shown = ImageDepth16U(CAMERA.width, CAMERA.height)
        shown.mutable_data[:] = np.rint(1000 * scale * depth)
        return shown

    bench = Bench(None, MarkedObject(7, 0.06, RigidTransform(), (cube,)))
    bench.fix("X_WC", down)
    bench.fix("object_pose", place)
    bench.show(image(scale), 0.0)
    assert bench.output("fault") == [DepthFault.WRONG_SCALE]
    assert not len(bench.points())
    bench.show(image(1.0), 0.2)
    assert bench.output("fault") == [DepthFault.NONE]
    assert len(bench.points())
    bench.show(image(scale), 0.4)
    assert bench.output("fault") == [DepthFault.WRONG_SCALE]
    assert bench.output("time_stamp") == [0.2]


def test_equal_images_are_of_a_camera_that_hangs():
    image = wall()
    bench = Bench().show(image, 0.0)
    bench.show(image, 0.2)
    assert bench.output("fault") == [DepthFault.FROZEN]
    assert bench.output("time_stamp") == [0.0]
    bench.show(wall(), 0.4)
    assert bench.output("time_stamp") == [0.4]


def test_equal_images_without_noise_count_while_the_camera_stands():
    quiet = ObstacleParameters(validity=ValidityParameters(expects_noise=False))
    image = wall()
    bench = Bench(parameters=quiet).show(image, 0.0)
    bench.show(image, 0.2)
    assert bench.output("time_stamp") == [0.2]


def ball_before_the_wall(column, millimetres):
    image = wall()
    y, x = np.indices((CAMERA.height, CAMERA.width))
    image.mutable_data[(x - column) ** 2 + (y - 120) ** 2 < 20**2] = millimetres
    return image


def test_what_moves_is_expected_ahead_of_where_it_is_seen():
    bench = Bench()
    for number in range(5):
        bench.show(ball_before_the_wall(80 + 24 * number, 700), 0.2 * number)
    # 24 pixels in 0.2 s at 0.7 m are 0.29 m/s, towards -y.
    edge_before, edge = 0.7 * (CAMERA.center_x - np.array([172.0, 196.0])) / CAMERA.focal_x
    ahead = bench.points("predicted_cloud")
    assert ahead[:, 1].min() == pytest.approx(edge - 0.29 * 0.7, abs=0.04)
    assert ahead[:, 1].max() < edge_before + 0.02
    np.testing.assert_allclose(ahead[:, 0], 0.7, atol=0.03)


def test_what_is_too_near_to_be_measured_is_expected_all_the_same():
    bench = Bench().show(wall(), 0.0)
    assert bench.output("predicted_cloud").size() == 0
    bench.show(ball_before_the_wall(160, 0), 0.2)
    near = bench.points("predicted_cloud")
    assert len(near) > 5
    assert near[:, 0].max() < CAMERA.near + 0.04


def test_holes_mean_nothing_where_they_need_not_be_near():
    bench = Bench(parameters=ObstacleParameters(treat_holes_as_near=False)).show(wall(), 0.0)
    bench.show(ball_before_the_wall(160, 0), 0.2)
    assert bench.output("predicted_cloud").size() == 0


def test_space_is_known_where_an_image_looked_through_it():
    bench = Bench()
    places = np.array([[0.7, 0.0, 1.0], [1.0, 0.0, 1.0], [1.3, 0.0, 1.0]])
    assert not bench.output("space").states(places, 0.0)[0].any()
    bench.show(wall(), 0.0)
    state, age = bench.output("space").states(places, 0.05)
    np.testing.assert_array_equal(state, [SpaceState.FREE, SpaceState.OCCUPIED, SpaceState.UNKNOWN])
    np.testing.assert_allclose(age, [0.05, 0.05, np.inf])
