from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachTiming
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan
from pepper_drake.systems.faults.fault import SIGNALS, parse_fault, parse_faults
from pepper_drake.systems.faults.fault_set import FaultSet
from pepper_drake.systems.faults.faulty_planner import FaultyPlanner, faulty

CLEAR = ReachPlan(PlanStatus.CLEAR, "", np.zeros(3), joint_path=np.zeros((4, 5)))


class Recorder(SimpleNamespace):
    """A planner whose every plan is clear, and that keeps what it was asked."""

    def __init__(self):
        super().__init__(asked=[])

    def _plan(self, observation):
        self.asked.append(observation)
        return CLEAR

    def plan_base_placement(self, observation):
        return self._plan(observation)

    def check_reach(self, observation, movement=None):
        return self._plan(observation)

    def replan(self, plan, observation):
        return self._plan(observation)

    def plan_retreat(self, travelled, observation):
        return self._plan(observation)


def observation(time):
    arm = ArmState(np.zeros(5), np.zeros(5))
    return Observation(time, np.zeros(3), np.zeros(15), arm, RigidTransform([1.0, 0.0, 0.8]))


def answers(planner, time):
    now = observation(time)
    return [
        planner.plan_base_placement(now),
        planner.check_reach(now),
        planner.replan(CLEAR, now),
        planner.plan_retreat(np.zeros((1, 5)), now),
    ]


@pytest.mark.parametrize("kind", ["off", "intermittent", "wrong", "garbage", "slow"])
def test_before_and_after_a_fault_the_answers_are_the_planners_own(kind):
    planner = FaultyPlanner(Recorder(), parse_fault(f"planner:{kind}@2+1"))
    for time in (0.0, 1.99, 3.0, 9.0):
        assert all(plan is CLEAR for plan in answers(planner, time))
        assert all(one.p_WO.tolist() == [1.0, 0.0, 0.8] for one in planner.planner.asked)


def test_a_planner_that_is_off_finds_nothing():
    planner = FaultyPlanner(Recorder(), parse_fault("planner:off@0"))
    assert {plan.status for plan in answers(planner, 1.0)} == {PlanStatus.NO_CLEAR_PATH}


def test_an_intermittent_planner_finds_something_half_of_the_time():
    planner = FaultyPlanner(Recorder(), parse_fault("planner:intermittent@0"))
    found = [
        planner.check_reach(observation(0.05 * k)).status == PlanStatus.CLEAR for k in range(200)
    ]
    assert 60 < sum(found) < 140


def test_a_wrong_plan_is_for_a_goal_elsewhere():
    planner = FaultyPlanner(Recorder(), parse_fault("planner:wrong@0"), seed=2)
    answers(planner, 1.0)
    moved = [one.p_WO - [1.0, 0.0, 0.8] for one in planner.planner.asked]
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), SIGNALS["planner"].offset)
    np.testing.assert_allclose(moved, moved[:1] * 4)


def test_garbage_is_clear_and_no_number():
    planner = FaultyPlanner(Recorder(), parse_fault("planner:garbage@0"))
    for plan in answers(planner, 1.0):
        assert plan.status == PlanStatus.CLEAR
        assert np.isnan(plan.joint_path).all()
        assert np.abs(plan.base_pose).max() > 10


def test_a_fault_that_waits_for_the_arm_spares_the_plans_before():
    planner = FaultyPlanner(Recorder(), parse_fault("planner:off@reach"))
    placed, checked, replanned, retreat = answers(planner, 1.0)
    assert placed is CLEAR
    assert checked is CLEAR
    assert replanned.status == retreat.status == PlanStatus.NO_CLEAR_PATH


def test_a_slow_planner_takes_five_times_as_long():
    timing, planner = ReachTiming(), Recorder()
    slow = FaultSet(parse_faults(["planner:slow@0"]))
    slowed = faulty(planner, timing, slow)[1].latency
    assert slowed.plan == pytest.approx(5 * timing.latency.plan)
    assert faulty(planner, timing, FaultSet()) == (planner, timing)
    off = FaultSet(parse_faults(["planner:off@0"]), seed=3)
    spoilt = FaultyPlanner(planner, off.faults[0], seed=3)
    assert faulty(planner, timing, off) == (spoilt, timing)
