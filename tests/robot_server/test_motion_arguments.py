import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.naoqi.constants import BODY, CHAINS, JOINTS
from pepper_drake.robot_server.services.motion_arguments import (
    bezier_keys,
    joint_names,
    lists_each,
    one_each,
    settings,
)

_HEAD = ("HeadYaw", "HeadPitch")


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        ("HeadYaw", ["HeadYaw"]),
        ("Head", list(_HEAD)),
        (["Head", "LHand"], [*_HEAD, "LHand"]),
        ("Body", list(BODY)),
        ("Joints", [j for j in JOINTS if not j.endswith("Hand")]),
        ([], []),
    ],
)
def test_names_expand_in_order(names, joints):
    assert joint_names(names) == joints


@pytest.mark.parametrize("names", ["head", ["HeadYaw", "Nose"], 3, None, [3], {"HeadYaw": 1}])
def test_names_that_are_none_are_refused(names):
    with pytest.raises(ValueError, match=r"joint or chain|must be"):
        joint_names(names)


@given(st.lists(st.floats(-1, 1), min_size=2, max_size=2))
def test_one_value_for_each_or_for_all(values):
    assert one_each("Head", values, "angles") == dict(zip(_HEAD, values, strict=True))
    assert one_each(list(_HEAD), values, "angles") == dict(zip(_HEAD, values, strict=True))
    assert one_each("Head", values[0], "angles") == dict.fromkeys(_HEAD, values[0])
    assert one_each("HeadYaw", [values[0]], "angles") == {"HeadYaw": values[0]}


def test_the_body_comes_with_or_without_wheels_but_wheels_take_no_angle():
    for count in (17, 20):
        found = one_each("Body", list(range(count)), "angles")
        assert list(found) == list(JOINTS)
        assert list(found.values()) == list(range(17))


@pytest.mark.parametrize(
    ("names", "values"),
    [("Head", [1, 2, 3]), (list(_HEAD), [1]), ("HeadYaw", [1, 2]), ("Body", [0] * 18)],
)
def test_too_few_or_too_many_values_are_counted(names, values):
    with pytest.raises(ValueError, match=r"\d+ joints, but \d+ angles"):
        one_each(names, values, "angles")


@pytest.mark.parametrize(
    ("names", "angles", "times", "expected"),
    [
        ("HeadYaw", 1, 2, {"HeadYaw": ([2], [1])}),
        ("HeadYaw", [1, 0], [1, 2], {"HeadYaw": ([1, 2], [1, 0])}),
        ("HeadYaw", [[1, 0]], [[1, 2]], {"HeadYaw": ([1, 2], [1, 0])}),
        (["HeadYaw"], [[1, 0]], [[1, 2]], {"HeadYaw": ([1, 2], [1, 0])}),
        (_HEAD, [1, 0], [1, 2], {"HeadYaw": ([1], [1]), "HeadPitch": ([2], [0])}),
        (
            _HEAD,
            [[1, 2], [0]],
            [[1, 2], [3]],
            {"HeadYaw": ([1, 2], [1, 2]), "HeadPitch": ([3], [0])},
        ),
        (_HEAD, [[1], 0], [1.0, [2]], {"HeadYaw": ([1], [1]), "HeadPitch": ([2], [0])}),
        ("Head", 0.5, 1.0, dict.fromkeys(_HEAD, ([1.0], [0.5]))),
        ("Head", [1, 0], 1.0, {"HeadYaw": ([1.0], [1]), "HeadPitch": ([1.0], [0])}),
    ],
)
def test_keys_in_every_shape(names, angles, times, expected):
    assert lists_each(names, angles, times, "angles") == expected


@pytest.mark.parametrize(
    ("names", "angles", "times", "text"),
    [
        (_HEAD, [[1, 2], [0]], [[1], [3]], "HeadYaw has 2 angles, but 1 times"),
        (_HEAD, [[1], [0], [2]], [[1], [3]], "2 joints, but 3 angles"),
        ("HeadYaw", [1, 2], [2, 1], "above 0 and increase"),
        ("HeadYaw", 1, -1, "above 0 and increase"),
        ("HeadYaw", 1, 1e12, "takes 1e.12 s, but at most 3600"),
        ("HeadYaw", [], 1, "empty"),
        (_HEAD, [[], [1]], 1, "of a joint are empty"),
        ("HeadYaw", "1", 1, "must be a list"),
    ],
)
def test_keys_that_do_not_fit_are_told_apart(names, angles, times, text):
    with pytest.raises(ValueError, match=text):
        lists_each(names, angles, times, "angles")


def test_bezier_keys_with_and_without_handles():
    keys = bezier_keys(
        list(_HEAD),
        [[1, 2], [1]],
        [[0.1, [0.2, [3, -0.1, 0.0], [3, 0.1, 0.0]]], [[0.3, [3, 0, 0]]]],
    )
    assert keys == {
        "HeadYaw": ([1, 2], [(0.1, None, None), (0.2, (3, -0.1, 0.0), (3, 0.1, 0.0))]),
        "HeadPitch": ([1], [(0.3, (3, 0, 0), None)]),
    }


@pytest.mark.parametrize(
    ("controls", "text"),
    [
        ([[0.1]], "2 joints, but 1 lists"),
        ([[0.1, 0.2], [0.1]], "HeadYaw has 2 control points, but 1 times"),
        ([[[0.1, [3]]], [0.1]], "must be 3 numbers"),
        ([[[]], [0.1]], "a control point is"),
    ],
)
def test_bezier_keys_that_do_not_fit(controls, text):
    with pytest.raises(ValueError, match=text):
        bezier_keys(list(_HEAD), [[1], [1]], controls)


def test_settings_keep_what_only_other_robots_know():
    assert settings([["MaxVelXY", 0.2], ["StepHeight", 1]]) == {"MaxVelXY": 0.2, "StepHeight": 1}
    for bad in ("MaxVelXY", [["MaxVelXY"]], [["MaxVelXY", "fast"]], [[1, 2]], 5):
        with pytest.raises(ValueError, match=r"configuration|finite"):
            settings(bad)


def test_chains_hold_each_joint_once():
    assert sorted(joint for chain in CHAINS.values() for joint in chain) == sorted(JOINTS)
