"""The wall's clock leads the diagram's, in virtual time."""

import itertools

import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import EventStatus, LeafSystem

from pepper_drake.hardware.paced_run import DiagramClock, run_paced


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
    over = lambda: simulator.get_context().get_time() >= until - 1e-9  # noqa: E731
    diagram_clock = DiagramClock(clock.wall, clock.sleep)
    pacing = run_paced(simulator, diagram_clock, over)
    return beat.calls, pacing, diagram_clock


def test_a_step_each_period_at_its_time():
    calls, pacing, _ = run({})
    assert pacing.skipped == 0
    start = calls[2][1] - calls[2][0]
    for simulated, wall in calls[2:]:
        assert wall - start == pytest.approx(simulated, abs=0.0015)


def test_after_a_pause_no_step_is_made_up_for():
    calls, pacing, clock = run({10: 0.105})
    assert pacing.skipped == 4
    assert pacing.worst == pytest.approx(0.085, abs=0.003)
    # The diagram's time stood still: each step is one period on, the next a whole period later.
    simulated, wall = zip(*calls[9:15], strict=True)
    for before, after in itertools.pairwise(simulated):
        assert after - before == pytest.approx(0.02)
    for before, after in itertools.pairwise(wall[1:]):
        assert after - before > 0.01
    # What was measured before, in and after the pause has the diagram's time of then.
    begin, end = calls[9][1], calls[10][1]
    assert clock.at(begin) == pytest.approx(calls[9][0], abs=0.022)
    assert clock.at(end) == pytest.approx(calls[10][0], abs=0.022)
    assert clock.at(begin) <= clock.at((begin + end) / 2) <= clock.at(end)
