"""Memory that is freed goes back to the system."""

from pathlib import Path

import numpy as np
import pytest

from linear_bem.memory import give_back

STATUS = Path("/proc/self/status")


def resident() -> float:
    """Return the memory of this process [MB]."""
    line = next(line for line in STATUS.read_text(encoding="ascii").splitlines() if line.startswith("VmRSS:"))
    return float(line.split()[1]) / 1e3


@pytest.mark.skipif(not STATUS.exists(), reason="no /proc")
def test_blocks_below_one_that_lives_are_given_back() -> None:
    blocks = [np.ones(10_000) for _ in range(2500)]  # 200 MB in blocks that the C library keeps when they are freed
    held, full = blocks[-1], resident()
    del blocks
    give_back()
    assert full - resident() > 150.0
    assert held[0] == 1.0
