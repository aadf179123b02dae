"""The gallery's examples draw their pictures, and each stands on its page with its source."""

import re
import runpy
from pathlib import Path

import cv2
import numpy as np
import pytest

GALLERY = Path(__file__).parents[1] / "docs" / "gallery"
EXAMPLES = sorted(GALLERY.glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_draws_its_picture(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
    assert [made.name for made in tmp_path.iterdir()] == [f"{path.stem}.png"]
    drawn, kept = (cv2.imread(str(folder / f"{path.stem}.png")) for folder in (tmp_path, GALLERY))
    assert drawn.shape == kept.shape
    assert np.abs(drawn.astype(float) - kept).mean() < 1.0  # Of 255: another digit, not a line.


def test_each_stands_on_the_page_with_picture_and_source():
    page = (GALLERY / "index.md").read_text()
    assert len(EXAMPLES) > 5
    for path in EXAMPLES:
        assert f"]({path.stem}.png)" in page
        assert f'--8<-- "docs/gallery/{path.name}"' in page
        assert path.with_suffix(".png").is_file()
    assert set(re.findall(r"gallery/(\w+)\.py", page)) == {path.stem for path in EXAMPLES}
