import dataclasses
import json
import pickle
from functools import reduce
from pathlib import Path

import pytest
import yaml

from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.errors import InputError
from pepper_drake.learning import ReportCoupling
from pepper_drake.models.scene import load_scene
from pepper_drake.planning.collision.clearance_table import ClearanceTable
from pepper_drake.scenario import (
    METHODS,
    MOVED,
    Scenario,
    coupling_of,
    load_scenario,
    movement_and_config,
    save_scenario,
    use_method,
)


def leaves(value, prefix=""):
    """Names and values of all fields of nested dataclasses."""
    for f in dataclasses.fields(value):
        inner, name = getattr(value, f.name), f"{prefix}{f.name}"
        if dataclasses.is_dataclass(inner):
            yield from leaves(inner, f"{name}.")
        else:
            yield name, inner


def test_a_saved_scenario_is_loaded_whole(tmp_path):
    scenario = load_scenario(
        None,
        [
            "seed=7",
            "planner.clearance.want=0.018",
            "faults=['depth:stuck@4+2', 'encoders:garbage@reach']",
        ],
    )
    scenario.scene = load_scene("shelf")
    save_scenario(scenario, tmp_path / "scenario.yaml")
    assert load_scenario(tmp_path / "scenario.yaml") == scenario


ORDERED = ("planner.clearance.", "planner.tolerance.", "planner.following.")
FREE = [
    name
    for name, value in leaves(Scenario())
    if isinstance(value, float) and value != 0.0 and not name.startswith(("scene.", *ORDERED))
]


@pytest.mark.parametrize("group", range(20))
def test_every_number_can_be_set_by_its_name_and_nothing_else_changes(group):
    """Not one by one, which would take half a minute: neighbours are in different groups."""
    before = dict(leaves(Scenario()))
    wanted = {name: 0.75 * before[name] for name in FREE[group::20]}
    settings = [f"{name}={value!r}" for name, value in wanted.items()]
    assert dict(leaves(load_scenario(None, settings))) == before | wanted


def test_clearances_stay_in_their_order():
    names = [f.name for f in dataclasses.fields(ClearanceTable)]
    values = [getattr(ClearanceTable(), name) for name in names]
    assert values == sorted(values)
    for name, above in zip(names[:-2], values[1:-1], strict=True):
        with pytest.raises(InputError, match="must be greater than"):
            load_scenario(None, [f"planner.clearance.{name}={above + 0.1}"])


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (["planner.clearence.want=1"], 'planner has no field "clearence"'),
        (["station.wear=1"], 'station has no field "wear"'),
        (["scene.arm=both"], 'arm is "both"'),
        (["push=[1, 2]"], "push has 2 numbers"),
        (["seed=many"], 'seed is "many"; it must be a whole number'),
        (
            ["perception.gaze.search.view_duration=0"],
            "gaze.search.view_duration is 0; it must be positive",
        ),
        (["perception.gaze.search.first_yaw=2"], "must lie within gaze.search.sweep"),
        (["planner.retreat.durations=[]"], "planner.retreat: sample_time"),
        (["controller.time_step=0"], "controller.time_step is 0; it must be positive"),
        (["controller.limit_margin=0.2"], "must be greater than controller.limit_margin, 0.2"),
        (
            ["planner.hanging_clearance=0.01"],
            "must not be less than planner.hanging_clearance, 0.01",
        ),
        (["planner.unseen.cell=-1"], "planner.unseen.cell is -1; it must be positive"),
        (["planner.adaptation.search.population=1"], "it must be 4 or more"),
        (["supervisor.latency.plan=-0.1"], "it must be 0 or more"),
        (["planner.retreat.sample_time=0.2"], "at most a quarter of the shortest"),
        (["planner.new_obstacle.depth_step=0"], "depth_step is 0 m; it must be positive"),
        (["station.stereo_pair.matching.block=6"], "stereo: block 6 must be odd"),
        (["perception.marker.small_side=-1"], "marker.small_side is -1; it must be positive"),
        (["perception.marker.edges.longest_search=1"], "less than marker.edges.longest_search, 1"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(settings, sentence):
    with pytest.raises(InputError) as error:
        load_scenario(None, settings)
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_holds_only_what_differs(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("seed: 4\nplanner:\n  clearance: {want: 0.018}\n")
    changed = dict(leaves(load_scenario(path)))
    same = {"seed": 4, "planner.clearance.want": 0.018}
    assert changed == dict(leaves(Scenario())) | same


def test_the_diagram_is_built_of_the_numbers_of_the_scenario():
    scenario = load_scenario(
        None, ["seed=4", "controller.posture_gain=3", "perception.goal_latency=0.1"]
    )
    config = scenario.reaching_config()
    assert config.station.seed == 4
    assert config.ik.posture_gain == 3.0
    assert config.perception.goal_latency == 0.1
    assert config.planner is scenario.planner


def test_the_guide_tells_the_clearances_that_there_are():
    guide = (Path(__file__).parents[1] / "docs" / "howto" / "scenario.md").read_text()
    for f in dataclasses.fields(ClearanceTable):
        assert f"| `{f.name}` | {getattr(ClearanceTable(), f.name):.3f} |" in guide


def test_the_reports_method_is_the_reports_equations():
    chosen = Scenario()
    use_method(chosen, "report")
    primitive, config = movement_and_config(chosen)
    assert (primitive.approximator, primitive.num_basis) == ("lwr", 40)
    assert primitive.translation.scaling == "goal"
    assert primitive.orientation.mode == "angles"
    assert make_coupling(chosen.scene.coupling) == ReportCoupling()
    assert not config.planner.adapt
    assert not config.planner.collision_checked


def test_methods_differ_in_what_they_are_said_to_differ_in():
    by_name = {name: Scenario() for name in METHODS}
    for name, chosen in by_name.items():
        use_method(chosen, name)
    assert by_name["adapted"] == Scenario()
    by_name["reactive"].planner.adapt = True
    assert by_name["reactive"] == by_name["adapted"]
    with pytest.raises(InputError, match="adapted, reactive, report"):
        use_method(Scenario(), "magic")


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("learning.approximator=magic", "'magic' is unknown"),
        ("learning.orientation=euler", "log_map"),
        ("learning.num_basis=-1", "0 or more"),
    ],
)
def test_a_wrong_way_to_learn_is_refused(setting, words):
    with pytest.raises(InputError, match=words):
        load_scenario(settings=[setting])


def another(value):
    """A value of the same type, which no check refuses."""
    return not value if isinstance(value, bool) else value + (1 if type(value) is int else 1e-3)


@pytest.mark.parametrize(("former", "now"), MOVED.items())
def test_a_former_name_is_read_and_the_new_one_told(former, now, tmp_path, caplog):
    groups, _, last = former.rpartition(".")
    before = dict(leaves(Scenario()))
    value = another(before[now])
    lines = [f"{'  ' * k}{key}:" for k, key in enumerate(groups.split("."))]
    path = tmp_path / "old.yaml"
    path.write_text("\n".join([*lines, f"{'  ' * len(lines)}{last}: {json.dumps(value)}\n"]))
    wanted = before | {now: value}
    assert dict(leaves(load_scenario(path))) == wanted
    assert dict(leaves(load_scenario(None, [f"{former}={json.dumps(value)}"]))) == wanted
    sentence = f"{former} is now {now}; this release reads both"
    assert caplog.messages == [f"{path}: {sentence}", f"--set {former}: {sentence}"]
    group, _, key = now.rpartition(".")
    text = f"{path.read_text()}{'  ' * len(lines)}{group.rpartition('.')[2]}: {{{key}: 1}}\n"
    if group != groups:
        path.write_text(text)
        with pytest.raises(InputError, match=f"{former} is now {now}, which it has, too"):
            load_scenario(path)


def test_a_scenario_that_an_earlier_release_saved_is_loaded_whole_with_one_warning(
    tmp_path, caplog
):
    path = tmp_path / "scenario.yaml"
    save_scenario(Scenario(), path)
    saved = yaml.safe_load(path.read_text())
    for former, now in MOVED.items():
        *groups, last = now.split(".")
        value = reduce(dict.__getitem__, groups, saved).pop(last)
        *groups, last = former.split(".")
        reduce(dict.__getitem__, groups, saved)[last] = value
    path.write_text(yaml.safe_dump(saved))
    assert load_scenario(path) == Scenario()
    assert len(caplog.messages) == 1
    assert f"{path}: {len(MOVED)} fields have former names; " in caplog.text


def test_a_former_name_does_not_hide_what_is_wrong_around_it(tmp_path):
    path = tmp_path / "old.yaml"
    path.write_text("perception: {head_velocity: 2, gaze: 3}\n")
    with pytest.raises(InputError, match=r"line 1: perception\.gaze must hold the fields"):
        load_scenario(path)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("compliance.stiffness=-3", "must be positive"),
        ("seed=-1", "seed is -1; it must be 0 or more"),
        ("station.time_step=-1", "must be positive"),
        ("station.stiffness={left_arm: -1}", "stiffness of left_arm is -1; it must be from 0"),
        ("station.stiffness={LArm: 0.5}", 'names "LArm"; the joint groups are base, body, head'),
        ("station.command_period=0", "must be positive"),
        ("station.camera_period=0", "must be positive"),
        ("station.camera_latency=-1", "must be 0 or more"),
        ("station.derivative_gain=-10", "must be 0 or more"),
        ("perception.image_poll_period=-1", "must be positive"),
        ("perception.obstacles.cloud.largest_spacing=0", "must be positive"),
        ("perception.stereo_obstacles.cloud.stride=0", "must be positive"),
        ("perception.obstacles.memory.voxel_size=0", "must be positive"),
        ("perception.obstacles.approach.spacing=0", "must be positive"),
        ("perception.obstacles.near_field.spacing=0", "must be positive"),
        ("perception.obstacles.near_field.least_rays=0", "must be positive"),
        ("safety.time_step=0", "must be positive"),
        ("contact.latency=-1", "must be 0 or more"),
        ("safety.base.acceleration=0", "must be positive"),
        ("safety.link_base.turning_acceleration=0", "must be positive"),
        ("compliance.stiffness=1.5", "at most 1"),
        ("planner.lean.image_border=1", "below 1"),
        ("planner.unseen.image_border=1.5", "below 1"),
        ("safety.lean.speed=0", "must be positive"),
        ("supervisor.steadiness.cloud_quantile=2", "below 1"),
        ("controller.catch_up_steps=0", "must be positive"),
        ("planner.rest_fraction=1", "below 1"),
        ("perception.marker.edges.blurred_growth=0", "must be positive"),
        ("perception.obstacles.memory.max_views=0", "must be positive"),
        ("planner.new_obstacle.spacing=0", "must be positive"),
        ("planner.support_surface.min_stripes=0", "must be 1 or more"),
        ("safety.base.approach_rate=0", "must be positive"),
        ("station.camera_latency=0.2", "must be less than station.camera_period"),
        ("planner.unseen.max_age=-1", "must not be negative"),
        ("supervisor.looking=-0.1", "must not be negative"),
    ],
)
def test_numbers_that_the_loop_divides_by_are_refused_where_they_are_set(setting, words):
    with pytest.raises(InputError, match=words):
        load_scenario(None, [setting])


def test_places_and_angles_may_be_negative():
    chosen = load_scenario(None, ["planner.hand_y=-0.1", "perception.gaze.search.low_pitch=-0.1"])
    assert chosen.planner.hand_y == -0.1


def test_the_barrier_and_an_arm_that_is_pushed_have_the_scenarios_numbers():
    settings = ["barrier.damping=20", "compliance.tracking.rate=10", "push=[0, 0, 5]"]
    chosen = load_scenario(None, settings)
    assert coupling_of(chosen).damping == 20.0
    compliance = chosen.reaching_config().compliance
    assert compliance.tracking.rate == 10.0
    assert compliance.pushes[0].force == (0.0, 0.0, 5.0)
    assert pickle.loads(pickle.dumps(chosen)) == chosen
    with pytest.raises(InputError, match=r"barrier\.damping is 0; it must be positive"):
        load_scenario(None, ["barrier.damping=0"])
