"""Flows that several tests look at."""

import pytest

import chuteflow
from chuteflow.stability.modes import Disturbances

CHUTE = chuteflow.Chute(slope=0.3, restitution=0.8, wall_restitution=0.8, roughness=0.6)


@pytest.fixture(scope="session")
def three():
    """The flows A, B and C of the paper."""
    return dict(zip("ABC", chuteflow.flows(CHUTE, Q=3.0), strict=True))


@pytest.fixture(scope="session")
def disturbances(three):
    """The disturbances of A, B and C."""
    return {name: Disturbances(flow) for name, flow in three.items()}
