"""Images from files: every kind that OpenCV reads, and none that claims to be huge."""

import cv2
import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.image_files import read_image, write_image


@pytest.mark.parametrize(
    ("name", "dtype", "shape"),
    [
        ("depth.tif", np.float64, (6, 8)),
        ("depth.tiff", np.float32, (6, 8)),
        ("points.tif", np.float32, (6, 8, 3)),
        ("depth.png", np.uint16, (6, 8)),
        ("color.png", np.uint8, (6, 8, 4)),
        ("color.bmp", np.uint8, (6, 8, 3)),
        ("gray.pgm", np.uint8, (6, 8)),
        ("color.webp", np.uint8, (6, 8, 3)),
    ],
)
def test_what_opencv_writes_is_read(tmp_path, name, dtype, shape):
    image = (np.arange(np.prod(shape)) % 200).reshape(shape).astype(dtype)
    path = tmp_path / name
    assert cv2.imwrite(str(path), image, [cv2.IMWRITE_WEBP_QUALITY, 101])
    found = read_image(path)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, image)


def test_a_tiff_that_claims_billions_of_pixels_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "depth.tif"
    assert cv2.imwrite(str(path), np.zeros((600, 800)))
    content = bytearray(path.read_bytes())
    # Width and height are entries 256 and 257 of its directory: both become 50,000.
    for tag, before in ((256, 800), (257, 600)):
        entry = content.find(tag.to_bytes(2, "little") + b"\x03\x00")
        assert int.from_bytes(content[entry + 8 : entry + 10], "little") == before
        content[entry + 8 : entry + 10] = (50_000).to_bytes(2, "little")
    path.write_bytes(content)
    with pytest.raises(InputError, match="more than 67108864 pixels"):
        read_image(path)


def test_a_damaged_photo_says_nothing_on_the_terminal(tmp_path, capfd):
    path = tmp_path / "photo.jpg"
    cv2.imwrite(str(path), np.arange(768, dtype=np.uint8).reshape(24, 32))
    content = path.read_bytes()
    scan = content.index(b"\xff\xda")
    path.write_bytes(content[:scan] + b"12345678" + content[scan:])
    cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    assert "extraneous" in capfd.readouterr().err
    assert read_image(path).shape == (24, 32)
    assert capfd.readouterr().err == ""


def test_an_image_that_cannot_be_written_is_an_error_and_no_silence(tmp_path):
    image = np.arange(24, dtype=np.uint8).reshape(4, 6)
    write_image(tmp_path / "photo.png", image)
    np.testing.assert_array_equal(read_image(tmp_path / "photo.png"), image)
    (tmp_path / "full.png").symlink_to("/dev/full")
    with pytest.raises(OSError, match="space"):
        write_image(tmp_path / "full.png", image)
