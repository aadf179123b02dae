import numpy as np
import pytest

from pepper_drake.learning import Demonstration
from pepper_drake.learning import rotations as so3


def make_demonstration(duration=2.5, seed=0, moving=True, rate=100.0):
    """Makes a smooth random motion of about 20 cm; with `moving`, both ends have velocity.

    Sums of sines below 1.5 Hz have derivatives of every order in closed form.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(duration * rate) + 1) / rate
    omega = 2 * np.pi * rng.uniform(0.2, 1.5, (4, 3))
    shift = rng.uniform(0, 2 * np.pi, (4, 3))
    size = rng.uniform(0.01, 0.05, (4, 3))
    wave = omega * times[:, None, None] + shift
    p = np.sum(size * np.sin(wave), axis=1)
    v = np.sum(size * omega * np.cos(wave), axis=1)
    a = -np.sum(size * omega**2 * np.sin(wave), axis=1)
    if not moving:
        s = times[:, None] / duration
        gate = s**3 * (10 - 15 * s + 6 * s**2)
        return Demonstration.from_positions(
            times, gate * [0.1, 0.2, -0.15] + 4 * gate * (1 - gate) * p
        )
    turn = np.column_stack((times**2 / 6, np.sin(times) / 2, 1 - np.cos(times)))
    rotations = so3.multiply(so3.exp_map(turn), so3.from_angles([0.3, -0.4, 1.0]))
    joints = np.column_stack((np.sin(times), -0.2 - 0.2 * times, np.cos(2 * times)))
    return Demonstration.from_positions(
        times,
        p,
        v,
        a,
        rotations=rotations,
        joints=joints,
        joint_names=("RShoulderPitch", "RShoulderRoll", "RElbowYaw"),
        name=f"motion {seed}",
    )


@pytest.fixture(scope="session")
def demonstration():
    return make_demonstration()


def distance(one, other):
    """Equation 4.1 of the report."""
    return float(np.mean(np.sqrt(np.sum((one - other) ** 2, axis=0))))
