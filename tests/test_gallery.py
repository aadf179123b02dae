"""The gallery's examples draw their pictures, and each stands on its page with its source."""

import re
import runpy
from pathlib import Path

import pytest
from pictures import is_like

GALLERY = Path(__file__).parents[1] / "docs" / "gallery"
EXAMPLES = sorted(GALLERY.glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_draws_its_picture(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
    assert [made.name for made in tmp_path.iterdir()] == [f"{path.stem}.png"]
    assert is_like(tmp_path / f"{path.stem}.png", path.with_suffix(".png"))


def test_each_stands_on_the_page_with_picture_and_source():
    page = (GALLERY / "index.md").read_text()
    assert len(EXAMPLES) > 5
    for path in EXAMPLES:
        assert f"]({path.stem}.png)" in page
        assert f'--8<-- "docs/gallery/{path.name}"' in page
        assert path.with_suffix(".png").is_file()
    assert set(re.findall(r"gallery/(\w+)\.py", page)) == {path.stem for path in EXAMPLES}
