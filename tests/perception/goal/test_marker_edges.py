import cv2
import numpy as np
import pytest

from pepper_drake.perception.cameras.camera import CAMERA_TOP
from pepper_drake.perception.goal.marker_edges import marker_edges, refine_on_edges

CAMERA = CAMERA_TOP.intrinsics.ideal()
EDGES = marker_edges("DICT_4X4_50", 7)


def test_edges_lie_where_the_picture_changes():
    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    picture = np.pad(cv2.aruco.generateImageMarker(book, 7, 600), 100, constant_values=255)

    def brightness(places):
        columns, rows = 400 + 600 * places[:, 0], 400 - 600 * places[:, 1]
        return picture[rows.astype(int), columns.astype(int)]

    assert (brightness(EDGES.points + 0.02 * EDGES.normals) == 255).all()
    assert (brightness(EDGES.points - 0.02 * EDGES.normals) == 0).all()
    # The outline of the black square is an edge all around.
    assert np.sum(np.abs(EDGES.points).max(axis=1) > 0.499) == 4 * 6 * 4


@pytest.mark.parametrize("distance", [0.3, 0.7, 1.1])
def test_fit_recovers_the_pose(draw_marker, facing, distance):
    X_CM = facing([0.02, 0.01, distance], 0.6, 0.7, 0.4)
    image = draw_marker(X_CM, CAMERA)
    start = facing([0.021, 0.01, distance * 1.005], 0.62, 0.7, 0.4)
    fit = refine_on_edges(image, start, EDGES, 0.06, CAMERA)
    error = fit.X_CM.translation() - X_CM.translation()
    assert np.linalg.norm(error) < 0.002 * distance
    turn = fit.X_CM.rotation().InvertAndCompose(X_CM.rotation()).ToAngleAxis().angle()
    assert turn < 0.01
    assert fit.support == 1.0
    assert np.linalg.norm(error) < 3 * np.sqrt(np.trace(fit.covariance[3:, 3:]))


def test_fit_bears_a_hidden_corner(draw_marker, facing):
    X_CM = facing([0, 0, 0.5], 0.4)
    image = draw_marker(X_CM, CAMERA)
    u, v = CAMERA.project(X_CM @ [0.03, 0.03, 0]).astype(int)
    image[v - 12 : v + 12, u - 12 : u + 12] = 120
    fit = refine_on_edges(image, X_CM, EDGES, 0.06, CAMERA)
    assert 0.7 < fit.support < 1.0
    assert np.linalg.norm(fit.X_CM.translation() - X_CM.translation()) < 0.001


def test_nothing_to_see_gives_no_fit(facing):
    blank = np.full((480, 640), 120, np.uint8)
    assert refine_on_edges(blank, facing([0, 0, 0.5]), EDGES, 0.06, CAMERA) is None


def test_marker_out_of_the_image_or_too_small_gives_no_fit(draw_marker, facing):
    X_CM = facing([0, 0, 0.5])
    image = draw_marker(X_CM, CAMERA)
    assert refine_on_edges(image, facing([0.6, 0, 0.5]), EDGES, 0.06, CAMERA) is None
    assert refine_on_edges(image, facing([0, 0, 6.0]), EDGES, 0.06, CAMERA) is None
    assert refine_on_edges(image, facing([0, 0, -0.5]), EDGES, 0.06, CAMERA) is None
