"""Waving: a rhythmic primitive, learned from four waves, made wider and faster."""

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.learning import Demonstration, fit_rhythmic


def draw() -> Figure:
    """Draws the hand's position to the side over time, as shown and as performed."""
    times = np.arange(0.0, 4.0, 0.01)
    angle = 2.0 * np.pi * times
    shown = Demonstration.from_positions(
        times,
        np.column_stack(
            (np.full_like(times, 0.3), 0.08 * np.sin(angle), 0.3 + 0.02 * np.cos(2.0 * angle))
        ),
    )
    wave = fit_rhythmic(shown)

    figure = Figure(figsize=(8, 3.5), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(times, shown.positions[:, 1], color="0.7", lw=5, label="shown")
    for name, changes in (
        ("performed", {}),
        ("half as wide, in 0.6 s a wave", {"amplitude": 0.5, "period": 0.6}),
        ("from elsewhere", {"start": [0.3, 0.15, 0.3]}),
    ):
        path = wave.rollout(4.0, **changes)
        axes.plot(path.times, path.positions[:, 1], lw=1.2, label=name)
    axes.set(xlabel="time [s]", ylabel="y, left [m]", title=f"A wave of {wave.period:.2f} s")
    axes.legend(ncols=2)
    return figure


if __name__ == "__main__":
    draw().savefig("waving.png", dpi=90)
