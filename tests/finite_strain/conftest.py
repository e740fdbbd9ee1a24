from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("light")


@pytest.fixture(scope="session")
def heard(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    from tests.finite_strain.scenes import Keeper  # noqa: PLC0415  (needs DOLFINx)

    return Keeper(folder, tmp_path_factory.mktemp("kept"))


@pytest.fixture(scope="session")
def result(folder: Path, heard: Any) -> Any:
    """The light pair, solved by this process."""
    from tests.finite_strain.light import solve  # noqa: PLC0415  (needs DOLFINx)

    return solve(folder, heard)
