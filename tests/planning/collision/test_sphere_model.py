import numpy as np
import pytest
from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, Sphere

from pepper_drake.models.control_model import shared_control_model
from pepper_drake.planning.collision.sphere_model import (
    SphereModel,
    approximate_with_spheres,
    arm_link_names,
    make_link_spheres,
)


def random_points_in(shape, rng, count=4000):
    if isinstance(shape, Box):
        return (rng.random((count, 3)) - 0.5) * np.asarray(shape.size())
    points = rng.uniform(-1, 1, (6 * count, 3))
    if isinstance(shape, Sphere):
        return shape.radius() * points[np.linalg.norm(points, axis=1) <= 1]
    disc = points[np.hypot(points[:, 0], points[:, 1]) <= 1]
    return disc * [shape.radius(), shape.radius(), shape.length() / 2]


@pytest.mark.parametrize(
    ("shape", "missed"),
    [
        (Sphere(0.04), 0.0),
        (Box(0.206, 0.088, 0.087), 0.004),
        (Box(0.03, 0.03, 0.03), 0.02),
        (Capsule(0.047, 0.13), 0.047 * (1 - np.sqrt(1 - 0.3**2))),
        (Cylinder(0.04, 0.084), 0.012),
    ],
    ids=str,
)
def test_spheres_cover_a_shape_but_for_its_sharpest_corners(shape, missed):
    centers, radii = approximate_with_spheres(shape)
    points = random_points_in(shape, np.random.default_rng(1))
    depth = np.max(radii - np.linalg.norm(points[:, None] - centers, axis=2), axis=1)
    # No point is left out by more than the millimetres that the safety margin allows for.
    assert np.quantile(-depth, 1.0) <= missed + 1e-12


def test_an_unknown_shape_is_named():
    with pytest.raises(TypeError, match="Ellipsoid"):
        approximate_with_spheres(Ellipsoid(1, 1, 1))


def test_placing_turns_then_moves_each_link():
    spheres = SphereModel(
        ("a", "b"), np.array([0, 1, 1]), np.array([[1.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.ones(3)
    )
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    placed = spheres.place(np.stack([np.eye(3), quarter]), np.array([[0.0, 0, 1], [0, 0, 2]]))
    np.testing.assert_allclose(placed, [[1, 0, 1], [0, 1, 2], [-1, 0, 2]], atol=1e-15)


def test_both_arms_have_mirrored_spheres():
    model = shared_control_model()
    right = make_link_spheres(model, arm_link_names("right"))
    left = make_link_spheres(model, arm_link_names("left"))
    assert len(right.radii) == len(left.radii) > 20
    mirrored = right.centers * [1, -1, 1]
    for link in range(len(right.link_names)):
        a = np.sort(mirrored[right.link == link].round(9), axis=0)
        b = np.sort(left.centers[left.link == link].round(9), axis=0)
        np.testing.assert_allclose(a, b, atol=1e-8)
