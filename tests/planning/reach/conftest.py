import pytest

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from tests.planning.reach.planner_setup import make_planner


@pytest.fixture(scope="module")
def right_primitive():
    return make_primitive(None, "right")


@pytest.fixture(scope="module")
def planner(right_primitive):
    return make_planner(right_primitive, make_coupling("barrier"))
