"""Memory that is freed goes back to the system; what does not fit is refused."""

from pathlib import Path

import numpy as np
import pytest

import linear_bem.memory
from linear_bem import solve
from linear_bem.errors import TooLarge
from linear_bem.memory import give_back
from tests.linear_bem.sampled_scenes import scene

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


def test_a_problem_that_does_not_fit_the_memory_is_refused_with_its_size(monkeypatch):
    monkeypatch.setattr(linear_bem.memory, "free_memory", lambda: 1e7)
    with pytest.raises(TooLarge, match=r"105 balls needs about 0.0137 GB of memory, and 0.01 GB are free"):
        solve(scene("force"), 1e-3)
