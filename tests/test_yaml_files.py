import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.yaml_files import read_yaml

_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**14), 10**14) | st.floats(allow_nan=False),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text("abcxyz"), inner, max_size=4)
    ),
    max_leaves=20,
)


@given(value=_values)
def test_plain_data_is_read_as_it_was_written(tmp_path_factory, value):
    path = tmp_path_factory.mktemp("yaml") / "value.yaml"
    path.write_text(yaml.safe_dump(value))
    assert read_yaml(path, 2**20) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1:30", "1:30"),
        ("0x10", "0x10"),
        ("010", "010"),
        ("1_000", "1_000"),
        ("yes", "yes"),
        ("on", "on"),
        ("2020-01-01", "2020-01-01"),
        ("1e-3", 1e-3),
        ("-.5", -0.5),
        ("+7", 7),
        ("True", True),
        ("~", None),
        ("1" * 30, float("1" * 30)),
    ],
)
def test_words_mean_what_everybody_takes_them_for(tmp_path, text, value):
    path = tmp_path / "value.yaml"
    path.write_text(text)
    read = read_yaml(path, 100)
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a: &x 1\nb: *x", r"line 2: aliases"),
        ("a: 1\n-\tb: 2", "line 2: not valid YAML .*; there is a tab in it, write blanks"),
        ("a:\n\tb: 2", "line 2: not valid YAML .*; there is a tab in it, write blanks"),
        ("a: !!python/object/apply:os.system [ls]", "tags"),
        ("a: 1\n---\nb: 2", "line 2: a second document"),
        ("[" * 100_000, "nested too deeply"),
        ("- " * 100_000, "nested too deeply|not valid YAML"),
        ("{a: 1, a: 2}", '"a" is there twice'),
        ("? [1]\n: 2", "a list or mapping stands where"),
        ('"\\UFFFFFFFF"', "not valid YAML"),
        ("a: [1", "line 2: not valid YAML"),
        ("\x07", "not valid YAML"),
        ("[" + "1," * 300_000 + "]", "larger than|more than"),
    ],
)
def test_what_is_no_plain_data_is_refused_in_one_line(tmp_path, text, sentence):
    path = tmp_path / "value.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=sentence) as refusal:
        read_yaml(path, 2**19)
    assert str(refusal.value).startswith(str(path))
    assert "\n" not in str(refusal.value)
