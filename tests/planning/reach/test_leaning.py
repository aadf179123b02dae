from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.errors import InputError
from pepper_drake.models.scene import Marker
from pepper_drake.planning.reach.lean_params import LeanParams
from pepper_drake.planning.reach.reach_plan import PlanStatus
from tests.planning.reach.planner_setup import (
    ORIGIN,
    make_planner,
    object_at,
    observed,
    sheet,
)

LOW = object_at(z=0.5)


def table(height):
    return sheet((0.85, 1.4), (-0.5, 0.5), height)


@pytest.fixture(scope="module")
def marked(right_primitive):
    """A planner for an object with a marker, of a robot that may lean."""
    return partial(make_planner, right_primitive, make_coupling("barrier"), X_OM=Marker().pose())


@pytest.fixture(scope="module")
def leaning(marked):
    return marked()


def test_at_a_usual_height_the_robot_stays_upright(leaning):
    plan = leaning.plan_base_placement(observed(ORIGIN, object_at(), table(0.78)))
    assert (plan.status, plan.hip_pitch) == (PlanStatus.CLEAR, None)


def test_for_a_low_goal_the_robot_leans_where_its_head_still_sees_the_marker(marked, leaning):
    observation = observed(ORIGIN, LOW, table(0.5))
    upright = marked(lean=LeanParams(hip_pitch=[]))
    unseen = upright.plan_base_placement(observation)
    assert not leaning.leaning.shows_marker(unseen, observation)
    plan = leaning.plan_base_placement(observation)
    assert plan.status == PlanStatus.CLEAR
    assert plan.hip_pitch in leaning.params.lean.hip_pitch
    assert leaning.leaning.shows_marker(plan, observation.with_hip_pitch(plan.hip_pitch))
    # There the reach is planned anew, as the robot then stands.
    there = observation.with_hip_pitch(plan.hip_pitch).from_base_pose(plan.base_pose)
    assert leaning.check_reach(there, plan.movement).status == PlanStatus.CLEAR


@pytest.mark.parametrize("z", [0.51, 0.55, 0.57])
def test_the_robot_stands_where_its_tablet_hides_no_corner_of_the_marker(marked, leaning, z):
    size = Marker().size
    corners = 0.5 * size * np.array([[0, 0, 0], [-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    observation, whole = observed(ORIGIN, object_at(z=z), table(z)), marked(marker_size=size)

    def is_seen(plan):
        hip_pitch = observation.hip_pitch if plan.hip_pitch is None else plan.hip_pitch
        return leaning.leaning.shows_marker(plan, observation.with_hip_pitch(hip_pitch), corners)

    assert not is_seen(leaning.plan_base_placement(observation))  # Its centre is enough for this.
    plan = whole.plan_base_placement(observation)
    assert plan.status == PlanStatus.CLEAR
    assert is_seen(plan)


def test_where_no_place_shows_the_whole_marker_its_centre_is_enough(marked):
    observation = observed(ORIGIN, object_at(z=0.51), table(0.51))
    plan = marked(marker_size=0.2).plan_base_placement(observation)
    assert plan.status == PlanStatus.CLEAR
    assert plan.hip_pitch is not None


def test_without_a_marker_nothing_must_be_seen(planner):
    plan = planner.plan_base_placement(observed(ORIGIN, LOW, table(0.5)))
    assert plan.hip_pitch is None


def test_the_robot_does_not_lean_into_an_obstacle(leaning):
    observation = observed(ORIGIN, LOW, table(0.5))
    plan = leaning.plan_base_placement(observation)
    leant = observation.with_hip_pitch(plan.hip_pitch)
    assert leaning.leaning.may_lean(plan, observation, plan.hip_pitch)
    assert leaning.check_drive(plan, observation).status == PlanStatus.CLEAR
    # A board that the head would lean into.
    spheres = leaning.base_placement.resting_clearances
    x, _, z = max(spheres.centers(leant.joint_position), key=lambda p_B: p_B[0] + p_B[2])
    head = RigidTransform(RotationMatrix.MakeZRotation(plan.base_pose[2]), [*plan.base_pose[:2], 0])
    board = (head @ (np.array([x + 0.05, 0.0, z]) + sheet(0.0, (-0.1, 0.1), (-0.1, 0.1))).T).T
    blocked = replace(observation, cloud=np.concatenate((observation.cloud, board)))
    assert not leaning.leaning.may_lean(plan, blocked, plan.hip_pitch)
    assert leaning.check_drive(plan, blocked).status == PlanStatus.NO_STANDING_ROOM


def test_angles_at_which_the_robot_could_fall_over_are_refused():
    with pytest.raises(InputError, match="hip_pitch"):
        LeanParams(hip_pitch=[-0.8]).check()
