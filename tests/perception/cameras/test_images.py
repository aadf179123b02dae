import zlib

import cv2
import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.image_files import read_depth, read_image
from pepper_drake.perception.cameras.images import to_8_bit, to_gray

RGB = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
GRAY = cv2.cvtColor(RGB, cv2.COLOR_RGB2GRAY)


@pytest.mark.parametrize(
    ("image", "order"),
    [
        (RGB, "rgb"),
        (RGB[..., ::-1], "bgr"),
        (cv2.cvtColor(RGB, cv2.COLOR_RGB2RGBA), "rgb"),
        (cv2.cvtColor(RGB, cv2.COLOR_RGB2BGRA), "bgr"),
        (GRAY, "rgb"),
        (GRAY[..., None], "bgr"),
        (GRAY.astype(np.uint16) * 257, "rgb"),
        (GRAY / 255.0, "rgb"),
        ((GRAY / 255.0).astype(np.float32), "rgb"),
    ],
)
def test_every_kind_of_image_has_the_same_brightness(image, order):
    np.testing.assert_array_equal(to_gray(np.ascontiguousarray(image), order=order), GRAY)


def test_truth_values_are_black_and_white():
    np.testing.assert_array_equal(to_8_bit(GRAY > 127), np.where(GRAY > 127, 255, 0))


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (RGB[..., :2], "channels"),
        (RGB[0, 0], "shape"),
        (GRAY.astype(np.uint16), "brightest pixel of 16 bits"),
        (GRAY.astype(np.float32), "0 to 1"),
        (np.full((4, 4), np.nan), "0 to 1"),
        (GRAY.astype(np.int32), "int32"),
        (GRAY.astype(complex), "complex"),
    ],
)
def test_what_is_no_image_is_refused(image, words):
    with pytest.raises(InputError, match=words):
        to_gray(image)


def test_unknown_orders_are_refused():
    with pytest.raises(InputError, match="gbr"):
        to_gray(RGB, order="gbr")


def test_images_keep_all_their_bits(tmp_path):
    deep = GRAY.astype(np.uint16) * 200
    cv2.imwrite(str(tmp_path / "deep.png"), deep)
    np.testing.assert_array_equal(read_image(tmp_path / "deep.png"), deep)
    np.testing.assert_array_equal(read_depth(tmp_path / "deep.png"), deep)


def test_depth_is_read_from_arrays(tmp_path):
    depth = np.linspace(0.5, 2, 12).reshape(3, 4)
    np.save(tmp_path / "d.npy", depth)
    np.savez(tmp_path / "d.npz", depth=depth, other=np.zeros(3))
    np.savez(tmp_path / "one.npz", image=depth)
    for name in ("d.npy", "d.npz", "one.npz"):
        np.testing.assert_array_equal(read_depth(tmp_path / name), depth)


@pytest.mark.parametrize("name", ["x.png", "x.jpg", "x.npy", "x.npz"])
@pytest.mark.parametrize("content", [b"", b"no image", b"\x89PNG\r\n\x1a\n" + bytes(40)])
def test_damaged_files_are_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=name):
        read_depth(tmp_path / name)


def test_archives_of_several_arrays_are_refused(tmp_path):
    np.savez(tmp_path / "two.npz", a=np.zeros((3, 4)), b=np.zeros((3, 4)))
    with pytest.raises(InputError, match="name the depth image"):
        read_depth(tmp_path / "two.npz")


@pytest.mark.parametrize("orientation", [1, 3, 6])
def test_a_photo_that_is_to_be_turned_is_refused(tmp_path, orientation):
    content = cv2.imencode(".jpg", RGB)[1].tobytes()
    tag = (
        b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0" + bytes([orientation]) + b"\0" * 7
    )
    length = (len(tag) + 2).to_bytes(2, "big")
    path = tmp_path / "photo.jpg"
    path.write_bytes(content[:2] + b"\xff\xe1" + length + tag + content[2:])
    if orientation == 1:
        assert read_image(path).shape == RGB.shape
    else:
        with pytest.raises(InputError, match=r"photo\.jpg: .*EXIF"):
            read_image(path)


def test_an_image_that_claims_too_many_pixels_is_not_unpacked(tmp_path):
    path = tmp_path / "bomb.png"
    cv2.imwrite(str(path), GRAY)
    content = bytearray(path.read_bytes())
    content[16:24] = (60_000).to_bytes(4, "big") * 2
    content[29:33] = zlib.crc32(content[12:29]).to_bytes(4, "big")
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"bomb\.png: more than 67108864 pixels"):
        read_image(path)
