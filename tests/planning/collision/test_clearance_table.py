from dataclasses import fields, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.models.typed_yaml import load_yaml, save_yaml
from pepper_drake.planning.collision.clearance_table import ClearanceTable
from pepper_drake.planning.reach.reach_parameters import (
    FollowingErrors,
    GoalTolerances,
    ReachPlannerParams,
    ReachTiming,
)

NAMES = [field.name for field in fields(ClearanceTable)]


@given(st.permutations([0.001, 0.004, 0.008, 0.012, 0.014, 0.016, 0.020, 0.060]))
def test_only_clearances_that_rise_are_accepted(values):
    table = dict(zip(NAMES, values, strict=True))
    if values == sorted(values):
        assert ClearanceTable(**table).retreat_end == 0.060
    else:
        with pytest.raises(InputError, match="must be greater than"):
            ClearanceTable(**table)


def test_the_sentence_names_both_clearances():
    with pytest.raises(InputError, match=r"clearance\.replan is 0\.012 m.*clearance\.slow, 0\.013"):
        replace(ClearanceTable(), slow=0.013)


def test_a_table_that_was_changed_field_by_field_is_checked_on_demand():
    table = ClearanceTable()
    table.want = 0.001
    with pytest.raises(InputError, match=r"clearance\.want"):
        table.check()


def test_tolerances_and_following_errors_have_an_order_too():
    with pytest.raises(InputError, match=r"tolerance\.accept"):
        GoalTolerances(arrive=0.02, accept=0.01)
    with pytest.raises(InputError, match=r"following\.stop"):
        FollowingErrors(plan=0.3, stop=0.2)
    with pytest.raises(InputError, match=r"following\.good"):
        FollowingErrors(good=0.13)


@pytest.mark.parametrize("parameters", [ReachPlannerParams(), ReachTiming()])
def test_parameters_are_written_and_read_as_yaml(parameters, tmp_path):
    path = tmp_path / "parameters.yaml"
    save_yaml(parameters, path)
    assert load_yaml(type(parameters), path) == parameters
