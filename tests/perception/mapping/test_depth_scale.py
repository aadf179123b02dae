import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import Box, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, pixel_rays
from pepper_drake.perception.mapping.depth_scale import depth_scale, ray_depths
from pepper_drake.perception.mapping.solids import Solid, SolidSet

CAMERA = CAMERA_DEPTH.intrinsics
SHAPE = (CAMERA.height, CAMERA.width)
# 1.2 m above the floor, 40 degrees down.
X_WC = RigidTransform(RollPitchYaw(-np.pi / 2 - 0.7, 0, -np.pi / 2), [0.0, 0.0, 1.2])
X_WO = RigidTransform([0.7, 0.05, 0.7])
MUG = [
    Solid(Cylinder(0.04, 0.1), RigidTransform([0.0, 0.0, 0.05])),
    Solid(Box(0.02, 0.02, 0.06), RigidTransform([0.0, 0.05, 0.05])),
]


def shown(solids=MUG, X=X_WO, height=0.7):
    """Exact depths of solids posed at X, on a table top of some height [m]."""
    X_CO = X_WC.InvertAndCompose(X)
    rays = pixel_rays(CAMERA).reshape(-1, 3).astype(float)
    depths = ray_depths(SolidSet.posed(solids, [X_CO] * len(solids)), rays, 0.3, 2.0)
    down = rays @ X_WC.rotation().matrix()[2]
    table = np.where(down < 0.0, (height - X_WC.translation()[2]) / down, np.inf)
    return np.minimum(np.minimum(depths, table), 3.0).reshape(SHAPE).astype(np.float32)


def scale_of(depth, X=X_WO, robot=None):
    return depth_scale(depth, CAMERA, X_WC, X, MUG, robot, robot_margin=0.02, spread=0.04)


def test_rays_meet_a_sphere_and_a_box_where_they_should():
    rays = np.array([[0.0, 0.0, 1.0], [0.05, 0.0, 1.0], [0.0, 0.5, 1.0]])
    ball = SolidSet([Solid(Sphere(0.1), RigidTransform([0.0, 0.0, 1.0]))])
    # (0.05 z)² + (z - 1)² = 0.01 for the second; the third passes by.
    second = (1.0 - np.sqrt(1.0 - 1.0025 * 0.99)) / 1.0025
    np.testing.assert_allclose(ray_depths(ball, rays, 0.5, 2.0), [0.9, second, np.inf], atol=2e-3)
    box = SolidSet([Solid(Box(1.0, 1.0, 0.2), RigidTransform([0.0, 0.0, 1.0]))])
    np.testing.assert_allclose(ray_depths(box, rays, 0.5, 2.0), [0.9] * 3, atol=1e-3)
    assert np.all(np.isinf(ray_depths(box, -rays, 0.0, 2.0)))


@given(scale=st.floats(0.5, 1.5), x=st.floats(0.55, 1.2), turn=st.floats(-3.0, 3.0))
def test_the_scale_of_an_image_is_found(scale, x, turn):
    X = RigidTransform(RollPitchYaw(0.0, 0.0, turn), [x, 0.05, 0.7])
    depth = np.float32(scale) * shown(X=X)
    assert scale_of(depth, X) == pytest.approx(scale, abs=0.01)


def test_holes_do_not_matter():
    depth = shown()
    depth[::3] = 0.0
    assert scale_of(depth) == pytest.approx(1.0, abs=0.01)
    assert np.isnan(scale_of(np.zeros(SHAPE, np.float32)))


def test_what_is_seen_through_tells_nothing():
    assert np.isnan(scale_of(shown(solids=[])))
    wall = np.minimum(shown(solids=[]), 0.95)
    assert np.isnan(scale_of(wall))


def test_what_hides_it_evenly_tells_nothing():
    depth = shown()
    part = np.isfinite(ray_depths_of_mug())
    depth[part] *= 0.9
    assert np.isnan(scale_of(depth))


def ray_depths_of_mug():
    X_CO = X_WC.InvertAndCompose(X_WO)
    rays = pixel_rays(CAMERA).reshape(-1, 3).astype(float)
    return ray_depths(SolidSet.posed(MUG, [X_CO] * len(MUG)), rays, 0.3, 2.0).reshape(SHAPE)


@pytest.mark.parametrize(
    "X",
    [[0.7, -0.01, 0.7], [0.7, 0.05, 0.78], [0.1, 0.0, 1.1], [-1.0, 0.0, 0.7], [0.7, 1.5, 0.7]],
    ids=["is elsewhere", "is lifted", "is too near", "is behind", "is out of view"],
)
def test_nothing_is_told_by_a_thing_that(X):
    assert np.isnan(scale_of(shown(), RigidTransform(X)))


def test_half_of_it_tells_nothing():
    depth = shown()
    middle = round(CAMERA.project((X_WC.inverse() @ X_WO).translation())[0])
    depth[:, :middle] = 0.4
    assert np.isnan(scale_of(depth))


def test_the_robots_own_hand_before_it_does_not_matter():
    hand = Solid(Box(0.02, 0.3, 0.03), RigidTransform([0.62, 0.05, 0.78]))
    depth = np.minimum(shown(), shown([hand], RigidTransform(), height=-9.0))
    assert scale_of(depth, robot=SolidSet([hand])) == pytest.approx(1.0, abs=0.01)
    assert scale_of(depth) != pytest.approx(1.0, abs=0.01)
