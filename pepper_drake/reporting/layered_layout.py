"""A layered drawing of a directed graph: rows of boxes, right-angled lines between them.

After Sugiyama, Tagawa and Toda (1981): rows by longest path, order within rows by barycentres,
lines across a row through slots of their own. All lines of one sender form one net, which leaves
its box once and branches; lines to rows above run up at the right-hand side.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.optimize import isotonic_regression

Vector = npt.NDArray[np.float64]
_Point = tuple[float, float]

_GAP = 0.22
"""Gap between boxes of a row [inch]."""
_PASSAGE = 0.10
"""Width of a line's slot across a row [inch]."""
_PITCH = 0.10
"""Distance between parallel lines [inch]."""
_CHANNEL = 0.20
"""Smallest height between rows [inch]."""
_SWEEPS = 24


@dataclass
class Layout:
    """Positions of a drawn graph [inch], y upwards.

    Attributes:
        centers: (N, 2) of the boxes.
        routes: Corners of each edge, from the sender's lower side to the receiver's upper.
        width: Width of the whole drawing, from x = 0.
        height: Height of the whole drawing, from y = 0.
    """

    centers: Vector
    routes: dict[tuple[int, int], list[_Point]]
    width: float
    height: float


@dataclass
class _Slot:
    """A box (its number) or a net's passage through a row (its sender's number)."""

    width: float
    node: int | None = None
    net: int | None = None
    x: float = 0.0
    above: list["_Slot"] = field(default_factory=list)
    below: list["_Slot"] = field(default_factory=list)


def lay_out(sizes: Vector, edges: Sequence[tuple[int, int]]) -> Layout:
    """Places boxes and routes lines.

    Args:
        sizes: (N, 2) widths and heights [inch]. Edges against the boxes' order count as feedback.
        edges: Unique pairs (sender, receiver).
    """
    rows = assign_rows(len(sizes), edges)
    slots, levels = _make_slots(sizes, edges, rows)
    _order(levels)
    _place(levels)
    return _Router(sizes, edges, rows, slots, levels).layout()


def assign_rows(count: int, edges: Sequence[tuple[int, int]]) -> list[int]:
    """Returns the row of each node: below all its senders, except for feedback."""
    rows = [0] * count
    for receiver in range(count):
        senders = [a for a, b in edges if b == receiver and a < receiver]
        rows[receiver] = max((rows[a] + 1 for a in senders), default=0)
    return rows


_Slots = dict[tuple[str, int, int], _Slot]


def _make_slots(
    sizes: Vector, edges: Sequence[tuple[int, int]], rows: list[int]
) -> tuple[_Slots, list[list[_Slot]]]:
    """Returns boxes and passages, row by row, with their connections above and below."""
    levels: list[list[_Slot]] = [[] for _ in range(max(rows, default=0) + 1)]
    slots: _Slots = {}
    for node, row in enumerate(rows):
        slots["box", node, row] = _Slot(sizes[node][0], node=node)
        levels[row].append(slots["box", node, row])
    for sender, receiver in edges:
        if rows[receiver] <= rows[sender]:
            continue
        upper = slots["box", sender, rows[sender]]
        for row in range(rows[sender] + 1, rows[receiver]):
            key = ("net", sender, row)
            if key not in slots:
                slots[key] = _Slot(_PASSAGE, net=sender)
                levels[row].append(slots[key])
                _link(upper, slots[key])
            upper = slots[key]
        _link(upper, slots["box", receiver, rows[receiver]])
    return slots, levels


def _link(upper: _Slot, lower: _Slot) -> None:
    upper.below.append(lower)
    lower.above.append(upper)


def _order(levels: list[list[_Slot]]) -> None:
    """Orders each row by the mean place of connected slots, in sweeps down and up."""
    for sweep in range(_SWEEPS):
        down = sweep % 2 == 0
        for level in levels if down else levels[::-1]:
            place = {
                id(slot): (k + 0.5) / len(other) for other in levels for k, slot in enumerate(other)
            }

            def mean(slot: _Slot, down: bool = down, place: dict[int, float] = place) -> float:
                near = slot.above if down else slot.below
                return float(np.mean([place[id(s)] for s in near])) if near else place[id(slot)]

            level.sort(key=mean)


def _place(levels: list[list[_Slot]]) -> None:
    """Gives each slot an x near its connected slots, without overlaps."""
    for level in levels:
        _spread(level, [0.0] * len(level))
    for sweep in range(_SWEEPS):
        for level in levels if sweep % 2 == 0 else levels[::-1]:
            _spread(
                level,
                [
                    float(np.mean([s.x for s in (*slot.above, *slot.below)] or [slot.x]))
                    for slot in level
                ],
            )
    left = min(slot.x - slot.width / 2 for level in levels for slot in level)
    for level in levels:
        for slot in level:
            slot.x += _GAP - left


def _spread(level: list[_Slot], targets: Sequence[float]) -> None:
    """Sets each x nearest to the targets (least squares), with order and distances kept."""
    steps = [
        (a.width + b.width) / 2 + (_GAP if a.node is not None and b.node is not None else _PITCH)
        for a, b in itertools.pairwise(level)
    ]
    offsets = np.concatenate(([0.0], np.cumsum(steps)))
    free = isotonic_regression(np.asarray(targets) - offsets).x
    for slot, x in zip(level, free + offsets, strict=True):
        slot.x = float(x)


class _Router:
    """Draws the lines between placed slots."""

    def __init__(
        self,
        sizes: Vector,
        edges: Sequence[tuple[int, int]],
        rows: list[int],
        slots: _Slots,
        levels: list[list[_Slot]],
    ) -> None:
        self._sizes, self._edges, self._rows = sizes, edges, rows
        self._slots, self._levels = slots, levels
        self._right = max(s.x + s.width / 2 for level in levels for s in level) + _GAP
        feedback = sorted({a for a, b in edges if rows[b] <= rows[a]}, key=lambda a: -rows[a])
        # Usually the lowest sender's line goes highest: its lane is the outermost.
        self._lanes = {a: self._right + _PITCH * k for k, a in enumerate(reversed(feedback))}
        self._entries = self._find_entries()
        self._spans = self._find_spans()
        self._tracks = [self._assign_tracks(spans) for spans in self._spans]

    def _box(self, node: int) -> _Slot:
        return self._slots["box", node, self._rows[node]]

    def _arrival(self, sender: int, receiver: int) -> float:
        """Returns the x from which a line comes down or across to its receiver."""
        if self._rows[receiver] <= self._rows[sender]:
            return self._lanes[sender]
        return self._passages(sender, receiver)[-1]

    def _passages(self, sender: int, receiver: int) -> list[float]:
        """Returns the x of a line at its sender's row and at each row that it crosses."""
        between = range(self._rows[sender] + 1, self._rows[receiver])
        return [self._box(sender).x, *(self._slots["net", sender, row].x for row in between)]

    def _find_entries(self) -> dict[tuple[int, int], float]:
        """Returns the x at which lines arrive on a node's upper side, in order of their sources."""
        entries = {}
        for node in range(len(self._sizes)):
            senders = [a for a, b in self._edges if b == node]
            senders.sort(key=lambda a, node=node: self._arrival(a, node))  # type: ignore[misc]
            box = self._box(node)
            step = min(0.16, 0.85 * box.width / max(len(senders), 1))
            for k, sender in enumerate(senders):
                entries[sender, node] = box.x + step * (k - (len(senders) - 1) / 2)
        # Nearly straight lines are made straight.
        for (sender, node), x in entries.items():
            alone = sum(b == node for _, b in self._edges) == 1
            arrival = self._arrival(sender, node)
            if alone and abs(arrival - self._box(node).x) < 0.45 * self._box(node).width:
                entries[sender, node] = arrival if self._rows[node] > self._rows[sender] else x
        return entries

    def _corners(self, sender: int, receiver: int) -> list[tuple[int, float, float]]:
        """Returns a line's horizontal pieces (channel, from x, to x); channel k is above row k."""
        entry = self._entries[sender, receiver]
        row, target = self._rows[sender], self._rows[receiver]
        if target <= row:
            lane = self._lanes[sender]
            return [(row + 1, self._box(sender).x, lane), (target, lane, entry)]
        xs = [*self._passages(sender, receiver), entry]
        return [(row + 1 + k, a, b) for k, (a, b) in enumerate(itertools.pairwise(xs))]

    def _find_spans(self) -> list[dict[int, tuple[float, float]]]:
        """Returns for each channel the range of x of each net."""
        spans: list[dict[int, tuple[float, float]]] = [{} for _ in range(len(self._levels) + 1)]
        for sender, receiver in self._edges:
            for channel, a, b in self._corners(sender, receiver):
                low, high = spans[channel].get(sender, (a, a))
                spans[channel][sender] = (min(low, a, b), max(high, a, b))
        return spans

    @staticmethod
    def _assign_tracks(spans: dict[int, tuple[float, float]]) -> dict[int, int]:
        """Returns a track for each net; overlapping nets have different tracks."""
        tracks: dict[int, int] = {}
        for net, (low, high) in sorted(spans.items(), key=lambda item: item[1]):
            taken = {
                tracks[other]
                for other in tracks
                if spans[other][0] < high + _PITCH and low < spans[other][1] + _PITCH
            }
            if high - low > 1e-6:
                tracks[net] = next(k for k in range(len(spans) + 1) if k not in taken)
        return tracks

    def layout(self) -> Layout:
        """Stacks rows and channels from the top and collects the corners."""
        heights = [
            max(self._sizes[s.node][1] for s in level if s.node is not None)
            for level in self._levels
        ]
        channels = [
            2 * _CHANNEL + _PITCH * max(t.values(), default=0) if s else _CHANNEL / 2
            for t, s in zip(self._tracks, self._spans, strict=True)
        ]
        total = sum(heights) + sum(channels)
        tops = total - np.concatenate(([0.0], np.cumsum(np.add(heights, channels[:-1]))))
        row_tops = [tops[k] - channels[k] for k in range(len(heights))]
        centers = np.array(
            [[self._box(n).x, row_tops[r] - heights[r] / 2] for n, r in enumerate(self._rows)]
        )
        routes = {}
        for sender, receiver in self._edges:
            line = [(self._box(sender).x, centers[sender, 1] - self._sizes[sender][1] / 2)]
            for channel, a, b in self._corners(sender, receiver):
                y = tops[channel] - _CHANNEL - _PITCH * self._tracks[channel].get(sender, 0)
                line += [(a, y), (b, y)]
            top = centers[receiver, 1] + self._sizes[receiver][1] / 2
            line.append((self._entries[sender, receiver], top))
            routes[sender, receiver] = _without_repeats(line)
        width = max([self._right, *(x + _PITCH for x in self._lanes.values())])
        return Layout(centers, routes, float(width), float(total))


def _without_repeats(line: list[_Point]) -> list[_Point]:
    """Returns the corners without those at which the line goes straight on."""
    kept = [line[0]]
    for point, after in zip(line[1:], [*line[2:], None], strict=True):
        if np.allclose(point, kept[-1], atol=1e-9):
            continue
        if after is not None:
            (x0, y0), (x1, y1), (x2, y2) = kept[-1], point, after
            if abs((x1 - x0) * (y2 - y1) - (y1 - y0) * (x2 - x1)) < 1e-12:
                continue
        kept.append((float(point[0]), float(point[1])))
    return kept
