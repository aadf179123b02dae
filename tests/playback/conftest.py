"""Runs to play back, made once."""

import pytest

from tests.playback.run_example import make_run


@pytest.fixture(scope="session")
def runs(tmp_path_factory):
    """Two runs: "low", and "high", whose hand and goal rise more."""
    root = tmp_path_factory.mktemp("runs")
    return [
        make_run(root / "low"),
        make_run(root / "high", lift=1.0, goal_rises=True, seconds=2.5),
    ]
