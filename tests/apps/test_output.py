"""Results that cannot be written are refused before an app does its work, whichever it is."""

import pytest

from tests.apps.conftest import APPS

ARGUMENTS = {
    "chain": ["wait:1"],
    "import": ["nothing.csv"],
    "learn": ["nothing"],
    "optimize": ["nothing"],
    "play": ["nothing"],
}
"""Arguments that an app cannot do without; the files are not there, which is found later."""
NAMES = sorted({path.stem for path in APPS.glob("*.py")} - {"preflight"})  # It writes nothing.


@pytest.mark.parametrize("name", NAMES)
def test_an_output_that_cannot_be_written_is_refused_first(run_app, tmp_path, name):
    file = tmp_path / "file"
    file.write_text("")
    end = run_app(name, *ARGUMENTS.get(name, ()), "--output", file / "below")
    assert end.returncode == 2
    assert end.stderr.startswith(f"error: --output {file / 'below'}: cannot be written to")
    assert end.stderr.count("\n") == 1
