"""Picture of a Drake diagram, without Graphviz."""

import textwrap
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import FancyBboxPatch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath

from pepper_drake.reporting.diagram_graph import DiagramGraph, Node
from pepper_drake.reporting.layered_layout import lay_out

_NAME, _KIND, _SIGNAL = 10.0, 7.5, 7.0
"""Font sizes [pt]."""
_LINE = 0.125
"""Height of a line of small text [inch]."""
_COLORS = (
    "#1f6fb4", "#d9711a", "#2a8f4c", "#c23b3b", "#7a5bb5", "#8a5a44", "#c94f9b", "#5f6b73",
    "#9a8c10", "#1597a5", "#3b4fa0", "#b0562c", "#4f7d2c", "#a03060", "#56789a", "#7d6608",
)  # fmt: skip


_KEY = "tinted: this project; white: Drake; small print: the class and the outputs in use"


class _Box:
    """A node's wrapped text, and the size of its box."""

    def __init__(self, node: Node) -> None:
        self.title = node.name.replace("_", " ")
        self.kind = "" if node.kind.lower() == node.name.replace("_", "").lower() else node.kind
        text = ", ".join(node.signals)
        width = 34 if len(text) < 160 else 110
        self.signals = textwrap.wrap(text, width, break_on_hyphens=False)
        lines = [(self.title, _NAME, "bold"), (self.kind, _KIND, "normal")]
        lines += [(line, _SIGNAL, "normal") for line in self.signals]
        self.width = max(_text_width(*line) for line in lines) + 0.24
        self.height = 0.30 + _LINE * (len(self.signals) + bool(self.kind))


def _text_width(text: str, size: float, weight: str) -> float:
    """Returns the width of a line of text [inch]."""
    if not text:
        return 0.0
    outline = TextPath((0, 0), text, size=size, prop=FontProperties(weight=weight))
    return float(outline.get_extents().width) / 72


def draw_diagram(graph: DiagramGraph, title: str) -> Figure:
    """Draws a graph: a box for each system, with its output signals, and a coloured net from each.

    This project's systems have a tinted box, Drake's own a white one.
    """
    names = list(graph.nodes)
    boxes = [_Box(graph.nodes[name]) for name in names]
    number = {name: k for k, name in enumerate(names)}
    edges = [(number[a], number[b]) for a, b in graph.edges]
    layout = lay_out(np.array([[box.width, box.height] for box in boxes]), edges)
    title_height = 0.62
    figure = Figure(figsize=(layout.width + 0.2, layout.height + title_height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set(xlim=(-0.1, layout.width + 0.1), ylim=(0, layout.height + title_height))
    axes.text(0.12, layout.height + 0.34, title, fontsize=13, weight="bold", va="center")
    axes.text(0.12, layout.height + 0.12, _KEY, fontsize=_KIND, color="0.35", va="center")

    for sender in range(len(names)):
        color = _COLORS[sender % len(_COLORS)]
        lines = [line for (a, _), line in layout.routes.items() if a == sender]
        if not lines:
            continue
        # One outline for the whole net, so lines that coincide are drawn once.
        net = Outline.make_compound_path(*(_rounded(line) for line in lines))
        for width, paint, order in ((4.2, "white", 2 * sender), (1.5, color, 2 * sender + 1)):
            axes.add_patch(PathPatch(net, fc="none", ec=paint, lw=width, zorder=order + 1))
        ends = np.array([line[-1] for line in lines])
        axes.plot(ends[:, 0], ends[:, 1] + 0.035, "v", ms=5, color=color, zorder=500, mew=0)

    for k, (name, box) in enumerate(zip(names, boxes, strict=True)):
        x, y = layout.centers[k]
        node = graph.nodes[name]
        color = _COLORS[k % len(_COLORS)]
        axes.add_patch(
            FancyBboxPatch(
                (x - box.width / 2, y - box.height / 2), box.width, box.height,
                boxstyle="round,pad=0,rounding_size=0.06",
                fc="white", ec="none", zorder=600,
            )
        )  # fmt: skip
        axes.add_patch(
            FancyBboxPatch(
                (x - box.width / 2, y - box.height / 2), box.width, box.height,
                boxstyle="round,pad=0,rounding_size=0.06",
                fc=(*mpl.colors.to_rgb(color), 0.10 if node.own else 0.0),
                ec=color, lw=1.4, zorder=601,
            )
        )  # fmt: skip
        top = y + box.height / 2 - 0.16
        axes.text(
            x, top, box.title, fontsize=_NAME, weight="bold", ha="center", va="center", zorder=602
        )
        rows = [(box.kind, _KIND, "0.25")] if box.kind else []
        rows += [(line, _SIGNAL, "0.35") for line in box.signals]
        for r, (text, size, gray) in enumerate(rows):
            axes.text(
                x, top - 0.15 - _LINE * r, text,
                fontsize=size, color=gray, ha="center", va="center", zorder=602,
            )  # fmt: skip
    return figure


def _rounded(line: list[tuple[float, float]], radius: float = 0.06) -> Outline:
    """Returns a line with rounded corners."""
    points = np.asarray(line)
    vertices, codes = [points[0]], [Outline.MOVETO]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        reach = [min(radius, np.linalg.norm(p - corner) / 2) for p in (before, after)]
        towards = [(p - corner) / np.linalg.norm(p - corner) for p in (before, after)]
        vertices += [corner + reach[0] * towards[0], corner, corner + reach[1] * towards[1]]
        codes += [Outline.LINETO, Outline.CURVE3, Outline.CURVE3]
    return Outline([*vertices, points[-1]], [*codes, Outline.LINETO])


def save_diagram_picture(graph: DiagramGraph, title: str, path: Path) -> None:
    """Draws a graph into a file (SVG, or another format by the path's extension)."""
    # Reproducible, so that a picture under version control changes only with the diagram.
    with mpl.rc_context({"svg.hashsalt": "pepper_drake"}):
        metadata = {"Date": None} if path.suffix == ".svg" else None
        draw_diagram(graph, title).savefig(path, dpi=100, facecolor="white", metadata=metadata)
