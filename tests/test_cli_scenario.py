from argparse import ArgumentParser

import pytest

from pepper_drake.cli_scenario import (
    add_scenario_options,
    check_robot_takes,
    keep_scenario,
    scenario_of,
)
from pepper_drake.errors import InputError
from pepper_drake.scenario import NUMBERS, Scenario, load_scenario


def options(*words):
    parser = ArgumentParser()
    add_scenario_options(parser, NUMBERS)
    return parser.parse_args(words)


def test_apps_with_a_scene_of_their_own_take_the_numbers_alone(tmp_path):
    path = tmp_path / "scenario.yaml"
    path.write_text("seed: 4\nrobot: worn\npush: [1, 0, 0]\nplanner:\n  hand_x: 0.25\n")
    chosen = scenario_of(options("--scenario", str(path), "--set", "perception.gaze.dwell=0.4"))
    config = chosen.reaching_config()
    assert config.planner.hand_x == 0.25
    assert config.perception.gaze.dwell == 0.4
    assert config.station.seed == 0
    assert config.station.wear is None
    assert config.compliance is None
    with pytest.raises(InputError, match=r"--set scene\.arm: this app takes station"):
        scenario_of(options("--set", "scene.arm=right"))


def test_an_app_refuses_what_it_has_no_use_for():
    parser = ArgumentParser()
    add_scenario_options(parser, ("station", "controller"))
    chosen = scenario_of(parser.parse_args(["--set", "station.derivative_gain=20"]))
    wanted = Scenario()
    wanted.station.derivative_gain = 20.0
    assert chosen == wanted
    with pytest.raises(
        InputError, match=r"--set planner\.reach_margin: this app takes station, contr"
    ):
        scenario_of(parser.parse_args(["--set", "planner.reach_margin=0.1"]))


def test_runs_of_other_numbers_do_not_mix_in_one_folder(tmp_path):
    others = load_scenario(None, ["planner.reach_margin=0.1"])
    with pytest.raises(InputError, match="are of other numbers; give another --output"):
        keep_scenario(others, tmp_path, has_runs=True)  # Runs of an earlier release.
    keep_scenario(others, tmp_path, has_runs=False)
    keep_scenario(others, tmp_path, has_runs=True)
    with pytest.raises(InputError, match="are of other numbers; give another --output"):
        keep_scenario(Scenario(), tmp_path, has_runs=True)


def test_what_only_a_simulated_robot_has_is_refused_with_a_robot():
    check_robot_takes(Scenario(), "station", "compliance.stiffness")
    with pytest.raises(InputError, match="station is of the simulated robot"):
        check_robot_takes(load_scenario(None, ["station.noise=false"]), "station")
