"""A live session without cameras, and its page."""

import pytest

from pepper_drake.diagrams.station import StationConfig
from pepper_drake.live.page import LivePage
from pepper_drake.live.session import LiveSession
from pepper_drake.live.show import LiveApp
from pepper_drake.live.simulation import LiveSimulation
from pepper_drake.models.scene import SCENES_DIR, load_scene
from pepper_drake.web.drake_page import DrakePage


def _make_session(folder=None, *, cameras=False, meshcat=None):
    simulation = LiveSimulation(
        load_scene(SCENES_DIR / "teach.yaml"),
        station=StationConfig(cameras=cameras),
        meshcat=meshcat,
    )
    return LiveSession(simulation, folder)


@pytest.fixture(scope="session")
def make_session():
    """Returns a function that makes a live session, without cameras unless it is told."""
    return _make_session


@pytest.fixture
def drake_page():
    with DrakePage() as page:
        yield page


@pytest.fixture
def meshcat(drake_page):
    return drake_page.meshcat


@pytest.fixture
def show(tmp_path, meshcat):
    """A session on its page."""
    session = _make_session(tmp_path, meshcat=meshcat)
    return LiveApp(session, LivePage(meshcat, session.simulation.diagram.movables))
