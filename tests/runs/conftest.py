"""Forces between balls that several files of tests use; their tables are made once a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from linear_bem import Ball, Layer, Load, Problem
from runs.evolution.pair_forces import PairForces
from runs.evolution.providers import Provider
from tests.runs.foam_balls import line, of, scene


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tables")


@pytest.fixture(scope="module")
def foam(tables: Path) -> Provider:
    """Point loads on foam: cheap, and the same machinery as every other model."""
    return of("point_load", scene(line(2, 0.03)), tables)


@pytest.fixture(scope="module")
def thin(tmp_path_factory: pytest.TempPathFactory) -> PairForces:
    """Point loads on a layer as thin as the balls' radius, on which touching balls separate; R = 1, E = 1."""
    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 1.16), balls, Load("approach", (0.1, 0.1)))
    given = of("point_load", problem, tmp_path_factory.mktemp("thin")).forces
    assert isinstance(given, PairForces)
    return given


@pytest.fixture(scope="module")
def thick(tmp_path_factory: pytest.TempPathFactory) -> PairForces:
    """The same on a layer of two radii, on which balls attract up to 2.35 R and separate farther away."""
    balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 2.0), balls, Load("approach", (0.1, 0.1)))
    given = of("point_load", problem, tmp_path_factory.mktemp("thick")).forces
    assert isinstance(given, PairForces)
    return given
