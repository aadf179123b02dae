import pytest

from pepper_drake.benchmarking.case import Case
from pepper_drake.errors import InputError
from pepper_drake.models.random_scene import random_scene
from pepper_drake.models.scene import load_scene
from pepper_drake.models.scene_families import family_scene


def test_a_case_is_the_random_scene_of_its_seed():
    assert Case(17).build() == random_scene(17)
    assert Case(3, moving=True).build() == random_scene(3, moving=True)


def test_a_case_may_be_one_scene_with_changes():
    scene = Case(3, scene="table", arm="left", goal_motion="up").build()
    assert scene.arm == "left"
    assert scene.goal.path
    assert load_scene("table").arm == "right"


@pytest.mark.parametrize(
    ("case", "name", "options"),
    [
        (Case(17), "random_17", "--random-scene 17 --seed 17"),
        (Case(17, moving=True), "moving_17", "--random-scene 17 --seed 17 --moving"),
        (Case(3, scene="table"), "table_seed_3", "--scene table --seed 3"),
        (
            Case(3, moving=True, family="bin", sensors="ideal"),
            "moving_bin_3_ideal_sensors",
            "--family bin --random-scene 3 --seed 3 --moving --set station.noise=false "
            "--set station.camera_latency=0",
        ),
        (
            Case(3, scene="a/b.yaml", arm="left", goal_motion="m/up.txt"),
            "b_seed_3_left_up",
            "--scene a/b.yaml --seed 3 --arm left --goal-motion m/up.txt",
        ),
    ],
)
def test_names_and_options_say_which(case, name, options):
    assert case.name == name
    assert " ".join(case.reach_options) == options


def test_a_scene_that_is_not_there_is_named():
    with pytest.raises(InputError, match="nowhere"):
        Case(0, scene="nowhere").build()


def test_a_family_is_the_scene_and_its_name():
    case = Case(4, family="pickets")
    assert case.build() == family_scene("pickets", 4)
    assert case.name == "pickets_4"
    assert case.reach_options[:4] == ["--family", "pickets", "--random-scene", "4"]


def test_a_calibrated_robot_has_a_name_of_its_own():
    case = Case(4, robot="worn", calibration="found/{seed}.yaml")
    assert case.name == "random_4_worn_calibrated"
    assert case.reach_options[-2:] == ["--calibration", "found/{seed}.yaml"]
