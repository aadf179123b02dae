"""Figures of demonstrations, primitives and maps for notebooks."""

import base64
import html
import io
from functools import singledispatch
from typing import Any

from matplotlib.figure import Figure

from pepper_drake.learning.demonstrations.check import examine
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.reporting.demonstration_figure import draw_demonstration
from pepper_drake.reporting.learning_figure import draw_primitive
from pepper_drake.reporting.perception_figures import draw_points


@singledispatch
def draw(shown: Any) -> Figure:
    """Returns the figure of an object.

    Raises:
        TypeError: There is no figure for its class.
    """
    raise TypeError(f"{type(shown).__name__} has no figure")


@draw.register
def _(shown: Demonstration) -> Figure:
    return draw_demonstration(shown, examine(shown))


@draw.register
def _(shown: MovementPrimitive) -> Figure:
    return draw_primitive(shown)


@draw.register
def _(shown: VoxelMap) -> Figure:
    return draw_points(
        shown.positions, f"{len(shown.keys)} occupied voxels, from above and from the side"
    )


def html_of(shown: Any) -> str:
    """Returns an image element with the figure of an object, and its repr as alternative text."""
    image = io.BytesIO()
    draw(shown).savefig(image, format="png", dpi=70)
    data = base64.b64encode(image.getvalue()).decode()
    return f'<img alt="{html.escape(repr(shown))}" src="data:image/png;base64,{data}">'
