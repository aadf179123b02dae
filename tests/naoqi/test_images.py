import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pepper_drake.naoqi.constants import (
    BGR,
    CAMERAS,
    DEPTH,
    DEPTH_MM,
    DISTANCE,
    H2RGB,
    HS_MIXED,
    HSY,
    LAYERS,
    RAW_DEPTH,
    RGB,
    TOP,
    XYZ,
    YUV,
    YUV422,
    YYCBCR,
)
from pepper_drake.naoqi.images import decode_reply, encode_color, encode_depth, encode_reply

_COLORS = arrays(np.uint8, (6, 8, 3))
_DEPTHS = arrays(np.float32, (6, 8), elements=st.floats(0.5, 8.0, width=32))


def _through(data, width, height, space, camera):
    return decode_reply(encode_reply(data, width, height, space, 1_500_000_000.25, camera))


@given(_COLORS)
@pytest.mark.parametrize("space", [RGB, BGR])
def test_colours_come_back_as_they_were(space, rgb):
    reply = _through(encode_color(rgb, space), 8, 6, space, TOP)
    np.testing.assert_array_equal(reply.rgb(), rgb)
    assert reply.time == pytest.approx(1_500_000_000.25, abs=1e-6)
    assert reply.camera == TOP


@given(_COLORS)
@settings(deadline=None)
def test_luma_and_chroma_come_back_to_rounding(rgb):
    reply = _through(encode_color(rgb, YUV), 8, 6, YUV, TOP)
    # Chroma beyond 0..255 is cut only at saturated colours; within the cube rounding is all.
    assert np.abs(reply.rgb().astype(int) - rgb).max() <= 3


@pytest.mark.parametrize("space", [YUV422, YYCBCR])
@given(_COLORS)
@settings(deadline=None)
def test_pairs_of_pixels_share_their_chroma(space, rgb):
    pairs = np.repeat(rgb[:, ::2], 2, axis=1)
    reply = _through(encode_color(pairs, space), 8, 6, space, TOP)
    assert np.abs(reply.rgb().astype(int) - pairs).max() <= 3


def test_byte_order_of_yuv422_is_u_y_v_y():
    rgb = np.array([[[255, 0, 0], [255, 0, 0]]], np.uint8)
    y, u, v = 76, 85, 255
    assert list(encode_color(rgb, YUV422)) == pytest.approx([u, y, v, y], abs=1)
    assert list(encode_color(rgb, YUV)) == pytest.approx([y, u, v] * 2, abs=1)
    assert list(encode_color(rgb, YYCBCR)) == pytest.approx([y, y, u, v], abs=1)


@given(_COLORS)
@settings(deadline=None)
def test_single_channels_are_those_of_the_whole(rgb):
    whole = decode_reply(encode_reply(encode_color(rgb, YUV), 8, 6, YUV, 0.0, TOP)).pixels
    hsy = decode_reply(encode_reply(encode_color(rgb, HSY), 8, 6, HSY, 0.0, TOP)).pixels
    for k in range(3):
        for first, channels in ((0, whole), (3, rgb), (6, hsy)):
            one = _through(encode_color(rgb, first + k), 8, 6, first + k, TOP).pixels
            np.testing.assert_array_equal(one, channels[:, :, k])
    gray = _through(encode_color(rgb, 0), 8, 6, 0, TOP).pixels.astype(int)
    # OpenCV rounds grey and the Y of YUV in two ways.
    np.testing.assert_allclose(gray, cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(int), atol=1)


@given(_COLORS)
@settings(deadline=None)
def test_hue_is_shown_as_a_full_colour(rgb):
    hue = encode_color(rgb, 6)
    shown = np.frombuffer(encode_color(rgb, H2RGB), np.uint8).reshape(6, 8, 3)
    assert (shown.max(axis=2) == 255).all()
    assert (shown.min(axis=2) == 0).all()
    mixed = np.frombuffer(encode_color(rgb, HS_MIXED), np.uint8).reshape(6, 8, 3)
    np.testing.assert_array_equal(mixed[:, :, 0].ravel(), np.frombuffer(hue, np.uint8))
    np.testing.assert_array_equal(
        mixed[:, :, 2], (mixed[:, :, 0].astype(int) + mixed[:, :, 1]) // 2
    )


@pytest.mark.parametrize("space", [DEPTH_MM, RAW_DEPTH, XYZ, DISTANCE])
@given(_DEPTHS)
@settings(deadline=None)
def test_depth_comes_back_to_a_millimetre(space, depth):
    reply = _through(encode_depth(depth, space), 8, 6, space, DEPTH)
    np.testing.assert_allclose(reply.depth(), depth, atol=0.00051)


def test_points_lie_where_the_field_of_view_puts_them():
    depth = np.full((240, 320), 2.0, np.float32)
    points = _through(encode_depth(depth, XYZ), 320, 240, XYZ, DEPTH).pixels
    camera = CAMERAS[DEPTH]
    np.testing.assert_allclose(points[:, :, 0], 2.0)
    # Left and up are positive; the middle of the outermost pixel is half a pixel inside.
    left = 2.0 * np.tan(camera.width_fov / 2) * (1 - 1 / 320)
    up = 2.0 * np.tan(camera.height_fov / 2) * (1 - 1 / 240)
    np.testing.assert_allclose(points[0, 0], [2.0, left, up], rtol=1e-5)
    distance = _through(encode_depth(depth, DISTANCE), 320, 240, DISTANCE, DEPTH).pixels
    assert distance[0, 0] == round(1000 * float(np.linalg.norm([2.0, left, up])))


@pytest.mark.parametrize("unknown", [0.0, np.inf, np.nan, -1.0])
@pytest.mark.parametrize("space", [0, RGB, DEPTH_MM, XYZ, DISTANCE, RAW_DEPTH])
def test_unknown_depth_is_zero_in_every_space(space, unknown):
    data = encode_depth(np.full((2, 2), unknown, np.float32), space)
    assert len(data) == 4 * LAYERS[space]
    assert not any(data)


def test_grey_depth_runs_from_near_to_far():
    depth = np.array([[0.4, 2.04, 3.68, 9.0]], np.float32)
    assert list(encode_depth(depth, 0)) == [0, 128, 255, 255]


@pytest.mark.parametrize("camera", list(CAMERAS))
def test_every_space_of_every_camera_has_the_size_it_says(camera):
    for space in CAMERAS[camera].color_spaces:
        if camera == DEPTH:
            data = encode_depth(np.ones((30, 40), np.float32), space)
        else:
            data = encode_color(np.full((30, 40, 3), 90, np.uint8), space)
        reply = encode_reply(data, 40, 30, space, 0.0, camera)
        assert len(reply) == 12
        assert len(reply[6]) == 40 * 30 * reply[2]
        assert reply[8] == -reply[10] == pytest.approx(CAMERAS[camera].width_fov / 2)
        assert reply[11] == -reply[9] == pytest.approx(CAMERAS[camera].height_fov / 2)


def test_replies_that_are_none_are_refused_with_the_reason():
    good = encode_reply(bytes(12), 2, 2, RGB, 0.0, TOP)
    with pytest.raises(ValueError, match="no image yet"):
        decode_reply(None)
    with pytest.raises(ValueError, match="12 values, not 3"):
        decode_reply(good[:3])
    with pytest.raises(ValueError, match="has 12 bytes, not 5"):
        decode_reply([*good[:6], bytes(5), *good[7:]])
    with pytest.raises(ValueError, match="colour space 99"):
        decode_reply([*good[:3], 99, *good[4:]])
    with pytest.raises(ValueError, match="no distances"):
        decode_reply(good).depth()
    with pytest.raises(ValueError, match="not one of the depth camera"):
        encode_depth(np.ones((2, 2), np.float32), 13)
    with pytest.raises(ValueError, match="not one of a colour camera"):
        encode_color(np.ones((2, 2, 3), np.uint8), DEPTH_MM)
    with pytest.raises(ValueError, match="even width"):
        encode_color(np.ones((2, 3, 3), np.uint8), YUV422)
