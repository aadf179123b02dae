"""The wall's clock leads the diagram's, in virtual time."""

import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import EventStatus, LeafSystem

from pepper_drake.hardware.paced_run import run_paced


class Clock:
    def __init__(self):
        self.now = 100.0

    def wall(self):
        return self.now

    def sleep(self, duration):
        self.now += duration


class Beat(LeafSystem):
    """Notes when it is called, and takes the time that it is told to."""

    def __init__(self, clock, durations):
        super().__init__()
        self.calls = []
        self._clock, self._durations = clock, durations
        self.DeclarePeriodicPublishEvent(0.02, 0.0, self._call)

    def _call(self, context):
        self.calls.append((context.get_time(), self._clock.now))
        self._clock.now += self._durations.pop(len(self.calls), 0.001)
        return EventStatus.Succeeded()


def run(durations, until=0.5):
    clock = Clock()
    beat = Beat(clock, durations)
    simulator = Simulator(beat)
    simulator.Initialize()
    over = lambda: simulator.get_context().get_time() >= until - 1e-9  # noqa: E731
    pacing = run_paced(simulator, 100.0, over, wall=clock.wall, sleep=clock.sleep)
    return beat.calls, pacing


def test_a_step_each_period_at_its_time():
    calls, pacing = run({})
    assert pacing.skipped == 0
    for simulated, wall in calls[2:]:
        assert wall - 100.0 == pytest.approx(simulated, abs=0.0015)


def test_after_a_pause_it_goes_on_with_the_beat():
    calls, pacing = run({10: 0.105})
    assert pacing.skipped == 4
    assert pacing.worst == pytest.approx(0.085, abs=0.003)
    late = [wall - 100.0 - simulated for simulated, wall in calls[15:]]
    assert max(map(abs, late)) < 0.0015
