"""Statistics and traces of an object's calls, enabled by clients."""

import inspect
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

TRACE_UID = 86
TRACE = (
    "(IiIm(ll)<timeval,tv_sec,tv_usec>llII)<EventTrace,id,kind,slotId,arguments,timestamp,"
    "userUsTime,systemUsTime,callerContext,calleeContext>"
)
"""Signature of the signal `traceObject`."""

_CALL, _RESULT, _ERROR = 1, 2, 3
_LONGEST_TEXT = 200

Tell = Callable[[tuple[Any, ...]], None]


@dataclass
class _Range:
    count: int = 0
    least: float = 0.0
    most: float = 0.0
    total: float = 0.0

    def add(self, value: float) -> None:
        self.least = value if self.count == 0 else min(self.least, value)
        self.most = value if self.count == 0 else max(self.most, value)
        self.total += value
        self.count += 1


@dataclass
class CallWatch:
    """Statistics and traces of an object's calls.

    Attributes:
        counts: Whether statistics are kept.
        traces: Whether calls and results are emitted by the signal `traceObject`.
    """

    counts: bool = False
    traces: bool = False
    _kept: dict[int, tuple[_Range, _Range, _Range]] = field(default_factory=dict)

    def statistics(self) -> dict[int, tuple[Any, ...]]:
        """Returns number, and least, largest and summed wall, user and system times [s], by uid."""
        return {
            uid: (kept[0].count, *((part.least, part.most, part.total) for part in kept))
            for uid, kept in self._kept.items()
        }

    def clear(self) -> None:
        """Clears the statistics."""
        self._kept.clear()

    def run(
        self, call: Callable[[], Any], uid: int, number: int, arguments: Any, tell: Tell
    ) -> Any:
        """Makes a call, with statistics and traces if enabled.

        Args:
            call: Makes it; its result may be awaitable.
            uid: Number of the method.
            number: Number of the call.
            arguments: Its arguments.
            tell: Emits `traceObject`.

        Returns:
            The result of `call`.
        """
        begin, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_THREAD)
        self._trace(tell, number, _CALL, uid, arguments, (0, 0))

        def ended(kind: int, value: Any) -> None:
            now = resource.getrusage(resource.RUSAGE_THREAD)
            spent = (now.ru_utime - used.ru_utime, now.ru_stime - used.ru_stime)
            if self.counts:
                kept = self._kept.setdefault(uid, (_Range(), _Range(), _Range()))
                for part, seconds in zip(kept, (time.perf_counter() - begin, *spent), strict=True):
                    part.add(seconds)
            micro = (int(1e6 * spent[0]), int(1e6 * spent[1]))
            self._trace(tell, number, kind, uid, value, micro)

        try:
            result = call()
        except Exception as error:
            ended(_ERROR, str(error))
            raise
        if not inspect.isawaitable(result):
            ended(_RESULT, result)
            return result

        async def later() -> Any:
            try:
                value = await result
            except Exception as error:
                ended(_ERROR, str(error))
                raise
            ended(_RESULT, value)
            return value

        return later()

    def _trace(
        self, tell: Tell, number: int, kind: int, uid: int, value: Any, spent: tuple[int, int]
    ) -> None:
        if self.traces:
            seconds, micro = divmod(time.time_ns() // 1000, 1_000_000)
            tell((number, kind, uid, _plain(value), (seconds, micro), *spent, 0, 0))


def _plain(value: Any) -> Any:
    """Returns a value for a trace: objects and images are replaced by their type."""
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str):
        return value[:_LONGEST_TEXT]
    if isinstance(value, list | tuple) and len(value) <= _LONGEST_TEXT:
        return [_plain(item) for item in value]
    return type(value).__name__
