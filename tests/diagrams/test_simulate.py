import time

import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import EventStatus
from pydrake.systems.framework import LeafSystem as DrakeLeafSystem
from pydrake.systems.primitives import ConstantVectorSource

from pepper_drake.diagrams.simulate import simulate
from pepper_drake.errors import PepperDrakeError


class Clock(DrakeLeafSystem):
    """Ticks a hundred times a second, and breaks when it is told to."""

    def __init__(self, breaks_at=None):
        super().__init__()
        self._breaks_at = breaks_at
        self.DeclarePeriodicPublishEvent(0.01, 0.0, self._tick)

    def _tick(self, context):
        if self._breaks_at is not None and context.get_time() > self._breaks_at:
            raise RuntimeError("The solver failed.\n  It is known why:\n  no scale.")


def make(**options):
    return Simulator(Clock(**options))


def test_it_ends_with_its_time():
    simulator = make()
    end = simulate(simulator, 0.5)
    assert simulator.get_context().get_time() == 0.5
    assert (end.stopped, end.fault) == (False, "")
    end.check()


def test_watching_ends_it_at_the_next_look():
    simulator, seen = make(), []

    def watch():
        seen.append(simulator.get_context().get_time())
        return len(seen) == 3

    end = simulate(simulator, 5.0, watch=watch, period=0.2)
    assert seen == pytest.approx([0.2, 0.4, 0.6])
    assert simulator.get_context().get_time() == pytest.approx(0.6)
    assert not end.stopped
    assert simulate(simulator, 0.7).fault == ""
    assert simulator.get_context().get_time() == 0.7


@pytest.mark.parametrize("count", [0, 3])
def test_it_is_stopped_when_it_is_asked_to(count):
    simulator, asked = make(), iter(range(100))
    end = simulate(simulator, 5.0, should_stop=lambda: next(asked) >= count)
    assert end.stopped
    assert simulator.get_context().get_time() == pytest.approx(0.1 * count)


def test_all_that_drake_says_is_one_sentence():
    simulator = make(breaks_at=0.33)
    end = simulate(simulator, 5.0)
    assert end.fault.startswith("the simulation cannot continue at 0.3")
    assert end.fault.endswith("The solver failed. It is known why: no scale.")
    with pytest.raises(PepperDrakeError, match="no scale"):
        end.check()


def test_a_monitor_goes_on_and_may_end_it():
    simulator, times = Simulator(ConstantVectorSource([0.0])), []

    def monitor(root):
        times.append(root.get_time())
        if root.get_time() >= 0.25:
            return EventStatus.ReachedTermination(simulator.get_system(), "enough")
        return None

    simulator.set_monitor(monitor)
    simulator.get_mutable_integrator().set_maximum_step_size(0.05)
    simulate(simulator, 1.0)
    assert simulator.get_monitor() is not None
    assert max(times) <= 1.0
    assert times


def test_keeping_takes_a_small_part_of_the_time_however_slow_it_is(monkeypatch):
    now, kept = [0.0], []
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])

    def watch():
        now[0] += 1.0
        return False

    def keep():
        kept.append(now[0])
        now[0] += 0.0 if len(kept) < 3 else 2.0

    simulate(make(), 10.0, watch=watch, keep=keep, period=0.1)
    # At once where it costs nothing; after 2 s of it not for 40 s.
    assert kept == [2.0, 4.0, 6.0, 50.0, 94.0]
