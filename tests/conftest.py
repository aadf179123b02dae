"""Fixtures that several rooms' tests share."""

import gc

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.collision.sphere_model import arm_link_names

# A test must not fail because the machine is busy.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")

_FINENESS = 4


def pytest_collection_finish():
    """Keeps what was imported out of later garbage collections, which take 0.2 s each otherwise."""
    gc.collect()
    gc.freeze()


def _draw_marker(
    X_CM,
    intrinsics,
    *,
    marker_id=7,
    size=0.06,
    background=120,
    image=None,
    dictionary=cv2.aruco.DICT_4X4_50,
):
    """A marker drawn by OpenCV and warped by a homography: no part of the project's renderer."""
    book = cv2.aruco.getPredefinedDictionary(dictionary)
    pixels = 40
    picture = cv2.aruco.generateImageMarker(book, marker_id, 6 * pixels)
    picture = cv2.copyMakeBorder(picture, *[pixels] * 4, cv2.BORDER_CONSTANT, value=255)
    edge = size * 8 / 6
    # Picture coordinates (pixel centres are integers) to the marker plane, then to the image.
    to_plane = np.array(
        [
            [edge / len(picture), 0, (0.5 / len(picture) - 0.5) * edge],
            [0, -edge / len(picture), (0.5 - 0.5 / len(picture)) * edge],
            [0, 0, 1],
        ]
    )
    R, p = X_CM.rotation().matrix(), X_CM.translation()
    plane_to_C = np.column_stack([R[:, 0], R[:, 1], p])
    to_image = intrinsics.matrix @ plane_to_C @ to_plane
    if image is None:
        image = np.full((intrinsics.height, intrinsics.width), background, np.uint8)
    # Only the part of the image that the marker covers is drawn.
    ends = np.array([[0, 0], [len(picture), 0], [len(picture)] * 2, [0, len(picture)]], float)
    corners = cv2.perspectiveTransform(ends[None] - 0.5, to_image)[0]
    size_out = (intrinsics.width, intrinsics.height)
    left, top = np.clip(np.floor(corners.min(axis=0)).astype(int) - 1, 0, size_out)
    right, bottom = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 2, 0, size_out)
    if left >= right or top >= bottom:
        return image.copy()
    part = image[top:bottom, left:right]
    middle = (_FINENESS - 1) / 2
    fine = [
        [_FINENESS, 0, middle - _FINENESS * left],
        [0, _FINENESS, middle - _FINENESS * top],
        [0, 0, 1],
    ]
    to_part = np.array(fine) @ to_image
    shape = (part.shape[1] * _FINENESS, part.shape[0] * _FINENESS)
    fine_part = cv2.resize(part, shape, interpolation=cv2.INTER_NEAREST)
    warped = cv2.warpPerspective(picture, to_part, shape, flags=cv2.INTER_LINEAR)
    covers = cv2.warpPerspective(np.full_like(picture, 255), to_part, shape) > 127
    fine_part[covers] = warped[covers]
    drawn = image.copy()
    drawn[top:bottom, left:right] = cv2.resize(
        fine_part, part.shape[1::-1], interpolation=cv2.INTER_AREA
    )
    return drawn


@pytest.fixture
def draw_marker():
    """Returns a function that draws a marker at a pose X_CM into a grey image."""
    return _draw_marker


@pytest.fixture
def facing():
    """Returns a function that makes the pose of a marker that faces the camera, then tilted."""

    def make(position, tilt=0.0, azimuth=0.0, roll=0.0):
        axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        turn = cv2.Rodrigues(tilt * axis)[0]
        front = np.diag([1.0, -1.0, -1.0]) @ cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0]
        return RigidTransform(RotationMatrix(turn @ front), position)

    return make


def _true_clearance(arm, joints, points_T, cap=0.1):
    """Least signed distance of an arm's collision shapes to points in T, at most `cap`, m."""
    model = shared_control_model()
    plant, scene_graph = model.plant, model.diagram.scene_graph()
    root = model.diagram.CreateDefaultContext()
    context = plant.GetMyMutableContextFromRoot(root)
    for name, angle in zip(arm_joints(arm), joints, strict=True):
        plant.GetJointByName(name).set_angle(context, angle)
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
    links = [plant.GetBodyByName(name) for name in arm_link_names(arm)]
    own = {g for link in links for g in plant.GetCollisionGeometriesForBody(link)}
    X_WT = model.pose(context, "torso")
    p_TH = model.pose(context, f"{arm[0]}_hand_effector", "torso").translation()
    points = np.asarray(points_T)
    near = points[np.linalg.norm(points - p_TH, axis=1) < 0.6 + cap]
    found = [
        pair.distance
        for point in near
        for pair in query.ComputeSignedDistanceToPoint(X_WT @ point, cap)
        if pair.id_G in own
    ]
    return min(found, default=cap)


@pytest.fixture(scope="session")
def true_clearance():
    """Distance between an arm and points by Drake's scene graph."""
    return _true_clearance
