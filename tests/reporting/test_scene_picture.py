import numpy as np
import pytest

from pepper_drake.reporting.scene_picture import look_at


def test_a_bystanders_camera_looks_at_its_target_with_the_world_upright():
    eye, target = np.array([-0.7, 1.3, 1.4]), np.array([0.2, 0.1, 0.8])
    X_WC = look_at(eye, target)
    p_CP = X_WC.inverse() @ target
    np.testing.assert_allclose(p_CP, [0, 0, np.linalg.norm(target - eye)], atol=1e-12)
    assert X_WC.rotation().matrix()[2, 0] == pytest.approx(0), "the image's x is level"
    assert X_WC.rotation().matrix()[2, 1] < 0, "the image's y points down"
