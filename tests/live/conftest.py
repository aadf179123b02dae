"""A live session without cameras, with and without a page."""

import pytest

from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.live.session import LiveSession
from pepper_drake.live.show import LiveApp
from pepper_drake.live.simulation import LiveSimulation
from pepper_drake.models.scene import SCENES_DIR, load_scene


def _make_session(folder=None, *, cameras=False, spares=False):
    simulation = LiveSimulation(
        load_scene(SCENES_DIR / "teach.yaml"),
        config=ReachingConfig(station=StationConfig(cameras=cameras)),
        spares=spares,
    )
    return LiveSession(simulation, folder)


@pytest.fixture(scope="session")
def make_session():
    """Returns a function that makes a live session, without cameras unless it is told."""
    return _make_session


@pytest.fixture
def show(tmp_path):
    """A session that nobody looks at."""
    return LiveApp(_make_session(tmp_path), None)
