import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, CAMERA_TOP
from pepper_drake.perception.cameras.camera_files import (
    StereoCalibration,
    load_intrinsics,
    load_stereo,
    make_intrinsics,
)

K = np.array([[610.5, 0.0, 320.25], [0.0, 612.75, 238.5], [0.0, 0.0, 1.0]])
FIVE = (0.12, -0.25, 0.001, -0.002, 0.08)
EIGHT = (0.3, -0.1, 0.001, -0.002, 0.02, 0.35, -0.05, 0.01)

ROS = """image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [610.5, 0.0, 320.25, 0.0, 612.75, 238.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.12, -0.25, 0.001, -0.002, 0.08]
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [600, 0, 320, 0, 0, 600, 240, 0, 0, 0, 1, 0]}
"""
MESSAGE = """header: {seq: 3, frame_id: head}
height: 480
width: 640
distortion_model: rational_polynomial
D: [0.3, -0.1, 0.001, -0.002, 0.02, 0.35, -0.05, 0.01]
K: [610.5, 0.0, 320.25, 0.0, 612.75, 238.5, 0.0, 0.0, 1.0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
"""


def write(path, text):
    path.write_text(text)
    return path


def storage(path, **entries):
    """A file as OpenCV's calibration samples write it; the suffix decides the format."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in entries.items():
        file.write(name, value)
    file.release()
    return path


def is_right(camera, distortion=FIVE):
    assert (camera.width, camera.height) == (640, 480)
    np.testing.assert_allclose(camera.matrix, K)
    expected = np.zeros(8 if len(distortion) == 8 else 5)
    expected[: len(distortion)] = distortion
    np.testing.assert_allclose(camera.distortion, expected)


def test_ros_calibrations_are_read(tmp_path):
    is_right(load_intrinsics(write(tmp_path / "head.yaml", ROS)))


def test_ros_messages_are_read(tmp_path):
    is_right(load_intrinsics(write(tmp_path / "info.yaml", MESSAGE)), EIGHT)
    lower = MESSAGE.replace("D:", "d:").replace("K:", "k:")
    is_right(load_intrinsics(write(tmp_path / "info2.yaml", lower)), EIGHT)


@pytest.mark.parametrize("suffix", ["yml", "yaml", "json", "xml"])
@pytest.mark.parametrize("distortion", [FIVE[:4], FIVE, EIGHT])
def test_opencv_storages_are_read(tmp_path, suffix, distortion):
    path = storage(
        tmp_path / f"camera.{suffix}",
        image_width=640,
        image_height=480,
        camera_matrix=K,
        distortion_coefficients=np.array(distortion).reshape(-1, 1),
        avg_reprojection_error=0.31,
    )
    is_right(load_intrinsics(path), distortion)


def test_names_of_other_scripts_are_read(tmp_path):
    path = storage(
        tmp_path / "c.json", image_size=np.array([640, 480]), cameraMatrix=K, dist=np.array([FIVE])
    )
    is_right(load_intrinsics(path))


def test_naoqi_names_are_read(tmp_path):
    own = load_intrinsics(write(tmp_path / "n.yaml", "camera: CameraTop\nresolution: kVGA\n"))
    assert own.distortion == CAMERA_TOP.intrinsics.distortion
    np.testing.assert_allclose(own.matrix, CAMERA_TOP.intrinsics.matrix)
    depth = load_intrinsics(write(tmp_path / "d.yaml", "camera: 2\nresolution: 1\n"))
    np.testing.assert_allclose(depth.matrix, CAMERA_DEPTH.intrinsics.matrix)
    assert (depth.near, depth.far) == (0.4, 8.0)
    wide = load_intrinsics(
        write(tmp_path / "w.yaml", "camera: 0\nresolution: 3\nhorizontal_fov: 1.0\n")
    )
    assert (wide.width, wide.height) == (1280, 960)
    assert wide.focal_x == pytest.approx(640 / np.tan(0.5))
    assert wide.focal_y == pytest.approx(2 * CAMERA_TOP.intrinsics.focal_y)


KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [0.12, -0.25, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [610.5, 612.75, 320.25, 238.5]
  resolution: [640, 480]
"""
ONE_BY_ONE = {
    "Kalibr": KALIBR,
    "EuRoC": "%YAML:1.0\n"
    + KALIBR.replace("cam0:\n", "").replace("  ", "").replace("radtan", "radial-tangential"),
    "RealSense": '{"width": 640, "height": 480, "fx": 610.5, "fy": 612.75, "ppx": 320.25, '
    '"ppy": 238.5, "model": "distortion.brown_conrady", "coeffs": [0.12, -0.25, 0.001, -0.002, 0]}',
    "ORB-SLAM": "%YAML:1.0\nCamera.type: PinHole\nCamera.fx: 610.5\nCamera.fy: 612.75\n"
    "Camera.cx: 320.25\nCamera.cy: 238.5\nCamera.k1: 0.12\nCamera.k2: -0.25\nCamera.p1: 0.001\n"
    "Camera.p2: -0.002\nCamera.width: 640\nCamera.height: 480\nViewer.PointSize:2\n"
    "Viewer.Colours:[1, 2]\n",
    "VINS": "%YAML:1.0\n---\nmodel_type: PINHOLE\nimage_width: 640\nimage_height: 480\n"
    "distortion_parameters:\n   k1: 0.12\n   k2: -0.25\n   p1: 0.001\n   p2: -0.002\n"
    "projection_parameters:\n   fx: 610.5\n   fy: 612.75\n   cx: 320.25\n   cy: 238.5\n",
    "a printed message": ROS.replace("-0.002, 0.08", "-0.002, 0") + "---\n",
}


@pytest.mark.parametrize("name", ONE_BY_ONE)
def test_focal_lengths_one_by_one_are_read(tmp_path, name):
    is_right(load_intrinsics(write(tmp_path / "camera.yaml", ONE_BY_ONE[name])), FIVE[:4])


BAD = {
    "two cameras": (KALIBR + KALIBR.replace("cam0", "cam1"), "2 cameras"),
    "an omnidirectional lens": (KALIBR.replace("pinhole", "omni"), "fisheye"),
    "VINS, another lens": (
        "%YAML:1.0\n---\nmodel_type: MEI\nimage_width: 640\n",
        "fisheye lens .mei",
    ),
    "OpenCV's xi": (ROS + "xi: 1.2\n", "fisheye"),
    "a matrix of smaller images": (
        ROS.replace("640", "1280").replace("480", "960"),
        "principal point",
    ),
    "a relative matrix": (
        ROS.replace("[610.5, 0.0, 320.25, 0.0, 612.75, 238.5", "[0.95, 0, 0.5, 0, 1.28, 0.5"),
        "principal point",
    ),
    "focal lengths in millimetres": (
        ROS.replace("610.5", "4.2").replace("612.75", "4.2"),
        "4.2 pixels would be a view of 178 degrees; is it in millimetres",
    ),
    "ROS's INI": ("# oST version 5.0 parameters\n[image]\nwidth\n640\n", "INI"),
    "fisheye": (ROS.replace("plumb_bob", "equidistant"), "fisheye"),
    "unknown model": (ROS.replace("plumb_bob", "spherical"), "spherical"),
    "no matrix": (ROS.replace("camera_matrix", "other"), "camera_matrix"),
    "no size": (ROS.replace("image_width", "w"), "image_width"),
    "half a pixel": (ROS.replace("640", "640.5"), "whole numbers"),
    "eight numbers": (ROS.replace("0.0, 0.0, 1.0]", "0.0, 1.0]"), "9 numbers"),
    "a misspelt name": (
        ROS.replace("distortion_coefficients", "distortion_coefficents"),
        "distortion_coefficents; name it",
    ),
    "three coefficients": (ROS.replace("[0.12, -0.25, ", "["), "3 distortion"),
    "skew": (ROS.replace("610.5, 0.0,", "610.5, 3.0,"), "skew"),
    "transposed": (
        ROS.replace("[610.5, 0.0, 320.25, 0.0,", "[610.5, 0.0, 0.0, 320.25,"),
        "fx, 0, cx",
    ),
    "negative focal length": (ROS.replace("610.5", "-610.5"), "focal"),
    "not a number": (ROS.replace("0.12,", "abc,"), "list of numbers"),
    "binned": (MESSAGE.replace("binning_x: 0", "binning_x: 2"), "binning_x"),
    "part of the sensor": (MESSAGE.replace("x_offset: 0", "x_offset: 40"), "roi"),
    "not YAML": ("a: [1, 2\nb: }", "YAML"),
    "no mapping": ("- 1\n- 2\n", "camera_matrix"),
    "reference": ("a: &x 3\nb: *x\n", "aliases"),
    "broken storage": ("%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n", "9 numbers"),
    "unknown camera": ("camera: CameraChest\nresolution: kVGA\n", "CameraTop"),
    "unknown resolution": ("camera: CameraTop\nresolution: kHD\n", "kVGA"),
    "angle in degrees": ("camera: 0\nresolution: 2\nvertical_fov: 44\n", "rad"),
    "empty": ("", "camera"),
}


@pytest.mark.parametrize("case", BAD)
def test_other_files_are_refused_in_a_sentence_that_names_the_file(tmp_path, case):
    text, words = BAD[case]
    with pytest.raises(InputError, match=words) as error:
        load_intrinsics(write(tmp_path / "bad.yaml", text))
    assert "bad.yaml" in str(error.value)
    assert "\n" not in str(error.value)


def test_opencv_fisheye_is_refused(tmp_path):
    path = storage(
        tmp_path / "f.yml",
        image_width=640,
        image_height=480,
        fisheye_model=1,
        camera_matrix=K,
        distortion_coefficients=np.array(FIVE[:4]),
    )
    with pytest.raises(InputError, match="fisheye"):
        load_intrinsics(path)


def test_missing_files_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nothing\.yaml"):
        load_intrinsics(tmp_path / "nothing.yaml")


@given(st.text(max_size=200), st.sampled_from([ROS, MESSAGE]), st.integers(0, 400))
def test_damaged_files_are_read_or_refused(tmp_path_factory, garbage, text, place):
    path = tmp_path_factory.mktemp("damaged") / "camera.yaml"
    path.write_text(text[:place] + garbage + text[place + len(garbage) :], encoding="utf-8")
    try:
        camera = load_intrinsics(path)
    except InputError:
        return
    assert camera.width > 0
    assert np.isfinite(camera.matrix).all()


def test_matrices_of_opencv_are_taken_as_they_are():
    is_right(make_intrinsics(K, np.array([FIVE]), (640, 480)))


R = cv2.Rodrigues(np.radians([0.2, -0.31, 0.1]))[0]
T = np.array([[-0.083], [0.001], [-0.0005]])


def stereo(path, **changes):
    entries = {"M1": K, "D1": np.array([FIVE]), "M2": K + np.diag([3.0, 2.0, 0.0])}
    entries |= {"D2": np.array([EIGHT]), "R": R, "T": T}
    entries |= {"image_width": 640, "image_height": 480} | changes
    return storage(path, **{k: v for k, v in entries.items() if v is not None})


def test_stereo_calibrations_keep_their_full_rotation(tmp_path):
    pair = load_stereo(stereo(tmp_path / "s.yml"))
    np.testing.assert_allclose(pair.X_RL.rotation().matrix(), R, atol=1e-9)
    np.testing.assert_allclose(pair.X_RL.translation(), T[:, 0])
    assert pair.left.distortion == FIVE
    assert pair.right.focal_x == pytest.approx(613.5)
    # In chessboard squares of 25 mm.
    squares = load_stereo(stereo(tmp_path / "q.yml", T=T / 0.025), unit=0.025)
    np.testing.assert_allclose(squares.X_RL.translation(), T[:, 0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"T": -T}, "exchanged"),
        ({"T": np.array([[0.001], [-0.08], [0.0]])}, "left"),
        ({"R": np.diag([1.0, 1.0, 1.1])}, "rotation matrix"),
        ({"R": None}, "R must"),
        ({"M2": None}, "M2 must"),
    ],
)
def test_other_stereo_calibrations_are_refused(tmp_path, changes, words):
    with pytest.raises(InputError, match=words):
        load_stereo(stereo(tmp_path / "s.yml", **changes))


def test_what_is_no_number_is_refused_in_a_stereo_calibration(tmp_path):
    for name, value in (("R", R), ("T", T)):
        path = stereo(tmp_path / "s.yml", **{name: np.where(value == value[1, 0], np.nan, value)})
        path.write_text(path.read_text().replace(".Nan", ".nan"))  # As YAML writes it.
        with pytest.raises(InputError, match=f"{name} holds what is no finite number"):
            load_stereo(path)


def test_a_matrix_where_a_word_belongs_is_refused(tmp_path):
    for name in ("distortion_model", "fisheye_model", "binning_x"):
        path = storage(tmp_path / "c.yml", camera_matrix=K, **{name: np.zeros((2, 2))})
        with pytest.raises(InputError, match=r"c\.yml"):
            load_intrinsics(path)


def test_both_images_of_a_pair_have_one_size():
    small = make_intrinsics(K, (), (320, 240))
    with pytest.raises(InputError, match="equal"):
        StereoCalibration(small, make_intrinsics(K, (), (640, 480)), RigidTransform([-0.1, 0, 0]))
