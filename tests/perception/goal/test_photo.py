import cv2
import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CAMERA_TOP
from pepper_drake.perception.cameras.noise import ColorNoise, apply_color_noise
from pepper_drake.perception.goal.photo import find_in_photo, markers_shown

CAMERA = CAMERA_TOP.intrinsics
SIZE = 0.06


def bloomed(image):
    """An image with 2.5 times the light, of which what is too much spills over."""
    light = cv2.GaussianBlur(image.astype(float), (0, 0), 1.0) * 2.5
    spilt = cv2.GaussianBlur(np.maximum(light - 255, 0), (0, 0), 3.0)
    return np.clip(light + 0.5 * spilt, 0, 255).astype(np.uint8)


SPOILS = {
    "as it is": lambda image: image,
    "too bright": bloomed,
    "too dark": lambda image: (0.15 * image).astype(np.uint8),
    "clipped": lambda image: np.clip(2.5 * image.astype(float), 0, 255).astype(np.uint8),
    "blurred": lambda image: cv2.GaussianBlur(image, (0, 0), 0.8),
}


@pytest.fixture
def photos(draw_marker, facing):
    """Returns a function that makes noisy photos of a marker of a side [pixels], and its poses."""

    def make(side, spoil, count=25):
        rng = np.random.default_rng(0)
        for frame in range(count):
            z = CAMERA.focal_x * SIZE / side
            place = [rng.uniform(-0.2, 0.2) * z, rng.uniform(-0.15, 0.15) * z, z]
            X_CM = facing(place, rng.uniform(0, 0.7), *rng.uniform(0, 6.28, 2))
            image = SPOILS[spoil](draw_marker(X_CM, CAMERA.ideal()))
            rgba = cv2.cvtColor(image, cv2.COLOR_GRAY2RGBA)
            noise = ColorNoise(1.5 if spoil == "too dark" else 3.0)
            yield apply_color_noise(rgba, CAMERA, noise, seed=1, frame=frame), X_CM

    return make


def default_finds(image):
    """True if OpenCV's default detector with its corner refinement finds the marker."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    gray = cv2.cvtColor(image, cv2.COLOR_RGBA2GRAY)
    ids = cv2.aruco.ArucoDetector(book, parameters).detectMarkers(gray)[1]
    return ids is not None and 7 in ids


CASES = [
    (spoil, side) for spoil in ("as it is", "too bright", "too dark") for side in (11, 14, 21, 40)
]
CASES += [(spoil, side) for spoil in ("clipped", "blurred") for side in (14, 17, 21)]


@pytest.mark.parametrize(("spoil", "side"), CASES)
def test_markers_are_found_as_often_as_by_opencv_and_their_covariance_is_true(photos, spoil, side):
    found = default = flipped = 0
    squares = []
    for image, X_CM in photos(side, spoil):
        default += default_finds(image)
        sightings = find_in_photo(image, CAMERA, 7, SIZE, order="rgb")
        found += len(sightings) == 1
        for sighting in sightings:
            X_SM = sighting.pose.X_CM.inverse() @ X_CM
            is_flipped = abs(X_SM.rotation().ToAngleAxis().angle()) > 0.35
            flipped += is_flipped and sighting.other is None
            error = sighting.pose.X_CM.translation() - X_CM.translation()
            squares.append(error @ np.linalg.solve(sighting.pose.covariance[3:, 3:], error) / 3)
    assert found >= default
    assert flipped == 0
    if len(squares) > 10:
        # The standard deviation is true within a factor of 1.5.
        assert 1.5**-2 < np.mean(squares) < 1.5**2


def test_photos_of_any_kind_give_the_same(photos):
    image, _ = next(photos(40, "as it is", 1))
    rgb = np.ascontiguousarray(image[..., :3])
    expected = find_in_photo(rgb, CAMERA, 7, SIZE, order="rgb")[0].pose.X_CM.translation()
    for other, order in (
        (np.ascontiguousarray(rgb[..., ::-1]), "bgr"),
        (rgb.astype(np.uint16) * 257, "rgb"),
        (rgb / 255.0, "rgb"),
    ):
        found = find_in_photo(other, CAMERA, 7, SIZE, order=order)[0].pose.X_CM.translation()
        np.testing.assert_allclose(found, expected, atol=1e-4)


def test_all_markers_of_the_number_are_found(draw_marker, facing):
    both = draw_marker(facing([-0.1, 0.0, 0.6]), CAMERA.ideal())
    both = draw_marker(facing([0.1, 0.02, 0.6]), CAMERA.ideal(), image=both)
    assert len(find_in_photo(both, CAMERA.ideal(), 7, SIZE)) == 2
    assert find_in_photo(both, CAMERA.ideal(), 8, SIZE) == []


def test_photos_of_another_size_and_unknown_markers_are_refused():
    image = np.zeros((480, 640), np.uint8)
    with pytest.raises(InputError, match="320x240"):
        find_in_photo(image[::2, ::2], CAMERA, 7, SIZE)
    with pytest.raises(InputError, match="0 to 49"):
        find_in_photo(image, CAMERA, 50, SIZE)
    with pytest.raises(InputError, match="DICT_4X5"):
        find_in_photo(image, CAMERA, 5, SIZE, dictionary="DICT_4X5_50")


def test_markers_of_other_dictionaries_are_named(draw_marker, facing):
    image = draw_marker(facing([0, 0, 0.5], 0.2), CAMERA.ideal(), marker_id=31)
    assert markers_shown(image) == [("DICT_4X4_1000", 31)]
    assert markers_shown(np.full((480, 640), 128, np.uint8)) == []
