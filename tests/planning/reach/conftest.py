import pytest

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.planning.trajectories.adaptation_params import GoalAxis
from tests.planning.reach.planner_setup import TABLE, make_planner, object_at, observed, stand


@pytest.fixture(scope="module")
def right_primitive():
    return make_primitive(None, "right")


@pytest.fixture(scope="module")
def planner(right_primitive):
    return make_planner(right_primitive, make_coupling("barrier"))


@pytest.fixture(scope="module")
def at_the_table(right_primitive):
    """A place at a table from which the movement as it was shown passes through the table."""
    blind = make_planner(right_primitive, None)
    base = stand(blind, object_at(z=0.74)).base_pose + [0.03, 0.0, 0.0]
    X_WO = object_at(z=0.74)
    observation = observed(base, X_WO, TABLE)
    assert blind.check_reach(observation).clearance < -0.01
    return observation


@pytest.fixture(scope="module")
def tolerant(right_primitive):
    """A planner for a task in which the hand may be turned by a radian."""
    return make_planner(right_primitive, make_coupling("barrier"), axis=GoalAxis(tolerance=1.0))
