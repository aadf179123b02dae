"""Names come from files, and may be anything: what matplotlib takes for mathematics, too."""

import dataclasses
import io

import pytest

from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.demonstrations.check import examine
from pepper_drake.reporting.comparison_figure import draw_comparison
from pepper_drake.reporting.demonstration_figure import draw_demonstration
from pepper_drake.reporting.learning_figure import draw_learning, draw_primitive

from ..learning.demonstrations.importers.recordings import make_motion


@pytest.fixture
def demonstration():
    shown = make_motion()
    return dataclasses.replace(shown, name="a$x^2_{$b")


def test_a_name_is_drawn_as_it_is(demonstration):
    primitive = MovementPrimitive.fit(demonstration, num_basis=10)
    path = primitive.rollout()
    for figure in (
        draw_demonstration(demonstration, examine(demonstration)),
        draw_learning(primitive, [demonstration], path),
        draw_primitive(primitive),
        draw_comparison(demonstration, {"lwr": path}, []),
    ):
        figure.savefig(io.BytesIO(), dpi=20)
