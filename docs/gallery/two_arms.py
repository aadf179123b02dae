"""Two arms: both hands carry a box to another place, and the box keeps its width."""

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.learning import BimanualPrimitive, Demonstration

WIDTH = 0.3
"""Of the box between the hands [m]."""


def hand(side: float) -> Demonstration:
    """A hand's motion while a box is lifted and put down: 1 the left hand, -1 the right."""
    share = np.linspace(0.0, 1.0, 301)
    smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    height = 0.15 * np.sin(np.pi * smooth) ** 2
    y = np.full_like(share, side * WIDTH / 2.0)
    return Demonstration.from_positions(3.0 * share, np.column_stack((0.2 * smooth, y, height)))


def draw() -> Figure:
    """Draws both hands from above, as shown and to another goal, and their distance."""
    primitive = BimanualPrimitive.fit(hand(1.0), hand(-1.0))
    figure = Figure(figsize=(9, 4), layout="constrained")
    above, apart = figure.subplots(1, 2)
    for name, goal, style in (("as shown", None, "--"), ("other goal", [0.3, 0.15, 0.0], "-")):
        paths = primitive.rollout(goal=goal)
        for side, color in (("left", "tab:blue"), ("right", "tab:orange")):
            x, y, _ = getattr(paths, side).positions.T
            above.plot(-y, x, style, color=color, label=f"{side} hand, {name}")
        between = np.linalg.norm(paths.left.positions - paths.right.positions, axis=1)
        apart.plot(paths.left.times, 100.0 * between, style, color="k", label=name)
    above.set(xlabel="-y, right [m]", ylabel="x, ahead [m]", aspect="equal", title="From above")
    apart.set(xlabel="time [s]", ylabel="distance of the hands [cm]", ylim=(0.0, 40.0))
    apart.set_title("Is the box held?")
    above.legend(fontsize=7, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.18))
    apart.legend()
    return figure


if __name__ == "__main__":
    draw().savefig("two_arms.png", dpi=90)
