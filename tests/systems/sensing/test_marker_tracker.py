import cv2
import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import ImageRgba8U

from pepper_drake.models.marker_script import FACING
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.systems.sensing.marker_tracker import MarkerTracker

FOCAL, SIZE, EDGE = 500.0, 0.08, 60
INTRINSICS = CameraIntrinsics(640, 480, FOCAL, FOCAL, 319.5, 239.5)
# The camera looks along T's x axis from (0, 0, 0.3).
X_TC = RigidTransform(RotationMatrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [0.0, 0.0, 0.3])


def picture(left, top):
    """A marker that is seen straight on, its black square's corner pixel at (left, top)."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    image = ImageRgba8U(640, 480)
    image.mutable_data[:] = 255
    square = cv2.aruco.generateImageMarker(dictionary, 9, EDGE)
    image.mutable_data[top : top + EDGE, left : left + EDGE, :3] = square[..., None]
    return Value(image)


def test_positions_are_those_of_a_pinhole_camera():
    tracker = MarkerTracker(
        MarkedObject(9, SIZE, RigidTransform(FACING, [0, 0, 0])), INTRINSICS, X_TC
    )
    simulator = Simulator(tracker)
    context = simulator.get_mutable_context()
    tracker.image_input.FixValue(context, Value(ImageRgba8U()))
    tracker.time_stamp_input.FixValue(context, [-np.inf])
    simulator.AdvanceTo(0.1)
    assert tracker.sighting_output.Eval(context)[0] == -np.inf

    distance = FOCAL * SIZE / EDGE
    for number, (left, top) in enumerate([(200, 150), (230, 160), (250, 200)], start=1):
        tracker.image_input.FixValue(context, picture(left, top))
        tracker.time_stamp_input.FixValue(context, [0.1 * number])
        simulator.AdvanceTo(0.1 * (number + 1))
        sighting = tracker.sighting_output.Eval(context)
        u, v = left + (EDGE - 1) / 2 - 319.5, top + (EDGE - 1) / 2 - 239.5
        expected = [distance, -u * distance / FOCAL, 0.3 - v * distance / FOCAL]
        assert sighting[0] == pytest.approx(0.1 * number)
        np.testing.assert_allclose(sighting[1:4], expected, atol=1e-3)
        facing = FACING.ToQuaternion().wxyz()
        assert 2 * np.arccos(min(abs(sighting[4:] @ facing), 1.0)) < 0.01

    # An image without the marker leaves the last sighting as it is.
    before = sighting.copy()
    tracker.image_input.FixValue(context, Value(ImageRgba8U(640, 480)))
    tracker.time_stamp_input.FixValue(context, [0.9])
    simulator.AdvanceTo(1.0)
    np.testing.assert_array_equal(tracker.sighting_output.Eval(context), before)
