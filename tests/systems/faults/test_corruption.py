import numpy as np
import pytest
from pydrake.perception import PointCloud
from pydrake.systems.sensors import ImageDepth16U, ImageRgba8U

from pepper_drake.systems.faults.corruption import corrupt
from pepper_drake.systems.faults.fault import SIGNALS


@pytest.mark.parametrize("kind", ["garbage", "wrong", "noisy"])
@pytest.mark.parametrize(
    ("signal", "value"),
    [("top", ImageRgba8U()), ("depth", ImageDepth16U()), ("cloud", PointCloud())],
)
def test_what_has_nothing_in_it_yet_stays_empty(kind, signal, value):
    """Before the first image, and where nothing is seen."""
    draw, shape = np.random.default_rng(0), np.random.default_rng(1)
    result = corrupt(value, kind, SIGNALS[signal], draw, shape)
    assert type(result) is type(value)
    assert result.size() == 0
