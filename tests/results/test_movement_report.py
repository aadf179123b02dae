from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_mode import ReachMode, last_attempt
from pepper_drake.reporting.reach_figures import movement_title
from pepper_drake.results.movement_report import ADAPTED, AS_SHOWN, BENT, measure_movement
from tests.results.test_reach_log import make_log

OFF = 0.03


def straight_log(origins, coupling=0.0):
    """A reach of 2 s along a line, 3 cm beside the taught one, with a constant coupling."""
    log = make_log([ReachMode.REACHING])
    origin = np.repeat(origins, len(log.time_s) // len(origins))
    taught = log.hand_position_torso_m + [0.0, OFF, 0.0]
    push = np.zeros((len(log.time_s), 3))
    push[:, 2] = coupling
    return replace(log, movement_origin=origin, coupling_m_per_s2=push, taught_path_torso_m=taught)


@pytest.mark.parametrize(
    ("origins", "coupling", "kind"),
    [
        ([Origin.TAUGHT], 0.0, AS_SHOWN),
        ([Origin.TAUGHT], 2.0, BENT),
        ([Origin.ADAPTED], 0.0, ADAPTED),
        ([Origin.ADAPTED], 2.0, ADAPTED),
        ([Origin.TAUGHT, Origin.DETOUR], 2.0, ADAPTED),
        ([Origin.TAUGHT, Origin.RETREAT], 0.0, AS_SHOWN),
    ],
)
def test_the_kind_of_a_performance_follows_from_what_was_performed(origins, coupling, kind):
    movement = measure_movement(straight_log(origins, coupling))
    assert movement.kind == kind
    assert movement.largest_coupling == coupling
    assert movement.coupled_seconds == pytest.approx(2.0 if coupling else 0.0)


def test_deviation_is_the_distance_between_the_paths():
    movement = measure_movement(straight_log([Origin.TAUGHT]))
    assert movement.mean_deviation == pytest.approx(OFF)
    assert movement.largest_deviation == pytest.approx(OFF)
    assert "30 mm" in movement_title(movement)


def test_the_rows_of_the_last_attempt_follow_the_last_drive():
    modes = [
        [ReachMode.LOOKING, ReachMode.DRIVING, ReachMode.SETTLING],
        [ReachMode.REACHING, ReachMode.HOLDING, ReachMode.REACHING],
        [ReachMode.LOOKING, ReachMode.DRIVING, ReachMode.SETTLING],
        [ReachMode.REACHING, ReachMode.HOLDING, ReachMode.DONE],
    ]
    for tried, first in ((4, 9), (3, 3), (2, 3)):
        mode = np.concatenate(modes[:tried])
        moving = np.flatnonzero(last_attempt(mode))
        assert (moving[0], len(moving)) == (first, 2 if tried == 4 else 3)
    assert not last_attempt(np.array(modes[0])).any()


def test_a_return_before_the_robot_drives_elsewhere_is_counted():
    origins = [Origin.ADAPTED, Origin.RETREAT, Origin.RETURN, Origin.ADAPTED, Origin.ADAPTED]
    movement = measure_movement(straight_log(origins))
    assert (movement.retreats, movement.returns) == (1, 1)
    assert "1 retreat, 1 drive elsewhere" in "\n".join(movement.lines())


def test_waiting_and_retreats_are_counted():
    origins = [Origin.TAUGHT, Origin.NONE, Origin.RETREAT, Origin.DETOUR, Origin.RETREAT]
    movement = measure_movement(straight_log(origins))
    assert (movement.detours, movement.retreats) == (1, 2)
    assert movement.waited_seconds == pytest.approx(0.4)
    assert movement.withdrawn_seconds == pytest.approx(0.8)
    words = "\n".join(movement.lines())
    for said in (
        "1 detour,",
        "2 retreats",
        "stood for 0.4 s",
        "withdrawn for 0.8 s",
        "zero: no obstacle",
    ):
        assert said in words
    assert "none: it was left out" in "\n".join(movement.lines(coupled=False))


def test_an_arm_that_did_not_start_performed_nothing():
    movement = measure_movement(make_log([ReachMode.LOOKING]))
    assert movement.kind == ""
    assert movement.lines() == []
