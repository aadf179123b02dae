import numpy as np
import pytest

from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive, get_approximator, get_coupling
from pepper_drake.planning import get_planner
from pepper_drake.scenario import Scenario, build_reaching, save_scenario
from pepper_drake.user_code import names_code, register_code

OWN = """\
from dataclasses import dataclass, replace

import numpy as np

from pepper_drake.learning import BarrierCoupling, CouplingOutput, get_approximator
from pepper_drake.planning import PlanStatus, ReachPlanner


class Upward(BarrierCoupling):
    def push(self, field, state, acceleration, goal, goal_clearance, tau):
        up = np.zeros(state.shape[:-2] + (3,))
        up[..., 2] = 0.5 * tau * tau
        distance = field.distance(state[..., 0, :])
        return CouplingOutput(up, np.zeros(state.shape[:-2]), distance)

    def zero_beyond(self, state, acceleration):
        return np.full(state.shape[:-2], np.inf)


class Refusing(ReachPlanner):
    def plan_base_placement(self, observation):
        plan = super().plan_base_placement(observation)
        return replace(plan, status=PlanStatus.OUT_OF_REACH, message="not today")


mine = get_approximator("lwr")
number = 3
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(OWN)
    return path


def line():
    s = np.linspace(0.0, 1.0, 101)
    blend = 10 * s**3 - 15 * s**4 + 6 * s**5
    return Demonstration.from_positions(2.0 * s, blend[:, None] * [0.2, 0.1, 0.0])


def test_a_coupling_of_ones_own_bends_a_movement(own, tmp_path):
    name = register_code(f"{own}:Upward")
    assert name == "own.py:Upward"
    assert make_coupling(name) == get_coupling(name)
    primitive = MovementPrimitive.fit(line())
    far = np.array([[5.0, 0.0, 0.0]])
    bent = primitive.rollout(obstacles=far, coupling=name)
    plain = primitive.rollout()
    assert bent.positions[50, 2] - plain.positions[50, 2] > 0.01


def test_a_primitive_names_the_approximator_of_ones_own_without_its_folder(own, tmp_path):
    name = register_code(f"{own}:mine")
    primitive = MovementPrimitive.fit(line(), approximator=name)
    primitive.save(tmp_path / "primitive.yaml")
    text = (tmp_path / "primitive.yaml").read_text()
    assert "own.py:mine" in text
    assert str(tmp_path) not in text
    again = MovementPrimitive.load(tmp_path / "primitive.yaml")
    np.testing.assert_array_equal(again.weights, primitive.weights)


def test_a_planner_of_ones_own_plans_the_reach_and_is_named_in_the_scenario(own, tmp_path):
    scenario = Scenario(planner_class=register_code(f"{own}:Refusing"))
    save_scenario(scenario, tmp_path / "scenario.yaml")
    text = (tmp_path / "scenario.yaml").read_text()
    assert "own.py:Refusing" in text
    assert str(tmp_path) not in text
    reaching = build_reaching(scenario)
    assert type(reaching.planner).__name__ == "Refusing"
    other = reaching.planner.with_primitive(reaching.primitive)
    assert type(other) is type(reaching.planner)


@pytest.mark.parametrize("get", [get_approximator, get_coupling, get_planner])
def test_code_that_a_file_names_is_not_run_unasked(get):
    with pytest.raises(InputError, match=r"--code FILE\.py:NAME"):
        get("unheard.py:of")


@pytest.mark.parametrize(
    ("name", "words"), [("number", "has to be an Approximator"), ("absent", "defines no absent")]
)
def test_what_is_no_part_is_refused(own, name, words):
    with pytest.raises(InputError, match=words):
        register_code(f"{own}:{name}")


def test_a_missing_file_and_a_broken_one_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        register_code(f"{tmp_path}/none.py:x")
    (tmp_path / "broken.py").write_text("1 / 0\n")
    with pytest.raises(InputError, match=r"broken\.py, line 1: ZeroDivisionError"):
        register_code(f"{tmp_path}/broken.py:x")


def test_names_of_code_are_told_from_others():
    assert names_code("a/b.py:c")
    assert not names_code("barrier")
    assert not names_code("scene.yaml")


def test_objects_of_many_numbers_have_a_short_text(tmp_path):
    demo = line()
    primitive = MovementPrimitive.fit(demo)
    for one in (demo, primitive, primitive.rollout()):
        assert len(repr(one)) < 500, repr(one)
        assert repr(one).startswith(type(one).__name__)
