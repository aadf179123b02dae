import pytest

from pepper_drake import cli
from pepper_drake.cli_robot import add_robot_options, chosen_faults
from pepper_drake.errors import InputError


def options(*words):
    parser = cli.make_parser("test", "Test.")
    add_robot_options(parser)
    return parser.parse_args(list(words))


def test_without_options_the_robot_is_ideal_and_nothing_fails():
    chosen = options()
    assert chosen.robot == "ideal"
    assert chosen_faults(chosen).faults == ()


def test_robot_and_faults_follow_the_seed():
    chosen = options("--robot", "worn", "--fault", "depth:off@1", "--fault", "goal:wrong@reach")
    chosen.seed = 7
    assert [str(fault) for fault in chosen_faults(chosen).faults] == [
        "depth:off@1",
        "goal:wrong@reach",
    ]
    assert chosen_faults(chosen).seed == 7


def test_a_fault_of_what_is_not_there_is_refused():
    chosen = options("--fault", "planner:off@1")
    with pytest.raises(InputError, match="what can fail here is depth, encoders"):
        chosen_faults(chosen, ("depth", "encoders"))
