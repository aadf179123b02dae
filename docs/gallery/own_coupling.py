"""A coupling of one's own: a barrier that always goes over the top, beside the usual one."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.learning import BarrierCoupling, Demonstration, MovementPrimitive


@dataclass(frozen=True)
class OverTheTop(BarrierCoupling):
    """Slides upward whenever a point is in the way, and keeps 3 cm more."""

    margin: float = 0.04
    up_bias: float = 3.0


def draw() -> Figure:
    """Draws the hand's path past a ball, seen from the side."""
    share = np.linspace(0.0, 1.0, 201)[:, None]
    smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    shown = Demonstration.from_positions(2.0 * share[:, 0], smooth * [0.4, 0.0, 0.0])
    primitive = MovementPrimitive.fit(shown)
    directions = np.random.default_rng(0).normal(size=(1000, 3))
    ball = 0.03 * directions / np.linalg.norm(directions, axis=1, keepdims=True) + [0.2, 0.02, 0.0]

    figure = Figure(figsize=(7, 3.5), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(*ball[:, [0, 2]].T, ".", color="0.7", ms=2, label="ball, as a cloud")
    for name, coupling in (("BarrierCoupling", "barrier"), ("OverTheTop", OverTheTop())):
        path = primitive.rollout(obstacles=ball, coupling=coupling)
        axes.plot(*path.positions[:, [0, 2]].T, label=name)
    axes.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="Which way past the ball?")
    axes.legend()
    return figure


if __name__ == "__main__":
    draw().savefig("own_coupling.png", dpi=90)
