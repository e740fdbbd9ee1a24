from __future__ import annotations

from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    # FFCx leaves its cache's lock file to be closed by the garbage collector
    left_open = pytest.mark.filterwarnings("ignore:unclosed file .*libffcx:ResourceWarning")
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(left_open)
