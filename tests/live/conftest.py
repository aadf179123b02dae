"""A live session without cameras, and its page."""

import pytest
from pydrake.geometry import Meshcat, MeshcatParams

from pepper_drake.diagrams.station import StationConfig
from pepper_drake.live.page import LivePage
from pepper_drake.live.session import LiveSession
from pepper_drake.live.show import LiveApp
from pepper_drake.live.simulation import LiveSimulation
from pepper_drake.models.scene import SCENES_DIR, load_scene


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
def meshcat():
    return Meshcat(MeshcatParams(host="localhost"))


@pytest.fixture
def show(tmp_path, meshcat):
    """A session on its page."""
    session = _make_session(tmp_path, meshcat=meshcat)
    return LiveApp(session, LivePage(meshcat, session.simulation.diagram.movables))
