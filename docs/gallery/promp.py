"""A probabilistic movement primitive: the spread of ten demonstrations, and a via point."""

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.learning import Demonstration, fit_promp


def demonstrations(count: int = 10) -> list[Demonstration]:
    """Reaches to about the same goal, of different heights; the seed is fixed."""
    rng = np.random.default_rng(3)
    share = np.linspace(0.0, 1.0, 201)
    smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    shown = []
    for height in rng.uniform(0.05, 0.2, count):
        goal = [0.4, 0.1, 0.05] + 0.01 * rng.normal(size=3)
        positions = np.outer(smooth, goal)
        positions[:, 2] += height * np.sin(np.pi * smooth) ** 2
        shown.append(Demonstration.from_positions(2.0 * share, positions))
    return shown


def draw() -> Figure:
    """Draws the height over time: learned, and conditioned on a height halfway."""
    shown = demonstrations()
    learned = fit_promp(shown)
    sent = learned.condition(1.0, [0.2, 0.05, 0.22])
    figure = Figure(figsize=(9, 3.5), layout="constrained")
    pair = figure.subplots(1, 2, sharey=True)
    times = np.linspace(0.0, learned.duration, 100)
    for axes, promp, title in (
        (pair[0], learned, "What was learned of ten demonstrations?"),
        (pair[1], sent, "What remains when it passes 22 cm halfway?"),
    ):
        for demo in shown:
            axes.plot(demo.times, demo.positions[:, 2], color="0.75", lw=1)
        mean, covariance = promp.path(times)
        spread = 2.0 * np.sqrt(covariance[:, 2, 2])
        band = (mean[:, 2] - spread, mean[:, 2] + spread)
        axes.fill_between(times, *band, color="tab:blue", alpha=0.25, lw=0, label="95 %")
        axes.plot(times, mean[:, 2], color="tab:blue", label="mean")
        axes.set(xlabel="time [s]", title=title)
    pair[0].set_ylabel("z, up [m]")
    pair[1].plot(1.0, 0.22, "o", color="k", label="via point")
    pair[1].legend()
    return figure


if __name__ == "__main__":
    draw().savefig("promp.png", dpi=90)
