"""Each system that others can take shows how, and what it shows is true."""

import doctest
import sys

import pytest

from pepper_drake import systems

NAMES = [name for name in systems.__all__ if not name.endswith("_")]


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_the_docstring_runs(name):
    taken = getattr(systems, name)
    names = dict(vars(sys.modules[taken.__module__]))
    example = doctest.DocTestParser().get_doctest(taken.__doc__, names, name, None, 0)
    assert len(example.examples) >= 3
    printed = []
    doctest.DocTestRunner().run(example, out=printed.append)
    assert not printed, "".join(printed)
