"""Runs a diagram's simulation, with progress bar, interruption and error message."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus
from tqdm import tqdm

from pepper_drake.errors import PepperDrakeError

_KEEP_PERIOD = 0.8
"""Least wall time between two calls of `keep` [s], plus up to one `period`."""
_KEEP_SHARE = 0.05
"""Largest share of the wall time that `keep` takes."""
_ROUNDING = 1e-9
"""Tolerance of times [s]."""
_GOES_ON = (EventStatus.Severity.kDidNothing, EventStatus.Severity.kSucceeded)


@dataclass(frozen=True)
class SimulationEnd:
    """End of a simulation.

    Attributes:
        stopped: Whether `should_stop` ended it.
        fault: Drake's error in one sentence; empty if there was none.
        wall_seconds: Wall time of the simulation, without `watch` and `keep` [s].
    """

    stopped: bool
    fault: str
    wall_seconds: float

    def check(self) -> None:
        """Raises PepperDrakeError if the simulation failed."""
        if self.fault:
            raise PepperDrakeError(self.fault)


def simulate(
    simulator: Simulator,
    until: float,
    *,
    watch: Callable[[], bool] = lambda: False,
    should_stop: Callable[[], bool] = lambda: False,
    keep: Callable[[], None] | None = None,
    period: float = 0.1,
    progress: bool = False,
    title: str | Callable[[], str] = "simulating",
) -> SimulationEnd:
    """Simulates up to a time, or until it is over, or until it is stopped.

    A monitor already set on the simulator stays active.

    Args:
        simulator: The simulator; initialized if it has not been yet.
        until: Latest end in simulated time [s].
        watch: Called once per `period`; the simulation is over when it returns True.
        should_stop: Polled before the first step and once per `period`.
        keep: Called about once a second of wall time, in case the program is killed; less often
            where it takes long, as on a busy computer.
        period: Simulated time between two calls [s].
        progress: Whether a progress bar is shown.
        title: Title of the progress bar; may change.
    """
    context, monitor = simulator.get_context(), simulator.get_monitor()
    began, watched = time.perf_counter(), 0.0
    keep_due = began + _KEEP_PERIOD
    stopped, fault = should_stop(), ""
    next_look = context.get_time() + period
    bar = None  # Not one that shows nothing: a page would make 128 a second.
    if progress:
        bar = tqdm(
            unit=" s",
            bar_format="{desc:10s} {n:5.1f} s simulated, {elapsed} elapsed",
            leave=False,
        )

    def look(root: Context) -> EventStatus:
        nonlocal next_look, keep_due, stopped, watched
        if monitor is not None:
            status = monitor(root)
            if status is not None and status.severity() not in _GOES_ON:
                return status
        if root.get_time() < next_look - _ROUNDING:
            return EventStatus.DidNothing()
        started = time.perf_counter()
        next_look += period
        is_over = watch()
        if keep is not None and started > keep_due:
            keeping = time.perf_counter()
            keep()
            kept = time.perf_counter()
            keep_due = kept + max(_KEEP_PERIOD, (kept - keeping) / _KEEP_SHARE)
        if bar is not None:
            bar.set_description(title if isinstance(title, str) else title(), refresh=False)
            bar.update(period)
        watched += time.perf_counter() - started
        stopped = should_stop()
        if is_over or stopped:
            return EventStatus.ReachedTermination(simulator.get_system(), "over")
        return EventStatus.DidNothing()

    simulator.set_monitor(look)
    try:
        if not stopped:
            simulator.AdvanceTo(until)
    except RuntimeError as error:
        words = " ".join(str(error).split())
        fault = f"the simulation cannot continue at {context.get_time():.2f} s: {words}"
    finally:
        if bar is not None:
            bar.close()
        simulator.clear_monitor()
        if monitor is not None:
            simulator.set_monitor(monitor)
    return SimulationEnd(stopped, fault, time.perf_counter() - began - watched)
