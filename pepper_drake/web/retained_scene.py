"""Past messages of a page, for browsers that open it later."""

from collections.abc import Iterator
from typing import Any

import msgpack

_LASTING = ("set_animation", "set_target", "show_realtime_rate")


class RetainedScene:
    """The messages of Drake's Meshcat that are still valid, by node or kind."""

    def __init__(self) -> None:
        self._nodes: dict[str, dict[str, bytes]] = {}
        self._lasting: dict[str, bytes] = {}

    def add(self, data: bytes) -> None:
        """Stores a message of Meshcat."""
        kind = _kind(data)
        if kind in ("set_transform", "set_object"):
            self._node(data)[kind] = data
        elif kind == "set_property":
            self._node(data)[f"property {msgpack.unpackb(data)['property']}"] = data
        elif kind == "delete":
            self._delete(_path(data))
        elif kind in _LASTING:
            self._lasting[kind] = data

    def messages(self) -> Iterator[bytes]:
        """Yields messages that bring a new browser up to date."""
        for node in self._nodes.values():
            # Objects first: they would reset transform and properties.
            yield from (node[kind] for kind in sorted(node, key=_order))
        yield from self._lasting.values()

    def _node(self, data: bytes) -> dict[str, bytes]:
        return self._nodes.setdefault(_path(data), {})

    def _delete(self, path: str) -> None:
        below = path.rstrip("/") + "/"
        for other in [o for o in self._nodes if o == path or o.startswith(below)]:
            del self._nodes[other]


def _order(kind: str) -> int:
    return ("set_object", "set_transform").index(kind) if kind.startswith("set_") else 2


def _first(data: bytes, count: int) -> list[Any]:
    """Returns the first values of a message's map without reading the rest."""
    unpacker = msgpack.Unpacker(max_buffer_size=0)
    unpacker.feed(data)
    unpacker.read_map_header()
    values = []
    for _ in range(count):
        unpacker.skip()
        values.append(unpacker.unpack())
    return values


def _kind(data: bytes) -> str:
    return str(_first(data, 1)[0])


def _path(data: bytes) -> str:
    return "/" + str(_first(data, 2)[1]).strip("/")
