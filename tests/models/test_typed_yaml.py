import doctest
from dataclasses import dataclass, field

import pytest

from pepper_drake.errors import InputError
from pepper_drake.models import typed_yaml
from pepper_drake.models.typed_yaml import load_yaml, parse_yaml, save_yaml, with_settings


@dataclass
class Inner:
    size: float = 1.0
    count: int = 2


@dataclass
class Outer:
    inner: Inner = field(default_factory=Inner)
    names: list[str] = field(default_factory=list)
    gains: dict[str, float] = field(default_factory=dict)
    maybe: Inner | None = None
    active: bool = False


def test_the_examples_in_the_docstrings():
    assert doctest.testmod(typed_yaml).failed == 0


def test_what_is_saved_is_loaded(tmp_path):
    outer = Outer(Inner(0.1, 7), ["a"], {"b": 2.0}, Inner(), True)
    save_yaml(outer, tmp_path / "outer.yaml")
    assert load_yaml(Outer, tmp_path / "outer.yaml") == outer


def test_what_a_file_leaves_out_is_taken_from_the_defaults():
    defaults = Outer(Inner(5.0, 6), active=True)
    assert parse_yaml(Outer, "inner: {size: 3}", "here", defaults) == Outer(
        Inner(3.0, 6), active=True
    )


def test_later_settings_win_and_the_original_stays():
    outer = Outer()
    changed = with_settings(
        outer, ["inner.size=2", "inner.size=1e-3", "active=true", "names=[x, y]"]
    )
    assert changed == Outer(Inner(0.001, 2), ["x", "y"], active=True)
    assert outer == Outer()


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("inner.sise=2", '--set inner.sise: inner has no field "sise"; its fields are size'),
        ("inner.size=big", '--set inner.size: inner.size is "big"; it must be a number'),
        ("inner.count=0x10", "it must be a whole number"),
        ("inner.count=1:30", "it must be a whole number"),
        ("inner.size=1:30", "it must be a number"),
        ("inner.size=.nan", "it must be a finite number"),
        ("inner=3", "inner must hold the fields size, count"),
        ("inner.size", "give it as FIELD=VALUE"),
        ("inner.size=", "give it as FIELD=VALUE"),
        ("active=maybe", "it must be true or false"),
        ("size=1", 'the file has no field "size"'),
    ],
)
def test_a_setting_that_does_not_fit_is_refused(setting, sentence):
    with pytest.raises(InputError) as error:
        with_settings(Outer(), [setting])
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("inner: {? [1, 2] : 3}", "a list or mapping stands where a field's name should"),
        ("active: true\nactive: false", '"active" is there twice'),
        ("gains: {true: 1}", "quote it"),
        ("names: [&a x, *a]", "aliases (*) are not read"),
        ("inner: " + "[" * 3000, "here"),
        ("inner: {size: 1", "not valid YAML"),
        ("", "is empty"),
        ("- 1", "must hold the fields"),
        ("inner: {size: '1'}", "it must be a number"),
    ],
)
def test_a_text_that_is_no_file_of_settings_is_refused(text, sentence):
    with pytest.raises(InputError) as error:
        parse_yaml(Outer, text, "here")
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)
