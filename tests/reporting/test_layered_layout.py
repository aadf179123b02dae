import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.reporting.layered_layout import assign_rows, lay_out


@st.composite
def graphs(draw):
    """Sizes of boxes, and edges of which some run back."""
    count = draw(st.integers(2, 9))
    pairs = list(itertools.permutations(range(count), 2))
    edges = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=18, unique=True))
    sizes = draw(
        st.lists(
            st.tuples(st.floats(0.5, 2.5), st.floats(0.3, 0.9)), min_size=count, max_size=count
        )
    )
    return np.array(sizes), edges


def spans(center, size):
    return center - size / 2, center + size / 2


@settings(max_examples=60)
@given(graphs())
def test_boxes_do_not_overlap_and_stay_inside(graph):
    sizes, edges = graph
    layout = lay_out(sizes, edges)
    for a, b in itertools.combinations(range(len(sizes)), 2):
        distance = np.abs(layout.centers[a] - layout.centers[b])
        assert np.any(distance >= (sizes[a] + sizes[b]) / 2 - 1e-9)
    low, high = layout.centers - sizes / 2, layout.centers + sizes / 2
    assert np.all(low >= -1e-9)
    assert np.all(high <= np.array([layout.width, layout.height]) + 1e-9)


@settings(max_examples=60)
@given(graphs())
def test_lines_are_right_angled_from_the_senders_lower_side_to_the_receivers_upper(graph):
    sizes, edges = graph
    layout = lay_out(sizes, edges)
    assert set(layout.routes) == set(edges)
    for (sender, receiver), line in layout.routes.items():
        points = np.array(line)
        steps = np.abs(np.diff(points, axis=0))
        assert np.all(steps.min(axis=1) < 1e-6)
        low, _ = spans(layout.centers[sender], sizes[sender])
        assert points[0] == pytest.approx([layout.centers[sender][0], low[1]])
        low, high = spans(layout.centers[receiver], sizes[receiver])
        assert points[-1][1] == pytest.approx(high[1])
        assert low[0] <= points[-1][0] <= high[0]
        assert points[-2][1] > points[-1][1], "it arrives from above"


@settings(max_examples=60)
@given(graphs())
def test_no_line_runs_through_a_box(graph):
    sizes, edges = graph
    layout = lay_out(sizes, edges)
    for line in layout.routes.values():
        for (x0, y0), (x1, y1) in itertools.pairwise(line):
            for center, size in zip(layout.centers, sizes, strict=True):
                low, high = spans(center, size)
                outside = (
                    max(x0, x1) <= low[0] + 1e-6
                    or min(x0, x1) >= high[0] - 1e-6
                    or max(y0, y1) <= low[1] + 1e-6
                    or min(y0, y1) >= high[1] - 1e-6
                )
                assert outside


def horizontals(layout, sender):
    for (a, _), line in layout.routes.items():
        if a == sender:
            for (x0, y0), (x1, y1) in itertools.pairwise(line):
                if abs(y0 - y1) < 1e-9 and abs(x0 - x1) > 1e-6:
                    yield y0, min(x0, x1), max(x0, x1)


@settings(max_examples=60)
@given(graphs())
def test_nets_of_two_senders_never_lie_on_each_other(graph):
    sizes, edges = graph
    layout = lay_out(sizes, edges)
    for a, b in itertools.combinations(sorted({s for s, _ in edges}), 2):
        for (ya, la, ha), (yb, lb, hb) in itertools.product(
            horizontals(layout, a), horizontals(layout, b)
        ):
            assert abs(ya - yb) > 1e-6 or ha < lb or hb < la


def test_rows_go_down_with_the_flow_and_feedback_does_not_count():
    #   0 → 1 → 2 → 3, 0 → 3, and 3 → 1 back.
    assert assign_rows(4, [(0, 1), (1, 2), (2, 3), (0, 3), (3, 1)]) == [0, 1, 2, 3]
    layout = lay_out(np.full((4, 2), 1.0), [(0, 1), (1, 2), (2, 3), (0, 3), (3, 1)])
    assert np.all(np.diff(layout.centers[:, 1]) < 0)
    back = np.array(layout.routes[3, 1])
    assert back[:, 0].max() > layout.centers[:, 0].max() + 0.5, "back up at the right-hand side"


def test_a_chain_is_drawn_straight():
    layout = lay_out(np.array([[2.0, 0.5], [1.0, 0.5], [1.5, 0.5]]), [(0, 1), (1, 2)])
    assert np.ptp(layout.centers[:, 0]) == pytest.approx(0)
    assert all(len(line) == 2 for line in layout.routes.values())
