"""Apps in which the loop's numbers matter take a scenario, and refuse what they have no use for."""

import pytest

APPS = {
    "reach": [],
    "teach": ["--script", "story"],
    "optimize": ["--rollouts", "diagram"],
    "reproduce": [],
    "serve_naoqi": ["--port", "0"],
    "perceive": [],
    "benchmark": ["--methods", "d"],
    "calibrate": [],
    "faults": [],
    "diagram": ["reaching"],
}
"""Names of apps, and what else they need."""
PARTS = {
    "teach": "station, perception, planner",
    "reproduce": "learning, station, controller, compliance",
    "serve_naoqi": "seed, scene, station",
    "perceive": "seed, scene, station, perception",
    "calibrate": "station",
    "faults": "station, perception, planner",
}


def refused(done):
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    return done.stderr


@pytest.fixture
def call(run_app, tmp_path):
    def run(app, *options):
        needed = list(APPS[app])
        if app == "optimize":
            needed = ["pepper_drake/models/demonstrations/reach", *needed]
        return run_app(app, *needed, "--output", tmp_path / "out", *options)

    return run


@pytest.mark.parametrize("app", APPS)
def test_a_field_that_does_not_exist_is_refused_in_one_sentence(call, app, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("station:\n  noize: false\n")
    assert f'{path} line 2: station has no field "noize"' in refused(call(app, "--scenario", path))
    assert 'station has no field "noize"' in refused(call(app, "--set", "station.noize=false"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("app", PARTS)
def test_a_field_that_an_app_has_no_use_for_is_refused(call, app):
    told = refused(call(app, "--set", "gentle=true"))
    assert f"error: --set gentle: this app takes {PARTS[app]}" in told


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--set", "planner.adapt=false"], "planner.adapt: the methods differ in it"),
        (["--set", "planner.reach_margin=0.1", "--methods", "d,g"], "method g is none of ours"),
        (["--set", "planner.reach_margin=0.1", "--gate"], "--gate is of the usual numbers"),
    ],
)
def test_the_benchmark_refuses_numbers_that_it_cannot_use(call, options, sentence, tmp_path):
    assert sentence in refused(call("benchmark", *options))
    assert not (tmp_path / "out").exists()


def test_own_data_are_not_of_a_scenario(call, tmp_path):
    cloud = tmp_path / "cloud.npy"
    assert "leave them out" in refused(call("perceive", "--cloud", cloud, "--set", "seed=2"))
