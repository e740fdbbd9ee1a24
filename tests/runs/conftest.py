"""Forces between balls that several files of tests use; their tables are made once a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from runs.evolution.providers import Provider
from tests.runs.foam_balls import line, of, scene


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tables")


@pytest.fixture(scope="module")
def foam(tables: Path) -> Provider:
    """Point loads on foam: cheap, and the same machinery as every other model."""
    return of("point_load", scene(line(2, 0.03)), tables)
