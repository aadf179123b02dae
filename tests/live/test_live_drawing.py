import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.live.drawing import colored_cloud, stretched, tube


@given(st.integers(0, 2**32 - 1), st.integers(2, 30))
def test_a_tube_lies_about_its_path(seed, count):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(size=(count, 3)) + [3.0, 0, 0], axis=0)
    vertices, triangles = tube(path, 0.1, sides=5)
    rings = vertices.reshape(count, 5, 3)
    np.testing.assert_allclose(rings.mean(axis=1), path, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(rings - path[:, None], axis=2), 0.1)
    across = np.einsum("nsk,nk->ns", rings - path[:, None], np.gradient(path, axis=0))
    np.testing.assert_allclose(across, 0, atol=1e-9)
    assert triangles.shape == (2 * (count - 1) * 5, 3)
    # Inside, each edge of a closed surface belongs to two triangles; at the two ends to one.
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, shared = np.unique(edges, axis=0, return_counts=True)
    assert sorted(set(shared)) == [1, 2]
    assert np.count_nonzero(shared == 1) == 2 * 5


def test_a_stretched_cylinder_reaches_from_end_to_end():
    start, end = np.array([0.1, 0.2, 0.3]), np.array([0.4, -0.2, 0.3])
    X = stretched(start, end)
    for z, point in ((-0.5, start), (0.5, end)):
        np.testing.assert_allclose((X @ [0, 0, z, 1])[:3], point, atol=1e-12)
    assert np.isfinite(stretched(start, start)).all()


def test_a_cloud_is_red_when_near_and_blue_when_far():
    points = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 2]])
    cloud = colored_cloud(points, np.array([0.0, 0.15, 5.0]))
    np.testing.assert_allclose(cloud.xyzs().T, points)
    near, _, far = cloud.rgbs().T.astype(int)
    assert near[0] > near[2] + 100
    assert far[2] > far[0] + 50
