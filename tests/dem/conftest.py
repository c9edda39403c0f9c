"""Scenes, and LAMMPS where it is installed."""

import pytest

from chuteflow.dem.contacts import Bounds
from chuteflow.dem.engine import EngineError, engine
from chuteflow.dem.scene import Scene
from chuteflow.steady.chute import Chute

CHUTE = Chute(slope=0.18, restitution=0.95, wall_restitution=0.95, roughness=0.6)
#: The same as options.
CHUTE_WORDS = ["--slope", "0.18", "--e", "0.95", "--ew", "0.95", "--roughness", "0.6"]


@pytest.fixture(scope="session")
def lammps():
    """How LAMMPS is started."""
    try:
        return engine()
    except EngineError as error:
        pytest.skip(str(error))


@pytest.fixture
def small():
    """A scene of few grains, with a coarse time step."""
    return Scene(CHUTE, 0.6, box=(6.0, 6.0), temperature=1.3, velocity=1.5, bounds=Bounds(restitution=0.01))
