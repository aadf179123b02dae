import numpy as np
import pytest

from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.optimization import Problem

DEMONSTRATION = example_demonstrations(2)[1]  # It never rests, not even at its ends.


@pytest.fixture(scope="session")
def primitive():
    return MovementPrimitive.fit(DEMONSTRATION, num_basis=12)


def bowl(minimum, curvatures=1.0, exploration=0.5):
    """A problem whose cost is a quadratic with a known minimum."""
    minimum = np.asarray(minimum, dtype=float)

    def evaluate(samples):
        return np.sum(curvatures * (samples - minimum) ** 2, axis=1)

    return Problem(np.zeros(len(minimum)), exploration, evaluate, chunk=4)
